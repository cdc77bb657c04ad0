// SPDX-License-Identifier: MIT
// One FIFO of a PIO state machine: four words, eight when joined, none when the other direction has taken them.

export class PioFifo {
  #words;
  #first = 0;

  constructor(depth) {
    this.#words = new Uint32Array(depth);
    this.depth = depth;
    this.count = 0;
  }

  get empty() {
    return this.count === 0;
  }

  get full() {
    return this.count === this.depth;
  }

  push(word) {
    this.#words[(this.#first + this.count) % this.depth] = word;
    this.count++;
  }

  pull() {
    const word = this.#words[this.#first];
    this.#first = (this.#first + 1) % this.depth;
    this.count--;
    return word;
  }
}
