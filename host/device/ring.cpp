// SPDX-License-Identifier: MIT
// The two ends of the shared-memory ring; waiting is by futex on words inside the mapping.
#include "device/ring.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <climits>
#include <cmath>
#include <cstring>
#include <ctime>

#include "device/guarded_mapping.hpp"
#include "image/whole_file.hpp"

namespace ols {

namespace {

using Clock = std::chrono::steady_clock;

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

// Whether a frame's samples can be where its RingFrame says.
bool is_sound(const RingFrame& frame, const RingLayout& layout) {
    const RingContent& content = layout.content;
    const uint64_t bytes = sample_bytes(frame.format);
    const uint64_t row_bytes = frame.width * uint64_t(samples_per_pixel(frame.cfa)) * bytes;
    return frame.format == content.format && frame.cfa == content.cfa && frame.width <= content.width &&
           frame.height <= content.height && frame.pitch_bytes >= row_bytes && frame.pitch_bytes % bytes == 0 &&
           uint64_t(frame.pitch_bytes) * frame.height <= frame.bytes &&
           frame.bytes <= layout.stride - sizeof(RingFrame) && std::isfinite(frame.black) &&
           std::isfinite(frame.white) && frame.black < frame.white;
}

}  // namespace

// A ring that another release has made, or somebody else.
std::string ring_defect(const RingLayout& layout, uint64_t file_bytes) {
    const RingContent& content = layout.content;
    if (layout.magic != ring_magic) return "it does not begin as one of this version does";
    if (layout.slots == 0 || layout.slots > ring_slots_max)
        return fmt::format("it says that it has {} slots, and 1 to {} can be", layout.slots, ring_slots_max);
    if (content.width == 0 || content.width > ring_size_max || content.height == 0 || content.height > ring_size_max)
        return fmt::format("its frames are {} x {} pixels, and 1 to {} a side can be", content.width, content.height,
                           ring_size_max);
    if (content.format != PixelFormat::u16 && content.format != PixelFormat::f32)
        return fmt::format("it says that its samples are of format {}", uint32_t(content.format));
    if (content.cfa > Cfa::rgb) return fmt::format("it says that its colour filter is {}", uint32_t(content.cfa));
    if (content.format == PixelFormat::u16 && (content.bits == 0 || content.bits > 16))
        return fmt::format("it says that its samples have {} bits", content.bits);
    const uint64_t least = sizeof(RingFrame) + content.frame_bytes();
    if (layout.stride % 64 != 0 || layout.stride < least || layout.stride > 2 * least + 4096)
        return fmt::format("its records are {} bytes, and a frame of {} x {} pixels takes {}", layout.stride,
                           content.width, content.height, least);
    const uint64_t bytes = sizeof(RingHeader) + uint64_t(layout.slots) * layout.stride;
    if (bytes > file_bytes)
        return fmt::format("its {} slots of {} bytes take {} bytes, and the file has {}", layout.slots, layout.stride,
                           bytes, file_bytes);
    return "";
}

// An end's own: the layout is not read from the shared memory again.
struct RingMapping {
    GuardedMapping memory;
    RingLayout layout;
    int fd = -1;

    RingHeader& header() const { return *reinterpret_cast<RingHeader*>(memory.data()); }
    std::byte* record(uint64_t n) const {
        return memory.data() + sizeof(RingHeader) + size_t(n % layout.slots) * layout.stride;
    }
    ~RingMapping() {
        memory = {};
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
    mapping->layout.slots = slots;
    mapping->layout.stride = uint32_t(stride);
    mapping->layout.content = content;
    const uint64_t bytes = sizeof(RingHeader) + slots * stride;

    // A reader never sees a half-made header.
    const Status made = write_whole_file(path, [&](const std::string& temporary) -> Status {
        mapping->fd = ::open(temporary.c_str(), O_RDWR | O_CLOEXEC);
        if (mapping->fd < 0 || fchmod(mapping->fd, 0600) != 0)
            return fail("cannot make ring '" + path + "': " + std::strerror(errno));
        if (!take_place(mapping->fd, End::writer))
            return fail("cannot lock ring '" + path + "': " + std::strerror(errno) + "; choose a local file system");
        if (posix_fallocate(mapping->fd, 0, off_t(bytes)) == 0) mapping->memory = GuardedMapping(mapping->fd, bytes);
        if (!mapping->memory.data())
            return fail("cannot reserve " + std::to_string(bytes >> 20) + " MiB for ring '" + path +
                        "': free space there or choose fewer slots");
        new (mapping->memory.data()) RingHeader{};
        mapping->header().layout = mapping->layout;
        return Done{};
    });
    if (!made) return made.error();
    return RingWriter(std::move(mapping));
}

std::optional<uint32_t> RingWriter::start_asked() const {
    const RingHeader& header = mapping_->header();
    const uint32_t asked = header.asked.load(std::memory_order_acquire);
    const bool is_open = header.running.load(std::memory_order_acquire) &&
                         asked != header.started.load(std::memory_order_relaxed) && is_taken(mapping_->fd, End::reader);
    return is_open ? std::optional(asked) : std::nullopt;
}

void RingWriter::confirm_start(uint32_t start, uint64_t camera_time_ns) {
    RingHeader& header = mapping_->header();
    header.started_ns.store(camera_time_ns, std::memory_order_relaxed);
    header.started_head.store(header.head.load(std::memory_order_relaxed), std::memory_order_relaxed);
    header.started.store(start, std::memory_order_release);
    futex_wake(header.head_futex);
}

bool RingWriter::wanted() const {
    const RingHeader& header = mapping_->header();
    return header.running.load(std::memory_order_acquire) &&
           header.asked.load(std::memory_order_acquire) == header.started.load(std::memory_order_relaxed) &&
           is_taken(mapping_->fd, End::reader);
}

RingWriter::Outcome RingWriter::write(const Frame& frame, bool wait, const std::atomic<bool>& cancelled) {
    RingHeader& header = mapping_->header();
    const uint64_t head = header.head.load(std::memory_order_relaxed);
    assert(sizeof(RingFrame) + frame.samples.size() <= mapping_->layout.stride);
    for (;;) {
        const uint32_t seen = header.tail_futex.load(std::memory_order_acquire);
        if (!wanted()) return Outcome::unwanted;
        if (head - header.tail.load(std::memory_order_acquire) < mapping_->layout.slots) break;
        if (!wait) {
            header.dropped.fetch_add(1, std::memory_order_release);  // who sees it sees the head before it
            return Outcome::full;
        }
        if (cancelled.load()) return Outcome::cancelled;
        futex_wait(header.tail_futex, seen, 100);
    }
    const RingFrame meta{
        frame.camera, frame.width,       frame.height,         frame.format,
        frame.cfa,    frame.pitch_bytes, frame.stamp.frame_id, frame.stamp.timestamp_ns,
        frame.black,  frame.white,       frame.samples.size(), header.dropped.load(std::memory_order_relaxed)};
    std::byte* record = mapping_->record(head);
    std::memcpy(record, &meta, sizeof meta);
    std::memcpy(record + sizeof meta, frame.samples.data(), frame.samples.size());
    header.head.store(head + 1, std::memory_order_release);
    futex_wake(header.head_futex);
    return Outcome::written;
}

void RingWriter::set_watermark(uint64_t camera_time_ns) {
    mapping_->header().watermark_ns.store(camera_time_ns, std::memory_order_release);
    futex_wake(mapping_->header().head_futex);
}

void RingWriter::close() {
    mapping_->header().closed.store(1, std::memory_order_release);
    futex_wake(mapping_->header().head_futex);
}

// What the reader keeps to itself.
struct RingReader::State {
    // Seen by an access, or by the file's size where nothing has been accessed since.
    bool is_cut() const {
        struct stat info {};
        return mapping.memory.cut() || fstat(mapping.fd, &info) != 0 || size_t(info.st_size) < mapping.memory.size();
    }

    RingMapping mapping;
    std::atomic<uint64_t> tail = 0;
    std::atomic<uint64_t> dropped = 0;  // before the last frame that was read
    std::atomic<bool> wanted = false;   // from a start, answered or not, to the stop
    std::atomic<bool> running = false;  // from the answer to a start to the stop
    std::atomic<bool> closed = false;   // the writer has said so once
    std::atomic<const char*> problem = nullptr;
};

RingReader::RingReader(std::unique_ptr<State> state) : state_(std::move(state)) {}
RingReader::RingReader(RingReader&&) noexcept = default;
RingReader& RingReader::operator=(RingReader&&) noexcept = default;
RingReader::~RingReader() {
    if (state_) stop();
}

Result<RingReader> RingReader::open(const std::string& path) {
    auto state = std::make_unique<State>();
    RingMapping& mapping = state->mapping;
    // Not to wait for the other end of a pipe.
    mapping.fd = ::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK);
    if (mapping.fd < 0)
        return fail("cannot open camera ring '" + path + "': " + std::strerror(errno) + "; start the camera first");
    const auto no_ring = [&](const std::string& why) {
        return fail("'" + path + "' is no camera ring: " + why + "; restart the camera program of this release");
    };
    struct stat info {};
    if (fstat(mapping.fd, &info) != 0 || !S_ISREG(info.st_mode)) return no_ring("it is no file");
    if (pread(mapping.fd, &mapping.layout, sizeof mapping.layout, 0) != ssize_t(sizeof mapping.layout) ||
        size_t(info.st_size) < sizeof(RingHeader))
        return no_ring("it is too small");
    if (const std::string defect = ring_defect(mapping.layout, uint64_t(info.st_size)); !defect.empty())
        return no_ring(defect);
    mapping.memory =
        GuardedMapping(mapping.fd, sizeof(RingHeader) + size_t(mapping.layout.slots) * mapping.layout.stride);
    if (!mapping.memory.data()) return no_ring(std::string("it cannot be mapped: ") + std::strerror(errno));
    if (!take_place(mapping.fd, End::reader))
        return fail("the camera at '" + path + "' is busy: another program reads it; end that one first");
    RingHeader& header = mapping.header();
    if (header.closed.load(std::memory_order_acquire) || !is_taken(mapping.fd, End::writer))
        return fail("nothing fills the camera ring '" + path + "' any more: start the camera again");
    header.running.store(0, std::memory_order_release);  // a reader that was killed left it as it was
    return RingReader(std::move(state));
}

const RingContent& RingReader::content() const {
    return state_->mapping.layout.content;
}

uint32_t RingReader::slots() const {
    return state_->mapping.layout.slots;
}

Result<uint64_t> RingReader::start(int patience_ms) {
    RingHeader& header = state_->mapping.header();
    state_->running = false;
    state_->wanted = true;
    header.running.store(0, std::memory_order_release);
    state_->dropped = header.dropped.load(std::memory_order_acquire);  // these are of an earlier take
    const uint32_t start = header.asked.load(std::memory_order_relaxed) + 1;
    const uint32_t answered_before = header.started.load(std::memory_order_acquire);
    header.asked.store(start, std::memory_order_release);
    header.running.store(1, std::memory_order_release);
    // A writer that waits for room sees that what it waits with is not wanted any more. Room is made when it has answered: what
    // it writes after that is not to be let go of.
    futex_wake(header.tail_futex);
    const auto until = Clock::now() + std::chrono::milliseconds(patience_ms);
    for (;;) {
        const uint32_t seen = header.head_futex.load(std::memory_order_acquire);
        if (!state_->wanted) return fail("the camera was stopped while it started");
        const uint32_t answered = header.started.load(std::memory_order_acquire);
        if (answered == start) break;
        // An answer to an earlier start may come late.
        if (start - answered > start - answered_before) state_->problem = "it answers a start that was not asked for";
        const Writer now = writer();
        if (now == Writer::broken)
            return fail("the camera's ring is broken, " + problem() + ": start the program that fills it again");
        if (now != Writer::live)
            return fail("the camera is gone: the program that fills its ring has ended; start it again");
        if (Clock::now() > until)
            return fail(
                "the camera does not start: the program that fills its ring gives no answer; start that one again");
        futex_wait(header.head_futex, seen, 100);
    }
    state_->tail = header.started_head.load(std::memory_order_relaxed);
    (void)frames_waiting();
    if (state_->problem)
        return fail("the camera's ring is broken, " + problem() + ": start the program that fills it again");
    header.tail.store(state_->tail, std::memory_order_release);
    state_->running = true;
    if (!state_->wanted) stop();  // it came meanwhile
    futex_wake(header.tail_futex);
    return header.started_ns.load(std::memory_order_relaxed);
}

void RingReader::stop() {
    state_->wanted = state_->running = false;
    state_->mapping.header().running.store(0, std::memory_order_release);
    futex_wake(state_->mapping.header().tail_futex);
}

// Frames between the reader's count and the writer's, which can be as many as there are slots. For the thread that reads: to
// another one the counts are of two moments.
uint64_t RingReader::frames_waiting() const {
    const RingMapping& mapping = state_->mapping;
    const uint64_t waiting = mapping.header().head.load(std::memory_order_acquire) - state_->tail;
    if (mapping.memory.cut())
        state_->problem = "its file was cut short";
    else if (waiting > mapping.layout.slots)
        state_->problem = "its count of frames jumped";
    return state_->problem ? 0 : waiting;
}

void RingReader::copy_as_they_are(const std::byte* samples, Frame& frame) {
    frame.samples.assign(samples, samples + size_t(frame.pitch_bytes) * frame.height);
}

std::optional<Frame> RingReader::read(int timeout_ms, const CopyRows& copy_rows) {
    RingHeader& header = state_->mapping.header();
    const auto until = Clock::now() + std::chrono::milliseconds(timeout_ms);
    while (state_->running && !state_->problem) {
        const uint32_t seen = header.head_futex.load(std::memory_order_acquire);
        if (frames_waiting() > 0) {
            Frame frame = take_frame(copy_rows);
            if (state_->mapping.memory.cut() || state_->problem) return std::nullopt;
            return frame;
        }
        const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()).count();
        if (left <= 0 || header.closed.load(std::memory_order_acquire)) return std::nullopt;
        futex_wait(header.head_futex, seen, int(left));
    }
    return std::nullopt;
}

Frame RingReader::take_frame(const CopyRows& copy_rows) {
    const RingMapping& mapping = state_->mapping;
    const std::byte* record = mapping.record(state_->tail);
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
    if (is_sound(meta, mapping.layout)) copy_rows(record + sizeof meta, frame);
    note_drops(meta.dropped_before);
    ++state_->tail;
    mapping.header().tail.store(state_->tail, std::memory_order_release);
    futex_wake(mapping.header().tail_futex);
    return frame;
}

// A count that the writer alone knows; what it says of it at one place must agree with the other.
void RingReader::note_drops(uint64_t before_frame) {
    const uint64_t all = state_->mapping.header().dropped.load(std::memory_order_acquire);
    if (before_frame < state_->dropped || before_frame > all)
        state_->problem = "its counts of dropped frames contradict each other";
    else
        state_->dropped = before_frame;
}

uint64_t RingReader::watermark_ns() const {
    return state_->mapping.header().watermark_ns.load(std::memory_order_acquire);
}

uint64_t RingReader::dropped() const {
    const RingHeader& header = state_->mapping.header();
    const uint64_t all = header.dropped.load(std::memory_order_acquire);
    const bool has_read_all = header.head.load(std::memory_order_acquire) == state_->tail;
    // Another thread may raise it meanwhile; it never falls.
    uint64_t known = state_->dropped;
    while (has_read_all && known < all && !state_->dropped.compare_exchange_weak(known, all)) {
    }
    return has_read_all ? std::max(known, all) : known;
}

RingReader::Writer RingReader::writer() const {
    // Both before the look into the ring: what was written before the end is seen in it.
    if (state_->mapping.header().closed.load(std::memory_order_acquire)) state_->closed = true;
    const bool closed = state_->closed, lives = is_taken(state_->mapping.fd, End::writer);
    const bool has_frames =
        state_->running && state_->mapping.header().head.load(std::memory_order_acquire) != state_->tail;
    if (state_->is_cut()) state_->problem = "its file was cut short";
    if (state_->problem) return Writer::broken;
    if ((lives && !closed) || has_frames) return Writer::live;
    return state_->closed || state_->mapping.header().closed.load(std::memory_order_acquire) ? Writer::closed
                                                                                             : Writer::gone;
}

std::string RingReader::problem() const {
    const char* const problem = state_->problem;
    return problem ? problem : "";
}

}  // namespace ols
