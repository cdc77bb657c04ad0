// SPDX-License-Identifier: MIT
// USB transfers as the host cuts them into transactions (USB 2.0 chapters 5 and 8). No time in here: the host asks for
// the next token and tells what came back.
import { Handshake } from '../chip/usb_controller.mjs';

/** How a transfer ended; the numbers go over the socket (docs/architecture.md, "USB transfers over a socket"). */
export const Status = Object.freeze({ OK: 0, STALL: -1, DISCONNECTED: -2, TIMED_OUT: -3, CANCELLED: -4, OVERFLOW: -5 });

const NOTHING = new Uint8Array(0);

/**
 * @typedef {{endpoint: number, setup?: Uint8Array, out?: Uint8Array, data1?: boolean}} Token
 *   a SETUP, an OUT with its packet, or, with neither, an IN
 */

/** A control transfer: setup, data if any, status (USB 2.0 8.5.3). */
export class ControlTransfer {
  #stage = 'setup';
  #data1 = true;
  #done = 0;
  #received = [];

  /**
   * @param {Uint8Array} setup the eight bytes of the request
   * @param {Uint8Array} data  of the data stage when the request goes to the device
   */
  constructor(setup, data = NOTHING) {
    this.setup = setup;
    this.data = data;
    this.toHost = (setup[0] & 0x80) !== 0;
    this.length = setup[6] | (setup[7] << 8);
    this.packetBytes = 64;
  }

  get pipe() {
    return 0;
  }

  get bytes() {
    return concatenate(this.#received);
  }

  /** @returns {Token} */
  token() {
    if (this.#stage === 'setup') return { endpoint: 0, setup: this.setup };
    if (this.#stage === 'data' && this.toHost) return { endpoint: 0 };
    if (this.#stage === 'data') {
      return { endpoint: 0, out: this.data.subarray(this.#done, this.#done + this.packetBytes), data1: this.#data1 };
    }
    return this.toHost && this.length > 0 ? { endpoint: 0, out: NOTHING, data1: true } : { endpoint: 0 };
  }

  /** @returns {number | null} the status if that ended the transfer */
  answered({ handshake, packet, data1 }) {
    if (handshake === Handshake.STALL) return Status.STALL;
    if (handshake === Handshake.SILENT) return Status.DISCONNECTED;
    if (this.#stage === 'setup') {
      this.#stage = this.length > 0 ? 'data' : 'status';
      return null;
    }
    if (this.#stage === 'status') return Status.OK;
    return this.toHost ? this.#keep(packet, data1) : this.#sent();
  }

  #keep(packet, data1) {
    if (data1 !== this.#data1) return null; // taken for a repetition, and dropped
    this.#data1 = !this.#data1;
    this.#received.push(packet);
    this.#done += packet.length;
    if (this.#done > this.length) return Status.OVERFLOW;
    if (packet.length < this.packetBytes || this.#done === this.length) this.#stage = 'status';
    return null;
  }

  #sent() {
    this.#data1 = !this.#data1;
    this.#done = Math.min(this.data.length, this.#done + this.packetBytes);
    if (this.#done === this.data.length) this.#stage = 'status';
    return null;
  }
}

/** A bulk transfer out: full packets, then the rest; an empty transfer is one empty packet (USB 2.0 5.8.3). */
export class BulkOutTransfer {
  #done = 0;

  /** @param {{data1: boolean}} toggle of the endpoint, which outlives the transfer */
  constructor(endpoint, data, toggle, packetBytes) {
    Object.assign(this, { endpoint, data, toggle, packetBytes });
  }

  get pipe() {
    return this.endpoint;
  }

  get bytes() {
    return NOTHING;
  }

  token() {
    const out = this.data.subarray(this.#done, this.#done + this.packetBytes);
    return { endpoint: this.endpoint, out, data1: this.toggle.data1 };
  }

  answered({ handshake }) {
    if (handshake === Handshake.STALL) return Status.STALL;
    if (handshake === Handshake.SILENT) return Status.DISCONNECTED;
    this.toggle.data1 = !this.toggle.data1;
    this.#done = Math.min(this.data.length, this.#done + this.packetBytes);
    return this.#done === this.data.length ? Status.OK : null;
  }
}

/** A bulk transfer in: ends when full or with a packet that is short, which may be empty (USB 2.0 5.8.3). */
export class BulkInTransfer {
  #received = [];
  #count = 0;

  constructor(endpoint, capacity, toggle, packetBytes) {
    Object.assign(this, { endpoint, capacity, toggle, packetBytes });
  }

  get pipe() {
    return this.endpoint | 0x80;
  }

  get bytes() {
    return concatenate(this.#received);
  }

  token() {
    return { endpoint: this.endpoint };
  }

  answered({ handshake, packet, data1 }) {
    if (handshake === Handshake.STALL) return Status.STALL;
    if (handshake === Handshake.SILENT) return Status.DISCONNECTED;
    if (data1 !== this.toggle.data1) return null; // taken for a repetition, and dropped
    this.toggle.data1 = !this.toggle.data1;
    this.#count += packet.length;
    if (this.#count > this.capacity) return Status.OVERFLOW;
    this.#received.push(packet);
    return packet.length < this.packetBytes || this.#count === this.capacity ? Status.OK : null;
  }
}

function concatenate(packets) {
  const bytes = new Uint8Array(packets.reduce((sum, packet) => sum + packet.length, 0));
  let at = 0;
  for (const packet of packets) {
    bytes.set(packet, at);
    at += packet.length;
  }
  return bytes;
}
