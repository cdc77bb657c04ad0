// SPDX-License-Identifier: MIT
// Sends exposures to the virtual stage as JSON lines (docs/architecture.md, "Exposures: emulated board to virtual
// stage").
import { connect } from 'node:net';

const END_MS = 2000;

export class ExposureSocket {
  #socket;
  #dropOnFull;
  #full = false;
  #closed = false;

  /**
   * @param {import('node:net').Socket} socket
   * @param {boolean} dropOnFull with --pace wall: lines that do not fit are dropped and counted
   */
  constructor(socket, dropOnFull) {
    this.#socket = socket;
    this.#dropOnFull = dropOnFull;
    this.dropped = 0;
    /** Called when the reader has caught up, or has gone. */
    this.onReady = () => {};
    const drained = () => {
      this.#full = false;
      this.onReady();
    };
    socket.on('drain', drained);
    socket.on('close', () => {
      this.#closed = true;
      drained();
    });
    socket.on('error', () => {}); // 'close' follows
  }

  /** @returns {Promise<ExposureSocket>} connected to the listener at `path` */
  static open(path, dropOnFull) {
    return new Promise((resolve, reject) => {
      const socket = connect(path);
      socket.once('connect', () => resolve(new ExposureSocket(socket, dropOnFull)));
      socket.once('error', (error) => reject(new Error(`${path}: nobody takes exposures there (${error.code})`)));
    });
  }

  /** True while the reader is behind. */
  get full() {
    return this.#full && !this.#closed;
  }

  send(message) {
    if (this.#closed) return;
    if (this.#full && this.#dropOnFull) {
      this.dropped++;
      return;
    }
    this.#full = !this.#socket.write(`${JSON.stringify(message)}\n`);
  }

  /** Says the end and resolves once all is written, the reader has gone, or has not read for two seconds. */
  end() {
    return new Promise((resolve) => {
      this.#socket.once('close', resolve);
      setTimeout(() => this.#socket.destroy(), END_MS).unref();
      if (this.#closed) resolve();
      else this.#socket.end(`${JSON.stringify({ type: 'end' })}\n`, () => this.#socket.destroy());
    });
  }
}
