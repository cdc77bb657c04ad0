// SPDX-License-Identifier: MIT
// How board time follows the world: slice by slice, never ahead of the reader of exposures in virtual pace, never
// ahead of the clock in wall pace, and at rest while there is nothing to do.
import { setTimeout as sleep } from 'node:timers/promises';

const TICKS_PER_MS = 125_000;
const SLICE_TICKS = TICKS_PER_MS; // also the longest gap between "now" lines
const SETTLE_TICKS = 8 * TICKS_PER_MS; // quiet for so long, or nothing more happens: a suspend needs 3 ms
const AWAKE_FRACTION = 0.1; // a processor that only wakes for ticks and frames is idle

/**
 * Virtual pace. While the board plays or works, time runs as fast as it can. When all is quiet and transfers wait for
 * the device, time passes no faster than the wall clock, so that a time-out or a timer can come. When nothing waits
 * either, time stands still until a client does something: an idle board costs no processor time, its watchdog cannot
 * run out, and ticks do not depend on how long a user pauses.
 */
export class Pacer {
  #board;
  #pace;
  #limit;
  #stage;
  #stopped = false;
  #wake = () => {};
  #woken = false;
  #quietSince = null;
  #startWall_ns = process.hrtime.bigint();
  #startTick;
  #running_ns = 0n;
  #lag_ns = 0;

  #openSince;

  /**
   * @param {{pace: 'virtual' | 'wall', ticksLimit: number, stage: object | null, openSince?: () => number}} options
   *   openSince: the tick at which the oldest exposure still under way began, Infinity when none is
   */
  constructor(board, { pace, ticksLimit, stage, openSince = () => Infinity }) {
    this.#openSince = openSince;
    this.#board = board;
    this.#pace = pace;
    this.#limit = ticksLimit;
    this.#stage = stage;
    this.#startTick = board.tick;
  }

  /** Something has come in from a client: time goes on. */
  wake() {
    this.#woken = true;
    this.#quietSince = null;
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
             wall_lag_max_us: this.#lag_ns / 1000 };
  }

  /** Runs until stopped or out of ticks. */
  async run() {
    while (!this.#stopped && this.#board.tick < this.#limit) {
      if (this.#pace === 'virtual' && this.#stage?.full) await this.#stage.ready();
      this.#slice();
      if (this.#pace === 'wall') await this.#followWall();
      else await this.#rest();
    }
  }

  #slice() {
    const board = this.#board;
    const from = board.tick;
    const awake = board.awakeCycles;
    const begin = process.hrtime.bigint();
    board.run(Math.min(from + SLICE_TICKS, this.#limit));
    this.#running_ns += process.hrtime.bigint() - begin;
    this.#stage?.send({ type: 'now', tick: Math.min(board.tick, this.#openSince()) });
    const busy = !board.quiet || board.awakeCycles < awake || board.awakeCycles - awake > AWAKE_FRACTION * SLICE_TICKS;
    if (busy) this.#quietSince = null;
    else this.#quietSince ??= from;
  }

  /** Lets sockets be served, and sleeps as long as there is nothing to do. */
  async #rest() {
    const settled = this.#quietSince !== null && this.#board.tick - this.#quietSince >= SETTLE_TICKS;
    if (!settled) {
      await new Promise(setImmediate);
    } else if (this.#board.usbHost.pending) {
      await this.#sleep(SLICE_TICKS / TICKS_PER_MS);
    } else if (!this.#endsByItself) {
      await this.#sleep(Infinity);
    }
    this.#woken = false;
  }

  /** With a limit of ticks and no client, time has to go on to reach it. */
  get #endsByItself() {
    return this.#limit !== Infinity;
  }

  async #followWall() {
    const board_ns = (this.#board.tick - this.#startTick) * 8;
    const wall_ns = Number(process.hrtime.bigint() - this.#startWall_ns);
    if (board_ns > wall_ns) await sleep((board_ns - wall_ns) / 1e6);
    else await new Promise(setImmediate);
    this.#lag_ns = Math.max(this.#lag_ns, wall_ns - board_ns);
  }

  #sleep(ms) {
    if (this.#woken || this.#stopped) return Promise.resolve();
    return new Promise((resolve) => {
      const timer = ms === Infinity ? setInterval(() => {}, 1 << 30) : setTimeout(resolve, ms);
      this.#wake = () => {
        clearTimeout(timer);
        resolve();
      };
    });
  }
}
