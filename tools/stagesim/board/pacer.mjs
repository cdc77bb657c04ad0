// SPDX-License-Identifier: MIT
// How board time follows the world: slice by slice, never ahead of the reader of exposures in virtual pace, never
// ahead of the clock in wall pace, and at rest while there is nothing to do.
import { setTimeout as sleep } from 'node:timers/promises';

const TICKS_PER_MS = 125_000;
const SLICE_TICKS = TICKS_PER_MS; // also the longest gap between "now" lines
const CAN_SLICE_TICKS = SLICE_TICKS / 8; // a node of the bus answers within a frame or two
const SETTLE_TICKS = 8 * TICKS_PER_MS; // quiet for so long, or nothing more happens: a suspend needs 3 ms
const GRANT_TICKS = 50 * TICKS_PER_MS; // for a request to be answered: the firmware looks every millisecond
const FOREVER_MS = 0x7fffffff; // the longest timer there is
const CATCH_UP_NS = 5e6; // in wall pace, what timers and single slices may cost; what comes later than that stays late
const AWAKE_FRACTION = 0.1; // a processor that only wakes for ticks and frames is idle

/**
 * Wall pace. Time runs as fast as the clock, or slower: what a busy machine has taken from it is told, and never made up for.
 *
 * Virtual pace. While the board plays or works, time runs as fast as it can. When all is quiet and transfers wait for
 * the device, time passes no faster than the wall clock, so that a time-out or a timer can come. When nothing waits
 * either, time stands still until a client does something: an idle board costs no processor time, its watchdog cannot
 * run out, and ticks do not depend on how long a user pauses.
 *
 * While the reader of exposures is behind, time stands still too, but for a short while after each request: the reader
 * may be waiting for a program that waits for the board's answer.
 */
export class Pacer {
  #board;
  #pace;
  #limit;
  #stage;
  #can;
  #lampNodes;
  #stopped = false;
  #wake = () => {};
  #woken = false;
  #quietSince = null;
  #grantedUntil = 0; // tick to which a request lets time go on
  #startWall_ns = process.hrtime.bigint();
  #startTick;
  #running_ns = 0n;
  #late_ns = 0; // in wall pace, in all

  #openSince;

  /**
   * @param {{pace: 'virtual' | 'wall', ticksLimit: number, stage: object | null, can?: object | null, lampNodes?: object | null, openSince?: () => number}} options
   *   openSince: the tick at which the oldest exposure still under way began, Infinity when none is
   */
  constructor(board, { pace, ticksLimit, stage, can = null, lampNodes = null, openSince = () => Infinity }) {
    this.#openSince = openSince;
    this.#board = board;
    this.#pace = pace;
    this.#limit = ticksLimit;
    this.#stage = stage;
    this.#can = can;
    this.#lampNodes = lampNodes;
    this.#startTick = board.tick;
    if (stage) stage.onReady = () => this.#resume();
  }

  /** Something has come in from a client: time goes on, for so many ticks even where the reader of exposures is behind. */
  wake(ticks = GRANT_TICKS) {
    this.#quietSince = null;
    this.#grantedUntil = Math.max(this.#grantedUntil, this.#board.tick + ticks);
    this.#resume();
  }

  #resume() {
    this.#woken = true;
    this.#wake();
  }

  stop() {
    this.#stopped = true;
    this.wake();
  }

  get statistics() {
    const ticks = this.#board.tick - this.#startTick;
    const running_s = Number(this.#running_ns) / 1e9;
    const { user, system } = process.cpuUsage();
    return { ticks, running_s, mcycles_per_s: ticks / 1e6 / running_s, mcycles_per_cpu_s: ticks / (user + system),
             wall_late_us: this.#late_ns / 1000 };
  }

  /** Runs until stopped or out of ticks. */
  async run() {
    while (!this.#stopped && this.#board.tick < this.#limit) {
      while (this.#heldBack) await this.#sleep(FOREVER_MS);
      this.#slice();
      if (this.#pace === 'wall') await this.#followWall();
      else await this.#rest();
    }
  }

  get #heldBack() {
    if (this.#pace === 'wall' || this.#stopped || !this.#stage?.full) return false;
    return !this.#isAwaited || this.#board.tick >= this.#grantedUntil;
  }

  /** Somebody may be waiting for the board's time to pass. */
  get #isAwaited() {
    return this.#board.usbHost.pending || (this.#can?.hasClients ?? false);
  }

  #slice() {
    const board = this.#board;
    const from = board.tick;
    const awake = board.awakeCycles;
    const begin = process.hrtime.bigint();
    const length = this.#can?.hasClients && this.#quietSince === null ? CAN_SLICE_TICKS : SLICE_TICKS;
    board.run(Math.min(from + length, this.#limit));
    this.#running_ns += process.hrtime.bigint() - begin;
    this.#lampNodes?.advance(board.tick);
    this.#can?.tell(board.tick);
    this.#stage?.send({ type: 'now', tick: Math.min(board.tick, this.#openSince()) });
    const busy = !board.quiet || board.awakeCycles < awake || board.awakeCycles - awake > AWAKE_FRACTION * length;
    if (busy) this.#quietSince = null;
    else this.#quietSince ??= from;
  }

  /** Lets sockets be served, and sleeps as long as there is nothing to do. */
  async #rest() {
    const settled = this.#quietSince !== null && this.#board.tick - this.#quietSince >= SETTLE_TICKS;
    if (settled && this.#isAwaited) await this.#sleep(SLICE_TICKS / TICKS_PER_MS);
    else if (settled && this.#limit === Infinity) await this.#sleep(FOREVER_MS);
    else await new Promise(setImmediate); // also to reach a limit of ticks
  }

  async #followWall() {
    const board_ns = (this.#board.tick - this.#startTick) * 8;
    const wall_ns = Number(process.hrtime.bigint() - this.#startWall_ns);
    if (board_ns > wall_ns) await sleep(Math.ceil((board_ns - wall_ns) / 1e6)); // a timer cuts fractions off
    else await new Promise(setImmediate);
    // A board that was kept from running is late, and stays so: it never goes faster than the clock to catch up.
    const late_ns = wall_ns - board_ns - CATCH_UP_NS;
    if (late_ns <= 0) return;
    this.#late_ns += late_ns;
    this.#startWall_ns += BigInt(Math.round(late_ns));
  }

  /** Until something has come in, at most `ms`. */
  async #sleep(ms) {
    if (!this.#woken && !this.#stopped) {
      await new Promise((resolve) => {
        const timer = setTimeout(resolve, ms);
        this.#wake = () => {
          clearTimeout(timer);
          resolve();
        };
      });
    }
    this.#wake = () => {};
    this.#woken = false;
  }
}
