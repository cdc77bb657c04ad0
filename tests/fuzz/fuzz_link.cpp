// SPDX-License-Identifier: MIT
// Fuzzes every message through link and stage on the host's board: a script of requests (any payload, or a good one with
// some bytes changed), time, cable, stop inputs and hardware trouble. Each request gets exactly one answer of its own
// type or an error with a text; pins belong to PIO only while the status says armed, waiting or playing; a fault names
// its cause and stays until it is cleared; a cleared, healthy board takes and plays a program again.
// links: ols_firmware
#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "board_host.h"
#include "frame.h"
#include "wire.h"

namespace {

using Bytes = std::vector<uint8_t>;

void expect(bool truth) {
    if (!truth) abort();
}

struct Script {
    const uint8_t* next;
    size_t left;

    uint8_t byte() {
        if (left == 0) return 0;
        left--;
        return *next++;
    }
    Bytes bytes(size_t count) {
        count = std::min(count, left);
        const Bytes taken(next, next + count);
        next += count;
        left -= count;
        return taken;
    }
};

struct Answer {
    uint16_t type = 0;
    Bytes payload;
};

template <typename T>
Bytes bytes_of(const T& value) {
    const auto* first = reinterpret_cast<const uint8_t*>(&value);
    return Bytes(first, first + sizeof value);
}

uint16_t last_id;

Answer ask(uint16_t type, const Bytes& payload) {
    uint8_t frame[OLS_FRAME_BYTES_MAX], answer[2 * OLS_FRAME_BYTES_MAX];
    const size_t bytes = ols_frame_encode(type, ++last_id, payload.data(), payload.size(), frame, sizeof frame);
    const size_t answered = board_host_exchange(frame, bytes, answer, sizeof answer);
    ols_frame_parser parser{};
    expect(ols_frame_parser_write(&parser, answer, answered) == answered);
    ols_frame got{};
    expect(ols_frame_parser_read(&parser, &got) && got.request_id == last_id);
    const Answer result{got.type, Bytes(got.payload, got.payload + got.payload_bytes)};
    expect(!ols_frame_parser_read(&parser, &got) && parser.dropped_bytes == 0);
    return result;
}

bool is_ok(const Answer& answer, uint16_t type) {
    if (answer.type == (type | OLS_REPLY)) return true;
    ols_error_reply error{};
    expect(answer.type == (OLS_ERROR | OLS_REPLY) && answer.payload.size() == sizeof error);
    memcpy(&error, answer.payload.data(), sizeof error);
    expect(error.code != 0 && error.text[0] != 0 && memchr(error.text, 0, sizeof error.text) != nullptr);
    return false;
}

bool command(uint16_t type, const Bytes& payload = {}) {
    return is_ok(ask(type, payload), type);
}

ols_status_reply status() {
    const Answer answer = ask(OLS_STATUS, {});
    ols_status_reply now{};
    expect(is_ok(answer, OLS_STATUS) && answer.payload.size() == sizeof now);
    memcpy(&now, answer.payload.data(), sizeof now);
    return now;
}

// A good program of 1 to 4 slots, grey ones among them, and as many of its bytes changed as `changes` says.
Bytes program_from(Script& script, uint16_t& slot_count, int changes) {
    slot_count = uint16_t(1 + script.byte() % 4);
    Bytes program, patterns;
    for (int n = 0; n < slot_count; n++) {
        ols_slot slot{};
        slot.kind = script.byte() % 4;
        slot.trigger_mask = script.byte() % 16;
        slot.planes = slot.kind == OLS_DARK ? 0 : script.byte() % 9;
        const uint32_t planes = std::max<uint32_t>(slot.planes, 1), units = (1u << planes) - 1;
        slot.exposure_ticks = units * (8u + script.byte() % 32);
        slot.period_ticks = slot.exposure_ticks * 2 + planes * 1300 + 100 + 8u * script.byte();
        const Bytes head = bytes_of(slot);
        program.insert(program.end(), head.begin(), head.end());
        patterns.resize(patterns.size() + planes * 6 * sizeof(uint32_t));
        if (slot.kind != OLS_DARK) patterns[patterns.size() - 24] = script.byte();
    }
    program.insert(program.end(), patterns.begin(), patterns.end());
    for (; changes > 0; changes--) program[(script.byte() * 256u + script.byte()) % program.size()] = script.byte();
    return program;
}

bool load(const Bytes& program, uint16_t slot_count, uint32_t cycles) {
    ols_load_begin begin{};
    begin.slot_count = slot_count;
    begin.chain_bits = 176;
    begin.cycles = cycles;
    begin.program_bytes = uint32_t(program.size());
    begin.program_crc32 = ols_crc32(0, program.data(), program.size());
    if (!command(OLS_LOAD_BEGIN, bytes_of(begin))) return false;
    for (size_t offset = 0; offset < program.size(); offset += 900) {
        Bytes chunk = bytes_of(ols_load_chunk{uint32_t(offset)});
        chunk.insert(chunk.end(), program.begin() + long(offset),
                     program.begin() + long(std::min(program.size(), offset + 900)));
        expect(command(OLS_LOAD_CHUNK, chunk));
    }
    return command(OLS_LOAD_END);
}

void load_from(Script& script) {
    const uint8_t how = script.byte();
    uint16_t slot_count;
    const Bytes program = program_from(script, slot_count, how % 8 < 5 ? 0 : how % 8 - 4);
    load(program, slot_count, how / 8 % 4);
}

void arm_from(Script& script) {
    ols_arm arm{};
    const uint8_t how = script.byte();
    if (how & 1) arm.heartbeat_ticks = OLS_HEARTBEAT_TICKS_MIN + 1000u * script.byte();
    if (how & 2) arm.start_source = OLS_START_BY_EDGE;
    command(OLS_ARM, bytes_of(arm));
}

void any_message(Script& script) {
    const uint8_t type = script.byte() % 32;
    const Bytes payload = script.bytes(script.byte() + 4u * (script.byte() % 128));
    if (!command(type, payload) || type != OLS_REBOOT_TO_BOOTLOADER) return;
    expect(!board_host_pins_are_connected());
    board_host_power_up();  // the boot loader has been, and started it again
    board_host_attach();
}

// Bytes that are no frame cost no answer but their own.
void noise(Script& script) {
    Bytes bytes = script.bytes(script.byte() % 64);
    std::replace(bytes.begin(), bytes.end(), uint8_t(OLS_FRAME_SYNC & 0xff), uint8_t(0));
    uint8_t answer[OLS_FRAME_BYTES_MAX];
    expect(board_host_exchange(bytes.data(), bytes.size(), answer, sizeof answer) == 0);
}

bool is_lit(const ols_status_reply& now) {
    return now.state == OLS_STATE_ARMED || now.state == OLS_STATE_PLAYING || now.state == OLS_STATE_WAITING;
}

void trouble(Script& script) {
    const uint8_t which = script.byte();
    switch (which % 8) {
        case 0: return board_host_starve_timeline();
        case 1: return board_host_starve_shifter();
        case 2: return board_host_delay_triggers(which);
        case 3:
            if (is_lit(status())) board_host_corrupt_program();
            return;
        case 4: return board_host_pull_stop_input(which / 8 % 3, true);
        case 5: return board_host_pull_stop_input(which / 8 % 3, false);
        case 6: board_host_detach(); return board_host_attach();
        default: board_host_bite(); return board_host_attach();
    }
}

void play(Script& script) {
    if (command(OLS_START) && script.byte() % 2) board_host_genlock();
}

void step(Script& script) {
    switch (script.byte() % 12) {
        case 0:
        case 1: return load_from(script);
        case 2: return arm_from(script);
        case 3: return play(script);
        case 4: command(OLS_SWAP); return;
        case 5: command(OLS_STOP); return;
        case 6: command(OLS_CLEAR_FAULT); return;
        case 7: return any_message(script);
        case 8: return noise(script);
        case 9: return trouble(script);
        case 10: command(OLS_READ_TRIGGER_LOG, bytes_of(ols_read_trigger_log{script.byte(), script.byte(), 0})); return;
        default: return board_host_run_us(1u + 64u * script.byte());
    }
}

void check_state(uint8_t state_before) {
    const ols_status_reply now = status();
    expect(is_lit(now) == board_host_pins_are_connected());
    expect((now.state == OLS_STATE_FAULT) == (now.fault != OLS_FAULT_NONE));
    if (state_before == OLS_STATE_FAULT && now.state == OLS_STATE_FAULT) expect(!command(OLS_START));
}

// Whatever came before: let go, clear, load, arm, start, play to the end.
void expect_recovery() {
    for (unsigned input = 0; input < 3; input++) board_host_pull_stop_input(input, false);
    if (status().state == OLS_STATE_FAULT) expect(command(OLS_CLEAR_FAULT));
    command(OLS_STOP);
    Script zeros{nullptr, 0};
    uint16_t slot_count;
    const Bytes program = program_from(zeros, slot_count, 0);
    expect(load(program, slot_count, 3));
    expect(command(OLS_ARM, bytes_of(ols_arm{})) && command(OLS_START));
    board_host_run_us(1000);
    expect(status().state == OLS_STATE_DONE);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Script script{data, size};
    board_host_power_up();
    board_host_attach();
    bool whole = true;  // hardware that starves or slips stays so
    for (int steps = 0; script.left > 0 && steps < 64; steps++) {
        const uint8_t before = status().state;
        if (*script.next % 12 == 9 && script.left > 1 && script.next[1] % 8 < 3) whole = false;
        step(script);
        check_state(before);
    }
    if (whole) expect_recovery();
    return 0;
}
