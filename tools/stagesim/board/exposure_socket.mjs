// SPDX-License-Identifier: MIT
// Sends exposures to the virtual stage as JSON lines (docs/architecture.md, "Exposures: emulated board to virtual
// stage").
import { connect } from 'node:net';
import { createInterface } from 'node:readline';

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
    /** The tick before which every exposure that rose has been sent. */
    this.now = () => 0;
    createInterface({ input: socket }).on('line', (line) => this.#answer(line)).on('error', () => {});
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
    this.#write(message);
  }

  /** A question of the reader's, {"type":"sync","n":N}: the answer stands behind all that was sent before, and is never dropped. */
  #answer(line) {
    const { type, n } = JSON.parse(line);
    if (type === 'sync' && !this.#closed) this.#write({ type, n, tick: this.now() });
  }

  #write(message) {
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
