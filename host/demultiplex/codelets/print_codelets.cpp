// SPDX-License-Identifier: MIT
// Prints every codelet (hadamard_codelets.hpp) as a C++ function: one statement a sum, so that the compiler keeps in
// registers what it can.
#include <cstdio>
#include <string>

#include "demultiplex/hadamard_codelets.hpp"

namespace {

std::string expression(const ols::Terms& terms) {
    std::string text;
    for (const bool positive : {true, false})  // a leading minus would cost a negation
        for (const ols::Term term : terms)
            if ((term.sign > 0) == positive)
                text += (positive ? text.empty() ? "" : " + " : " - ") + ("v" + std::to_string(term.value));
    return text;
}

void print_codelet(ols::Codelet codelet) {
    const ols::SumPlan& plan = ols::codelet_plan(codelet);
    std::printf("// %d to %zu values by %d additions.\n", plan.inputs(), plan.outputs().size(), plan.additions());
    std::printf("HWY_NOINLINE void %s(const int16_t* HWY_RESTRICT from, int16_t* HWY_RESTRICT to) {\n",
                ols::codelet_name(codelet));
    std::printf("for (size_t i = 0; i < tile_samples; i += sizeof(ShortLanes) / sizeof(int16_t)) {\n");
    int value = 0;
    for (; value < plan.inputs(); ++value)
        std::printf("[[maybe_unused]] const ShortLanes v%d = at(from + i, %d);\n", value, value);
    for (const ols::Terms& terms : plan.all_sums())
        std::printf("const ShortLanes v%d = %s;\n", value++, expression(terms).c_str());
    for (size_t k = 0; k < plan.outputs().size(); ++k) std::printf("at(to + i, %zu) = v%d;\n", k, plan.outputs()[k]);
    std::printf("}\n}\n\n");
}

}  // namespace

int main() {
    for (const ols::Codelet codelet : ols::codelets) print_codelet(codelet);
}
