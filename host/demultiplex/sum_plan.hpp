// SPDX-License-Identifier: MIT
// Sum plan: a transform with small integer weights as a list of sums and differences, shared where several outputs need
// the same. How many additions a plan takes is known before it runs, and what it computes can be read back as a matrix.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace ols {

// One term of a sum: a value with its sign, +1 or -1.
struct Term {
    int value;
    int sign;
};

using Terms = std::vector<Term>;

// Values are numbered: first the inputs, then each sum in the order in which it was added.
class SumPlan {
  public:
    explicit SumPlan(int inputs) : inputs_(inputs) {}

    int inputs() const { return inputs_; }
    int values() const { return inputs_ + int(sums_.size()); }

    // Adds a sum of values that are there already; returns its number. A sum of one positive term is that value.
    int sum(const Terms& terms);

    // Adds many sums at once, sharing pairs: as long as some pair of terms (up to its common sign) occurs in at least
    // `uses_min` of them, the most frequent pair becomes a sum of its own (C. Paar, "Optimized arithmetic for
    // Reed-Solomon encoders", 1997). Returns their numbers.
    std::vector<int> sums(std::vector<Terms> rows, int uses_min = 2);

    // Adds all sums of `part`, which takes the values `inputs` for its inputs; returns the numbers of its outputs.
    std::vector<int> append(const SumPlan& part, const std::vector<int>& inputs);

    void add_output(int value) { outputs_.push_back(value); }
    const std::vector<int>& outputs() const { return outputs_; }

    int additions() const;

    // Row i holds the weights of output i over the inputs, found by playing the plan on unit vectors.
    std::vector<std::vector<int>> matrix() const;

    const std::vector<Terms>& all_sums() const { return sums_; }

  private:
    int inputs_;
    std::vector<Terms> sums_;
    std::vector<int> outputs_;
};

// A plan laid out for running: values share places when they are not needed at the same time.
struct SumCode {
    int places = 0;                 // vectors of scratch
    std::vector<uint16_t> code;     // for each sum: place, count of plus terms, count of minus terms, their places
    std::vector<uint16_t> outputs;  // places; they hold until the end
    uint16_t zero_place = 0;        // holds zeros, for sums without a plus term
};

// The inputs have places 0..inputs - 1 at the begin; those of `kept` to the end.
SumCode lay_out(const SumPlan& plan, const std::vector<int>& kept = {});

}  // namespace ols
