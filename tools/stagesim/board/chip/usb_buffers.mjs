// SPDX-License-Identifier: MIT
// The USB controller's view of its memory: who owns each buffer, and what the controller knows of its control, which the
// program writes in another clock domain (RP2040 datasheet 4.1.2.5).

/** A half of a buffer control (datasheet 4.1.2.5.4). */
export const Buffer = Object.freeze({ FULL: 1 << 15, LAST: 1 << 14, DATA1: 1 << 13, STALL: 1 << 11, AVAILABLE: 1 << 10, LENGTH: 0x3ff });

/** An endpoint's control (datasheet 4.1.2.5.3). */
export const Endpoint = Object.freeze({ ENABLE: 0x80000000 | 0, DOUBLE: 1 << 30, INT_1BUF: 1 << 29, INT_2BUF: 1 << 28 });

const ENDPOINT_CONTROLS = 0x08;
const BUFFER_CONTROLS = 0x80;
const BUFFERS = 0x100;
const BLOCK_BYTES = 64;
const CONTROL_WORDS = BUFFERS / 4;
// One cycle of clk_usb, 48 MHz, in cycles of clk_sys, 125 MHz, rounded up (datasheet 4.1.2.5.1).
const CROSSING_CYCLES = 3;

export class UsbBuffers {
  #chip;
  #time;
  #note;
  #isOn;
  #mayTake;
  #words = new Uint32Array(CONTROL_WORDS); // the controls as last written, by either side
  #fields = new Uint16Array(2 * 32); // of each buffer, what the controller has seen
  #before = new Uint16Array(2 * 32); // and had seen before the last change of fields
  #changed = new Float64Array(2 * 32).fill(-Infinity); // cycle of that change
  #armed = new Float64Array(2 * 32); // cycle in which AVAILABLE was set
  #blockOf = new Int16Array(2 * 32).fill(-1); // of owned buffers: where in memory, in blocks of 64 bytes
  #owned = new Uint8Array(4096 / BLOCK_BYTES);

  /**
   * @param {object} options
   * @param {{cycle: number}} options.time
   * @param {(section: string, text: string) => void} options.note
   * @param {() => boolean} options.isOn a controller that is off owns nothing
   * @param {(half: number) => boolean} options.mayTake whether the program may now write to what the controller owns
   */
  constructor(chip, { time, note, isOn, mayTake }) {
    this.#chip = chip;
    this.#time = time;
    this.#note = note;
    this.#isOn = isOn;
    this.#mayTake = mayTake;
  }

  /** Endpoint 0 has no control in memory. `half` is 2 * endpoint, and 1 more for OUT. */
  endpointControl(half) {
    return this.#chip.usbDPRAMView.getUint32(4 * half, true) | 0;
  }

  /** What the controller sees of buffer 0 or 1. */
  fields(half, second) {
    return this.#fields[2 * half + (second ? 1 : 0)];
  }

  armedAt(half, second) {
    return this.#armed[2 * half + (second ? 1 : 0)];
  }

  /** The controller is done with a buffer: writes its control, and gives it up. */
  finish(half, second, fields) {
    const n = 2 * half + (second ? 1 : 0);
    this.#chip.usbDPRAMView.setUint16(BUFFER_CONTROLS + 2 * n, fields, true);
    this.#words[(BUFFER_CONTROLS >> 2) + half] = this.#chip.usbDPRAMView.getUint32(BUFFER_CONTROLS + 4 * half, true);
    this.#fields[n] = fields;
    this.#own(n, -1);
  }

  /** A write of the program. @returns {boolean} whether an endpoint may have become ready */
  written(offset, value) {
    if (offset >= BUFFERS) {
      if (this.#owned[offset >> 6] && this.#isOn()) this.#note('4.1.2.5.1', 'the program wrote to a buffer that the controller owns: either packet may go out');
      return false;
    }
    const before = this.#words[offset >> 2];
    this.#words[offset >> 2] = value;
    if (offset >= BUFFER_CONTROLS) {
      const half = (offset - BUFFER_CONTROLS) >> 2;
      this.#controlWritten(half, 0, value & 0xffff, before & 0xffff);
      this.#controlWritten(half, 1, value >>> 16, before >>> 16);
      return true;
    }
    if (offset >= ENDPOINT_CONTROLS && value >>> 0 !== before) {
      const half = offset >> 2;
      const owned = (this.#fields[2 * half] | this.#fields[2 * half + 1]) & Buffer.AVAILABLE;
      if (owned && this.#isOn()) this.#note('4.1.2.5.3', 'an endpoint control was changed while the controller owns a buffer of that endpoint');
    }
    return false;
  }

  #controlWritten(half, second, value, before) {
    const n = 2 * half + second;
    if (value === before) return;
    const now = this.#time.cycle;
    if (this.#fields[n] & Buffer.AVAILABLE) {
      if (this.#isOn() && !this.#mayTake(half)) {
        this.#note('4.1.2.5.1', 'a buffer control was written while the controller owns the buffer, which may be in use');
      }
      this.#own(n, -1);
    } else if (value & Buffer.AVAILABLE) {
      this.#arm(half, n, value, before, now);
      return;
    }
    this.#before[n] = this.#fields[n];
    this.#fields[n] = value;
    this.#changed[n] = now;
    if (value & Buffer.AVAILABLE) this.#own(n, this.#blockAt(half, second));
  }

  #arm(half, n, value, before, now) {
    let seen = before;
    if ((value ^ before) & ~Buffer.AVAILABLE) {
      this.#note('4.1.2.5.1', 'AVAILABLE was set in the same write as other fields: the controller may see the old ones');
    } else if (now - this.#changed[n] < CROSSING_CYCLES) {
      this.#note('4.1.2.5.1', 'AVAILABLE was set less than a cycle of clk_usb after other fields: the controller may see the old ones');
      seen = this.#before[n];
    }
    this.#fields[n] = seen | Buffer.AVAILABLE;
    this.#armed[n] = now;
    this.#own(n, this.#blockAt(half, n & 1));
  }

  #blockAt(half, second) {
    const base = half < 2 ? BUFFERS : this.endpointControl(half) & 0xffc0;
    return ((base >> 6) + second) & 63;
  }

  #own(n, block) {
    const before = this.#blockOf[n];
    if (before >= 0) this.#owned[before]--;
    this.#blockOf[n] = block;
    if (block >= 0) this.#owned[block]++;
  }
}
