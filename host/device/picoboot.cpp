// SPDX-License-Identifier: MIT
// PICOBOOT over USB (RP2040 datasheet 2.8.5): a command of 32 bytes, its data if any, and an empty packet the other way.
#include "device/picoboot.hpp"

#include <fmt/format.h>

#include <cstring>

namespace ols {

namespace {

enum Command : uint8_t {
    command_exclusive_access = 0x01,
    command_reboot = 0x02,
    command_flash_erase = 0x03,
    command_read = 0x84,  // bit 7: data to the host
    command_write = 0x05,
    command_exit_xip = 0x06
};
constexpr uint32_t command_magic = 0x431fd10b;
constexpr uint32_t exclusive = 1;
constexpr uint32_t sram_end = 0x20042000;

// Control requests to the interface (2.8.5.5).
constexpr uint8_t to_interface = 0x41, from_interface = 0xc1;
constexpr uint8_t interface_reset = 0x41, get_command_status = 0x42;

// A sector takes 400 ms to erase, a page 3 ms to write (W25Q16JV datasheet 9.6); nothing here asks for more than one
// sector at once.
constexpr uint32_t timeout_ms = 3000;

struct CommandPacket {
    uint32_t magic = command_magic, token = 0;
    uint8_t id = 0, argument_bytes = 0;
    uint16_t reserved = 0;
    uint32_t transfer_bytes = 0, arguments[4] = {};
};
static_assert(sizeof(CommandPacket) == 32);

struct CommandStatus {
    uint32_t token, code;
    uint8_t id, in_progress, reserved[6];
};
static_assert(sizeof(CommandStatus) == 16);

const char* command_name(uint8_t id) {
    switch (id) {
        case command_exclusive_access: return "exclusive access";
        case command_reboot: return "reboot";
        case command_flash_erase: return "flash erase";
        case command_read: return "read";
        case command_write: return "write";
        case command_exit_xip: return "exit XIP";
        default: return "unknown";
    }
}

const char* status_name(uint32_t code) {
    constexpr const char* names[] = {"OK",
                                     "UNKNOWN_CMD",
                                     "INVALID_CMD_LENGTH",
                                     "INVALID_TRANSFER_LENGTH",
                                     "INVALID_ADDRESS",
                                     "BAD_ALIGNMENT",
                                     "INTERLEAVED_WRITE: something else writes to its drive",
                                     "REBOOTING",
                                     "UNKNOWN_ERROR"};
    return code < std::size(names) ? names[code] : "an unknown status";
}

Error cut_short(uint8_t id) {
    return fail(fmt::format("the boot loader took only a part of {}: start over", command_name(id)));
}

std::span<const uint8_t> bytes_of(const CommandPacket& packet) {
    return {reinterpret_cast<const uint8_t*>(&packet), sizeof packet};
}

}  // namespace

Error Picoboot::refusal(uint8_t id, UsbOutcome outcome) {
    CommandStatus status{};
    const std::span<uint8_t> bytes(reinterpret_cast<uint8_t*>(&status), sizeof status);
    if (outcome == UsbOutcome::stalled) {
        const UsbResult got = device_->control(from_interface, get_command_status, bytes, timeout_ms);
        if (got.outcome == UsbOutcome::done && got.bytes == sizeof status) {
            const bool is_of_this = status.token == token_ && status.id == id;
            return fail(fmt::format("the boot loader refused {}: {}",
                                    is_of_this ? command_name(id) : "an earlier command", status_name(status.code)));
        }
    }
    return fail(fmt::format("{} failed: {}", command_name(id), usb_outcome_text(outcome)));
}

Status Picoboot::send_command(uint8_t id, const Arguments& arguments, uint32_t transfer_bytes) {
    CommandPacket packet;
    packet.token = ++token_;
    packet.id = id;
    packet.argument_bytes = arguments.bytes;
    packet.transfer_bytes = transfer_bytes;
    std::memcpy(packet.arguments, arguments.words, sizeof packet.arguments);
    const UsbResult sent = device_->write(bytes_of(packet), timeout_ms);
    if (sent.outcome != UsbOutcome::done) return refusal(id, sent.outcome);
    if (sent.bytes != sizeof packet) return cut_short(id);
    return Done{};
}

Status Picoboot::acknowledge(uint8_t id) {
    uint8_t nothing[64];
    const UsbResult result =
        id & 0x80 ? device_->write({}, timeout_ms) : device_->read(std::span<uint8_t>(nothing), timeout_ms);
    if (result.outcome != UsbOutcome::done) return refusal(id, result.outcome);
    if (result.bytes != 0)
        return fail(fmt::format("the boot loader acknowledged {} with {} bytes, and it should be with none: start over",
                                command_name(id), result.bytes));
    return Done{};
}

// INTERFACE_RESET alone does not do after a stall: it leaves the boot ROM's data toggles, and a host controller may have begun
// its own anew (Linux on xHCI does). The next packet would then be acknowledged and dropped, as one that came before.
Status Picoboot::reset() {
    UsbResult result = device_->clear_stalls();
    if (result.outcome == UsbOutcome::done) result = device_->control(to_interface, interface_reset, {}, timeout_ms);
    if (result.outcome != UsbOutcome::done)
        return fail(fmt::format("the boot loader does not react: {}", usb_outcome_text(result.outcome)));
    return Done{};
}

Status Picoboot::exclusive_access() {
    if (Status sent = send_command(command_exclusive_access, {{exclusive}, 1}, 0); !sent.ok()) return sent;
    return acknowledge(command_exclusive_access);
}

Status Picoboot::exit_xip() {
    if (Status sent = send_command(command_exit_xip, {}, 0); !sent.ok()) return sent;
    return acknowledge(command_exit_xip);
}

Status Picoboot::erase(uint32_t address, uint32_t byte_count) {
    if (Status sent = send_command(command_flash_erase, {{address, byte_count}, 8}, 0); !sent.ok()) return sent;
    return acknowledge(command_flash_erase);
}

Status Picoboot::write(uint32_t address, std::span<const uint8_t> bytes) {
    const uint32_t byte_count = uint32_t(bytes.size());
    if (Status sent = send_command(command_write, {{address, byte_count}, 8}, byte_count); !sent.ok()) return sent;
    const UsbResult sent = device_->write(bytes, timeout_ms);
    if (sent.outcome != UsbOutcome::done) return refusal(command_write, sent.outcome);
    if (sent.bytes != byte_count) return cut_short(command_write);
    return acknowledge(command_write);
}

Result<std::vector<uint8_t>> Picoboot::read(uint32_t address, uint32_t byte_count) {
    if (const Status sent = send_command(command_read, {{address, byte_count}, 8}, byte_count); !sent.ok())
        return sent.error();
    std::vector<uint8_t> bytes(byte_count);
    const UsbResult got = device_->read(bytes, timeout_ms);
    if (got.outcome != UsbOutcome::done) return refusal(command_read, got.outcome);
    if (got.bytes != byte_count) return fail("the boot loader sent less than was asked for: start over");
    if (const Status done = acknowledge(command_read); !done.ok()) return done.error();
    return bytes;
}

Status Picoboot::reboot(uint32_t delay_ms) {
    const Arguments from_flash{{0, sram_end, delay_ms}, 12};
    if (Status sent = send_command(command_reboot, from_flash, 0); !sent.ok()) return sent;
    return acknowledge(command_reboot);
}

}  // namespace ols
