// SPDX-License-Identifier: MIT
// The host's end of the USB cable: finds the device, configures it, keeps frames going and carries transfers, all in
// board time. One transaction at a time is on the bus, as long as its bytes take at 12 Mbit/s.
import { Handshake } from '../chip/usb_controller.mjs';
import { BulkInTransfer, BulkOutTransfer, ControlTransfer, Status } from './usb_transfer.mjs';

const MS = 1_000_000; // ns
const DEBOUNCE_NS = 100 * MS; // USB 2.0 7.1.7.3
const RESET_NS = 10 * MS; // USB 2.0 7.1.7.5
const RECOVERY_NS = 10 * MS; // USB 2.0 7.1.7.5
const SET_ADDRESS_NS = 2 * MS; // USB 2.0 9.2.6.3
const REQUEST_NS = 5000 * MS; // USB 2.0 9.2.6.1
const SUSPEND_NS = 3 * MS; // USB 2.0 7.1.7.6
const RESUME_NS = 20 * MS; // USB 2.0 7.1.7.7
const ERRORS_MAX = 3; // in a row, of one transfer (USB 2.0 8.7.4, and what hosts do)
const ATTEMPTS_MAX = 3; // to configure a device, each from a bus reset on
const FRAME_NS = MS;
const OVERHEAD_BYTES = 13; // of a bulk transaction: sync, PIDs, CRCs, gaps (USB 2.0 5.8.4)
const BYTE_NS = 8e9 / 12e6;
const CYCLE_NS = 8;
const ADDRESS = 1;

const GET_DESCRIPTOR = 6;
const SET_ADDRESS = 5;
const SET_CONFIGURATION = 9;
const CLEAR_FEATURE = 1;
const SET_INTERFACE = 11;
const DESCRIPTOR_DEVICE = 1;
const DESCRIPTOR_CONFIGURATION = 2;
const DESCRIPTOR_ENDPOINT = 5;

export class UsbHost {
  #clock;
  #controller;
  #state = 'unplugged'; // searching, resetting, configuring, configured, failed
  #address = 0;
  #frame = 0;
  #queues = new Map(); // pipe -> entries, the first is on the bus
  #waiting = []; // submitted before the device was configured
  #lastPipe = -1;
  #toggles = new Map();
  #packetBytes = new Map([[0, 64]]);
  #onBus = null;
  #stepAlarm;
  #nextStep = () => {};
  #busAlarm;
  #frameAlarm;
  #suspendAlarm;
  #log;
  #attempts = 0;
  #asleep = false;
  #busError = null; // what the next bulk IN meets: 'garbled', or 'fatal' to the controller

  /**
   * @param {object} clock of the chip (createAlarm)
   * @param {import('../chip/usb_controller.mjs').UsbController} controller
   * @param {(message: string) => void} log
   */
  constructor(clock, controller, log) {
    this.#clock = clock;
    this.#controller = controller;
    this.#log = log;
    this.#stepAlarm = new Alarm(clock, () => this.#nextStep());
    this.#busAlarm = new Alarm(clock, () => this.#endTransaction());
    this.#frameAlarm = new Alarm(clock, () => this.#startFrame());
    this.#suspendAlarm = new Alarm(clock, () => this.#controller.suspend());
    controller.onReady = () => this.#deviceMayHaveChanged();
  }

  /** True while something is under way that only needs time to pass. */
  get active() {
    return this.#onBus !== null || this.#suspendAlarm.scheduled || this.#state === 'resetting' ||
      this.#state === 'configuring' || this.#stepAlarm.scheduled;
  }

  /** True while transfers wait for the device to answer. */
  get pending() {
    return this.#waiting.length > 0 || [...this.#queues.values()].some((queue) => queue.length > 0);
  }

  /** A device that is plugged in sees an idle bus, and suspends, until the host has debounced the connection. */
  plug() {
    this.#controller.setPowered(true);
    this.#state = 'searching';
    this.#idle();
    this.#deviceMayHaveChanged();
  }

  /** From now on nothing is on the bus. */
  #idle() {
    if (!this.#suspendAlarm.scheduled) this.#suspendAlarm.schedule(SUSPEND_NS);
  }

  /** The device sees its power go, and 3 ms later an idle bus. */
  unplug() {
    if (this.#state === 'unplugged') return;
    this.#lose('unplugged');
    this.#controller.setPowered(false);
    this.#idle();
  }

  /** Resets the bus and configures the device anew, as a host does that has lost patience with it. */
  resetBus() {
    this.#lose('resetting');
    this.#beginReset();
  }

  /** Sends no more frames: the device sees an idle bus. */
  suspend() {
    this.#lose('failed');
  }

  /** The same, but resume() goes on where this left off. */
  sleep() {
    this.#asleep = true;
    this.#frameAlarm.cancel();
    this.#idle();
  }

  resume() {
    if (!this.#asleep) return;
    this.#suspendAlarm.cancel();
    this.#controller.resume();
    this.#after(RESUME_NS, () => {
      this.#asleep = false;
      this.#startFrame();
      this.#startTransaction();
    });
  }

  /** The next bulk IN's packet is garbled; if `fatal`, so that the controller locks up (erratum RP2040-E15). */
  injectBusError(fatal) {
    this.#busError = fatal ? 'fatal' : 'garbled';
  }

  /**
   * @param {{type: 'control' | 'bulk', endpoint: number, setup?: Uint8Array, data?: Uint8Array, capacity?: number,
   *          timeout_us: number, done: (status: number, bytes: Uint8Array) => void}} request
   *   endpoint has bit 7 set for IN; timeout in board time, 0 for none
   * @returns {object} a handle for cancel()
   */
  submit(request) {
    const entry = { request, transfer: null, deadline: null };
    if (request.timeout_us > 0) {
      entry.deadline = new Alarm(this.#clock, () => this.#finish(entry, Status.TIMED_OUT));
      entry.deadline.schedule(request.timeout_us * 1000);
    }
    if (this.#state === 'configured') this.#enqueue(entry);
    else if (this.#state === 'failed') this.#finish(entry, Status.DISCONNECTED);
    else this.#waiting.push(entry);
    return entry;
  }

  cancel(entry) {
    this.#finish(entry, Status.CANCELLED);
  }

  // Finding and configuring the device

  #deviceMayHaveChanged() {
    const { attached } = this.#controller;
    if (attached && this.#state === 'searching') {
      this.#state = 'resetting';
      this.#attempts = 0;
      this.#idle();
      this.#after(DEBOUNCE_NS, () => this.#beginReset());
    } else if (!attached && !['unplugged', 'searching'].includes(this.#state)) {
      this.#lose('searching');
    } else {
      this.#startTransaction();
    }
  }

  #after(delay_ns, step) {
    this.#nextStep = step;
    this.#stepAlarm.schedule(delay_ns);
  }

  #lose(state) {
    this.#state = state;
    this.#asleep = false;
    this.#controller.endReset();
    if (state === 'failed') this.#idle(); // the port is left alone
    for (const alarm of [this.#stepAlarm, this.#busAlarm, this.#frameAlarm]) alarm.cancel();
    this.#onBus = null;
    const lost = [...this.#waiting, ...[...this.#queues.values()].flat()];
    for (const entry of lost) this.#finish(entry, Status.DISCONNECTED);
    this.#queues.clear();
    this.#toggles.clear();
  }

  #beginReset() {
    this.#suspendAlarm.cancel();
    this.#attempts++;
    this.#controller.beginReset();
    this.#after(RESET_NS, () => this.#endReset());
  }

  #endReset() {
    this.#address = 0;
    this.#controller.endReset();
    this.#frameAlarm.schedule(FRAME_NS);
    this.#after(RECOVERY_NS, () => this.#configure());
  }

  /** The order of requests is that of common hosts; descriptors are read as USB 2.0 9.6 lays them out. */
  #configure() {
    this.#state = 'configuring';
    this.#ask([0x80, GET_DESCRIPTOR, 0, DESCRIPTOR_DEVICE, 0, 0, 8, 0], (device) => {
      this.#packetBytes.set(0, device[7]);
      this.#ask([0x00, SET_ADDRESS, ADDRESS, 0, 0, 0, 0, 0], () => {
        this.#address = ADDRESS;
        this.#after(SET_ADDRESS_NS, () => this.#readConfiguration());
      });
    });
  }

  #readConfiguration() {
    this.#ask([0x80, GET_DESCRIPTOR, 0, DESCRIPTOR_CONFIGURATION, 0, 0, 9, 0], (head) => {
      this.#ask([0x80, GET_DESCRIPTOR, 0, DESCRIPTOR_CONFIGURATION, 0, 0, head[2], head[3]], (whole) => {
        for (let at = 0; at + 1 < whole.length && whole[at] > 0; at += whole[at]) {
          if (whole[at + 1] !== DESCRIPTOR_ENDPOINT) continue;
          this.#packetBytes.set(whole[at + 2], whole[at + 4] | (whole[at + 5] << 8));
        }
        this.#ask([0x00, SET_CONFIGURATION, whole[5], 0, 0, 0, 0, 0], () => this.#configured());
      });
    });
  }

  #ask(setup, next) {
    const done = (status, bytes) => {
      if (status === Status.OK) {
        next(bytes);
      } else if (this.#state === 'configuring') {
        this.#tryAgain(setup[1], status);
      }
    };
    const request = { type: 'control', endpoint: 0, setup: Uint8Array.from(setup), timeout_us: REQUEST_NS / 1000, done };
    const entry = { request, transfer: null, deadline: new Alarm(this.#clock, () => this.#finish(entry, Status.TIMED_OUT)) };
    entry.deadline.schedule(REQUEST_NS);
    this.#enqueue(entry);
  }

  /** What waits for the device goes on waiting. */
  #tryAgain(request, status) {
    const last = this.#attempts >= ATTEMPTS_MAX;
    this.#log(`usb: the device answered request ${request} with status ${status}; ${last ? 'giving up on it' : 'trying again'}`);
    const waiting = this.#waiting;
    if (!last) this.#waiting = [];
    this.#lose(last ? 'failed' : 'resetting');
    if (last) return;
    this.#waiting = waiting;
    this.#beginReset();
  }

  #configured() {
    this.#state = 'configured';
    this.#attempts = 0;
    this.#toggles.clear();
    const waiting = this.#waiting;
    this.#waiting = [];
    for (const entry of waiting) this.#enqueue(entry);
  }

  // Carrying transfers

  #enqueue(entry) {
    const { request } = entry;
    const number = request.endpoint & 0x0f;
    if (request.type === 'control') {
      entry.transfer = new ControlTransfer(request.setup, request.data);
      entry.transfer.packetBytes = this.#packetBytes.get(0);
    } else {
      const packetBytes = this.#packetBytes.get(request.endpoint);
      if (packetBytes === undefined) {
        this.#finish(entry, Status.STALL);
        return;
      }
      const toggle = this.#toggle(request.endpoint);
      entry.transfer = request.endpoint & 0x80
        ? new BulkInTransfer(number, request.capacity, toggle, packetBytes)
        : new BulkOutTransfer(number, request.data, toggle, packetBytes);
    }
    const { pipe } = entry.transfer;
    if (!this.#queues.has(pipe)) this.#queues.set(pipe, []);
    this.#queues.get(pipe).push(entry);
    this.#startTransaction();
  }

  #toggle(endpoint) {
    if (!this.#toggles.has(endpoint)) this.#toggles.set(endpoint, { data1: false });
    return this.#toggles.get(endpoint);
  }

  /** Clearing an endpoint's halt starts its data toggle again, a configuration or a setting of the only interface those of
   *  all (USB 2.0 9.4.5, 9.1.1.5, 9.4.10). */
  #noteToggleRestart(setup) {
    if (setup[0] === 0x02 && setup[1] === CLEAR_FEATURE) this.#toggle(setup[4]).data1 = false;
    const all = (setup[0] === 0x00 && setup[1] === SET_CONFIGURATION) || (setup[0] === 0x01 && setup[1] === SET_INTERFACE);
    if (all) for (const toggle of this.#toggles.values()) toggle.data1 = false;
  }

  /** Puts the next transaction on the bus, pipe after pipe, skipping those that would only be NAKed. */
  #startTransaction() {
    if (this.#onBus !== null || this.#asleep) return;
    const pipes = [...this.#queues.keys()].sort((a, b) => a - b);
    const start = pipes.findIndex((pipe) => pipe > this.#lastPipe);
    const order = start < 0 ? pipes : [...pipes.slice(start), ...pipes.slice(0, start)];
    for (const pipe of order) {
      const entry = this.#queues.get(pipe)[0];
      if (entry === undefined) continue;
      const token = entry.transfer.token();
      if (!token.setup && !this.#controller.ready(token.endpoint, token.out !== undefined)) continue;
      this.#lastPipe = pipe;
      this.#onBus = { entry, token };
      const bytes = (token.setup ?? token.out)?.length ?? entry.transfer.packetBytes;
      this.#busAlarm.schedule((OVERHEAD_BYTES + bytes) * BYTE_NS);
      return;
    }
  }

  #endTransaction() {
    const { entry, token } = this.#onBus;
    this.#onBus = null;
    const answer = this.#transact(token);
    const status = this.#statusAfter(entry, answer);
    if (status !== null) this.#finish(entry, status);
    this.#startTransaction();
  }

  /** A transaction without an answer is tried again, three times in all. */
  #statusAfter(entry, answer) {
    if (answer.handshake === Handshake.NAK) return null;
    if (answer.handshake === Handshake.SILENT || answer.handshake === Handshake.LOST) {
      entry.errors = (entry.errors ?? 0) + 1;
      return entry.errors < ERRORS_MAX ? null : Status.DISCONNECTED;
    }
    entry.errors = 0;
    return entry.transfer.answered(answer);
  }

  #transact({ endpoint, setup, out, data1 }) {
    if (this.#controller.address !== this.#address) return { handshake: Handshake.SILENT };
    if (setup) return { handshake: this.#controller.setup(setup) };
    if (out) return this.#controller.out(endpoint, out, data1);
    const error = endpoint !== 0 && this.#controller.ready(endpoint, false) ? this.#busError : null;
    if (error) this.#busError = null;
    const answer = this.#controller.in(endpoint, error !== null);
    if (error === 'fatal') this.#controller.lockUp();
    return answer;
  }

  #finish(entry, status) {
    entry.deadline?.cancel();
    const queue = entry.transfer ? this.#queues.get(entry.transfer.pipe) : this.#waiting;
    const place = queue ? queue.indexOf(entry) : -1;
    if (place >= 0) queue.splice(place, 1);
    if (this.#onBus?.entry === entry) {
      this.#busAlarm.cancel();
      this.#onBus = null;
    }
    if (status === Status.OK && entry.request.type === 'control') this.#noteToggleRestart(entry.request.setup);
    const { done } = entry.request;
    entry.request.done = () => {};
    done(status, entry.transfer && status === Status.OK ? entry.transfer.bytes : new Uint8Array(0));
    this.#startTransaction();
  }

  #startFrame() {
    this.#frame = (this.#frame + 1) & 0x7ff;
    this.#frameAlarm.schedule(FRAME_NS);
    this.#controller.startOfFrame(this.#frame);
  }
}

/** An alarm of the chip's clock, on whole cycles. */
class Alarm {
  #alarm;

  constructor(clock, ring) {
    this.#alarm = clock.createAlarm(ring);
  }

  get scheduled() {
    return this.#alarm.scheduled;
  }

  schedule(delay_ns) {
    this.#alarm.schedule(Math.round(delay_ns / CYCLE_NS) * CYCLE_NS);
  }

  cancel() {
    if (this.#alarm.scheduled) this.#alarm.cancel();
  }
}
