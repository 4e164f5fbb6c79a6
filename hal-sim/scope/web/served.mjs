// A served drive, the program `ddfeed scope` in front of it, and a line between both that can stall.
import { execFile, spawn } from "node:child_process";
import { createServer, connect } from "node:net";
import { once } from "node:events";
import { createInterface } from "node:readline";
import { promisify } from "node:util";

/** The program `ddfeed` with all features. */
export const program = process.env.DDFEED;
const page = process.env.SCOPE_PAGE;

async function freePort() {
  const server = createServer().listen(0, "127.0.0.1");
  await once(server, "listening");
  const { port } = server.address();
  server.close();
  await once(server, "close");
  return port;
}

/** A program that can be killed and started again with the same words. It is up once its output has `mark`. */
class Program {
  constructor(words, mark) {
    this.words = words;
    this.mark = mark;
  }

  async start() {
    this.child = spawn(program, this.words, { stdio: ["ignore", "pipe", "inherit"] });
    for await (const line of createInterface({ input: this.child.stdout })) {
      if (!line.includes(this.mark)) continue;
      this.child.stdout.resume();
      return;
    }
    throw new Error(`${this.words.join(" ")} ended`);
  }

  async kill() {
    if (!this.child || this.child.exitCode !== null || this.child.signalCode !== null) return;
    const ended = once(this.child, "exit");
    this.child.kill("SIGKILL");
    await ended;
  }
}

/** Hands bytes on, both ways, unless it stalls. */
class Line {
  stalled = false;
  pairs = [];

  async start(port) {
    this.server = createServer((near) => {
      const far = connect(port, "127.0.0.1");
      for (const [from, to] of [[near, far], [far, near]]) {
        from.setNoDelay(true);
        from.on("data", (bytes) => to.write(bytes));
        from.on("close", () => to.destroy());
        from.on("error", () => to.destroy());
      }
      if (this.stalled) for (const one of [near, far]) one.pause();
      this.pairs.push(near, far);
    }).listen(0, "127.0.0.1");
    await once(this.server, "listening");
    return this.server.address().port;
  }

  stall(on) {
    this.stalled = on;
    for (const one of this.pairs) on ? one.pause() : one.resume();
  }

  close() {
    this.server?.close();
    for (const one of this.pairs) one.destroy();
  }
}

/** A served drive as a person starts it: `ddfeed serve`, `ddfeed scope --sim`. */
export class Served {
  line = new Line();

  async start() {
    const [port, http] = [await freePort(), await freePort()];
    this.drive = new Program(["serve", "--listen", `127.0.0.1:${port}`], "--sim");
    await this.drive.start();
    const near = await this.line.start(port);
    this.scope = new Program(["scope", "--sim", `127.0.0.1:${near}`, "--listen", `127.0.0.1:${http}`, "--page", page], "http://");
    await this.scope.start();
    this.address = `http://127.0.0.1:${http}/`;
    return this;
  }

  /** What `ddfeed drive` prints, over a line of its own. */
  async command(...words) {
    const { stdout } = await promisify(execFile)(program, ["drive", "--sim", this.drive.words[2], ...words]);
    return stdout;
  }

  /** What the drive tells of itself. */
  async status() {
    return JSON.parse(await this.command("status", "--json"));
  }

  async end() {
    this.line.close();
    await this.scope?.kill();
    await this.drive?.kill();
  }
}
