// SPDX-License-Identifier: MIT
// CAN 2.0 frames: the bits on the wire (Bosch CAN 2.0 part B, chapter 3), and the 16 bytes of Linux's struct can_frame.

export const FRAME_BYTES = 16;
const EXTENDED_FLAG = 0x80000000;
const REMOTE_FLAG = 0x40000000;
const ERROR_FLAG = 0x20000000;
const CRC_POLYNOMIAL = 0x4599;
const TAIL_BITS = 10; // CRC delimiter, ACK slot and delimiter, seven of end of frame: never stuffed
export const INTERMISSION_BITS = 3;

/**
 * @typedef {{id: number, extended: boolean, remote: boolean, data: Uint8Array, length: number}} CanFrame
 *   `length` is the DLC, at most 8; a remote frame has one but no data
 */

function pushBits(bits, value, count) {
  for (let n = count - 1; n >= 0; n--) bits.push((value >>> n) & 1);
}

/** The bits from start of frame to the end of the CRC, before stuffing. */
export function frameBits({ id, extended, remote, data, length }) {
  const bits = [0];
  if (extended) {
    pushBits(bits, id >>> 18, 11);
    bits.push(1, 1); // SRR, IDE
    pushBits(bits, id & 0x3ffff, 18);
    bits.push(remote ? 1 : 0, 0, 0); // RTR, r1, r0
  } else {
    pushBits(bits, id, 11);
    bits.push(remote ? 1 : 0, 0, 0); // RTR, IDE, r0
  }
  pushBits(bits, length, 4);
  if (!remote) for (const byte of data) pushBits(bits, byte, 8);
  pushBits(bits, crc15(bits), 15);
  return bits;
}

function crc15(bits) {
  let crc = 0;
  for (const bit of bits) {
    const next = bit ^ (crc >> 14);
    crc = (crc << 1) & 0x7fff;
    if (next) crc ^= CRC_POLYNOMIAL;
  }
  return crc;
}

/** Bits from start to end of frame, with one of the other kind put after every five equal ones. */
export function wireBits(frame) {
  let stuffed = 0;
  let run = 0;
  let last = -1;
  const bits = frameBits(frame);
  for (const bit of bits) {
    run = bit === last ? run + 1 : 1;
    last = bit;
    if (run < 5) continue;
    stuffed++;
    last = 1 - bit; // the stuff bit begins a run of its own
    run = 1;
  }
  return bits.length + stuffed + TAIL_BITS;
}

/** Orders frames as arbitration does: the lower wins. A standard frame beats an extended one, data beats remote. */
export function arbitration({ id, extended, remote }) {
  const base = extended ? id >>> 18 : id;
  const rest = extended ? ((3 << 18) | (id & 0x3ffff)) * 2 + (remote ? 1 : 0) : remote ? 1 << 20 : 0;
  return base * 2 ** 22 + rest;
}

/** @returns {Buffer} the frame as Linux's struct can_frame */
export function encodeFrame({ id, extended, remote, data, length }) {
  const record = Buffer.alloc(FRAME_BYTES);
  record.writeUInt32LE(id + (extended ? EXTENDED_FLAG : 0) + (remote ? REMOTE_FLAG : 0), 0);
  record[4] = length;
  if (!remote) record.set(data, 8);
  return record;
}

/** @returns {CanFrame | 'error' | undefined} an error frame breaks what is on the bus; undefined if it is none */
export function decodeFrame(record) {
  const word = record.readUInt32LE(0);
  if (word & ERROR_FLAG) return 'error';
  const extended = (word & EXTENDED_FLAG) !== 0;
  const remote = (word & REMOTE_FLAG) !== 0;
  const id = (word & 0x1fffffff) >>> 0;
  const length = record[4];
  if (length > 8 || (!extended && id > 0x7ff)) return undefined;
  return { id, extended, remote, length, data: Uint8Array.from(record.subarray(8, 8 + (remote ? 0 : length))) };
}
