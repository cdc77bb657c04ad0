// SPDX-License-Identifier: MIT
// Writing, syncing and reading back a nameless file.
#include "doctor/disk_speed.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "image/disk_room.hpp"
#include "image/nameless_file.hpp"
#include "steady_clock.hpp"

namespace ols {

namespace {

constexpr size_t piece_bytes = size_t(4) << 20;  // of one call
constexpr size_t alignment = 4096;               // that O_DIRECT asks for at most, of address, place and size
constexpr double sync_s_max = 0.5;               // for which one sync may go on, so that the whole is bounded
constexpr uint64_t least_bytes = 8 * piece_bytes;

struct Descriptor {
    int fd = -1;
    explicit Descriptor(int fd) : fd(fd) {}
    ~Descriptor() {
        if (fd >= 0) ::close(fd);
    }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
};

using Piece = std::unique_ptr<std::byte, decltype(&std::free)>;

Piece make_piece() {
    auto* const bytes = static_cast<std::byte*>(std::aligned_alloc(alignment, piece_bytes));
    if (!bytes) throw std::bad_alloc();
    // xorshift64*: disks and file systems that compress find nothing to.
    uint64_t state = 0x9e3779b97f4a7c15;
    for (size_t at = 0; at < piece_bytes; at += sizeof state) {
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        const uint64_t word = state * 0x2545f4914f6cdd1d;
        std::memcpy(bytes + at, &word, sizeof word);
    }
    return {bytes, std::free};
}

Error cannot(const char* what, const std::string& folder) {
    return fail(fmt::format("{} in '{}': {}", what, folder, std::strerror(errno)));
}

// Each piece says which it is, so that no two are alike.
Status write_pieces(int fd, std::byte* piece, uint64_t bytes, const DiskSpeedOptions& options,
                    const std::string& folder, DiskSpeed& speed) {
    const uint64_t begin_ns = steady_ns(), end_ns = begin_ns + uint64_t(options.seconds_max * 1e9);
    uint64_t synced = 0, unsynced = 0;
    while (speed.bytes < bytes && (steady_ns() < end_ns || speed.bytes == 0)) {
        std::memcpy(piece, &speed.bytes, sizeof speed.bytes);
        for (size_t done = 0; done < piece_bytes;) {
            const ssize_t wrote = ::write(fd, piece + done, piece_bytes - done);
            if (wrote < 0 && errno == EINTR) continue;
            if (wrote < 0) return cannot("cannot write a file", folder);
            done += size_t(wrote);
        }
        speed.bytes += piece_bytes;
        unsynced += piece_bytes;
        const double so_far_s = double(steady_ns() - begin_ns) * 1e-9;
        const auto soon_bytes = uint64_t(double(synced) / so_far_s * sync_s_max);
        if (unsynced >= std::min(options.synced_bytes, soon_bytes)) {
            if (::fdatasync(fd) != 0) return cannot("cannot sync a file", folder);
            synced = speed.bytes;
            unsynced = 0;
        }
        options.progress((steady_ns() - begin_ns) / 1'000'000,
                         uint64_t(options.seconds_max * (options.is_read ? 2e3 : 1e3)));
    }
    if (::fdatasync(fd) != 0) return cannot("cannot sync a file", folder);
    speed.write_s = double(steady_ns() - begin_ns) * 1e-9;
    speed.write_bytes_per_s = double(speed.bytes) / speed.write_s;
    return Done{};
}

std::optional<double> read_pieces(int fd, std::byte* piece, const DiskSpeedOptions& options, uint64_t bytes) {
    const Descriptor direct(::open(fmt::format("/proc/self/fd/{}", fd).c_str(), O_RDONLY | O_DIRECT | O_CLOEXEC));
    if (direct.fd < 0) return std::nullopt;
    const uint64_t begin_ns = steady_ns(), end_ns = begin_ns + uint64_t(options.seconds_max * 1e9);
    uint64_t done = 0;
    while (done < bytes && (steady_ns() < end_ns || done == 0)) {
        const ssize_t got = ::read(direct.fd, piece, piece_bytes);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return std::nullopt;
        done += uint64_t(got);
        const auto half_ms = uint64_t(options.seconds_max * 1e3);
        options.progress(std::min(half_ms + (steady_ns() - begin_ns) / 1'000'000, 2 * half_ms), 2 * half_ms);
    }
    return double(done) / (double(steady_ns() - begin_ns) * 1e-9);
}

}  // namespace

Result<DiskSpeed> measure_disk(const std::string& folder, const DiskSpeedOptions& options) {
    const auto room = room_of(folder);
    if (!room.ok()) return room.error();
    const uint64_t bytes = std::min(options.bytes_max, room->free_bytes / 10) / piece_bytes * piece_bytes;
    if (bytes < std::min(least_bytes, options.bytes_max))
        return fail(fmt::format("too little room in '{}' to measure its disk", folder));
    const Descriptor file(open_nameless_file(folder));
    if (file.fd < 0) return cannot("cannot make a file", folder);
    const Piece piece = make_piece();
    DiskSpeed speed;
    if (const Status wrote = write_pieces(file.fd, piece.get(), bytes, options, folder, speed); !wrote.ok())
        return wrote.error();
    if (options.is_read && !room->is_memory)
        speed.read_bytes_per_s = read_pieces(file.fd, piece.get(), options, speed.bytes);
    options.progress(1, 1);
    return speed;
}

}  // namespace ols
