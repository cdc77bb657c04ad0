// SPDX-License-Identifier: MIT
// The two ends of the shared-memory ring; waiting is by futex on words inside the mapping.
#include "device/ring.hpp"

#include <fcntl.h>
#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstring>
#include <ctime>

#include "image/whole_file.hpp"

namespace ols {

namespace {

void futex_wait(std::atomic<uint32_t>& word, uint32_t seen, int timeout_ms) {
    const timespec timeout{timeout_ms / 1000, long(timeout_ms % 1000) * 1000000};
    syscall(SYS_futex, &word, FUTEX_WAIT, seen, &timeout, nullptr, 0);
}

void futex_wake(std::atomic<uint32_t>& word) {
    word.fetch_add(1, std::memory_order_release);
    syscall(SYS_futex, &word, FUTEX_WAKE, INT_MAX, nullptr, nullptr, 0);
}

struct Map {
    RingHeader* header = nullptr;
    size_t bytes = 0;

    std::byte* record(uint64_t n) const {
        return reinterpret_cast<std::byte*>(header) + sizeof(RingHeader) + size_t(n % header->slots) * header->stride;
    }
    ~Map() {
        if (header) munmap(header, bytes);
    }
};

}  // namespace

struct RingWriter::Mapping : Map {};
struct RingReader::Mapping : Map {};

RingWriter::RingWriter(std::unique_ptr<Mapping> mapping) : mapping_(std::move(mapping)) {}
RingWriter::RingWriter(RingWriter&&) noexcept = default;
RingWriter& RingWriter::operator=(RingWriter&&) noexcept = default;
RingWriter::~RingWriter() {
    if (mapping_) close();
}

Result<RingWriter> RingWriter::create(const std::string& path, uint32_t slots, uint64_t frame_bytes) {
    const uint64_t stride = (sizeof(RingFrame) + frame_bytes + 63) / 64 * 64;
    if (slots == 0 || stride > UINT32_MAX)
        return fail("ring '" + path + "': needs at least one slot of less than 4 GiB");
    auto mapping = std::make_unique<Mapping>();
    mapping->bytes = sizeof(RingHeader) + slots * stride;

    // A reader never sees a half-made header.
    const Status made = write_whole_file(path, [&](const std::string& temporary) -> Status {
        const int fd = ::open(temporary.c_str(), O_RDWR | O_CLOEXEC);
        if (fd < 0 || fchmod(fd, 0600) != 0) return fail("cannot make ring '" + path + "': " + std::strerror(errno));
        void* memory = MAP_FAILED;
        if (posix_fallocate(fd, 0, off_t(mapping->bytes)) == 0)
            memory = mmap(nullptr, mapping->bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
        ::close(fd);
        if (memory == MAP_FAILED)
            return fail("cannot reserve " + std::to_string(mapping->bytes >> 20) + " MiB for ring '" + path +
                        "': free space there or choose fewer slots");
        mapping->header = new (memory) RingHeader{};
        mapping->header->magic = ring_magic;
        mapping->header->slots = slots;
        mapping->header->stride = uint32_t(stride);
        return Done{};
    });
    if (!made) return made.error();
    return RingWriter(std::move(mapping));
}

bool RingWriter::write(const Frame& frame, bool wait, const std::atomic<bool>& cancelled) {
    RingHeader& header = *mapping_->header;
    const uint64_t head = header.head.load(std::memory_order_relaxed);
    assert(sizeof(RingFrame) + frame.samples.size() <= header.stride);
    for (;;) {
        const uint32_t seen = header.tail_futex.load(std::memory_order_acquire);
        if (head - header.tail.load(std::memory_order_acquire) < header.slots) break;
        if (!wait) {
            header.dropped.fetch_add(1, std::memory_order_relaxed);
            return false;
        }
        if (cancelled.load()) return false;
        futex_wait(header.tail_futex, seen, 100);
    }
    const RingFrame meta{frame.camera, frame.width,       frame.height,         frame.format,
                         frame.cfa,    frame.pitch_bytes, frame.stamp.frame_id, frame.stamp.timestamp_ns,
                         frame.black,  frame.white,       frame.samples.size()};
    std::byte* record = mapping_->record(head);
    std::memcpy(record, &meta, sizeof meta);
    std::memcpy(record + sizeof meta, frame.samples.data(), frame.samples.size());
    header.head.store(head + 1, std::memory_order_release);
    futex_wake(header.head_futex);
    return true;
}

void RingWriter::set_watermark(uint64_t camera_time_ns) {
    mapping_->header->watermark_ns.store(camera_time_ns, std::memory_order_release);
    futex_wake(mapping_->header->head_futex);
}

void RingWriter::close() {
    mapping_->header->closed.store(1, std::memory_order_release);
    futex_wake(mapping_->header->head_futex);
}

RingReader::RingReader(std::unique_ptr<Mapping> mapping) : mapping_(std::move(mapping)) {}
RingReader::RingReader(RingReader&&) noexcept = default;
RingReader& RingReader::operator=(RingReader&&) noexcept = default;
RingReader::~RingReader() = default;

Result<RingReader> RingReader::open(const std::string& path) {
    const int fd = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
    if (fd < 0)
        return fail("cannot open camera ring '" + path + "': " + std::strerror(errno) + "; start the camera first");
    struct stat info {};
    fstat(fd, &info);
    auto mapping = std::make_unique<Mapping>();
    mapping->bytes = size_t(info.st_size);
    void* memory = mapping->bytes >= sizeof(RingHeader)
                       ? mmap(nullptr, mapping->bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0)
                       : MAP_FAILED;
    ::close(fd);
    if (memory == MAP_FAILED) return fail("'" + path + "' is no camera ring: it is too small");
    mapping->header = static_cast<RingHeader*>(memory);
    const RingHeader& header = *mapping->header;
    if (header.magic != ring_magic || header.slots == 0 || header.stride < sizeof(RingFrame) ||
        sizeof(RingHeader) + uint64_t(header.slots) * header.stride > mapping->bytes)
        return fail("'" + path + "' is no camera ring of this version: restart the camera program of this release");
    return RingReader(std::move(mapping));
}

std::optional<Frame> RingReader::read(int timeout_ms) {
    RingHeader& header = *mapping_->header;
    const uint64_t tail = header.tail.load(std::memory_order_relaxed);
    const uint32_t seen = header.head_futex.load(std::memory_order_acquire);
    if (header.head.load(std::memory_order_acquire) == tail) {
        if (header.closed.load(std::memory_order_acquire)) return std::nullopt;
        futex_wait(header.head_futex, seen, timeout_ms);
        if (header.head.load(std::memory_order_acquire) == tail) return std::nullopt;
    }
    const std::byte* record = mapping_->record(tail);
    RingFrame meta;
    std::memcpy(&meta, record, sizeof meta);
    Frame frame;
    frame.camera = meta.camera;
    frame.stamp = {meta.frame_id, meta.timestamp_ns};
    frame.width = meta.width;
    frame.height = meta.height;
    frame.format = meta.format;
    frame.cfa = meta.cfa;
    frame.pitch_bytes = meta.pitch_bytes;
    frame.black = meta.black;
    frame.white = meta.white;
    const size_t bytes = std::min<size_t>(meta.bytes, header.stride - sizeof meta);
    frame.samples.assign(record + sizeof meta, record + sizeof meta + bytes);
    header.tail.store(tail + 1, std::memory_order_release);
    futex_wake(header.tail_futex);
    return frame;
}

uint64_t RingReader::watermark_ns() const {
    return mapping_->header->watermark_ns.load(std::memory_order_acquire);
}

uint64_t RingReader::dropped() const {
    return mapping_->header->dropped.load(std::memory_order_relaxed);
}

bool RingReader::closed() const {
    const RingHeader& header = *mapping_->header;
    return header.closed.load(std::memory_order_acquire) &&
           header.head.load(std::memory_order_acquire) == header.tail.load(std::memory_order_acquire);
}

}  // namespace ols
