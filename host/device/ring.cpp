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
#include <chrono>
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

// The bytes of the file that the ends lock (fcntl(2), "Open file description locks"): the lock goes with the process.
enum class End : off_t { reader = 0, writer = 1 };

struct flock lock_of(End end) {
    struct flock lock {};
    lock.l_type = F_WRLCK;
    lock.l_whence = SEEK_SET;
    lock.l_start = off_t(end);
    lock.l_len = 1;
    return lock;
}

bool take_place(int fd, End end) {
    struct flock lock = lock_of(end);
    return fcntl(fd, F_OFD_SETLK, &lock) == 0;
}

// Whether another process (or another opening of the file) holds that end.
bool is_taken(int fd, End end) {
    struct flock lock = lock_of(end);
    return fcntl(fd, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

}  // namespace

struct RingMapping {
    RingHeader* header = nullptr;
    size_t bytes = 0;
    int fd = -1;

    std::byte* record(uint64_t n) const {
        return reinterpret_cast<std::byte*>(header) + sizeof(RingHeader) + size_t(n % header->slots) * header->stride;
    }
    ~RingMapping() {
        if (header) munmap(header, bytes);
        if (fd >= 0) ::close(fd);
    }
};

RingWriter::RingWriter(std::unique_ptr<RingMapping> mapping) : mapping_(std::move(mapping)) {}
RingWriter::RingWriter(RingWriter&&) noexcept = default;
RingWriter& RingWriter::operator=(RingWriter&&) noexcept = default;
RingWriter::~RingWriter() {
    if (mapping_) close();
}

Result<RingWriter> RingWriter::create(const std::string& path, uint32_t slots, const RingContent& content) {
    const uint64_t stride = (sizeof(RingFrame) + content.frame_bytes() + 63) / 64 * 64;
    if (slots == 0 || stride > UINT32_MAX)
        return fail("ring '" + path + "': needs at least one slot of less than 4 GiB");
    auto mapping = std::make_unique<RingMapping>();
    mapping->bytes = sizeof(RingHeader) + slots * stride;

    // A reader never sees a half-made header.
    const Status made = write_whole_file(path, [&](const std::string& temporary) -> Status {
        mapping->fd = ::open(temporary.c_str(), O_RDWR | O_CLOEXEC);
        if (mapping->fd < 0 || fchmod(mapping->fd, 0600) != 0)
            return fail("cannot make ring '" + path + "': " + std::strerror(errno));
        if (!take_place(mapping->fd, End::writer))
            return fail("cannot lock ring '" + path + "': " + std::strerror(errno) + "; choose a local file system");
        void* memory = MAP_FAILED;
        if (posix_fallocate(mapping->fd, 0, off_t(mapping->bytes)) == 0)
            memory = mmap(nullptr, mapping->bytes, PROT_READ | PROT_WRITE, MAP_SHARED, mapping->fd, 0);
        if (memory == MAP_FAILED)
            return fail("cannot reserve " + std::to_string(mapping->bytes >> 20) + " MiB for ring '" + path +
                        "': free space there or choose fewer slots");
        mapping->header = new (memory) RingHeader{};
        mapping->header->magic = ring_magic;
        mapping->header->slots = slots;
        mapping->header->stride = uint32_t(stride);
        mapping->header->content = content;
        return Done{};
    });
    if (!made) return made.error();
    return RingWriter(std::move(mapping));
}

std::optional<uint32_t> RingWriter::start_asked() const {
    const RingHeader& header = *mapping_->header;
    const uint32_t asked = header.asked.load(std::memory_order_acquire);
    const bool is_open = header.running.load(std::memory_order_acquire) &&
                         asked != header.started.load(std::memory_order_relaxed) && is_taken(mapping_->fd, End::reader);
    return is_open ? std::optional(asked) : std::nullopt;
}

void RingWriter::confirm_start(uint32_t start, uint64_t camera_time_ns) {
    RingHeader& header = *mapping_->header;
    header.started_ns.store(camera_time_ns, std::memory_order_relaxed);
    header.started_head.store(header.head.load(std::memory_order_relaxed), std::memory_order_relaxed);
    header.started.store(start, std::memory_order_release);
    futex_wake(header.head_futex);
}

bool RingWriter::wanted() const {
    const RingHeader& header = *mapping_->header;
    return header.running.load(std::memory_order_acquire) &&
           header.asked.load(std::memory_order_acquire) == header.started.load(std::memory_order_relaxed) &&
           is_taken(mapping_->fd, End::reader);
}

RingWriter::Outcome RingWriter::write(const Frame& frame, bool wait, const std::atomic<bool>& cancelled) {
    RingHeader& header = *mapping_->header;
    const uint64_t head = header.head.load(std::memory_order_relaxed);
    assert(sizeof(RingFrame) + frame.samples.size() <= header.stride);
    for (;;) {
        const uint32_t seen = header.tail_futex.load(std::memory_order_acquire);
        if (!wanted()) return Outcome::unwanted;
        if (head - header.tail.load(std::memory_order_acquire) < header.slots) break;
        if (!wait) {
            header.dropped.fetch_add(1, std::memory_order_relaxed);
            return Outcome::full;
        }
        if (cancelled.load()) return Outcome::cancelled;
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
    return Outcome::written;
}

void RingWriter::set_watermark(uint64_t camera_time_ns) {
    mapping_->header->watermark_ns.store(camera_time_ns, std::memory_order_release);
    futex_wake(mapping_->header->head_futex);
}

void RingWriter::close() {
    mapping_->header->closed.store(1, std::memory_order_release);
    futex_wake(mapping_->header->head_futex);
}

RingReader::RingReader(std::unique_ptr<RingMapping> mapping) : mapping_(std::move(mapping)) {}
RingReader::RingReader(RingReader&&) noexcept = default;
RingReader& RingReader::operator=(RingReader&&) noexcept = default;
RingReader::~RingReader() {
    if (mapping_) stop();
}

Result<RingReader> RingReader::open(const std::string& path) {
    auto mapping = std::make_unique<RingMapping>();
    mapping->fd = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
    if (mapping->fd < 0)
        return fail("cannot open camera ring '" + path + "': " + std::strerror(errno) + "; start the camera first");
    struct stat info {};
    fstat(mapping->fd, &info);
    mapping->bytes = size_t(info.st_size);
    void* memory = mapping->bytes >= sizeof(RingHeader)
                       ? mmap(nullptr, mapping->bytes, PROT_READ | PROT_WRITE, MAP_SHARED, mapping->fd, 0)
                       : MAP_FAILED;
    if (memory == MAP_FAILED) return fail("'" + path + "' is no camera ring: it is too small");
    mapping->header = static_cast<RingHeader*>(memory);
    RingHeader& header = *mapping->header;
    if (header.magic != ring_magic || header.slots == 0 || header.stride < sizeof(RingFrame) ||
        sizeof(RingHeader) + uint64_t(header.slots) * header.stride > mapping->bytes)
        return fail("'" + path + "' is no camera ring of this version: restart the camera program of this release");
    if (!take_place(mapping->fd, End::reader))
        return fail("the camera at '" + path + "' is busy: another program reads it; end that one first");
    if (header.closed.load(std::memory_order_acquire) || !is_taken(mapping->fd, End::writer))
        return fail("nothing fills the camera ring '" + path + "' any more: start the camera again");
    header.running.store(0, std::memory_order_release);  // a reader that was killed left it as it was
    return RingReader(std::move(mapping));
}

const RingContent& RingReader::content() const {
    return mapping_->header->content;
}

uint32_t RingReader::slots() const {
    return mapping_->header->slots;
}

Result<uint64_t> RingReader::start(int patience_ms) {
    using Clock = std::chrono::steady_clock;
    RingHeader& header = *mapping_->header;
    header.running.store(0, std::memory_order_release);
    const uint32_t start = header.asked.load(std::memory_order_relaxed) + 1;
    header.asked.store(start, std::memory_order_release);
    header.running.store(1, std::memory_order_release);
    // A writer that waits for room sees that what it waits with is not wanted any more. Room is made when it has answered: what
    // it writes after that is not to be let go of.
    futex_wake(header.tail_futex);
    const auto until = Clock::now() + std::chrono::milliseconds(patience_ms);
    while (header.started.load(std::memory_order_acquire) != start) {
        const uint32_t seen = header.head_futex.load(std::memory_order_acquire);
        if (header.started.load(std::memory_order_acquire) == start) break;
        if (header.running.load(std::memory_order_acquire) == 0) return fail("the camera was stopped while it started");
        if (writer() != Writer::live)
            return fail("the camera is gone: the program that fills its ring has ended; start it again");
        if (Clock::now() > until)
            return fail(
                "the camera does not start: the program that fills its ring gives no answer; start that one again");
        futex_wait(header.head_futex, seen, 100);
    }
    header.tail.store(header.started_head.load(std::memory_order_relaxed), std::memory_order_release);
    futex_wake(header.tail_futex);
    return header.started_ns.load(std::memory_order_relaxed);
}

void RingReader::stop() {
    mapping_->header->running.store(0, std::memory_order_release);
    futex_wake(mapping_->header->tail_futex);
}

std::optional<Frame> RingReader::read(int timeout_ms) {
    RingHeader& header = *mapping_->header;
    if (!header.running.load(std::memory_order_acquire)) return std::nullopt;
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

bool RingReader::has_frames() const {
    const RingHeader& header = *mapping_->header;
    return header.running.load(std::memory_order_acquire) &&
           header.asked.load(std::memory_order_acquire) == header.started.load(std::memory_order_acquire) &&
           header.head.load(std::memory_order_acquire) != header.tail.load(std::memory_order_acquire);
}

RingReader::Writer RingReader::writer() const {
    // Both before the look into the ring: what was written before the end is seen in it.
    const bool closed = mapping_->header->closed.load(std::memory_order_acquire) != 0;
    const bool lives = is_taken(mapping_->fd, End::writer);
    if ((lives && !closed) || has_frames()) return Writer::live;
    return mapping_->header->closed.load(std::memory_order_acquire) ? Writer::closed : Writer::gone;
}

}  // namespace ols
