// SPDX-License-Identifier: MIT
// Reads the image that is flashed, ELF or UF2, and puts it where the boot ROM would find it.
import { createHash } from 'node:crypto';
import { readFileSync } from 'node:fs';
import { basename } from 'node:path';
import { isBoot2 } from './chip/boot_rom.mjs';

const FLASH_START = 0x10000000;
const FLASH_BYTES = 2 << 20; // of a Pico's chip
const BOOT2_BYTES = 256;
const LABEL_ADDRESS = 0x10000108; // protocol/image_label.h
const LABEL_BYTES = 56;
const LABEL_MAGIC = 0x62614c4f;
const UF2_BLOCK = 512;
const UF2_FAMILY_RP2040 = 0xe48bff56;

/** @typedef {{address: number, bytes: Uint8Array}} Piece of flash */

/**
 * @param {boolean} asIs takes an image that the boot ROM would not start
 * @returns {{name: string, flash: Uint8Array, label: {board: string, version: string} | null}}
 * @throws {Error} naming the file and what is wrong with it
 */
export function readImage(path, asIs = false) {
  let bytes;
  try {
    bytes = readFileSync(path);
  } catch (error) {
    throw new Error(`${path}: cannot read the firmware image (${error.code}); build it with \`make firmware\``);
  }
  const isElf = bytes.subarray(0, 4).equals(Buffer.from('\x7fELF', 'latin1'));
  const pieces = isElf ? readElf(path, bytes) : readUf2(path, bytes);
  for (const { address, bytes: content } of pieces) {
    if (address < FLASH_START || address + content.length > FLASH_START + FLASH_BYTES) {
      throw new Error(`${path}: ${hex(address)} is not in flash; link the image with load addresses in its 2 MB`);
    }
  }
  const flash = flashOf(pieces);
  if (!asIs) checkBoot2(path, flash);
  const digest = createHash('sha256').update(bytes).digest('hex').slice(0, 12);
  return { name: `${basename(path)} ${digest}`, flash, label: readLabel(flash) };
}

/** What the image says of itself (protocol/image_label.h); null without a label. */
function readLabel(flash) {
  const label = Buffer.from(flash.buffer, LABEL_ADDRESS - FLASH_START, LABEL_BYTES);
  if (label.readUInt32LE(0) !== LABEL_MAGIC) return null;
  const text = (from, bytes) => label.toString('latin1', from, from + bytes).replace(/\0.*$/s, '');
  return { board: text(16, 16), version: text(32, 24) };
}

/** The whole of flash, all ones where the image has nothing. */
function flashOf(pieces) {
  const flash = new Uint8Array(FLASH_BYTES).fill(0xff);
  for (const { address, bytes } of pieces) flash.set(bytes, address - FLASH_START);
  return flash;
}

/** Program headers with bytes in the file, by physical (load) address (ELF specification, "Program Header"). */
function readElf(path, bytes) {
  const ARM = 40;
  const PT_LOAD = 1;
  if (bytes.length < 52 || bytes[4] !== 1 || bytes[5] !== 1 || bytes.readUInt16LE(18) !== ARM) {
    throw new Error(`${path}: not a 32-bit little-endian ARM ELF file`);
  }
  const table = bytes.readUInt32LE(28);
  const entryBytes = bytes.readUInt16LE(42);
  const count = bytes.readUInt16LE(44);
  const pieces = [];
  for (let n = 0; n < count; n++) {
    const at = table + n * entryBytes;
    if (at + 32 > bytes.length) throw new Error(`${path}: cut off in its program headers; build it again`);
    const offset = bytes.readUInt32LE(at + 4);
    const address = bytes.readUInt32LE(at + 12);
    const size = bytes.readUInt32LE(at + 16);
    if (bytes.readUInt32LE(at) !== PT_LOAD || size === 0) continue;
    if (offset + size > bytes.length) throw new Error(`${path}: cut off at byte ${bytes.length}; build it again`);
    pieces.push({ address, bytes: bytes.subarray(offset, offset + size) });
  }
  return pieces;
}

/** Blocks of at most 476 bytes, each with its address (UF2 file format specification). */
function readUf2(path, bytes) {
  if (bytes.length === 0 || bytes.length % UF2_BLOCK !== 0) {
    throw new Error(`${path}: neither an ELF nor a UF2 file`);
  }
  const pieces = [];
  for (let at = 0; at < bytes.length; at += UF2_BLOCK) {
    const magic = [bytes.readUInt32LE(at), bytes.readUInt32LE(at + 4), bytes.readUInt32LE(at + UF2_BLOCK - 4)];
    if (magic[0] !== 0x0a324655 || magic[1] !== 0x9e5d5157 || magic[2] !== 0x0ab16f30) {
      throw new Error(`${path}: no UF2 block at byte ${at}`);
    }
    const size = bytes.readUInt32LE(at + 16);
    const family = bytes.readUInt32LE(at + 28);
    if (size > 476) throw new Error(`${path}: a UF2 block of ${size} bytes at byte ${at}; at most 476 fit`);
    if (family !== UF2_FAMILY_RP2040) throw new Error(`${path}: made for chip family ${hex(family)}, not the RP2040`);
    pieces.push({ address: bytes.readUInt32LE(at + 12), bytes: bytes.subarray(at + 32, at + 32 + size) });
  }
  return pieces;
}

/** The boot ROM starts no image whose first 252 bytes do not have the CRC in the next four (datasheet 2.8.1.3.1). */
function checkBoot2(path, flash) {
  if (!isBoot2(flash.subarray(0, BOOT2_BYTES))) {
    throw new Error(`${path}: its first ${BOOT2_BYTES} bytes, boot2, do not have their CRC; the boot ROM would refuse it`);
  }
}

function hex(value) {
  return `0x${value.toString(16).padStart(8, '0')}`;
}
