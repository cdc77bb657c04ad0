// SPDX-License-Identifier: MIT
// A CAN bus: arbitration, the time that frames take, acknowledgement and error flags (Bosch CAN 2.0 part B).
import { arbitration, INTERMISSION_BITS, wireBits } from './can_frame.mjs';

const ERROR_BITS = 6 + 8; // flag and delimiter
const SUSPEND_BITS = 8; // an error passive transmitter waits so much longer
const BITS_AFTER_ACK_SLOT = 8; // ACK delimiter and end of frame, which an error flag replaces
const RATE_TOLERANCE = 0.0158; // the most that CAN's resynchronisation can bear with SJW 1..4 and short segments

/**
 * Nodes are objects with
 *   bitRate          bits a second, 0 while the node takes no part
 *   next()           the frame it wants to send now, or null
 *   lost(frame)      it sent, and lost arbitration
 *   sent(frame)      it sent, and somebody acknowledged
 *   received(frame)  another node's frame, undamaged; true to acknowledge it
 *   failed(sending, kind)  an error frame: `kind` is 'ack', 'bit' or 'rate'
 *   errorPassive     true if it has to suspend transmission
 */
export class CanBus {
  #nodes = [];
  #bitRate;
  #alarm = null;
  #clock = null;
  #under = null; // {frame, sender, kind} on the wire now
  #breakNext = 0;
  #freeAt_ns = 0;

  /** @param {number} bitRate of the bus, which decides who understands it */
  constructor(bitRate) {
    this.#bitRate = bitRate;
  }

  get bitRate() {
    return this.#bitRate;
  }

  get #bit_ns() {
    return 1e9 / this.#bitRate;
  }

  add(node) {
    this.#nodes.push(node);
  }

  remove(node) {
    this.#nodes = this.#nodes.filter((other) => other !== node);
    if (this.#under?.sender === node) this.#under.kind ??= 'bit'; // a frame cut short is an error to all
  }

  /** Continues on another chip's clock. A frame that was on the wire is broken off. */
  attach(clock) {
    this.#clock = clock;
    this.#under = null;
    this.#freeAt_ns = clock.nanos;
    this.#alarm = clock.createAlarm(() => this.#act());
    this.kick();
  }

  /** True while a frame is on the wire or waits for it. A node that is alone calls in vain: that is rest. */
  get busy() {
    if (this.#nodes.length < 2) return false;
    return this.#under !== null || this.#nodes.some((node) => node.bitRate !== 0 && node.next() !== null);
  }

  /** The next `count` frames on the bus meet an error flag. */
  breakFrames(count) {
    this.#breakNext += count;
  }

  /** A node may have something to send. */
  kick() {
    if (this.#under !== null || this.#alarm === null || this.#alarm.scheduled) return;
    this.#alarm.schedule(Math.max(0, this.#freeAt_ns - this.#clock.nanos));
  }

  #act() {
    if (this.#under !== null) this.#finish();
    if (this.#freeAt_ns > this.#clock.nanos) this.#alarm.schedule(this.#freeAt_ns - this.#clock.nanos);
    else this.#begin();
  }

  #begin() {
    const wanting = [];
    for (const node of this.#nodes) {
      const frame = node.bitRate === 0 ? null : node.next();
      if (frame !== null) wanting.push({ node, frame });
    }
    if (wanting.length === 0) return;
    wanting.sort((a, b) => arbitration(a.frame) - arbitration(b.frame));
    const { node: sender, frame } = wanting[0];
    for (const loser of wanting.slice(1)) loser.node.lost(loser.frame);
    const total = wireBits(frame);
    const kind = this.#verdict(sender);
    const bits = kind === null ? total : (total >> 1) + ERROR_BITS; // an error shows in the middle of the frame
    this.#under = { frame, sender, kind };
    this.#freeAt_ns = this.#clock.nanos + (bits + INTERMISSION_BITS) * this.#bit_ns;
    this.#alarm.schedule(bits * this.#bit_ns);
  }

  #understands(node) {
    return node.bitRate !== 0 && Math.abs(node.bitRate / this.#bitRate - 1) < RATE_TOLERANCE;
  }

  #verdict(sender) {
    if (this.#breakNext > 0) {
      this.#breakNext--;
      return 'bit';
    }
    return this.#understands(sender) ? null : 'rate';
  }

  #finish() {
    const { frame, sender, kind } = this.#under;
    this.#under = null;
    const others = this.#nodes.filter((node) => node !== sender && node.bitRate !== 0);
    if (kind !== null) {
      this.#fail(sender, others, kind);
      return;
    }
    let acknowledged = false;
    for (const node of others) {
      if (!this.#understands(node)) node.failed(false, 'rate');
      else if (node.received(frame)) acknowledged = true;
    }
    if (acknowledged) {
      sender.sent(frame);
    } else {
      this.#freeAt_ns += (ERROR_BITS - BITS_AFTER_ACK_SLOT) * this.#bit_ns; // in place of the frame's end
      this.#fail(sender, [], 'ack');
    }
  }

  #fail(sender, others, kind) {
    if (sender.errorPassive) this.#freeAt_ns += SUSPEND_BITS * this.#bit_ns;
    sender.failed(true, kind);
    for (const node of others) node.failed(false, kind);
  }
}
