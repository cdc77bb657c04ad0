// SPDX-License-Identifier: MIT
// Fuzzes a camera ring: a file whose header is any bytes, or a good one with some bytes changed, whose words and records change
// between reads, and that is cut short at any of them. Opening, starting and reading end, without a signal; a frame that comes
// lies within its record.
// links: ols_device
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "device/ring.hpp"

using namespace ols;

namespace {

void expect(bool truth) {
    if (!truth) abort();
}

constexpr uint32_t slots = 4, stride = 320, file_bytes = sizeof(RingHeader) + slots * stride;

struct Script {
    const uint8_t* next;
    size_t left;

    uint8_t byte() {
        if (left == 0) return 0;
        left--;
        return *next++;
    }
    uint64_t word() {
        uint64_t word = 0;
        for (uint8_t n = byte() % 9; n > 0; n--) word = word << 8 | byte();
        return word;
    }
};

// The writer's end of the file, which is in memory and has no name but the descriptor's.
class RingFile {
  public:
    RingFile() : fd_(memfd_create("ring", MFD_CLOEXEC)), path_("/proc/self/fd/" + std::to_string(fd_)) {
        expect(fd_ >= 0);
        // Another opening of the file, for locks are an opening's.
        writer_ = ::open(path_.c_str(), O_RDWR | O_CLOEXEC);
        struct flock lock {};
        lock.l_type = F_WRLCK;
        lock.l_whence = SEEK_SET;
        lock.l_start = 1;
        lock.l_len = 1;
        expect(fcntl(writer_, F_OFD_SETLK, &lock) == 0);
    }
    ~RingFile() {
        ::close(fd_);
        ::close(writer_);
    }
    void put(size_t at, const void* bytes, size_t count) {
        expect(pwrite(writer_, bytes, count, off_t(at)) == ssize_t(count));
    }
    void cut(size_t bytes) { expect(ftruncate(writer_, off_t(bytes)) == 0); }
    const std::string& path() const { return path_; }

  private:
    int fd_, writer_ = -1;
    std::string path_;
};

void write_header(RingFile& file, Script& script) {
    RingHeader header{};
    header.layout = {ring_magic, slots, stride, {16, 8, PixelFormat::u16, Cfa::rggb, 12, 0}};
    header.started = 1;  // the answer to the first start
    auto* bytes = reinterpret_cast<uint8_t*>(&header);
    const uint8_t changes = script.byte() % 8;
    for (uint8_t n = 0; n < changes; n++) bytes[script.byte() % sizeof header] = script.byte();
    if (changes == 7)
        for (size_t n = 0; n < sizeof header; n++) bytes[n] = script.byte();
    file.cut(file_bytes);
    file.put(0, bytes, sizeof header);
    if (script.byte() % 16 == 0) file.cut(script.byte() * 8u);
}

void change(RingFile& file, Script& script) {
    const uint8_t how = script.byte();
    if (how % 8 == 7) return file.cut(size_t(script.byte()) * 8);
    if (how % 8 < 4) {  // a frame, and the count of it
        const uint64_t n = script.byte();
        RingFrame frame{0, 16, 8, PixelFormat::u16, Cfa::rggb, 32, n, 1000 * n, 0, 4095, 256, 0};
        auto* bytes = reinterpret_cast<uint8_t*>(&frame);
        for (uint8_t changes = how / 8 % 4; changes > 0; changes--) bytes[script.byte() % sizeof frame] = script.byte();
        file.put(sizeof(RingHeader) + n % slots * stride, &frame, sizeof frame);
        const uint64_t head = n + 1;
        return file.put(offsetof(RingHeader, head), &head, sizeof head);
    }
    const uint64_t word = script.word();
    file.put(script.byte() % (sizeof(RingHeader) / 4) * 4, &word, how % 8 == 4 ? 4 : 8);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Script script{data, size};
    RingFile file;
    write_header(file, script);
    auto reader = RingReader::open(file.path());
    if (!reader.ok()) return 0;
    const RingContent content = reader->content();
    expect(content.width > 0 && content.width <= ring_size_max && content.height > 0 &&
           content.height <= ring_size_max);
    for (int steps = 0; script.left > 0 && steps < 64; steps++) {
        if (steps % 16 == 0) (void)reader->start(0);
        change(file, script);
        const auto frame = reader->read(0);
        (void)reader->watermark_ns();
        (void)reader->dropped();
        if (reader->writer() == RingReader::Writer::broken) expect(!reader->problem().empty());
        if (!frame || frame->samples.empty()) continue;
        expect(frame->samples.size() <= 2 * (sizeof(RingFrame) + content.frame_bytes()) + 4096);
        expect(frame->samples.size() <= size_t(frame->pitch_bytes) * frame->height);
        expect(frame->width <= content.width && frame->height <= content.height && frame->format == content.format);
        expect(frame->pitch_bytes >= frame->width * 2u);
    }
    return 0;
}
