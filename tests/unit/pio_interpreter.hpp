// SPDX-License-Identifier: MIT
// Runs the assembled programs of pulse.pio tick by tick, from the instruction set of RP2040 datasheet 3.4 alone: what
// the firmware's words do, told without the firmware's own reckoning of what they cost.
#pragma once

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <vector>

namespace ols::test {

// What machines of one block share.
struct PioBlock {
    uint32_t flags = 0;
    uint32_t pins = 0;  // of this test's own numbering
};

// One state machine at clock divider 1. Its FIFO is a table played round and round, `words_fed` of it in all.
struct PioMachine {
    PioBlock& block;
    std::vector<uint16_t> program;
    int wrap_target, wrap;
    int side_bits = 0, side_pin = 0;
    int out_pin = 0, out_count = 0;
    int jmp_pin = 0;
    bool shift_right = false;
    int status_below = 0;  // STATUS is all ones when fewer words than this wait
    std::vector<uint32_t> table = {};
    uint64_t words_fed = UINT64_MAX;

    int pc = 0, delay = 0;
    bool irq_raised = false;  // by an `irq wait` that waits for it to be cleared
    uint32_t x = 0, y = 0, isr = 0, osr = 0;
    int bits_out = 32;
    uint64_t words_pulled = 0;
    std::vector<uint32_t> pushed = {};

    uint64_t words_waiting() const { return words_fed - words_pulled < 8 ? words_fed - words_pulled : 8; }

    void set_pins(int first, int count, uint32_t value) {
        const uint32_t mask = ((1u << count) - 1) << first;
        block.pins = (block.pins & ~mask) | (value << first & mask);
    }

    void tick() {
        if (delay > 0) {
            delay--;
            return;
        }
        const uint16_t word = program.at(pc);
        const int delay_bits = 5 - side_bits;
        if (side_bits) set_pins(side_pin, side_bits, word >> (8 + delay_bits) & 1);
        std::optional<int> next = pc == wrap ? wrap_target : pc + 1;
        execute(word, next);
        if (!next) return;  // stalled: the same again
        pc = *next;
        delay = word >> 8 & ((1 << delay_bits) - 1);
    }

  private:
    void execute(uint16_t word, std::optional<int>& next) {
        const int operand = word & 31, middle = word >> 5 & 7;
        switch (word >> 13) {
            case 0:
                if (jumps(middle)) next = operand;
                break;
            case 1:  // wait 1 irq: clears the flag it has waited for
                if ((word & 0xe0) != 0xc0) throw std::runtime_error("wait for something else than a flag");
                if (!(block.flags >> operand & 1)) next = {};
                block.flags &= ~(1u << operand);
                break;
            case 3: out(middle, operand, next); break;
            case 4:
                if (word & 0x80)
                    pull(word & 0x20, next);
                else
                    pushed.push_back(isr);
                break;
            case 5: mov(middle, word >> 3 & 3, word & 7); break;
            case 6: irq(operand, word & 0x20, next); break;
            default: throw std::runtime_error("instruction unknown to this interpreter");
        }
    }

    void irq(int flag, bool waits, std::optional<int>& next) {
        if (!irq_raised) block.flags |= 1u << flag;
        irq_raised = waits && (!irq_raised || block.flags >> flag & 1);
        if (irq_raised) next = {};
    }

    bool jumps(int condition) {
        switch (condition) {
            case 0: return true;
            case 2: return x-- != 0;
            case 3: return y == 0;
            case 4: return y-- != 0;
            case 6: return block.pins >> jmp_pin & 1;
            case 7: return bits_out < 32;
            default: throw std::runtime_error("condition unknown to this interpreter");
        }
    }

    void out(int destination, int count, std::optional<int>& next) {
        const uint32_t mask = count == 32 ? ~0u : (1u << count) - 1;
        const uint32_t value = shift_right ? osr & mask : osr >> (32 - count);
        osr = shift_right ? uint64_t(osr) >> count : uint64_t(osr) << count;
        bits_out += count;
        switch (destination) {
            case 0: set_pins(out_pin, out_count, value); break;
            case 1: x = value; break;
            case 2: y = value; break;
            case 5: next = int(value); break;
            default: throw std::runtime_error("destination unknown to this interpreter");
        }
    }

    void pull(bool block_when_empty, std::optional<int>& next) {
        if (words_waiting() > 0)
            osr = table.at(words_pulled++ % table.size());
        else if (block_when_empty)
            next = {};
        else
            osr = x;
        bits_out = 0;
    }

    void mov(int destination, int operation, int source) {
        uint32_t value = 0;
        switch (source) {
            case 1: value = x; break;
            case 2: value = y; break;
            case 3: break;
            case 5: value = words_waiting() < uint64_t(status_below) ? ~0u : 0; break;
            case 6: value = isr; break;
            default: throw std::runtime_error("source unknown to this interpreter");
        }
        if (operation == 1) value = ~value;
        switch (destination) {
            case 1: x = value; break;
            case 2: y = value; break;
            case 6: isr = value; break;
            default: throw std::runtime_error("destination unknown to this interpreter");
        }
    }
};

}  // namespace ols::test
