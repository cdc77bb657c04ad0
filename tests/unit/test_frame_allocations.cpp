// SPDX-License-Identifier: MIT
// What a frame costs in allocations on its way from the camera to its slot: none of the size of its samples, and few small ones.
// links: ols_take
#include <gtest/gtest.h>

#include <cstdlib>
#include <new>

#include "played_take.hpp"

using namespace ols;
using namespace ols::test;

namespace {

std::atomic<bool> is_counted = false;
std::atomic<uint64_t> small = 0, large = 0;
constexpr size_t large_bytes = 512;  // a frame of 16 x 16

void* allocate(size_t bytes, size_t alignment = alignof(std::max_align_t)) {
    if (is_counted) ++(bytes >= large_bytes ? large : small);
    if (void* const memory = std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment))
        return memory;
    throw std::bad_alloc();
}

}  // namespace

[[gnu::noinline]] void* operator new(size_t bytes) {
    return allocate(bytes);
}
[[gnu::noinline]] void* operator new(size_t bytes, std::align_val_t alignment) {
    return allocate(bytes, size_t(alignment));
}
[[gnu::noinline]] void operator delete(void* memory) noexcept {
    std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, size_t) noexcept {
    std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept {
    std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, size_t, std::align_val_t) noexcept {
    std::free(memory);
}

TEST(FrameAllocations, no_frame_takes_memory_for_its_samples_and_few_pieces_beside) {
    PlayedTake take("single", 20);
    const uint64_t cycle = take.description.sequence.slots.size(), total = take.description.sequence.trigger_count();
    uint64_t frames = 0;
    RecordSink sink;
    sink.frame = [&](const std::shared_ptr<const Frame>&) {
        ++frames;
        if (frames == 4 * cycle) is_counted = true;  // all containers have their size
        if (frames == total - cycle) is_counted = false;
    };
    sink.missing = [](const MissingSlot&) {};
    sink.progress = [](uint64_t, uint64_t) {};
    take.camera.play(take.model);
    const auto report = record_take(take.board, {{take.camera, 0, std::nullopt, sink}}, take.description.sequence,
                                    take.description.stage, take.stop);
    take.camera.end();
    ASSERT_TRUE(report.ok()) << report.error().message;
    ASSERT_EQ(report->missing().total(), 0u);
    const double counted = double(total - 5 * cycle);
    RecordProperty("small_allocations_a_frame", std::to_string(double(small) / counted));
    std::printf("%.1f small and %.3f larger allocations a frame\n", double(small) / counted, double(large) / counted);
    // Larger ones are blocks of queues (a hundred events each), and tables that grow with the take.
    EXPECT_LT(double(large) / counted, 1.5);
    EXPECT_LT(double(small) / counted, 40);
}
