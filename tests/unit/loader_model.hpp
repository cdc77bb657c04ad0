// SPDX-License-Identifier: MIT
// An RP2040's USB boot loader at the level of USB transfers, from RP2040 datasheet 2.8.5 and the boot ROM's published
// source, with a flash chip that erases to ones and writes only zeros. It refuses what the boot ROM refuses, and counts
// as a violation what would hang it or do nothing there.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "device/usb_device.hpp"

namespace ols::test {

struct FlashChip {
    static constexpr uint32_t sector = 4096, page = 256;
    std::vector<uint8_t> cells = std::vector<uint8_t>(2 << 20, 0xff);
    bool listens = false;     // to commands: not while it still serves reads by address
    uint32_t stuck_zero = 0;  // this cell's bit 0 does not erase; 0: none
    uint64_t erases = 0, writes = 0;

    void erase(uint32_t offset) {
        if (!listens) return;
        erases++;
        std::fill_n(cells.begin() + offset, sector, uint8_t(0xff));
        if (stuck_zero && stuck_zero / sector == offset / sector) cells[stuck_zero] &= 0xfe;
    }
    void program(uint32_t offset, std::span<const uint8_t> bytes) {
        if (!listens) return;
        writes++;
        for (size_t n = 0; n < bytes.size(); n++) cells[offset + n] &= bytes[n];
    }
};

class LoaderModel {
  public:
    enum Status : uint32_t {
        ok,
        unknown_command,
        invalid_command_length,
        invalid_transfer_length,
        invalid_address,
        bad_alignment,
        interleaved_write,
        rebooting
    };

    explicit LoaderModel(FlashChip& flash) : flash_(flash) {}

    std::function<void(uint32_t delay_ms)> on_reboot = [](uint32_t) {};
    bool drive_is_busy = false;  // some program keeps writing to the BOOTSEL drive
    int violations = 0;          // of the protocol
    bool exclusive = false;

    UsbResult control(uint8_t type, uint8_t request, std::span<uint8_t> data) {
        if (type == 0x41 && request == 0x41 && data.empty()) {  // INTERFACE_RESET
            halted_in_ = halted_out_ = exclusive = false;
            phase_ = Phase::command;
            status_ = {};
            return {UsbOutcome::done, 0};
        }
        if (type == 0xc1 && request == 0x42 && data.size() == status_.size()) {  // GET_COMMAND_STATUS
            std::copy(status_.begin(), status_.end(), data.begin());
            return {UsbOutcome::done, data.size()};
        }
        return {UsbOutcome::stalled, 0};
    }

    UsbResult write(std::span<const uint8_t> bytes) {
        if (!halted_out_ && std::exchange(is_out_of_step_, false)) return {UsbOutcome::done, bytes.size()};  // dropped
        const UsbResult result = take(bytes);
        if (result.outcome == UsbOutcome::stalled) is_out_of_step_ = true;
        return result;
    }

    // CLEAR_FEATURE(ENDPOINT_HALT) to both endpoints.
    void clear_stalls() { halted_in_ = halted_out_ = is_out_of_step_ = false; }

    UsbResult read(std::span<uint8_t> buffer) {
        if (halted_in_) return {UsbOutcome::stalled, 0};
        if (phase_ == Phase::acknowledge_in) {
            phase_ = Phase::command;
            return {UsbOutcome::done, 0};
        }
        if (phase_ == Phase::data_in) return give_data(buffer);
        violations++;
        return {UsbOutcome::timed_out, 0};
    }

  private:
    enum class Phase { command, data_out, data_in, acknowledge_in, acknowledge_out };
    static constexpr uint32_t flash_begin = 0x10000000, flash_end = 0x11000000;  // the window, chips are smaller

    static uint32_t word(std::span<const uint8_t> bytes, size_t at) {
        return uint32_t(bytes[at]) | uint32_t(bytes[at + 1]) << 8 | uint32_t(bytes[at + 2]) << 16 |
               uint32_t(bytes[at + 3]) << 24;
    }
    void set_status(uint32_t code) {
        for (int n = 0; n < 4; n++) status_[size_t(4 + n)] = uint8_t(code >> 8 * n);
    }
    UsbResult halt_both(uint32_t code) {
        set_status(code);
        halted_in_ = halted_out_ = true;
        // The packet itself was acknowledged; what comes next is refused.
        return {UsbOutcome::done, 32};
    }
    bool in_flash(uint32_t address) const { return address >= flash_begin && address < flash_end; }

    UsbResult take(std::span<const uint8_t> bytes) {
        if (halted_out_) return {UsbOutcome::stalled, 0};
        switch (phase_) {
            case Phase::command: return take_command(bytes);
            case Phase::data_out: return take_data(bytes);
            case Phase::acknowledge_out:
                if (!bytes.empty()) break;
                phase_ = Phase::command;
                return {UsbOutcome::done, 0};
            default: break;
        }
        violations++;
        return {UsbOutcome::timed_out, 0};  // not acknowledged
    }

    UsbResult take_command(std::span<const uint8_t> bytes) {
        if (bytes.size() != 32 || word(bytes, 0) != 0x431fd10b) {
            halted_in_ = halted_out_ = true;
            return {UsbOutcome::done, bytes.size()};
        }
        std::copy_n(bytes.begin() + 4, 4, status_.begin());  // the token
        const uint8_t id = bytes[8];
        status_[8] = id;
        struct Known {
            uint8_t id, argument_bytes;
            bool transfers;
        };
        constexpr Known known[] = {{0x01, 1, false}, {0x02, 12, false}, {0x03, 8, false}, {0x84, 8, true},
                                   {0x05, 8, true},  {0x06, 0, false},  {0x07, 0, false}};
        const auto* const command =
            std::find_if(std::begin(known), std::end(known), [&](const Known& k) { return k.id == id; });
        if (command == std::end(known)) return halt_both(unknown_command);
        if (bytes[9] != command->argument_bytes) return halt_both(invalid_command_length);
        address_ = word(bytes, 16);
        size_ = word(bytes, 20);
        if (word(bytes, 12) != (command->transfers ? size_ : 0)) return halt_both(invalid_transfer_length);
        if (id == 0x02) {
            rebooting_ = true;
            on_reboot(word(bytes, 24));
            phase_ = Phase::acknowledge_in;
            return {UsbOutcome::done, 32};
        }
        set_status(ok);
        moved_ = 0;
        phase_ = id == 0x84 ? Phase::data_in : id == 0x05 ? Phase::data_out : Phase::acknowledge_in;
        if (command->transfers) return {UsbOutcome::done, 32};
        const uint32_t code = run(id, bytes);
        return code == ok ? UsbResult{UsbOutcome::done, 32} : halt_both(code);
    }

    uint32_t run(uint8_t id, std::span<const uint8_t> bytes) {
        if (rebooting_) return rebooting;
        if (id == 0x01) exclusive = bytes[16] != 0;
        if (id == 0x06) flash_.listens = true;
        if (id == 0x07) flash_.listens = false;
        if (id != 0x03) return ok;
        if (address_ % FlashChip::sector || size_ % FlashChip::sector) return bad_alignment;
        if (!in_flash(address_) || !in_flash(address_ + size_)) return invalid_address;
        if (!flash_.listens) violations++;
        for (uint32_t at = 0; at < size_; at += FlashChip::sector) flash_.erase(address_ + at - flash_begin);
        return ok;
    }

    // One page's worth of a write, as far as it has come.
    uint32_t program(std::span<const uint8_t> bytes) {
        if (rebooting_) return rebooting;
        const uint32_t at = address_ + moved_;
        if (drive_is_busy && !exclusive && moved_ > 0) return interleaved_write;
        if (!in_flash(at) || !in_flash(at + uint32_t(bytes.size()))) return invalid_address;
        if (at % FlashChip::page) return bad_alignment;
        if (!flash_.listens) violations++;
        std::vector<uint8_t> whole(bytes.begin(), bytes.end());
        whole.resize(FlashChip::page, 0);  // the last page is filled with zeros
        flash_.program(at - flash_begin, whole);
        return ok;
    }

    UsbResult take_data(std::span<const uint8_t> bytes) {
        for (size_t used = 0; used < bytes.size();) {
            const auto chunk = bytes.subspan(used, std::min<size_t>(FlashChip::page, bytes.size() - used));
            if (const uint32_t code = program(chunk); code != ok) {
                set_status(code);
                halted_out_ = true;
                return {UsbOutcome::stalled, used};
            }
            used += chunk.size();
            moved_ += uint32_t(chunk.size());
        }
        if (moved_ > size_) violations++;
        if (moved_ >= size_) phase_ = Phase::acknowledge_in;
        return {UsbOutcome::done, bytes.size()};
    }

    UsbResult give_data(std::span<uint8_t> buffer) {
        uint32_t code = ok;
        if (rebooting_) code = rebooting;
        if (!in_flash(address_) || !in_flash(address_ + size_)) code = invalid_address;
        if (code == ok && address_ % FlashChip::page) code = bad_alignment;
        if (code != ok) {
            set_status(code);
            halted_in_ = true;
            return {UsbOutcome::stalled, 0};
        }
        if (!flash_.listens) violations++;
        const size_t bytes = std::min<size_t>(buffer.size(), size_ - moved_);
        for (size_t n = 0; n < bytes; n++)
            buffer[n] =
                flash_.listens ? flash_.cells[(address_ + moved_ + n - flash_begin) % flash_.cells.size()] : 0xff;
        moved_ += uint32_t(bytes);
        if (moved_ == size_) phase_ = Phase::acknowledge_out;
        return {UsbOutcome::done, bytes};
    }

    FlashChip& flash_;
    Phase phase_ = Phase::command;
    bool halted_in_ = false, halted_out_ = false, rebooting_ = false;
    bool is_out_of_step_ = false;  // a stall has begun the host's data toggle anew, as on xHCI, and not the chip's
    std::array<uint8_t, 16> status_{};
    uint32_t address_ = 0, size_ = 0, moved_ = 0;
};

}  // namespace ols::test
