// SPDX-License-Identifier: MIT
// Counts by bit, and one table of what the bits are called.
#include "mask_counts.hpp"

#include <fmt/format.h>

#include <bit>

#include "image/target.hpp"

namespace ols {

namespace {

struct MaskKind {
    MaskBit bit;
    const char* name;
    const char* warning;  // empty: others made up for what was left out, or it was asked for
};

constexpr MaskKind mask_kinds[] = {
    {mask_saturated, "saturated", ""},
    {mask_missing, "missing", ""},
    {mask_outside, "outside", ""},
    {mask_clamped, "clamped", "had values that were no numbers or beyond what the archive holds"},
    {mask_estimated, "estimated", "are estimates: their samples did not determine them"},
    {mask_unsolved, "unsolved",
     "are not solved and are 0: too few samples were left; record with --estimate, or with a shorter exposure where "
     "they "
     "saturate"},
    {mask_misaligned, "misaligned", "may be wrong: motion compensation failed there"},
};

}  // namespace

void MaskCounts::add(const std::vector<uint32_t>& mask) {
    pixels_ += mask.size();
    for (uint32_t bits : mask)
        for (; bits != 0; bits &= bits - 1) ++counts_[std::countr_zero(bits)];
}

std::vector<std::string> MaskCounts::warnings() const {
    std::vector<std::string> lines;
    for (const MaskKind& kind : mask_kinds)
        if (const size_t count = counts_[std::countr_zero(uint32_t(kind.bit))]; count > 0 && *kind.warning)
            lines.push_back(fmt::format("{} of {} pixels ({:.2g} %) {}", count, pixels_,
                                        100 * double(count) / double(pixels_), kind.warning));
    return lines;
}

nlohmann::json MaskCounts::report() const {
    nlohmann::json report = {{"pixels", pixels_}};
    for (const MaskKind& kind : mask_kinds) report[kind.name] = counts_[std::countr_zero(uint32_t(kind.bit))];
    return report;
}

}  // namespace ols
