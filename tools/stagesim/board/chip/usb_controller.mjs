// SPDX-License-Identifier: MIT
// The RP2040's USB controller in device mode, packet by packet (RP2040 datasheet 4.1). Takes the place of rp2040js'
// model, which reports buffers as done before the host has them and knows neither NAK nor STALL.
import { BasePeripheral } from 'rp2040js';
import { Buffer, Endpoint, UsbBuffers } from './usb_buffers.mjs';
import { Interrupt, LEVEL_INTERRUPTS, Register, Sie, UsbRegisters } from './usb_registers.mjs';

const USBCTRL_INTERRUPT = 5;

const MAIN_ENABLE = 1;
const MAIN_HOST = 2;
const SIE_PULLUP_EN = 1 << 16;
const SIE_EP0_DOUBLE = 1 << 30;
const SIE_EP0_INT_1BUF = 1 << 29;
const SIE_EP0_INT_2BUF = 1 << 28;
const PWR_VBUS_DETECT = 1 << 2;
const PWR_VBUS_OVERRIDE = 1 << 3;
const MUXING_TO_PHY = 1 << 0;
const MUXING_TO_DIGITAL_PAD = 1 << 2;
const PHY_DP_PULLUP = 1 << 1;
const PHY_DP_PULLUP_OVERRIDE = 1 << 2;

const GPIO_DP = 15; // while TO_DIGITAL_PAD, with function 8 (appendix B, RP2040-E5)
const FUNCTION_USB_MUXING = 8;
const INPUT_FORCED_HIGH = 3;

const EP0_BUFFER = 0x100;
const CONNECT_NS = 800_000; // appendix B, RP2040-E5
const CYCLES_PER_US = 125;
const E15_SAFE_CYCLES = 800 * CYCLES_PER_US; // appendix B, RP2040-E15: the last 200 us of a frame
const FRAME_CYCLES = 1000 * CYCLES_PER_US;
const REVISION_B2 = 2;

/** The bus as LINE_STATE tells it. */
export const Line = Object.freeze({ SE0: 0, J: 1, K: 2 });

/** The answer of the device to one token of the host; LOST: garbled on the way. */
export const Handshake = Object.freeze({ ACK: 'ack', NAK: 'nak', STALL: 'stall', SILENT: 'silent', LOST: 'lost' });

export class UsbController extends BasePeripheral {
  #time;
  #revision;
  #registers;
  #buffers;
  #raw = 0; // interrupts that no level of SIE_STATUS raises
  #status = 0; // the bits of SIE_STATUS that clear by writing 1
  #suspended = false;
  #connected = false;
  #line = Line.SE0; // at the cable
  #idleSince = null; // settles the connection
  #buffStatus = 0;
  #abortDone = 0;
  #secondBuffer = 0; // bit 2 * endpoint + out: the last buffer done was buffer 1
  #nextBuffer = 0; // the same bits: buffer 1 is next
  #frameCycle = -Infinity; // of the last start of frame
  #lockedUp = false; // RP2040-E15

  /**
   * @param {import('rp2040js').RP2040} chip with `violations`
   * @param {{cycle: number}} time
   * @param {number} revision of SYSINFO.CHIP_ID
   */
  constructor(chip, time, revision) {
    super(chip, 'USB');
    this.#time = time;
    this.#revision = revision;
    this.#registers = new UsbRegisters((text) => chip.violations.note('4.1.4', `USB: ${text}`));
    const note = (section, text) => chip.violations.note(section, `USB: ${text}`);
    this.#buffers = new UsbBuffers(chip, { time, note, isOn: () => this.#isOn, mayTake: (half) => this.#mayTake(half) });
    /** Called when the program may have made an endpoint ready to answer, or changed its pull-up. */
    this.onReady = () => {};
    this.powered = false;
    /** A hub whose other devices keep the bus from ever being idle. */
    this.busyHub = false;
  }

  /** As RESETS leaves the block: every register at its reset value, off the bus. The memory keeps its contents. */
  reset() {
    this.#registers.reset();
    this.#raw = this.#status = this.#buffStatus = this.#abortDone = this.#secondBuffer = this.#nextBuffer = 0;
    this.#suspended = this.#connected = this.#lockedUp = false;
    this.#frameCycle = -Infinity;
    this.#cancelConnection();
    this.#update();
    this.onReady();
  }

  // What the host's end of the cable sees

  /** True while D+ is held up: a full-speed device is there. */
  get attached() {
    return this.powered && this.#pullsUp;
  }

  get #pullsUp() {
    if (this.#registers.get(Register.USBPHY_DIRECT_OVERRIDE) & PHY_DP_PULLUP_OVERRIDE) {
      return (this.#registers.get(Register.USBPHY_DIRECT) & PHY_DP_PULLUP) !== 0;
    }
    return this.#isOn && (this.#registers.get(Register.USB_MUXING) & MUXING_TO_PHY) !== 0 &&
      (this.#registers.get(Register.SIE_CTRL) & SIE_PULLUP_EN) !== 0;
  }

  get #isOn() {
    return (this.#registers.get(Register.MAIN_CTRL) & MAIN_ENABLE) !== 0;
  }

  /** Whether packets reach an engine that answers. */
  get #hears() {
    return this.attached && this.#isOn && this.#connected && !this.#lockedUp &&
      (this.#registers.get(Register.USB_MUXING) & MUXING_TO_PHY) !== 0;
  }

  get address() {
    return this.#registers.get(Register.ADDR_ENDP) & 0x7f;
  }

  /** Plugs or unplugs the cable. */
  setPowered(powered) {
    this.powered = powered;
    this.#line = Line.J;
    this.#followLine();
    this.#update();
  }

  /** A bus reset begins (USB 2.0 7.1.7.5). Registers, buffers and address stay for the program to reset. */
  beginReset() {
    if (!this.#isOn) return;
    this.#line = Line.SE0;
    this.#status |= Sie.BUS_RESET;
    this.#frameCycle = -Infinity;
    this.#setSuspended(false);
    this.#setConnected(false);
    this.#followLine();
    this.#update();
  }

  endReset() {
    this.#line = Line.J;
    this.#followLine();
  }

  /** The bus was idle for 3 ms (USB 2.0 7.1.7.6). */
  suspend() {
    if (this.#isOn) this.#setSuspended(true);
    this.#update();
  }

  /** The host resumes the bus (USB 2.0 7.1.7.7). */
  resume() {
    if (!this.#suspended) return;
    this.#status |= Sie.RESUME;
    this.#setSuspended(false);
    this.#update();
  }

  startOfFrame(number) {
    if (!this.attached || !this.#isOn || !this.#connected) return;
    this.#setSuspended(false);
    this.#registers.set(Register.SOF_RD, number & 0x7ff);
    this.#frameCycle = this.#time.cycle;
    this.#raw |= Interrupt.SOF;
    this.#update();
  }

  /** It answers nothing any more until it is reset, whatever the host does (RP2040-E15). */
  lockUp() {
    this.#lockedUp = true;
    this.onReady();
  }

  /** A SETUP packet: always accepted, and ends a stall of endpoint 0 (USB 2.0 8.5.3.4). Buffers stay as they are. */
  setup(packet) {
    if (!this.#hears) return Handshake.SILENT;
    this.rp2040.usbDPRAM.set(packet, 0);
    this.#registers.set(Register.EP_STALL_ARM, 0);
    this.#status |= Sie.SETUP;
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
    if (data1 !== ((found.fields & Buffer.DATA1) !== 0)) {
      this.#status |= Sie.SEQ_ERROR;
      this.#update();
      return { handshake: Handshake.ACK };
    }
    const room = found.fields & Buffer.LENGTH;
    const length = Math.min(packet.length, room);
    this.rp2040.usbDPRAM.set(packet.subarray(0, length), found.address);
    this.#complete(found, (found.fields & ~(Buffer.AVAILABLE | Buffer.LENGTH)) | Buffer.FULL | length);
    return { handshake: Handshake.ACK };
  }

  /**
   * An IN transaction. A bus error garbles its packet: the host does not acknowledge, the controller sees none, and offers it
   * again; or locks up, if the buffer was handed over in the last 200 us of a frame (RP2040-E15).
   * @returns {{handshake: string, packet?: Uint8Array, data1?: boolean}}
   */
  in(endpoint, busError = false) {
    const found = this.#peek(endpoint, false);
    if (found.handshake !== Handshake.ACK) return { handshake: found.handshake };
    if (busError) {
      this.#status |= Sie.RX_TIMEOUT;
      if (this.#wasArmedLate(found)) this.lockUp();
      this.#update();
      return { handshake: Handshake.LOST };
    }
    const length = found.fields & Buffer.LENGTH;
    const packet = this.rp2040.usbDPRAM.slice(found.address, found.address + length);
    const data1 = (found.fields & Buffer.DATA1) !== 0;
    this.#status |= Sie.ACK_REC;
    this.#complete(found, found.fields & ~(Buffer.AVAILABLE | Buffer.FULL));
    return { handshake: Handshake.ACK, packet, data1 };
  }

  #wasArmedLate({ half, second }) {
    const age = this.#buffers.armedAt(half, second) - this.#frameCycle; // negative: in an earlier frame
    return Number.isFinite(age) && ((age % FRAME_CYCLES) + FRAME_CYCLES) % FRAME_CYCLES >= E15_SAFE_CYCLES;
  }

  #peek(endpoint, out) {
    if (!this.#hears) return { handshake: Handshake.SILENT };
    const half = 2 * endpoint + (out ? 1 : 0);
    const bit = 1 << half;
    const control = endpoint === 0 ? this.#ep0Control() : this.#buffers.endpointControl(half);
    if ((control & Endpoint.ENABLE) === 0) return { handshake: Handshake.SILENT };
    if (this.#registers.get(Register.EP_ABORT) & bit) return { handshake: Handshake.NAK };
    const stallArmed = endpoint !== 0 || (this.#registers.get(Register.EP_STALL_ARM) >> (out ? 1 : 0)) & 1;
    if (this.#buffers.fields(half, false) & Buffer.STALL && stallArmed) return { handshake: Handshake.STALL };
    const second = (control & Endpoint.DOUBLE) !== 0 && (this.#nextBuffer & bit) !== 0;
    const fields = this.#buffers.fields(half, second);
    const filled = (fields & Buffer.FULL) !== 0;
    if ((fields & Buffer.AVAILABLE) === 0 || filled === out) return { handshake: Handshake.NAK };
    const base = endpoint === 0 ? EP0_BUFFER : control & 0xffc0;
    return { handshake: Handshake.ACK, half, bit, fields, second, control, address: base + (second ? 64 : 0) };
  }

  /** Endpoint 0 has no control word in memory; SIE_CTRL has its bits (datasheet 4.1.2.5.3). */
  #ep0Control() {
    const sie = this.#registers.get(Register.SIE_CTRL);
    return Endpoint.ENABLE | (sie & SIE_EP0_DOUBLE ? Endpoint.DOUBLE : 0) |
      (sie & SIE_EP0_INT_1BUF ? Endpoint.INT_1BUF : 0) | (sie & SIE_EP0_INT_2BUF ? Endpoint.INT_2BUF : 0);
  }

  #complete({ half, bit, second, control, fields: before }, fields) {
    this.#buffers.finish(half, second, fields);
    if (control & Endpoint.DOUBLE) this.#nextBuffer ^= bit;
    if (control & Endpoint.INT_1BUF || (control & Endpoint.INT_2BUF && second)) {
      this.#buffStatus |= bit;
      this.#secondBuffer = second ? this.#secondBuffer | bit : this.#secondBuffer & ~bit;
    }
    if (before & Buffer.LAST) this.#status |= Sie.TRANS_COMPLETE;
    this.#update();
  }

  // The line, and what follows from it

  get #lineState() {
    const muxing = this.#registers.get(Register.USB_MUXING);
    if (muxing & MUXING_TO_DIGITAL_PAD) return this.#padIsForcedToJ ? Line.J : Line.SE0;
    if (!(muxing & MUXING_TO_PHY)) return Line.SE0;
    if (!this.#pullsUp) return Line.SE0;
    return this.powered ? this.#line : Line.J;
  }

  get #padIsForcedToJ() {
    const pin = this.rp2040.gpio[GPIO_DP];
    return pin.functionSelect === FUNCTION_USB_MUXING && pin.inputOverride === INPUT_FORCED_HIGH;
  }

  /** Connected after 800 us of J; chips before B2 are not while others' packets are on the bus (RP2040-E5). */
  #followLine() {
    const isForced = (this.#registers.get(Register.USB_MUXING) & MUXING_TO_DIGITAL_PAD) !== 0;
    const isIdle = this.#isOn && this.#lineState === Line.J &&
      (isForced || !this.busyHub || this.#revision >= REVISION_B2);
    if (!isIdle) return this.#cancelConnection();
    if (this.#connected || this.#idleSince?.scheduled) return undefined;
    this.#idleSince ??= this.rp2040.clock.createAlarm(() => {
      this.#setConnected(true);
      this.#update();
      this.onReady();
    });
    return this.#idleSince.schedule(CONNECT_NS);
  }

  #cancelConnection() {
    if (this.#idleSince?.scheduled) this.#idleSince.cancel();
  }

  /** INTR: "Set when the device suspend state changes", and likewise of the connection. */
  #setSuspended(suspended) {
    if (suspended !== this.#suspended) this.#raw |= Interrupt.SUSPEND;
    this.#suspended = suspended;
  }

  #setConnected(connected) {
    if (connected !== this.#connected) this.#raw |= Interrupt.CONN;
    this.#connected = connected;
  }

  // What the program sees

  /** rp2040js calls this after each write to the USB memory. */
  DPRAMUpdated(offset, value) {
    if (this.#buffers.written(offset, value)) this.onReady();
  }

  /** Revoking a buffer goes by EP_ABORT, which chips before B2 do not come out of (RP2040-E2): they have no other way than this. */
  #mayTake(half) {
    return this.#revision < REVISION_B2 || ((this.#abortDone >>> half) & 1) === 1;
  }

  get #sieStatus() {
    const power = this.#registers.get(Register.USB_PWR);
    const vbus = power & PWR_VBUS_OVERRIDE ? (power & PWR_VBUS_DETECT) !== 0 : this.powered;
    return this.#status | (this.#connected ? Sie.CONNECTED : 0) | (this.#suspended ? Sie.SUSPENDED : 0) |
      (this.#lineState << Sie.LINE_STATE_LSB) | (vbus ? Sie.VBUS : 0);
  }

  get #interruptRaw() {
    const status = this.#sieStatus;
    let raw = this.#raw | (this.#buffStatus ? Interrupt.BUFF_STATUS : 0) | (this.#abortDone ? Interrupt.ABORT_DONE : 0);
    for (const [bit, interrupt] of LEVEL_INTERRUPTS) if (status & bit) raw |= interrupt;
    return raw;
  }

  get #interruptStatus() {
    return (this.#interruptRaw & this.#registers.get(Register.INTE)) | this.#registers.get(Register.INTF);
  }

  #update() {
    this.rp2040.setInterrupt(USBCTRL_INTERRUPT, this.#interruptStatus !== 0);
  }

  readUint32(offset) {
    switch (offset) {
      case Register.SOF_RD:
        this.#raw &= ~Interrupt.SOF;
        this.#update();
        return this.#registers.get(offset);
      case Register.SIE_STATUS: return this.#sieStatus >>> 0;
      case Register.BUFF_STATUS: return this.#buffStatus >>> 0;
      case Register.BUFF_CPU_SHOULD_HANDLE: return this.#secondBuffer >>> 0;
      case Register.EP_ABORT_DONE: return this.#abortDone >>> 0;
      case Register.INTR: return this.#interruptRaw >>> 0;
      case Register.INTS: return this.#interruptStatus >>> 0;
      default: return this.#registers.get(offset) >>> 0;
    }
  }

  writeUint32Atomic(offset, value, alias) {
    const { cleared, told } = this.#registers.write(offset, value >>> 0, alias);
    if (offset === Register.SIE_STATUS) this.#clearStatus(cleared, told);
    if (offset === Register.BUFF_STATUS) this.#buffStatus &= ~cleared;
    if (offset === Register.EP_ABORT) this.#abort();
    if (offset === Register.EP_ABORT_DONE) this.#abortDone &= ~cleared | this.#registers.get(Register.EP_ABORT);
    if (offset === Register.MAIN_CTRL && this.#registers.get(offset) & MAIN_HOST) throw new Error('USB: host mode is not modelled');
    this.#followLine();
    this.#update();
    this.onReady();
  }

  /** Those of a level clear the interrupt that its change has raised. */
  #clearStatus(cleared, told) {
    this.#status &= ~cleared;
    if (told & Sie.SUSPENDED) this.#raw &= ~Interrupt.SUSPEND;
    if (told & Sie.CONNECTED) this.#raw &= ~Interrupt.CONN;
  }

  /** Done at once: no transaction is cut up here. */
  #abort() {
    const aborted = this.#registers.get(Register.EP_ABORT);
    if (aborted && this.#revision < REVISION_B2) {
      this.rp2040.violations.note('appendix B, RP2040-E2', 'USB: EP_ABORT was set, which this stepping does not come out of');
    }
    this.#abortDone |= aborted;
  }
}
