// What the page and its worker say to each other, and the JSON of the Rust code.

export interface Sentence {
  name: string;
  sentence: string;
}

export interface MotorStatus {
  state: string;
  fault: Sentence | null;
  limited_by: Sentence[];
  speed_rpm: number;
  current_d_a: number;
  current_q_a: number;
  bus_v: number;
  limits: { speed_rpm: number; torque_nm: number };
}

/** The same as `ddfeed drive status --json` prints. */
export interface Status {
  state: string;
  fault: Sentence | null;
  further_faults: Sentence[];
  limited_by: Sentence[];
  misalignment: Sentence | null;
  tables: (Sentence & { table: string })[];
  warnings: Sentence[];
  settings: (Sentence & { unfit: string | null }) | null;
  armed: boolean;
  simulated: boolean;
  uptime_s: number;
  travel: string;
  screw: MotorStatus;
  nut: MotorStatus;
  table: {
    homed: boolean;
    position_mm: number;
    velocity_mm_s: number;
    limits: { velocity_mm_s: number; position_mm: [number, number] | null; position_limits_act: boolean };
  };
}

/** True values of a simulated machine. */
export interface Machine {
  table_mm: number;
  velocity_mm_s: number;
  screw_turns: number;
  nut_turns: number;
  travel_mm: number;
  brake_holds: boolean;
  end_forward: boolean;
  end_backward: boolean;
  load_n: number;
}

export interface Signal {
  name: string;
  label: string;
  unit: string;
  group: string;
}

export interface SettingSchema {
  id: number;
  name: string;
  group: string;
  unit: string;
  doc: string;
  effect: "at once" | "at rest" | "after a restart";
  default: string;
  kind: { real: [number, number] } | { whole: [number, number] } | { choice: string[] };
}

export interface Injection {
  name: string;
  sentence: string;
  unit: string | null;
  range: [number, number] | null;
  motor: boolean;
}

export interface JournalEvent {
  number: number;
  uptime_s: number;
  kind: string;
  name: string;
  value: number | null;
  limit: number | null;
  unit: string | null;
}

/** How the burst of the drive is going. */
export interface BurstStatus {
  state: "none" | "waiting" | "filling" | "complete" | "unknown";
  sentence: string;
  motor: number;
  before: number;
  interval_s: number;
  samples: number;
}

export interface Reply {
  sequence: number;
  done?: true;
  refused?: Sentence;
  hello?: { simulated: boolean } & Rates;
  status?: Status;
  events?: JournalEvent[];
  settings?: { id: number; name: string; value: string }[];
  unfit?: string;
  burst?: BurstStatus;
  /** Samples of the burst that were read so far. */
  samples?: number;
}

/** PWM periods and steps of the speed task a second. */
export interface Rates {
  pwm_hz: number;
  speed_hz: number;
}

export interface Stream {
  interval_s: number;
  lead_mm: number;
  scale_um: number;
}

export type FromDrive = { reply: Reply } | { event: { uptime_ms: number; state: string; fault: Sentence | null } } | { stream: Stream };

export interface Counts {
  frames: number;
  damaged: number;
  rows: number;
  lost: number;
}

export type Command = { command: string; [key: string]: unknown };

/** What the worker does by itself. */
export type Call =
  | { name: "begin recording" }
  | { name: "take recording" }
  | { name: "burst rows" }
  | { name: "declared" }
  | { name: "compensation"; model: string };

export interface FoundEffect {
  kind: string;
  where: string;
  order?: number;
  hz?: number;
  parameters: Record<string, number>;
  interval: Record<string, [number, number]>;
  unit: Record<string, string>;
  explained: number;
}

/** What the identification found, and the model with it. */
export interface Found {
  report: {
    verdict: string;
    summary: string;
    effects: FoundEffect[];
    residual: { channel: string; unit: string; check_before: number; check_after: number; noise_floor: number }[];
  };
  model: string;
}

export interface Compensation {
  settings: Record<string, string>;
  not_compensated: string[];
}

export interface Crossing {
  bandwidth_rad_s: number;
  margin_deg: number;
}

/** A loop's response to a step, and its open loop: measured, and of the model. */
export interface LoopResponse {
  /** `A` of the current along d, `rpm` of a motor's speed. */
  unit: string;
  from: number;
  to: number;
  steps: number;
  time_s: number[];
  measured: number[];
  predicted: number[];
  hz: number[];
  gain_db: number[];
  phase_deg: number[];
  predicted_gain_db: number[];
  predicted_phase_deg: number[];
  crossing: Crossing | null;
  predicted_crossing: Crossing | null;
}

/** What a commissioning is asked for. */
export interface CommissioningWanted {
  travel_mm: number;
  margin_deg: number;
  /** Only the loops are measured. */
  response_only: boolean;
}

export interface Quantity {
  name: string;
  unit: string;
  estimate: { value: number; plus_minus: number };
  before: number | null;
}

/** A step of the commissioning that is done. */
export interface CommissioningStep {
  name: string;
  about: string;
  seconds: number;
  quantities: Quantity[];
  limits: { name: string; unit: string; reached: number; limit: number }[];
  /** Current loops of screw and nut; null where the steps were not seen. */
  responses: (LoopResponse | null)[] | null;
  /** Speed loops, the same. */
  speed_responses: (LoopResponse | null)[] | null;
}

export interface Commissioning {
  running: boolean;
  step: string;
  about: string;
  /** From 0 to 1, of the step. */
  part: number;
  error: string | null;
  done: CommissioningStep[];
}

export type SourceChoice =
  | { kind: "simulation"; board: string; cold: boolean; effects: string }
  | { kind: "socket"; url: string }
  | { kind: "serial"; baud: number };

export type ToWorker =
  | { type: "start"; module: WebAssembly.Module }
  | { type: "source"; source: SourceChoice }
  | { type: "ask"; id: number; command: Command }
  | { type: "commission"; wanted: CommissioningWanted }
  | { type: "stop" }
  | { type: "call"; id: number; call: Call }
  | { type: "identify"; declared: string; fit: Float64Array; check: Float64Array }
  | { type: "alive"; hidden: boolean };

export type FromWorker =
  | { type: "connection"; open: boolean; sentence: string; simulated: boolean }
  | { type: "rates"; rates: Rates }
  | { type: "answer"; id: number; reply: Reply | null; error: string | null }
  | { type: "status"; status: Status; counts: Counts }
  | { type: "machine"; machine: Machine }
  | { type: "stream"; stream: Stream }
  | { type: "rows"; rows: Float64Array }
  | { type: "commissioning"; report: Commissioning }
  | { type: "notice"; sentence: string }
  | { type: "result"; id: number; result: unknown; error: string | null }
  | { type: "identified"; found: Found | null; error: string | null }
  | { type: "stopped"; ms: number };
