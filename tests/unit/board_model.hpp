// SPDX-License-Identifier: MIT
// A board on a USB bus for the tests of flashing: starts what is in its flash as the boot ROM does, runs a firmware that
// says who it is, has the boot loader otherwise. The cable can be pulled, or the host end, at any transfer.
#pragma once

#include <memory>
#include <optional>

#include "device/usb_board.hpp"
#include "frame.h"
#include "layout_hash.h"
#include "loader_model.hpp"
#include "wire.h"

namespace ols::test {

using Bytes = std::vector<uint8_t>;

// The boot ROM's CRC, bit by bit over the message as one long number (datasheet 2.8.1.3.1): a long division.
inline uint32_t boot_rom_crc(std::span<const uint8_t> bytes) {
    uint64_t remainder = 0xffffffff;
    for (const uint8_t byte : bytes)
        for (int bit = 7; bit >= 0; bit--) {
            const bool carry = (remainder >> 31 & 1) != (byte >> bit & 1);
            remainder = (remainder << 1 & 0xffffffff) ^ (carry ? 0x04c11db7u : 0);
        }
    return uint32_t(remainder);
}

// A firmware image of `sectors` and a half, for `board`; offsets from protocol/image_label.h's description.
inline Bytes make_image(const std::string& board, const std::string& version, size_t sectors, uint32_t seed,
                        uint64_t layout_hash = OLS_LAYOUT_HASH) {
    Bytes image(sectors * 4096 + 2048);
    for (uint8_t& byte : image) byte = uint8_t((seed = seed * 1664525 + 1013904223) >> 24);
    const uint32_t crc = boot_rom_crc(std::span(image).first(252));
    std::memcpy(&image[252], &crc, 4);
    Bytes label(56);
    std::memcpy(&label[0], "OLab", 4);
    label[4] = 56;
    std::memcpy(&label[8], &layout_hash, 8);
    std::memcpy(&label[16], board.data(), board.size());
    std::memcpy(&label[32], version.data(), version.size());
    std::copy(label.begin(), label.end(), image.begin() + 0x108);
    return image;
}

inline void put_word(Bytes& bytes, size_t at, uint32_t value) {
    for (int n = 0; n < 4; n++) bytes[at + size_t(n)] = uint8_t(value >> 8 * n);
}

// The image as a UF2 file (UF2 file format specification).
inline Bytes make_uf2(const Bytes& image) {
    Bytes file(image.size() / 256 * 512);
    for (uint32_t n = 0; n < image.size() / 256; n++) {
        const uint32_t words[] = {
            0x0a324655, 0x9e5d5157, 0x2000, 0x10000000 + n * 256, 256, n, uint32_t(image.size() / 256), 0xe48bff56};
        for (size_t w = 0; w < 8; w++) put_word(file, n * 512 + 4 * w, words[w]);
        std::copy_n(image.begin() + n * 256, 256, file.begin() + n * 512 + 32);
        put_word(file, n * 512 + 508, 0x0ab16f30);
    }
    return file;
}

class BoardModel {
  public:
    explicit BoardModel(std::string port = "1-1", std::string serial = "00f1e2d3c4b5a697")
        : port(std::move(port)), serial(std::move(serial)) {}

    enum class Runs { nothing, firmware, loader };
    std::string port, serial;
    FlashChip flash;
    Runs runs = Runs::nothing;
    std::unique_ptr<LoaderModel> loader;
    bool playing = false, loader_is_dead = false;
    bool loader_may_not_be_opened = false;
    bool drive_is_busy = false;  // some program keeps writing to the boot loader's drive
    int transfers = 0;           // so far
    int unplug_at = -1;          // the transfer at which the cable is pulled
    int host_dies_at = -1;       // the transfer that the host does not live to see done; the board stays as it is
    int session = 0;             // handles of earlier sessions are dead
    std::optional<uint32_t> restart_in_ms;

    void hold_image(const Bytes& image) {
        flash.cells.assign(2 << 20, 0xff);
        std::copy(image.begin(), image.end(), flash.cells.begin());
    }
    bool boots() const {
        uint32_t stated;
        std::memcpy(&stated, &flash.cells[252], 4);
        return boot_rom_crc(std::span(flash.cells).first(252)) == stated;
    }
    void power_up(bool bootsel = false) {
        session++;
        restart_in_ms.reset();
        frames_ = {};
        out_.clear();
        flash.listens = false;
        loader.reset();
        runs = !bootsel && boots() ? Runs::firmware : loader_is_dead ? Runs::nothing : Runs::loader;
        if (runs != Runs::loader) return;
        loader = std::make_unique<LoaderModel>(flash);
        loader->drive_is_busy = drive_is_busy;
        loader->on_reboot = [this](uint32_t delay_ms) { restart_in_ms = delay_ms; };
    }
    void pull_cable() {
        session++;
        runs = Runs::nothing;
    }
    void advance(uint32_t ms) {
        if (!restart_in_ms) return;
        if (*restart_in_ms > ms)
            *restart_in_ms -= ms;
        else
            power_up(std::exchange(to_loader_, false));
    }

    UsbResult firmware_write(std::span<const uint8_t> bytes) {
        ols_frame_parser_write(&frames_, bytes.data(), bytes.size());
        ols_frame frame;
        while (ols_frame_parser_read(&frames_, &frame)) answer(frame);
        return {UsbOutcome::done, bytes.size()};
    }
    UsbResult firmware_read(std::span<uint8_t> buffer) {
        if (out_.empty()) return {UsbOutcome::timed_out, 0};
        const size_t bytes = std::min(buffer.size(), out_.size());
        std::copy_n(out_.begin(), bytes, buffer.begin());
        out_.erase(out_.begin(), out_.begin() + ptrdiff_t(bytes));
        return {UsbOutcome::done, bytes};
    }

  private:
    void answer(const ols_frame& frame) {
        Bytes payload;
        uint16_t type = frame.type | 0x80;
        if (frame.type == 0x01) {  // hello: PROTOCOL.md
            payload.resize(92);
            std::copy_n(flash.cells.begin() + 0x108 + 8, 8, payload.begin());
            std::copy_n(flash.cells.begin() + 0x108 + 32, 24, payload.begin() + 8);
            std::copy_n(flash.cells.begin() + 0x108 + 16, 16, payload.begin() + 76);
        } else if (frame.type == 0x0d && !playing) {
            restart_in_ms = 10;
            to_loader_ = true;
        } else {
            type = 0xff;
            payload.resize(120);
            payload[0] = 3;
            payload[2] = payload[3] = 0xff;
            std::strcpy(reinterpret_cast<char*>(&payload[4]), "a program is armed or playing");
        }
        uint8_t reply[OLS_FRAME_BYTES_MAX];
        const size_t bytes =
            ols_frame_encode(type, frame.request_id, payload.data(), payload.size(), reply, sizeof reply);
        out_.insert(out_.end(), reply, reply + bytes);
    }

    ols_frame_parser frames_{};
    Bytes out_;
    bool to_loader_ = false;
};

// An open board: every transfer may be the last.
class ModelDevice : public UsbDevice {
  public:
    explicit ModelDevice(BoardModel& board) : board_(board), session_(board.session) {}

    UsbResult control(uint8_t type, uint8_t request, std::span<uint8_t> data, uint32_t) override {
        return transfer([&] {
            return board_.loader ? board_.loader->control(type, request, data) : UsbResult{UsbOutcome::stalled, 0};
        });
    }
    UsbResult write(std::span<const uint8_t> bytes, uint32_t) override {
        // Half of what a cut-off transfer had to bring has arrived.
        if (cut_off() && alive() && board_.loader && bytes.size() > 512) board_.loader->write(bytes.first(512));
        return transfer([&] { return board_.loader ? board_.loader->write(bytes) : board_.firmware_write(bytes); });
    }
    UsbResult read(std::span<uint8_t> buffer, uint32_t) override {
        return transfer([&] { return board_.loader ? board_.loader->read(buffer) : board_.firmware_read(buffer); });
    }
    UsbResult clear_stalls() override {
        return transfer([&] {
            if (board_.loader) board_.loader->clear_stalls();
            return UsbResult{UsbOutcome::done, 0};
        });
    }

  private:
    bool alive() const { return !dead_ && session_ == board_.session; }
    bool cut_off() const { return board_.transfers == board_.unplug_at || board_.transfers == board_.host_dies_at; }

    template <typename F>
    UsbResult transfer(F run) {
        if (!alive()) return {UsbOutcome::gone, 0};
        const int n = board_.transfers++;
        if (n == board_.unplug_at) board_.pull_cable();
        if (n == board_.host_dies_at) dead_ = true;
        return alive() ? run() : UsbResult{UsbOutcome::gone, 0};
    }

    BoardModel& board_;
    int session_;
    bool dead_ = false;
};

class ModelBus : public UsbBus {
  public:
    std::vector<BoardModel*> boards;
    std::vector<UsbListing> strangers;  // other devices
    std::function<void()> on_pause = [] {};

    Result<std::vector<UsbListing>> list(uint16_t vendor, uint16_t product) override {
        std::vector<UsbListing> found;
        for (const BoardModel* board : boards) {
            if (board->runs == BoardModel::Runs::firmware && vendor == 0x1209 && product == 0x0001)
                found.push_back({board->port, vendor, product, "light stage sequencer", board->serial, {}});
            // All RP2040s say the same serial number there.
            if (board->runs == BoardModel::Runs::loader && vendor == 0x2e8a && product == 0x0003)
                found.push_back({board->port, vendor, product, "RP2 Boot", "E0C9125B0D9B",
                                 board->loader_may_not_be_opened ? "no permission" : ""});
        }
        for (const UsbListing& stranger : strangers)
            if (stranger.vendor == vendor && stranger.product == product) found.push_back(stranger);
        return found;
    }
    Result<std::unique_ptr<UsbDevice>> open(const UsbListing& listing) override {
        for (BoardModel* board : boards)
            if (board->port == listing.port) return std::unique_ptr<UsbDevice>(std::make_unique<ModelDevice>(*board));
        return fail("nothing at that port");
    }
    void pause_ms(uint32_t ms) override {
        on_pause();
        for (BoardModel* board : boards) board->advance(ms);
    }
};

}  // namespace ols::test
