// A board's serial port, where the browser has WebSerial. The page has asked for the port before.

import type { Source } from "./source";

interface Port {
  open(options: { baudRate: number; bufferSize: number }): Promise<void>;
  close(): Promise<void>;
  readable: ReadableStream<Uint8Array>;
  writable: WritableStream<Uint8Array>;
}

const BUFFER_BYTES = 65536;

export class SerialSource implements Source {
  private came: Uint8Array[] = [];
  private readonly writer: WritableStreamDefaultWriter<Uint8Array>;
  private readonly reader: ReadableStreamDefaultReader<Uint8Array>;

  private constructor(private readonly port: Port, private readonly lost: (sentence: string) => void) {
    this.writer = port.writable.getWriter();
    this.reader = port.readable.getReader();
    void this.read();
  }

  static async open(baud: number, lost: (sentence: string) => void): Promise<SerialSource> {
    const serial = (navigator as unknown as { serial: { getPorts(): Promise<Port[]> } }).serial;
    const port = (await serial.getPorts()).at(-1);
    if (!port) throw new Error("No serial port was chosen.");
    await port.open({ baudRate: baud, bufferSize: BUFFER_BYTES });
    return new SerialSource(port, lost);
  }

  private async read() {
    try {
      for (;;) {
        const { value, done } = await this.reader.read();
        if (done) break;
        this.came.push(value);
      }
    } catch {
      this.lost("The serial port is gone: is the board still plugged in?");
    }
  }

  send(bytes: Uint8Array) {
    this.writer.write(new Uint8Array(bytes)).catch(() => this.lost("The serial port takes no more bytes."));
  }

  poll(): Uint8Array[] {
    const came = this.came;
    this.came = [];
    return came;
  }

  machine() {
    return null;
  }

  declared() {
    return null;
  }

  close() {
    this.writer.releaseLock();
    this.reader.cancel().then(() => this.reader.releaseLock()).then(() => this.port.close()).catch(() => undefined);
  }
}
