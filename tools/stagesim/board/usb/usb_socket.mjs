// SPDX-License-Identifier: MIT
// The USB cable as a socket: a client that connects plugs the board in, its requests are transfers
// (docs/architecture.md, "USB transfers over a socket").
import { createServer } from 'node:net';
import { listenAt } from '../listen.mjs';

const REQUEST_MAGIC = 0x54425355; // "USBT"
const REPLY_MAGIC = 0x52425355; // "USBR"
const HEADER_BYTES = 28;
const REPLY_BYTES = 16;
const PAYLOAD_LIMIT = 1 << 20;
const TYPES = ['control', 'bulk', 'cancel'];
const HANDOVER_MS = 200;
const FAREWELL_MS = 2000;
const BUSY = -6; // a client is turned away
const NO_BYTES = Buffer.alloc(0);

export class UsbSocket {
  #server;
  #path;
  #client = null;
  #input = Buffer.alloc(0);
  #inFlight = new Map(); // tag -> handle of the host
  #host;
  #log;
  #onActivity;
  #onClient;

  /**
   * @param {object} options
   * @param {() => import('./usb_host.mjs').UsbHost} options.host the chip's at this moment
   * @param {() => void} options.onActivity called when something has come in
   * @param {(connected: boolean) => void} options.onClient called when a client has come or gone
   * @param {(text: string) => void} options.log
   */
  constructor(path, { host, onActivity, onClient, log }) {
    this.#path = path;
    this.#host = host;
    this.#onActivity = onActivity;
    this.#onClient = onClient;
    this.#log = log;
    this.#server = createServer((socket) => this.#accept(socket));
  }

  /** @returns {Promise<void>} listening */
  listen() {
    return listenAt(this.#path, this.#server);
  }

  /** The device has gone: pending transfers have been answered, the client must connect anew. */
  drop() {
    this.#client?.destroySoon(); // once what was written has gone out
    this.#forget();
  }

  close() {
    this.drop();
    this.#server.close();
  }

  /** A client that reconnects may be seen before its old connection's end is: waits for that, for a moment. */
  #acceptLater(socket) {
    const client = this.#client;
    const settle = () => {
      clearTimeout(patience);
      client.off('close', handOver);
      socket.off('close', settle);
    };
    const handOver = () => {
      settle();
      this.#accept(socket);
    };
    const patience = setTimeout(() => {
      settle();
      this.#log('usb: a second client was turned away');
      turnAway(socket);
    }, HANDOVER_MS);
    client.once('close', handOver);
    socket.once('close', settle);
  }

  #accept(socket) {
    socket.on('error', () => {}); // 'close' follows
    if (this.#client !== null) {
      this.#acceptLater(socket);
      return;
    }
    this.#client = socket;
    this.#onClient(true);
    socket.on('data', (bytes) => {
      if (socket === this.#client) this.#receive(bytes);
    });
    socket.on('close', () => {
      if (socket !== this.#client) return;
      this.#forget();
      this.#host().unplug();
      this.#onActivity();
    });
    this.#host().plug();
    this.#onActivity();
  }

  #forget() {
    if (this.#client !== null) this.#onClient(false);
    this.#client = null;
    this.#input = Buffer.alloc(0);
    this.#inFlight.clear();
  }

  #receive(bytes) {
    this.#input = this.#input.length === 0 ? bytes : Buffer.concat([this.#input, bytes]);
    while (this.#input.length >= HEADER_BYTES) {
      const request = this.#parse();
      if (request === undefined) {
        this.#client.destroy();
        return;
      }
      const total = HEADER_BYTES + request.payloadBytes;
      if (this.#input.length < total) break;
      request.data = Uint8Array.from(this.#input.subarray(HEADER_BYTES, total));
      this.#input = this.#input.subarray(total);
      this.#start(request);
    }
    this.#onActivity();
  }

  /** @returns the request's header, or undefined if this is none: then there is no telling where the next begins */
  #parse() {
    const input = this.#input;
    const type = TYPES[input[8]];
    const endpoint = input[9];
    const length = input.readUInt32LE(12);
    if (input.readUInt32LE(0) !== REQUEST_MAGIC || type === undefined || length > PAYLOAD_LIMIT) {
      this.#log('usb: not a transfer request; the client is cut off');
      return undefined;
    }
    const setup = Uint8Array.from(input.subarray(20, 28));
    const toHost = type === 'control' ? (setup[0] & 0x80) !== 0 : (endpoint & 0x80) !== 0;
    const payloadBytes = type === 'cancel' || toHost ? 0 : length;
    return { tag: input.readUInt32LE(4), type, endpoint, capacity: length, timeout_us: input.readUInt32LE(16), setup,
             payloadBytes };
  }

  #start(request) {
    const { tag, type } = request;
    if (type === 'cancel') {
      const handle = this.#inFlight.get(tag);
      if (handle) this.#host().cancel(handle);
      return;
    }
    const client = this.#client;
    let finished = false;
    const done = (status, bytes) => {
      finished = true;
      this.#inFlight.delete(tag);
      if (!client.destroyed && client.writable) client.write(replyTo(tag, status, bytes));
    };
    const handle = this.#host().submit({ ...request, done });
    if (!finished) this.#inFlight.set(tag, handle);
  }
}

/** Says why, and takes in what the client still sends until it goes. */
function turnAway(socket) {
  if (socket.writable) socket.end(replyTo(0, BUSY, NO_BYTES));
  socket.resume();
  socket.unref();
  setTimeout(() => socket.destroy(), FAREWELL_MS).unref();
}

function replyTo(tag, status, bytes) {
  const header = Buffer.alloc(REPLY_BYTES);
  header.writeUInt32LE(REPLY_MAGIC, 0);
  header.writeUInt32LE(tag, 4);
  header.writeInt32LE(status, 8);
  header.writeUInt32LE(bytes.length, 12);
  return Buffer.concat([header, bytes]);
}
