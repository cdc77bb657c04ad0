// SPDX-License-Identifier: MIT
// Prints every codelet (hadamard_codelets.hpp) as a C++ function on Highway's vectors: one statement a sum, so that the
// compiler keeps in registers what it can.
#include <cstdio>
#include <string>

#include "reflectance/hadamard_codelets.hpp"

namespace {

std::string expression(const ols::Terms& terms) {
    std::string text;
    for (const bool positive : {true, false})
        for (const ols::Term term : terms) {
            if ((term.sign > 0) != positive) continue;
            const std::string value = "v" + std::to_string(term.value);
            if (text.empty())
                text = positive ? value : "hn::Neg(" + value + ")";
            else
                text = (positive ? "hn::Add(" : "hn::Sub(") + text + ", " + value + ")";
        }
    return text;
}

void print_codelet(ols::Codelet codelet) {
    const ols::SumPlan& plan = ols::codelet_plan(codelet);
    std::printf("// %d to %zu values by %d additions.\n", plan.inputs(), plan.outputs().size(), plan.additions());
    std::printf("HWY_NOINLINE void %s(const int16_t* HWY_RESTRICT from, int16_t* HWY_RESTRICT to) {\n",
                ols::codelet_name(codelet));
    std::printf("const hn::CappedTag<int16_t, tile_samples> d;\n");
    std::printf(
        "for (const int16_t* const end = from + tile_samples; from < end; from += hn::Lanes(d), to += "
        "hn::Lanes(d)) {\n");
    int value = 0;
    for (; value < plan.inputs(); ++value)
        std::printf("[[maybe_unused]] const auto v%d = hn::Load(d, from + %d * tile_samples);\n", value, value);
    for (const ols::Terms& terms : plan.all_sums())
        std::printf("const auto v%d = %s;\n", value++, expression(terms).c_str());
    for (size_t k = 0; k < plan.outputs().size(); ++k)
        std::printf("hn::Store(v%d, d, to + %zu * tile_samples);\n", plan.outputs()[k], k);
    std::printf("}\n}\n\n");
}

}  // namespace

int main() {
    for (const ols::Codelet codelet : ols::codelets) print_codelet(codelet);
}
