// SPDX-License-Identifier: MIT
// The timer: microseconds since the reset, four alarms (RP2040 datasheet 4.6). Takes the place of rp2040js' own, whose alarms
// ring up to a microsecond early.
import { BasePeripheral } from 'rp2040js';

const TIMEHR = 0x08;
const TIMELR = 0x0c;
const ALARM0 = 0x10;
const ARMED = 0x20;
const TIMERAWH = 0x24;
const TIMERAWL = 0x28;
const INTR = 0x34;
const INTE = 0x38;
const INTF = 0x3c;
const INTS = 0x40;
const ALARMS = 4;
const ALL = 0xf;
const US_NS = 1000;
const PAST_US = 0x80000000; // an alarm that is further away was meant for before

export class Timer extends BasePeripheral {
  #alarms;

  /** @param {import('rp2040js').RP2040} chip */
  constructor(chip) {
    super(chip, 'TIMER');
    this.#alarms = Array.from({ length: ALARMS }, (_, n) => ({ target_us: 0, armed: false, clock: chip.clock.createAlarm(() => this.#ring(n)) }));
    this.reset();
  }

  /** As after the block's reset, but for the time, which goes on: it is the board's. */
  reset() {
    for (const alarm of this.#alarms) {
      this.#disarm(alarm);
      alarm.target_us = 0;
    }
    this.latchedHigh = 0;
    this.raised = 0;
    this.enable = 0;
    this.force = 0;
    this.#updateInterrupts();
  }

  get #now_us() {
    return Math.floor(this.rp2040.clock.nanos / US_NS);
  }

  #disarm(alarm) {
    alarm.armed = false;
    alarm.clock.cancel();
  }

  /** The low 32 bits of the time equal the alarm: it disarms itself and stays raised until it is cleared (4.6.3). */
  #ring(n) {
    this.#disarm(this.#alarms[n]);
    this.raised |= 1 << n;
    this.#updateInterrupts();
  }

  #arm(n, target_us) {
    const now_ns = this.rp2040.clock.nanos;
    const wait_us = (target_us - this.#now_us) >>> 0;
    const alarm = this.#alarms[n];
    alarm.target_us = target_us >>> 0;
    alarm.armed = true;
    // Equality with the present time is taken to be missed, as one that is past is: 71 minutes.
    if (wait_us === 0 || wait_us > PAST_US) {
      this.#note('4.6.3', `alarm ${n} is set to a time that is past: it rings in 71 minutes`);
      alarm.clock.schedule((wait_us + (wait_us === 0 ? 2 ** 32 : 0)) * US_NS - (now_ns % US_NS));
      return;
    }
    alarm.clock.schedule(wait_us * US_NS - (now_ns % US_NS));
  }

  #updateInterrupts() {
    const status = (this.raised & this.enable) | this.force;
    for (let n = 0; n < ALARMS; n++) this.rp2040.setInterrupt(n, ((status >> n) & 1) === 1);
  }

  #note(section, text) {
    this.rp2040.violations.note(section, `timer: ${text}`);
  }

  readUint32(offset) {
    if (offset >= ALARM0 && offset < ARMED) return this.#alarms[(offset - ALARM0) >> 2].target_us;
    switch (offset) {
      case TIMELR: // latches the upper half (4.6.2)
        this.latchedHigh = Math.floor(this.#now_us / 2 ** 32);
        return this.#now_us >>> 0;
      case TIMEHR:
        return this.latchedHigh;
      case TIMERAWH:
        return Math.floor(this.#now_us / 2 ** 32);
      case TIMERAWL:
        return this.#now_us >>> 0;
      case ARMED:
        return this.#alarms.reduce((bits, { armed }, n) => bits | (armed ? 1 << n : 0), 0);
      case INTR:
        return this.raised;
      case INTE:
        return this.enable;
      case INTF:
        return this.force;
      case INTS:
        return (this.raised & this.enable) | this.force;
      default:
        return 0;
    }
  }

  writeUint32(offset, value) {
    if (offset >= ALARM0 && offset < ARMED) {
      this.#arm((offset - ALARM0) >> 2, value);
      return;
    }
    switch (offset) {
      case ARMED: // write clear, as INTR
        this.#alarms.forEach((alarm, n) => ((this.rawWriteValue >> n) & 1) && this.#disarm(alarm));
        break;
      case INTR:
        this.raised &= ~this.rawWriteValue;
        break;
      case INTE:
        this.enable = value & ALL;
        break;
      case INTF:
        this.force = value & ALL;
        break;
    }
    this.#updateInterrupts();
  }
}
