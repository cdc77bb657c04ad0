// SPDX-License-Identifier: MIT
// What is at each address, and what an access does there: memories, register blocks with their atomic aliases, and faults
// (RP2040 datasheet 2.1 and 2.2; ARMv6-M A3.2.1, B3.1). Takes the place of rp2040js' decoding, which forgives.
import { TICK_HZ } from './clocks.mjs';
import { BLOCKS, FULL_CLOCK, NOT_MODELLED, TICK } from './registers.mjs';

const ROM_END = 0x4000;
const XIP = 0x10000000;
const XIP_END = 0x14000000; // four aliases of the flash (2.6.3)
const SRAM = 0x20000000;
const SRAM_BYTES = 0x42000; // six banks (2.6.2)
const DPRAM = 0x50100000;
const DPRAM_BYTES = 0x1000;
const USBCTRL_RESET = 24;
const BLOCK_BYTES = 0x4000;
const ALIAS_BYTES = 0x1000;
const ALIASES = ['', ' by XOR', ' by SET', ' by CLR'];

/** Thrown by an access that the bus answers with an error: the processor faults, a DMA channel halts. */
export class BusFault extends Error {}

export class Bus {
  #chip;
  #blocks = new Map(); // by address / BLOCK_BYTES
  #resets;
  #xip;
  #has; // by what a block may want: whether that is so now
  #violations;

  /**
   * Takes over the chip's accesses.
   * @param {import('rp2040js').RP2040} chip
   * @param {{resets: import('./resets.mjs').Resets, xip: import('./xip.mjs').Xip, clocks: import('./clocks.mjs').Clocks,
   *   watchdog: import('./watchdog.mjs').Watchdog}} parts
   */
  constructor(chip, { resets, xip, clocks, watchdog }) {
    this.#chip = chip;
    this.#resets = resets;
    this.#xip = xip;
    this.#violations = chip.violations;
    this.#has = { [FULL_CLOCK]: () => clocks.sysHz === TICK_HZ, [TICK]: () => watchdog.tickHz === 1e6 };
    for (const block of BLOCKS) this.#add(block);
    for (const [name, base] of Object.entries(NOT_MODELLED)) this.#add({ name, base, section: '2.2', registers: {} });
    // SRAM first and by itself, for every instruction is fetched from there.
    const bytes = chip.sram;
    const halfwords = new Uint16Array(bytes.buffer);
    const words = new Uint32Array(bytes.buffer);
    chip.readUint32 = (address) => {
      const at = (address >>> 0) - SRAM;
      if (at >= 0 && at < SRAM_BYTES && (at & 3) === 0) return words[at >> 2];
      return this.#read(address >>> 0, 4);
    };
    chip.readUint16 = (address) => {
      const at = (address >>> 0) - SRAM;
      if (at >= 0 && at < SRAM_BYTES && (at & 1) === 0) return halfwords[at >> 1];
      return this.#read(address >>> 0, 2);
    };
    chip.readUint8 = (address) => {
      const at = (address >>> 0) - SRAM;
      return at >= 0 && at < SRAM_BYTES ? bytes[at] : this.#read(address >>> 0, 1);
    };
    chip.writeUint32 = (address, value) => {
      const at = (address >>> 0) - SRAM;
      if (at >= 0 && at < SRAM_BYTES && (at & 3) === 0) words[at >> 2] = value;
      else this.#write(address >>> 0, value, 4);
    };
    chip.writeUint16 = (address, value) => {
      const at = (address >>> 0) - SRAM;
      if (at >= 0 && at < SRAM_BYTES && (at & 1) === 0) halfwords[at >> 1] = value;
      else this.#write(address >>> 0, value, 2);
    };
    chip.writeUint8 = (address, value) => {
      const at = (address >>> 0) - SRAM;
      if (at >= 0 && at < SRAM_BYTES) bytes[at] = value;
      else this.#write(address >>> 0, value, 1);
    };
  }

  #add(block) {
    const registers = [];
    for (const [name, [offset, bits, writeOnly]] of Object.entries(block.registers)) registers[offset >> 2] = { name, bits, writeOnly };
    this.#blocks.set(Math.floor(block.base / BLOCK_BYTES), { ...block, registers, known: registers.length > 0 });
  }

  #fault(section, text) {
    this.#violations.note(section, `${text}: a bus fault`);
    throw new BusFault(text);
  }

  #read(address, bytes) {
    if (address % bytes !== 0) this.#fault('ARMv6-M A3.2.1', `an unaligned read of ${bytes} bytes at ${hex(address)}`);
    const word = this.#readWord((address & ~3) >>> 0);
    return bytes === 4 ? word : (word >>> (8 * (address & 3))) & (bytes === 2 ? 0xffff : 0xff);
  }

  #readWord(address) {
    if (address < ROM_END) return this.#chip.bootrom[address / 4];
    if (address >= XIP && address < XIP_END) return this.#xip.read(address);
    if (address >= DPRAM && address < DPRAM + DPRAM_BYTES) {
      this.#dpramIsThere(address);
      return this.#chip.usbDPRAMView.getUint32(address - DPRAM, true);
    }
    const block = this.#blockAt(address, 'read');
    const alias = this.#aliasOf(block, address);
    if (alias !== 0) this.#violations.note('2.1.2', `a read${ALIASES[alias]} of ${block.name}: aliases are for writes`);
    const register = this.#register(block, address, 'read');
    if (!register) return 0;
    if (register.writeOnly) this.#violations.note(block.section, `${block.name} ${register.name} is read, and is write only`);
    return this.#peripheral(block, address).readUint32(offsetOf(block, address)) >>> 0;
  }

  #write(address, value, bytes) {
    if (address % bytes !== 0) this.#fault('ARMv6-M A3.2.1', `an unaligned write of ${bytes} bytes at ${hex(address)}`);
    if (address < ROM_END) this.#fault('2.2', `a write to the boot ROM at ${hex(address)}`);
    if (address >= XIP && address < XIP_END) {
      this.#violations.note('2.6.3', `a write to flash at ${hex(address)}: ignored`);
    } else if (address >= DPRAM && address < DPRAM + DPRAM_BYTES) {
      this.#writeDpram(address - DPRAM, value, bytes);
    } else {
      // Registers ignore the width of an access: the bus repeats a byte or halfword (2.1.4).
      const word = bytes === 4 ? value : bytes === 2 ? (value & 0xffff) * 0x10001 : (value & 0xff) * 0x1010101;
      this.#writeWord((address & ~3) >>> 0, word >>> 0);
    }
  }

  #writeWord(address, value) {
    const block = this.#blockAt(address, 'write');
    const register = this.#register(block, address, 'write');
    if (!register) return;
    if (block.wants && !this.#has[block.wants]()) {
      this.#violations.note(block.section, `${block.name} ${register.name} is written without ${block.wants}`);
    }
    const alias = this.#aliasOf(block, address);
    const reserved = (value & ~register.bits) >>> 0;
    if (reserved !== 0) {
      this.#violations.note(block.section, `${block.name} ${register.name} = ${hex(value)}${ALIASES[alias]}: bits ${hex(reserved)} ` +
        'are reserved or read only');
    }
    const peripheral = this.#peripheral(block, address);
    if (block.noAliases) peripheral.writeUint32(offsetOf(block, address), value);
    else peripheral.writeUint32Atomic(offsetOf(block, address), value, alias);
  }

  #aliasOf(block, address) {
    return block.noAliases ? 0 : Math.floor((address % BLOCK_BYTES) / ALIAS_BYTES);
  }

  #writeDpram(at, value, bytes) {
    this.#dpramIsThere(DPRAM + at);
    const view = this.#chip.usbDPRAMView;
    if (bytes === 4) view.setUint32(at, value, true);
    else if (bytes === 2) view.setUint16(at, value, true);
    else view.setUint8(at, value);
    this.#chip.usbCtrl.DPRAMUpdated(at & ~3, view.getUint32(at & ~3, true));
  }

  #dpramIsThere(address) {
    if (this.#resets.holds(USBCTRL_RESET)) {
      this.#violations.note('2.14', `USB memory is used at ${hex(address)} while USBCTRL is held in reset`);
    }
  }

  #blockAt(address, access) {
    const block = this.#blocks.get(Math.floor(address / BLOCK_BYTES));
    if (block === undefined) this.#fault('2.2', `a ${access} at ${hex(address)}, where nothing is`);
    return block;
  }

  /** The register's entry; none if the access is lost, which is noted. */
  #register(block, address, access) {
    if (block.reset !== undefined && this.#resets.holds(block.reset)) {
      this.#violations.note('2.14', `a ${access} of ${block.name} at ${hex(address)} while it is held in reset: lost`);
      return null;
    }
    const register = block.registers[offsetOf(block, address) >> 2];
    if (register === undefined) {
      this.#violations.note(block.section, `a ${access} of ${block.name} + ${hex(offsetOf(block, address))}, which is ` +
        (block.known ? 'no register, or one that is not modelled' : 'not modelled'));
      return null;
    }
    return register;
  }

  #peripheral(block, address) {
    if (block.name === 'SIO') return this.#chip.sio;
    if (block.name === 'PPB') return this.#chip.ppb;
    return this.#chip.peripherals[(address >>> 14) << 2];
  }
}

function offsetOf(block, address) {
  return block.noAliases ? address - block.base : address % ALIAS_BYTES;
}

function hex(value) {
  return `0x${value.toString(16)}`;
}
