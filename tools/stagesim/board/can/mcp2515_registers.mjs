// SPDX-License-Identifier: MIT
// The register map of the MCP2515 (Microchip DS20001801J, chapter 11): addresses, bits, what reset leaves and what
// writes may change; and how a frame lies in a buffer (registers 3-3 to 3-8, 4-4 to 4-9).

export const ADDRESS = Object.freeze({
  CANSTAT: 0x0e, CANCTRL: 0x0f, TEC: 0x1c, REC: 0x1d, CNF3: 0x28, CNF2: 0x29, CNF1: 0x2a, CANINTE: 0x2b,
});
export const CANINTF = 0x2c;
export const EFLG = 0x2d;
export const MODE = Object.freeze({ NORMAL: 0, SLEEP: 1, LOOPBACK: 2, LISTEN_ONLY: 3, CONFIGURATION: 4 });
export const FLAGS = Object.freeze({
  RX0IF: 0x01, RX1IF: 0x02, TX0IF: 0x04, ERRIF: 0x20, WAKIF: 0x40, MERRF: 0x80, // CANINTF
  EWARN: 0x01, RXWAR: 0x02, TXWAR: 0x04, RXEP: 0x08, TXEP: 0x10, TXBO: 0x20, RX0OVR: 0x40, RX1OVR: 0x80, // EFLG
  TXREQ: 0x08, TXERR: 0x10, MLOA: 0x20, ABTF: 0x40, // TXBnCTRL
  BUKT: 0x04, // RXB0CTRL
  OSM: 0x08, ABAT: 0x10, // CANCTRL
});

/** After reset: configuration mode, all else 0 (table 11-2; "unknown" registers read 0 here). */
export const RESET_VALUES = new Uint8Array(128);
RESET_VALUES[ADDRESS.CANSTAT] = 0x80;
RESET_VALUES[ADDRESS.CANCTRL] = 0x87;

/** Registers that the BIT MODIFY instruction can change bit by bit (shaded in table 11-1). */
export function isBitModifiable(address) {
  return (address & 0xf) === 0xf || [0x0c, 0x0d, 0x28, 0x29, 0x2a, 0x2b, CANINTF, EFLG, 0x30, 0x40, 0x50, 0x60, 0x70]
    .includes(address);
}

/** The bits of a register that a write changes. */
export function writableBits(address, configuring) {
  const row = address >> 4;
  const column = address & 0xf;
  if (address === 0x0c) return 0x3f; // BFPCTRL
  if (address === 0x0d) return configuring ? 0x07 : 0; // TXRTSCTRL
  if (address === EFLG) return 0xc0; // only the overflows can be cleared
  if (address === ADDRESS.CANINTE || address === CANINTF) return 0xff;
  if (row <= 2 && column < 0xc) return configuring ? configurationBits(address) : 0;
  if (row >= 3 && row <= 5) return column === 0 ? 0x0b : column === 2 ? 0xeb : column === 5 ? 0x4f : 0xff;
  if (address === 0x60) return 0x64;
  if (address === 0x70) return 0x60;
  return 0; // receive buffers, error counters
}

function configurationBits(address) {
  if (address === ADDRESS.CNF3) return 0xc7;
  if (address >= ADDRESS.CNF2) return 0xff;
  if ((address & 3) !== 1) return 0xff;
  return address < 0x20 ? 0xeb : 0xe3; // filters have EXIDE, masks do not
}

/** The frame in SIDH, SIDL, EID8, EID0, DLC, D0.. of a transmit buffer. */
export function transmitFrame(bytes) {
  const extended = (bytes[1] & 0x08) !== 0;
  const remote = (bytes[4] & 0x40) !== 0;
  const standard = (bytes[0] << 3) | (bytes[1] >> 5);
  const id = extended ? standard * 2 ** 18 + (((bytes[1] & 3) << 16) | (bytes[2] << 8) | bytes[3]) : standard;
  const length = Math.min(bytes[4] & 0x0f, 8);
  return { id, extended, remote, length, data: Uint8Array.from(bytes.subarray(5, 5 + (remote ? 0 : length))) };
}

/** Puts a frame into SIDH, SIDL, EID8, EID0, DLC, D0.. of a receive buffer. */
export function receiveFrame(bytes, { id, extended, remote, length, data }) {
  const standard = extended ? Math.floor(id / 2 ** 18) : id;
  bytes[0] = standard >> 3;
  bytes[1] = ((standard & 7) << 5) | (extended ? 0x08 | ((id >>> 16) & 3) : remote ? 0x10 : 0); // SRR, IDE
  bytes[2] = extended ? (id >>> 8) & 0xff : 0;
  bytes[3] = extended ? id & 0xff : 0;
  bytes[4] = length | (extended && remote ? 0x40 : 0);
  bytes.set(data, 5);
}
