// The drive's settings: reading all, changing some.

import { computed, effect, signal } from "@preact/signals";
import { settings_schema } from "scope";
import { ask, commissioning, connection, notice, source, status, stops } from "./drive";
import { sentenceOf } from "./format";
import type { SettingSchema } from "./messages";

export const schema = signal<SettingSchema[]>([]);
/** Values that hold, by name. */
export const held = signal<ReadonlyMap<string, string>>(new Map());
/** Values with the orders that the drive has learned. */
export const learned = signal<ReadonlyMap<string, string>>(new Map());

/** Values that were typed and are not set yet. */
export const edited = signal<ReadonlyMap<string, string>>(new Map());

/** Whether values hold that are not stored yet: a drive stores at rest. */
export const unstored = signal(false);

/** States in which a drive stores. */
const AT_REST = ["ready", "unaligned", "fault"];

const atRest = computed(() => AT_REST.includes(status.value?.state ?? ""));

export const byName = computed(() => new Map(schema.value.map((one) => [one.name, one])));

export function start() {
  schema.value = JSON.parse(settings_schema()) as SettingSchema[];
  effect(() => {
    // Another drive: what this one has not stored is not its own.
    void source.value;
    unstored.value = false;
  });
  // A commissioning stores what it has measured.
  const commissioned = computed(() => !commissioning.value?.running);
  effect(() => {
    if (connection.value.open && commissioned.value) void read();
  });
  effect(() => {
    if (unstored.value && atRest.value) void store();
  });
}

/** Types a value, or takes it back. */
export function edit(name: string, value: string) {
  const next = new Map(edited.value);
  if (value === held.value.get(name)) next.delete(name);
  else next.set(name, value);
  edited.value = next;
}

async function all(command: "settings" | "learned"): Promise<Map<string, string>> {
  const values = new Map<string, string>();
  for (let from = 0; ; ) {
    const some = (await ask({ command, from })).settings ?? [];
    const last = some.at(-1);
    if (!last) return values;
    for (const { name, value } of some) values.set(name, value);
    from = last.id + 1;
  }
}

async function read() {
  try {
    held.value = await all("settings");
  } catch {
    // The connection is gone; the next one reads again.
  }
}

export async function readLearned() {
  try {
    learned.value = await all("learned");
  } catch (error) {
    notice(sentenceOf(error));
  }
}

async function store() {
  unstored.value = false;
  try {
    await ask({ command: "store" });
  } catch (error) {
    notice(sentenceOf(error));
  }
}

/** What a restart of the drive loses now. */
export function lostInRestart(): string[] {
  const now = status.value;
  const lost: string[] = [];
  if (now?.table.homed) lost.push("the homed position");
  if (now?.table.limits.position_limits_act) lost.push("the soft limits until the table is homed again");
  if (now && now.state !== "unaligned") lost.push("the alignment of incremental encoders");
  lost.push("orders that were learned and not saved");
  return lost;
}

/** Whether a change restarts the drive. */
export function restarts(names: Iterable<string>): boolean {
  return [...names].some((name) => byName.value.get(name)?.effect === "after a restart");
}

/** Makes values hold: all or none. The drive stores them as soon as it is at rest. True if they hold. */
export async function change(values: ReadonlyMap<string, string>): Promise<boolean> {
  const begun = stops.value;
  const goOn = () => {
    if (stops.value !== begun) throw new Error("A stop interrupted the change of settings.");
  };
  try {
    await ask({ command: "discard" });
    for (const [name, value] of values) {
      goOn();
      await ask({ command: "draft", name, value });
    }
    goOn();
    await ask({ command: "commit" });
    if (!restarts(values.keys())) {
      await read();
      unstored.value = true;
    }
    return true;
  } catch (error) {
    notice(sentenceOf(error));
    return false;
  }
}
