// SPDX-License-Identifier: MIT
// The lamp nodes on the CAN bus (protocol/PROTOCOL.md, "CAN", and wire.h, ols_canbus_lamp_node): a driver of 16 outputs each,
// which tells its temperature, current and faults every second and when its faults change.
import { Chain } from '../chain.mjs';

const TICK_HZ = 125_000_000;
const FIRST_ID = 0x200; // OLS_CANBUS_LAMP_NODE
const OUTPUTS = 16;
const LAMP_MA = 700; // of a lit lamp, as in firmware/boards
const AMBIENT_C = 25;
const RISE_C_PER_A = 5; // of the driver over ambient, in the end
const TIME_CONSTANT_S = 60; // first order, as a heat sink's
const HOT_C = 95; // of a node that was made hot
export const Fault = Object.freeze({ OVER_TEMPERATURE: 1, OPEN: 2, SHORTED: 4, UNDER_VOLTAGE: 8 });

/** One node: its frames queue for the bus. */
class LampNode {
  #bus;
  #id;
  #queue = [];
  #count = 0;
  #temperature_c = AMBIENT_C;
  #current_ma = 0;
  litTicks = 0; // of all its lamps together, since the last frame
  faults = 0;
  openOutputs = 0;
  isSilent = false;
  errorPassive = false;

  constructor(bus, number) {
    this.#bus = bus;
    this.#id = FIRST_ID + number;
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
    if (this.#queue.length > 1) this.#queue.splice(1); // nobody there: the newest would only be old when somebody comes
    this.#bus.kick();
  }

  received() {
    return true;
  }

  heat() {
    this.#temperature_c = HOT_C;
    this.faults |= Fault.OVER_TEMPERATURE;
  }

  /** So many ticks have gone by. */
  measure(ticks) {
    this.#current_ma = (LAMP_MA * this.litTicks) / ticks;
    this.litTicks = 0;
    if (this.faults & Fault.OVER_TEMPERATURE) return;
    const target_c = AMBIENT_C + (RISE_C_PER_A * this.#current_ma) / 1000;
    this.#temperature_c += (target_c - this.#temperature_c) * (1 - Math.exp(-ticks / TICK_HZ / TIME_CONSTANT_S));
  }

  tell() {
    if (this.isSilent) return;
    const data = Buffer.alloc(8);
    data.writeInt16LE(Math.round(this.#temperature_c * 100), 0);
    data.writeUInt16LE(Math.min(0xffff, Math.round(this.#current_ma)), 2);
    data.writeUInt16LE(this.openOutputs, 4);
    data[6] = this.faults;
    data[7] = this.#count;
    this.#count = (this.#count + 1) & 255;
    this.#queue.push({ id: this.#id, extended: false, remote: false, data, length: 8 });
    this.#bus.kick();
  }
}

export class LampNodes {
  #nodes;
  #chain;
  #outputs;
  #levels = 0;
  #litSince = 0;
  #toldAt = 0;

  /**
   * @param {import('./can_bus.mjs').CanBus} bus
   * @param {number} chainBits of the lamps' shift chain: node n drives its bits from 16 n on
   * @param {import('../pins.mjs').BoardPins} pins
   */
  constructor(bus, chainBits, pins) {
    this.#outputs = pins.outputs;
    this.#chain = new Chain(chainBits);
    this.#nodes = Array.from({ length: Math.ceil(chainBits / OUTPUTS) }, (_, number) => new LampNode(bus, number));
    for (const node of this.#nodes) bus.add(node);
  }

  /** @param {number} levels of all GPIOs from `tick` on */
  edge(tick, levels) {
    const before = this.#levels;
    const rose = levels & ~before;
    const light = 1 << this.#outputs.LIGHT_EN;
    const latched = (rose >> this.#outputs.LATCH) & 1;
    this.#levels = levels;
    if (before & light && ((levels ^ before) & light || latched)) this.#addLight(tick - this.#litSince);
    if (latched) this.#chain.latch();
    if ((rose >> this.#outputs.CLK) & 1) this.#chain.clock((before >> this.#outputs.DATA) & 1);
    if (rose & light || latched) this.#litSince = tick;
  }

  #addLight(ticks) {
    const digits = OUTPUTS / 4;
    this.#nodes.forEach((node, number) => {
      const word = parseInt(this.#chain.pattern.slice(digits * number, digits * (number + 1)), 16);
      node.litTicks += ticks * ones(word);
    });
  }

  /** Time has gone on to `tick`. */
  advance(tick) {
    if (tick - this.#toldAt < TICK_HZ) return;
    for (const node of this.#nodes) {
      node.measure(tick - this.#toldAt);
      node.tell();
    }
    this.#toldAt = tick;
  }

  /** @param {number} fault bits of Fault */
  setFault(number, fault) {
    const node = this.#node(number);
    if (fault & Fault.OVER_TEMPERATURE) node.heat();
    node.faults |= fault;
    node.tell();
  }

  open(number, output) {
    const node = this.#node(number);
    node.openOutputs |= 1 << output;
    this.setFault(number, Fault.OPEN);
  }

  silence(number) {
    this.#node(number).isSilent = true;
  }

  #node(number) {
    const node = this.#nodes[number];
    if (node === undefined) throw new Error(`there is no lamp node ${number}: the chain has ${this.#nodes.length}`);
    return node;
  }
}

function ones(word) {
  let count = 0;
  for (let rest = word; rest !== 0; rest &= rest - 1) count++;
  return count;
}
