// SPDX-License-Identifier: MIT
// An MCP2515, or the same inside an MCP25625: stand-alone CAN controller behind SPI (Microchip DS20001801J). A node of
// can_bus.mjs on one side, bytes under a chip select and an interrupt pin on the other.
import {
  ADDRESS, CANINTF, EFLG, FLAGS, isBitModifiable, MODE, receiveFrame, RESET_VALUES, transmitFrame, writableBits,
} from './mcp2515_registers.mjs';

const OSCILLATOR_HZ = 16_000_000;
const RECOVERY_BITS = 128 * 11; // out of bus-off (6.6)
const BUFFERS = [0, 1, 2];

export class Mcp2515 {
  #registers = new Uint8Array(128);
  #bus;
  #clock = null;
  #recovery = null;
  #sending = -1; // the transmit buffer that is on the bus
  #interrupt = false;
  #selected = false;
  #step = null; // takes the next byte of the instruction, gives the byte shifted out
  #atEnd = null; // of the instruction: when CS rises

  /** @param {import('./can_bus.mjs').CanBus} bus */
  constructor(bus) {
    this.#bus = bus;
    /** Called with the level of the INT pin when it changes. */
    this.onInterrupt = () => {};
    this.transmitErrors = 0;
    this.receiveErrors = 0;
    this.reset();
    bus.add(this);
  }

  /** The time of another RP2040 from now on: this chip has its own power and goes on. */
  attach(clock) {
    this.#clock = clock;
    this.#recovery = clock.createAlarm(() => this.#recover());
    if (this.#busOff) this.#scheduleRecovery();
  }

  // SPI (chapter 12)

  /** @param {boolean} selected CS is low */
  select(selected) {
    if (selected === this.#selected) return;
    this.#selected = selected;
    this.#atEnd?.();
    this.#atEnd = null;
    this.#step = selected ? (byte) => this.#instruction(byte) : null;
    this.#changed();
  }

  /** One byte each way. @returns {number} 0 while not selected: nobody drives the line, and it is pulled down */
  exchange(byte) {
    const answer = this.#step?.(byte) ?? 0;
    this.#changed();
    return answer;
  }

  #instruction(byte) {
    this.#step = () => 0; // what no instruction is has no answer
    if (byte === 0xc0) this.reset();
    else if (byte === 0x03) this.#step = (address) => this.#beginReading(address);
    else if (byte === 0x02) this.#step = (address) => this.#beginWriting(address);
    else if (byte === 0x05) this.#step = (address) => this.#beginModifying(address);
    else if (byte === 0xa0) this.#step = () => this.#readStatus();
    else if (byte === 0xb0) this.#step = () => this.#receiveStatus();
    else if ((byte & 0xf9) === 0x90) this.#readReceiveBuffer(byte >> 2 & 1, byte >> 1 & 1);
    else if ((byte & 0xf8) === 0x40 && (byte & 7) < 6) this.#beginWriting(0x31 + (byte >> 1 & 3) * 0x10 + (byte & 1) * 5);
    else if ((byte & 0xf8) === 0x80) this.#requestToSend(byte & 7);
    return 0;
  }

  #beginReading(address) {
    let at = address & 0x7f;
    this.#step = () => {
      const value = this.#read(at);
      at = (at + 1) & 0x7f;
      return value;
    };
    return 0;
  }

  #beginWriting(address) {
    let at = address & 0x7f;
    this.#step = (value) => {
      this.#write(at, value);
      at = (at + 1) & 0x7f;
      return 0;
    };
    return 0;
  }

  #beginModifying(address) {
    const at = address & 0x7f;
    this.#step = (mask) => {
      const changed = isBitModifiable(at) ? mask : 0xff; // else the mask is forced (12.10)
      this.#step = (value) => {
        this.#write(at, (this.#read(at) & ~changed) | (value & changed));
        this.#step = () => 0;
        return 0;
      };
      return 0;
    };
    return 0;
  }

  #readReceiveBuffer(buffer, part) {
    this.#beginReading(0x61 + buffer * 0x10 + part * 5);
    this.#atEnd = () => {
      this.#registers[CANINTF] &= ~(FLAGS.RX0IF << buffer);
    };
  }

  #requestToSend(mask) {
    for (const n of BUFFERS) if (mask & (1 << n)) this.#write(control(n), this.#registers[control(n)] | FLAGS.TXREQ);
  }

  /** Figure 12-8. */
  #readStatus() {
    const flags = this.#registers[CANINTF];
    let status = flags & 3;
    for (const n of BUFFERS) {
      if (this.#registers[control(n)] & FLAGS.TXREQ) status |= 4 << (2 * n);
      if (flags & (FLAGS.TX0IF << n)) status |= 8 << (2 * n);
    }
    return status;
  }

  /** Figure 12-9: of buffer 0 when both hold a message. */
  #receiveStatus() {
    const full = this.#registers[CANINTF] & 3;
    if (full === 0) return 0;
    const buffer = full & 1 ? 0 : 1;
    const base = 0x60 + 0x10 * buffer;
    const extended = this.#registers[base + 2] & 0x08;
    const remote = extended ? this.#registers[base + 5] & 0x40 : this.#registers[base + 2] & 0x10;
    const hit = this.#registers[base] & (buffer === 0 ? 1 : 7);
    const rolledOver = buffer === 1 && hit < 2;
    return (full << 6) | (extended ? 0x10 : 0) | (remote ? 0x08 : 0) | (rolledOver ? hit + 6 : hit);
  }

  // Registers (chapter 11)

  get #mode() {
    return this.#registers[ADDRESS.CANSTAT] >> 5;
  }

  /** By the instruction, or by the pin (chapter 9). */
  reset() {
    this.#registers.set(RESET_VALUES);
    this.transmitErrors = this.receiveErrors = 0;
    this.#sending = -1;
    this.#recovery?.cancel();
    this.#changed();
  }

  #read(address) {
    if ((address & 0xf) === 0xe) return (this.#registers[ADDRESS.CANSTAT] & 0xe0) | (this.#interruptCode << 1);
    if ((address & 0xf) === 0xf) return this.#registers[ADDRESS.CANCTRL];
    if (address === ADDRESS.TEC) return Math.min(this.transmitErrors, 255);
    if (address === ADDRESS.REC) return Math.min(this.receiveErrors, 255);
    // Filters and masks can be read in configuration mode only (register 4-10).
    if (this.#mode !== MODE.CONFIGURATION && isFilter(address)) return 0;
    return this.#registers[address];
  }

  /** CANSTAT's ICOD (register 10-2): the first of these that is enabled and flagged. */
  get #interruptCode() {
    const active = this.#registers[CANINTF] & this.#registers[ADDRESS.CANINTE];
    const order = [FLAGS.ERRIF, FLAGS.WAKIF, FLAGS.TX0IF, FLAGS.TX0IF << 1, FLAGS.TX0IF << 2, FLAGS.RX0IF, FLAGS.RX1IF];
    return order.findIndex((flag) => active & flag) + 1;
  }

  #write(address, value) {
    if ((address & 0xf) === 0xe) return; // CANSTAT
    if ((address & 0xf) === 0xf) {
      this.#writeControl(value);
      return;
    }
    const buffer = (address >> 4) - 3;
    if (buffer >= 0 && buffer < 3 && (address & 0xf) > 0 && this.#registers[control(buffer)] & FLAGS.TXREQ) return;
    const bits = writableBits(address, this.#mode === MODE.CONFIGURATION);
    const before = this.#registers[address];
    this.#registers[address] = (before & ~bits) | (value & bits);
    if (BUFFERS.some((n) => address === control(n))) this.#writeTransmitControl(address, before);
  }

  #writeTransmitControl(address, before) {
    const now = this.#registers[address];
    if (now & ~before & FLAGS.TXREQ) {
      this.#registers[address] &= ~(FLAGS.ABTF | FLAGS.MLOA | FLAGS.TXERR);
      this.#bus.kick();
    } else if (before & ~now & FLAGS.TXREQ) {
      this.#abort(address, before);
    }
  }

  /** A message that is on the bus already is sent, if it can be (3.6). */
  #abort(address, before) {
    if (this.#sending >= 0 && address === control(this.#sending)) this.#registers[address] = before;
    else this.#registers[address] = (before & ~FLAGS.TXREQ) | FLAGS.ABTF;
  }

  #writeControl(value) {
    this.#registers[ADDRESS.CANCTRL] = value;
    const mode = value >> 5;
    if (mode <= MODE.CONFIGURATION) this.#registers[ADDRESS.CANSTAT] = mode << 5;
    if (value & FLAGS.ABAT) {
      for (const n of BUFFERS) {
        if (this.#registers[control(n)] & FLAGS.TXREQ) this.#abort(control(n), this.#registers[control(n)]);
      }
    }
    if (mode === MODE.CONFIGURATION) this.transmitErrors = this.receiveErrors = 0;
    this.#countersChanged();
    this.#bus.kick();
    this.#loopBack();
  }

  get interrupting() {
    return this.#interrupt;
  }

  /** Interrupt pin: low while an enabled flag is up. */
  #changed() {
    const low = (this.#registers[CANINTF] & this.#registers[ADDRESS.CANINTE]) !== 0;
    if (low === this.#interrupt) return;
    this.#interrupt = low;
    this.onInterrupt(!low);
  }

  // The bus's side (chapters 3, 4 and 6)

  get #busOff() {
    return (this.#registers[EFLG] & FLAGS.TXBO) !== 0;
  }

  get errorPassive() {
    return this.transmitErrors > 127 || this.receiveErrors > 127;
  }

  /** The parts of a bit from CNF1..3 (chapter 5): a quantum in ns, and how many of it the segments after the first have. */
  get bitTiming() {
    const [cnf3, cnf2, cnf1] = this.#registers.subarray(ADDRESS.CNF3, ADDRESS.CNF1 + 1);
    const phase1 = (cnf2 >> 3 & 7) + 1;
    return {
      quantum_ns: 2e9 * ((cnf1 & 0x3f) + 1) / OSCILLATOR_HZ,
      jump: (cnf1 >> 6) + 1,
      propagation: (cnf2 & 7) + 1,
      phase1,
      phase2: cnf2 & 0x80 ? (cnf3 & 7) + 1 : Math.max(phase1, 2), // BTLMODE; information processing time
    };
  }

  /** 0 while not on the bus. */
  get bitRate() {
    if ((this.#mode !== MODE.NORMAL && this.#mode !== MODE.LISTEN_ONLY) || this.#busOff) return 0;
    const { quantum_ns, propagation, phase1, phase2 } = this.bitTiming;
    return 1e9 / quantum_ns / (1 + propagation + phase1 + phase2);
  }

  /** The highest priority first, and among equals the highest buffer (3.3). */
  #nextBuffer() {
    let best = -1;
    for (const n of BUFFERS) {
      const value = this.#registers[control(n)];
      if (value & FLAGS.TXREQ && (best < 0 || (value & 3) >= (this.#registers[control(best)] & 3))) best = n;
    }
    return best;
  }

  next() {
    if (this.#mode !== MODE.NORMAL) return null;
    this.#sending = this.#nextBuffer();
    return this.#sending < 0 ? null : transmitFrame(this.#registers.subarray(control(this.#sending) + 1));
  }

  sent() {
    const n = this.#sending;
    this.#sending = -1;
    this.#registers[control(n)] &= ~FLAGS.TXREQ;
    this.#registers[CANINTF] |= FLAGS.TX0IF << n;
    if (this.transmitErrors > 0) this.transmitErrors--;
    this.#countersChanged();
    this.#bus.kick();
  }

  lost() {
    this.#registers[control(this.#sending)] |= FLAGS.MLOA;
    this.#giveUpOneShot();
  }

  failed(sending, kind) {
    if (this.#mode === MODE.LISTEN_ONLY) return;
    this.#registers[CANINTF] |= FLAGS.MERRF;
    if (!sending) {
      this.receiveErrors = Math.min(this.receiveErrors + 1, 128);
    } else {
      this.#registers[control(this.#sending)] |= FLAGS.TXERR;
      // A passive transmitter that only misses the acknowledgement does not count up: alone on a bus is not bus-off.
      if (kind !== 'ack' || this.transmitErrors <= 127) this.transmitErrors += 8;
      this.#giveUpOneShot();
    }
    this.#countersChanged();
    this.#bus.kick();
  }

  #giveUpOneShot() {
    if (this.#registers[ADDRESS.CANCTRL] & FLAGS.OSM) this.#registers[control(this.#sending)] &= ~FLAGS.TXREQ;
    this.#sending = -1;
  }

  received(frame) {
    if (this.receiveErrors > 127) this.receiveErrors = 127;
    else if (this.receiveErrors > 0) this.receiveErrors--;
    this.#store(frame);
    this.#countersChanged();
    return this.#mode === MODE.NORMAL;
  }

  /** Error states (figure 6-1) and warnings (register 6-3); ERRIF when one of them changes. */
  #countersChanged() {
    const before = this.#registers[EFLG];
    let flags = before & (FLAGS.RX0OVR | FLAGS.RX1OVR | FLAGS.TXBO);
    if (this.transmitErrors > 255 && !(before & FLAGS.TXBO)) {
      flags |= FLAGS.TXBO;
      this.#scheduleRecovery();
    }
    if (this.transmitErrors > 127) flags |= FLAGS.TXEP;
    if (this.receiveErrors > 127) flags |= FLAGS.RXEP;
    if (this.transmitErrors > 95) flags |= FLAGS.TXWAR;
    if (this.receiveErrors > 95) flags |= FLAGS.RXWAR;
    if (flags & (FLAGS.TXWAR | FLAGS.RXWAR)) flags |= FLAGS.EWARN;
    if (this.transmitErrors === 0 && this.receiveErrors === 0) flags &= ~FLAGS.TXBO;
    this.#registers[EFLG] = flags;
    if (flags !== before) this.#registers[CANINTF] |= FLAGS.ERRIF;
    this.#changed();
  }

  #scheduleRecovery() {
    this.#recovery?.schedule(RECOVERY_BITS * 1e9 / this.#bus.bitRate);
  }

  #recover() {
    this.transmitErrors = this.receiveErrors = 0;
    this.#countersChanged();
    this.#bus.kick();
  }

  /** In loop-back mode messages go from the transmit to the receive buffers without the bus (10.4). */
  #loopBack() {
    while (this.#mode === MODE.LOOPBACK && this.#nextBuffer() >= 0) {
      const n = this.#nextBuffer();
      this.#registers[control(n)] &= ~FLAGS.TXREQ;
      this.#registers[CANINTF] |= FLAGS.TX0IF << n;
      this.#store(transmitFrame(this.#registers.subarray(control(n) + 1)));
    }
  }

  /** Figure 4-3: into the first buffer that accepts it and has room, with what does not fit as an overflow. */
  #store(frame) {
    const rollover = this.#registers[0x60] & FLAGS.BUKT;
    const hit0 = this.#match(frame, 0, [0, 1]);
    if (hit0 >= 0 && !(this.#registers[CANINTF] & FLAGS.RX0IF)) return this.#fill(0, frame, hit0);
    if (hit0 >= 0 && !rollover) return this.#overflow(FLAGS.RX0OVR);
    const hit1 = hit0 >= 0 ? hit0 : this.#match(frame, 1, [2, 3, 4, 5]);
    if (hit1 < 0) return undefined;
    return this.#registers[CANINTF] & FLAGS.RX1IF ? this.#overflow(FLAGS.RX1OVR) : this.#fill(1, frame, hit1);
  }

  #overflow(flag) {
    if (!(this.#registers[EFLG] & flag)) this.#registers[CANINTF] |= FLAGS.ERRIF;
    this.#registers[EFLG] |= flag;
  }

  #fill(buffer, frame, hit) {
    const base = 0x60 + 0x10 * buffer;
    receiveFrame(this.#registers.subarray(base + 1, base + 14), frame);
    const kept = this.#registers[base] & (buffer === 0 ? 0x64 : 0x60);
    const bukt1 = kept & FLAGS.BUKT ? 2 : 0; // a read-only copy of BUKT
    this.#registers[base] = kept | (buffer === 0 ? bukt1 : 0) | (frame.remote ? 0x08 : 0) | hit;
    this.#registers[CANINTF] |= FLAGS.RX0IF << buffer;
  }

  /** The number of the filter that accepts the frame for a buffer, or -1 (4.5). */
  #match(frame, buffer, filters) {
    if ((this.#registers[0x60 + 0x10 * buffer] & 0x60) === 0x60) return filters[0]; // all messages
    const mask = this.#registers.subarray(0x20 + 4 * buffer, 0x24 + 4 * buffer);
    return filters.find((n) => {
      const at = n < 3 ? 4 * n : 0x10 + 4 * (n - 3);
      return accepts(this.#registers.subarray(at, at + 4), mask, frame);
    }) ?? -1;
  }
}

function control(buffer) {
  return 0x30 + 0x10 * buffer;
}

function isFilter(address) {
  return address < 0x28 && (address & 0xf) < 0xc && !(address >= 0x1c && address < 0x20);
}

/** A standard frame's first two data bytes are compared where an extended one has EID15..0 (4.5.1). */
function accepts(filter, mask, frame) {
  if (((filter[1] & 0x08) !== 0) !== frame.extended) return false;
  const image = new Uint8Array(13);
  receiveFrame(image, frame);
  const seen = frame.extended ? image : [image[0], image[1] & 0xe0, frame.data[0] ?? 0, frame.data[1] ?? 0];
  const compared = frame.extended ? [0xff, 0xe3, 0xff, 0xff] : [0xff, 0xe0, frame.data.length > 0 ? 0xff : 0,
                                                                frame.data.length > 1 ? 0xff : 0];
  return compared.every((bits, n) => ((seen[n] ^ filter[n]) & mask[n] & bits) === 0);
}
