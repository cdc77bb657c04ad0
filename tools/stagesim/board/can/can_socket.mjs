// SPDX-License-Identifier: MIT
// The bus end as a socket (docs/architecture.md, "CAN frames over a socket"): every client is a node with a controller
// that never tires. Records of 16 bytes, Linux's struct can_frame.
import { createServer } from 'node:net';
import { decodeFrame, encodeFrame, FRAME_BYTES } from './can_frame.mjs';
import { listenAt } from '../listen.mjs';

const NOW_ID = 0xffffffff; // a record with the board's time instead of a frame
const BACKLOG_BYTES = 1 << 20; // of a client that does not read: then it is cut off

/** One client: its frames queue for the bus, all others' come to it. */
class SocketNode {
  #socket;
  #bus;
  #queue = [];
  #input = Buffer.alloc(0);
  errorPassive = false;

  constructor(socket, bus) {
    this.#socket = socket;
    this.#bus = bus;
  }

  get bitRate() {
    return this.#bus.bitRate;
  }

  next() {
    return this.#queue[0] ?? null;
  }

  sent() {
    this.#queue.shift();
    this.#bus.kick();
  }

  lost() {}

  failed() {
    this.#bus.kick(); // sends again
  }

  received(frame) {
    this.write(encodeFrame(frame));
    return true;
  }

  write(record) {
    if (this.#socket.writableLength > BACKLOG_BYTES) this.#socket.destroy();
    else if (this.#socket.writable) this.#socket.write(record);
  }

  take(bytes) {
    this.#input = Buffer.concat([this.#input, bytes]);
    while (this.#input.length >= FRAME_BYTES) {
      const frame = decodeFrame(this.#input.subarray(0, FRAME_BYTES));
      this.#input = this.#input.subarray(FRAME_BYTES);
      if (frame === undefined) return false;
      if (frame === 'error') this.#bus.breakFrames(1);
      else this.#queue.push(frame);
    }
    this.#bus.kick();
    return true;
  }
}

export class CanSocket {
  #path;
  #bus;
  #server;
  #nodes = new Map(); // by socket
  #log;
  #onActivity;

  /** @param {{onActivity: () => void, log: (text: string) => void}} options */
  constructor(path, bus, { onActivity, log }) {
    this.#path = path;
    this.#bus = bus;
    this.#log = log;
    this.#onActivity = onActivity;
    this.#server = createServer((socket) => this.#accept(socket));
  }

  /** True while somebody could send, or wait for something. */
  get hasClients() {
    return this.#nodes.size > 0;
  }

  /** @returns {Promise<void>} listening */
  listen() {
    return listenAt(this.#path, this.#server);
  }

  /** Tells all clients the time, so that they can time out in the board's. */
  tell(tick) {
    if (this.#nodes.size === 0) return;
    const record = Buffer.alloc(FRAME_BYTES);
    record.writeUInt32LE(NOW_ID, 0);
    record[4] = 8;
    record.writeBigUInt64LE(BigInt(tick), 8);
    for (const node of this.#nodes.values()) node.write(record);
  }

  close() {
    for (const socket of this.#nodes.keys()) socket.destroySoon();
    this.#server.close();
  }

  #accept(socket) {
    const node = new SocketNode(socket, this.#bus);
    this.#nodes.set(socket, node);
    this.#bus.add(node);
    socket.on('error', () => {}); // 'close' follows
    socket.on('data', (bytes) => {
      if (!node.take(bytes)) {
        this.#log('can: not a CAN 2.0 frame; the client is cut off');
        socket.destroy();
      }
      this.#onActivity();
    });
    socket.on('close', () => {
      this.#nodes.delete(socket);
      this.#bus.remove(node);
      this.#onActivity();
    });
    this.#bus.kick();
    this.#onActivity();
  }
}
