// The line of `ddfeed scope`, as a WebSocket.

import type { Source } from "./source";

export class SocketSource implements Source {
  private came: Uint8Array[] = [];

  private constructor(private readonly socket: WebSocket) {
    socket.onmessage = (message) => this.came.push(new Uint8Array(message.data as ArrayBuffer));
  }

  static open(url: string, lost: (sentence: string) => void): Promise<SocketSource> {
    return new Promise((resolve, reject) => {
      const socket = new WebSocket(url);
      socket.binaryType = "arraybuffer";
      socket.onopen = () => resolve(new SocketSource(socket));
      socket.onclose = () => {
        const sentence = "The line to the drive is closed: is `ddfeed scope` running, and no other page connected?";
        reject(new Error(sentence));
        lost(sentence);
      };
    });
  }

  send(bytes: Uint8Array) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(new Uint8Array(bytes));
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
    this.socket.onclose = null;
    this.socket.close();
  }
}
