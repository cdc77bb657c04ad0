// SPDX-License-Identifier: MIT
// Values beyond 65504 have no half: stored as Inf they turn a pixel of every relit picture to Inf or NaN.
// links: ols_archive
#include <half.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "archive/archive.hpp"
#include "hard_case.hpp"

using namespace ols;

namespace {

constexpr float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
constexpr float beyond[] = {65520, -65520, 1e9f, 3.4e38f, inf, -inf, nan};  // 65520 is the first that rounds to Inf
constexpr float largest_half = 65504;

// One lamp that overflows and one that does not, a pixel a value.
Target overflowing_target() {
    Target target;
    target.width = std::size(beyond), target.height = 1;
    target.lamps = {{std::begin(beyond), std::end(beyond)}, Plane(std::size(beyond), 0.5f)};
    target.mask.resize(std::size(beyond));
    return target;
}

Target through_archive(const Target& target) {
    const auto path = std::filesystem::temp_directory_path() / "stability_half_overflow.rfa";
    TakeInfo info;
    info.lights = named_lamps({{0, 1, 0}, {0, 0, 1}});
    info.value_unit = "reflectance";
    auto writer = ArchiveWriter::create(path, info, true);
    EXPECT_TRUE(writer.ok() && writer->write_target(target).ok() && writer->finish().ok());
    const auto back = ArchiveReader::open(path)->read_target(0, 0);
    std::filesystem::remove_all(path);
    return *back;
}

// Pixels of a picture under the second lamp alone that are not finite.
int poisoned(const std::vector<Plane>& lamps) {
    constexpr float weights[] = {0, 1};
    int count = 0;
    for (size_t p = 0; p < lamps[0].size(); ++p)
        count += !std::isfinite(weights[0] * lamps[0][p] + weights[1] * lamps[1][p]);
    return count;
}

}  // namespace

// Bound: no pixel. What does not fit is the largest half, or 0 for NaN, and marked, so that every sum is finite.
TEST(HalfOverflow, is_clamped_and_marked_when_an_archive_is_written) {
    const Target target = overflowing_target(), back = through_archive(target);
    auto naive = target.lamps;
    for (float& value : naive[0]) value = half(value);
    for (size_t p = 0; p < std::size(beyond); ++p) {
        EXPECT_EQ(back.mask[p], uint32_t(mask_clamped));
        const float expected = std::isnan(beyond[p]) ? 0 : std::copysign(largest_half, beyond[p]);
        EXPECT_EQ(back.lamps[0][p], expected);
        EXPECT_EQ(back.lamps[1][p], 0.5f);
    }
    expect_within("half overflow, NaN and Inf on archive write: poisoned pixels of 7, relit without that lamp",
                  poisoned(naive), poisoned(back.lamps), 0, "pixels");
}
