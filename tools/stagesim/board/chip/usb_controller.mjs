// SPDX-License-Identifier: MIT
// The RP2040's USB controller in device mode, packet by packet (RP2040 datasheet 4.1). Takes the place of rp2040js'
// model, which reports buffers as done before the host has them and knows neither NAK nor STALL.
import { BasePeripheral } from 'rp2040js';

const USBCTRL_INTERRUPT = 5;

// Registers (datasheet 4.1.4)
const ADDR_ENDP = 0x00;
const MAIN_CTRL = 0x40;
const SOF_RD = 0x48;
const SIE_CTRL = 0x4c;
const SIE_STATUS = 0x50;
const BUFF_STATUS = 0x58;
const BUFF_CPU_SHOULD_HANDLE = 0x5c;
const EP_ABORT = 0x60;
const EP_ABORT_DONE = 0x64;
const EP_STALL_ARM = 0x68;
const NAK_POLL = 0x6c;
const EP_STATUS_STALL_NAK = 0x70;
const USB_MUXING = 0x74;
const USB_PWR = 0x78;
const INTR = 0x8c;
const INTE = 0x90;
const INTF = 0x94;
const INTS = 0x98;

const MAIN_ENABLE = 1;
const SIE_PULLUP_EN = 1 << 16;
const SIE_EP0_DOUBLE = 1 << 30;
const SIE_EP0_INT_1BUF = 1 << 29;
const SIE_EP0_INT_2BUF = 1 << 28;
const PWR_VBUS_DETECT = 1 << 2;
const PWR_VBUS_OVERRIDE = 1 << 3;

const STATUS_SEQ_ERROR = 0x80000000 | 0;
const STATUS_BUS_RESET = 1 << 19;
const STATUS_TRANS_COMPLETE = 1 << 18;
const STATUS_SETUP = 1 << 17;
const STATUS_CONNECTED = 1 << 16;
const STATUS_RESUME = 1 << 11;
const STATUS_SUSPENDED = 1 << 4;
const STATUS_LINE_J = 1 << 2;
const STATUS_VBUS = 1 << 0;
const STATUS_CLEARABLE = STATUS_SEQ_ERROR | 0x7f000000 | STATUS_BUS_RESET | STATUS_TRANS_COMPLETE | STATUS_SETUP |
  STATUS_RESUME;

const INT_SOF = 1 << 17;
const INT_SETUP = 1 << 16;
const INT_RESUME = 1 << 15;
const INT_SUSPEND = 1 << 14;
const INT_CONN = 1 << 13;
const INT_BUS_RESET = 1 << 12;
const INT_VBUS = 1 << 11;
const INT_SEQ_ERROR = 1 << 5;
const INT_BUFF_STATUS = 1 << 4;
const INT_TRANS_COMPLETE = 1 << 3;

// Buffer control, a half for each buffer (datasheet 4.1.2.5.3)
const BUF_FULL = 1 << 15;
const BUF_LAST = 1 << 14;
const BUF_DATA1 = 1 << 13;
const BUF_STALL = 1 << 11;
const BUF_AVAILABLE = 1 << 10;
const BUF_LENGTH = 0x3ff;

// Endpoint control (datasheet 4.1.2.5.2)
const EP_ENABLE = 0x80000000 | 0;
const EP_DOUBLE = 1 << 30;
const EP_INT_1BUF = 1 << 29;
const EP_INT_2BUF = 1 << 28;

const BUFFER_CONTROLS = 0x80;
const BUFFER_CONTROLS_END = 0x100;
const EP0_BUFFER = 0x100;

/** The answer of the device to one token of the host. `data` is the packet of an answered IN. */
export const Handshake = Object.freeze({ ACK: 'ack', NAK: 'nak', STALL: 'stall', SILENT: 'silent' });

export class UsbController extends BasePeripheral {
  #registers = new Map();
  #raw = 0;
  #enable = 0;
  #force = 0;
  #status = 0;
  #buffStatus = 0;
  #secondBuffer = 0; // bit 2 * endpoint + out: the last buffer done was buffer 1
  #nextBuffer = 0; // the same bits: buffer 1 is next

  /** @param {import('rp2040js').RP2040} chip */
  constructor(chip) {
    super(chip, 'USB');
    /** Called when the program may have made an endpoint ready to answer, or changed its pull-up. */
    this.onReady = () => {};
    this.powered = false;
  }

  #register(offset) {
    return this.#registers.get(offset) ?? 0;
  }

  // What the host's end of the cable sees

  /** True while the program holds D+ up: a full-speed device is there. */
  get attached() {
    return this.powered && (this.#register(MAIN_CTRL) & MAIN_ENABLE) !== 0 &&
      (this.#register(SIE_CTRL) & SIE_PULLUP_EN) !== 0;
  }

  get address() {
    return this.#register(ADDR_ENDP) & 0x7f;
  }

  /** Plugs or unplugs the cable: VBUS and the idle state of the bus. */
  setPowered(powered) {
    if (powered === this.powered) return;
    this.powered = powered;
    if (powered) this.#status |= STATUS_CONNECTED | STATUS_LINE_J;
    else this.#status &= ~(STATUS_CONNECTED | STATUS_LINE_J);
    this.#raw |= INT_CONN;
    this.#updateVbus();
    this.#update();
  }

  #updateVbus() {
    const power = this.#register(USB_PWR);
    const present = power & PWR_VBUS_OVERRIDE ? (power & PWR_VBUS_DETECT) !== 0 : this.powered;
    this.#status = present ? this.#status | STATUS_VBUS : this.#status & ~STATUS_VBUS;
  }

  /** A bus reset ends (USB 2.0 7.1.7.5): endpoints start with buffer 0 again, the device answers at address 0. */
  busReset() {
    this.#nextBuffer = 0;
    this.#registers.set(ADDR_ENDP, 0);
    this.#status = (this.#status | STATUS_BUS_RESET) & ~STATUS_SUSPENDED;
    this.#update();
  }

  /** The bus was idle for 3 ms (USB 2.0 7.1.7.6). */
  suspend() {
    this.#status |= STATUS_SUSPENDED;
    this.#raw |= INT_SUSPEND;
    this.#update();
  }

  startOfFrame(number) {
    this.#registers.set(SOF_RD, number & 0x7ff);
    this.#raw |= INT_SOF;
    this.#update();
  }

  /** A SETUP packet: always accepted, and ends a stall of endpoint 0 (USB 2.0 8.5.3.4). */
  setup(packet) {
    if (!this.attached) return Handshake.SILENT;
    this.rp2040.usbDPRAM.set(packet, 0);
    this.#registers.set(EP_STALL_ARM, 0);
    this.#status |= STATUS_SETUP;
    this.#update();
    return Handshake.ACK;
  }

  /** Whether a token to the endpoint would now get something other than NAK. */
  ready(endpoint, out) {
    return this.#peek(endpoint, out).handshake !== Handshake.NAK;
  }

  /**
   * An OUT transaction. A packet with the wrong data toggle is acknowledged and dropped, with an error flag: the
   * hardware takes it for a repetition (USB 2.0 8.6.2).
   * @returns {{handshake: string}}
   */
  out(endpoint, packet, data1) {
    const found = this.#peek(endpoint, true);
    if (found.handshake !== Handshake.ACK) return { handshake: found.handshake };
    if (data1 !== ((found.half & BUF_DATA1) !== 0)) {
      this.#status |= STATUS_SEQ_ERROR;
      this.#update();
      return { handshake: Handshake.ACK };
    }
    const room = found.half & BUF_LENGTH;
    const length = Math.min(packet.length, room);
    this.rp2040.usbDPRAM.set(packet.subarray(0, length), found.address);
    this.#complete(endpoint, true, found, (found.half & ~(BUF_AVAILABLE | BUF_LENGTH)) | BUF_FULL | length);
    return { handshake: Handshake.ACK };
  }

  /** @returns {{handshake: string, packet?: Uint8Array, data1?: boolean}} of an IN transaction. */
  in(endpoint) {
    const found = this.#peek(endpoint, false);
    if (found.handshake !== Handshake.ACK) return { handshake: found.handshake };
    const length = found.half & BUF_LENGTH;
    const packet = this.rp2040.usbDPRAM.slice(found.address, found.address + length);
    const data1 = (found.half & BUF_DATA1) !== 0;
    this.#complete(endpoint, false, found, found.half & ~(BUF_AVAILABLE | BUF_FULL));
    return { handshake: Handshake.ACK, packet, data1 };
  }

  #peek(endpoint, out) {
    if (!this.attached) return { handshake: Handshake.SILENT };
    const view = this.rp2040.usbDPRAMView;
    const bit = 1 << (endpoint * 2 + (out ? 1 : 0));
    const control = endpoint === 0 ? this.#ep0Control() : view.getUint32(8 * endpoint + (out ? 4 : 0), true) | 0;
    if ((control & EP_ENABLE) === 0) return { handshake: Handshake.SILENT };
    const both = view.getUint32(BUFFER_CONTROLS + 8 * endpoint + (out ? 4 : 0), true);
    const stallArmed = endpoint !== 0 || (this.#register(EP_STALL_ARM) >> (out ? 1 : 0)) & 1;
    if (both & BUF_STALL && stallArmed) return { handshake: Handshake.STALL };
    const second = (control & EP_DOUBLE) !== 0 && (this.#nextBuffer & bit) !== 0;
    const half = second ? both >>> 16 : both & 0xffff;
    if ((half & BUF_AVAILABLE) === 0 || (!out && (half & BUF_FULL) === 0)) return { handshake: Handshake.NAK };
    const base = endpoint === 0 ? EP0_BUFFER : control & 0xffc0;
    return { handshake: Handshake.ACK, half, second, control, bit, address: base + (second ? 64 : 0) };
  }

  /** Endpoint 0 has no control word in memory; SIE_CTRL has its bits (datasheet 4.1.2.5.2). */
  #ep0Control() {
    const sie = this.#register(SIE_CTRL);
    return EP_ENABLE | (sie & SIE_EP0_DOUBLE ? EP_DOUBLE : 0) | (sie & SIE_EP0_INT_1BUF ? EP_INT_1BUF : 0) |
      (sie & SIE_EP0_INT_2BUF ? EP_INT_2BUF : 0);
  }

  #complete(endpoint, out, { second, control, bit, half: before }, half) {
    const view = this.rp2040.usbDPRAMView;
    view.setUint16(BUFFER_CONTROLS + 8 * endpoint + (out ? 4 : 0) + (second ? 2 : 0), half, true);
    if (control & EP_DOUBLE) this.#nextBuffer ^= bit;
    if (control & EP_INT_1BUF || (control & EP_INT_2BUF && second)) {
      this.#buffStatus |= bit;
      this.#secondBuffer = second ? this.#secondBuffer | bit : this.#secondBuffer & ~bit;
    }
    if (before & BUF_LAST) this.#status |= STATUS_TRANS_COMPLETE;
    this.#update();
  }

  // What the program sees

  /** rp2040js calls this after each write to the USB memory. */
  DPRAMUpdated(offset) {
    if (offset >= BUFFER_CONTROLS && offset < BUFFER_CONTROLS_END) this.onReady();
  }

  #update() {
    const sources = [[STATUS_SETUP, INT_SETUP], [STATUS_RESUME, INT_RESUME], [STATUS_BUS_RESET, INT_BUS_RESET],
                     [STATUS_VBUS, INT_VBUS], [STATUS_SEQ_ERROR, INT_SEQ_ERROR],
                     [STATUS_TRANS_COMPLETE, INT_TRANS_COMPLETE]];
    for (const [status, interrupt] of sources) {
      this.#raw = this.#status & status ? this.#raw | interrupt : this.#raw & ~interrupt;
    }
    this.#raw = this.#buffStatus ? this.#raw | INT_BUFF_STATUS : this.#raw & ~INT_BUFF_STATUS;
    this.rp2040.setInterrupt(USBCTRL_INTERRUPT, this.#interruptStatus !== 0);
  }

  get #interruptStatus() {
    return (this.#raw & this.#enable) | this.#force;
  }

  readUint32(offset) {
    switch (offset) {
      case SOF_RD:
        this.#raw &= ~INT_SOF;
        this.#update();
        return this.#register(SOF_RD);
      case SIE_STATUS:
        return this.#status >>> 0;
      case BUFF_STATUS:
        return this.#buffStatus >>> 0;
      case BUFF_CPU_SHOULD_HANDLE:
        return this.#secondBuffer >>> 0;
      case EP_ABORT_DONE:
        return this.#register(EP_ABORT); // nothing is ever in the middle of a packet when the program runs
      case INTR:
        return this.#raw;
      case INTE:
        return this.#enable;
      case INTF:
        return this.#force;
      case INTS:
        return this.#interruptStatus;
      default:
        return this.#register(offset) >>> 0;
    }
  }

  writeUint32(offset, value) {
    switch (offset) {
      case SIE_STATUS:
        this.#clearStatus(this.rawWriteValue);
        break;
      case BUFF_STATUS:
        this.#buffStatus &= ~this.rawWriteValue;
        break;
      case INTE:
        this.#enable = value & 0xfffff;
        break;
      case INTF:
        this.#force = value & 0xfffff;
        break;
      case EP_ABORT_DONE:
      case EP_STATUS_STALL_NAK:
      case INTR:
      case INTS:
      case SOF_RD:
        break; // read only, or never set here
      case ADDR_ENDP:
      case MAIN_CTRL:
      case SIE_CTRL:
      case EP_ABORT:
      case EP_STALL_ARM:
      case NAK_POLL:
      case USB_MUXING:
      case USB_PWR:
        this.#registers.set(offset, value);
        break;
      default:
        super.writeUint32(offset, value);
    }
    this.#updateVbus();
    this.#update();
    this.onReady();
  }

  /** Bits are cleared by writing 1; those of a level clear the interrupt that its change has raised. */
  #clearStatus(bits) {
    this.#status &= ~(bits & STATUS_CLEARABLE);
    if (bits & STATUS_SUSPENDED) {
      this.#status &= ~STATUS_SUSPENDED;
      this.#raw &= ~INT_SUSPEND;
    }
    if (bits & STATUS_CONNECTED) this.#raw &= ~INT_CONN;
  }
}
