// SPDX-License-Identifier: MIT
// Sharing of pairs by greedy choice, and places by a linear scan.
#include "demultiplex/sum_plan.hpp"

#include <algorithm>
#include <cassert>
#include <map>
#include <queue>
#include <unordered_map>

namespace ols {

namespace {

// A pair of values and whether their signs agree, as one number that orders pairs.
using PairKey = uint64_t;

PairKey pair_key(Term a, Term b) {
    if (a.value > b.value) std::swap(a, b);
    return uint64_t(a.value) << 33 | uint64_t(b.value) << 1 | (a.sign == b.sign);
}

Term first_of(PairKey key) {
    return {int(key >> 33), 1};
}

Term second_of(PairKey key) {
    return {int(key >> 1 & 0xffffffff), key & 1 ? 1 : -1};
}

// Sums that are being rewritten, with the count of every pair in them.
class PairSharing {
  public:
    explicit PairSharing(std::vector<Terms>& rows) : rows_(rows) {
        for (const Terms& row : rows_)
            for (size_t i = 0; i < row.size(); ++i)
                for (size_t k = 0; k < i; ++k) count(row[i], row[k], 1);
    }

    // The most frequent pair, the lowest key of several; its count. Counts that have fallen since are put back in order.
    std::pair<PairKey, int> most_frequent() {
        while (!queue_.empty()) {
            const auto [uses, reversed] = queue_.top();
            const PairKey key = ~reversed;
            const int now = counts_[key];
            if (now == uses) return {key, uses};
            queue_.pop();
            if (now > 0) queue_.emplace(now, ~key);
        }
        return {0, 0};
    }

    // Replaces the pair by `value`, the sum of its first value and its second with its sign, wherever it occurs.
    void replace(PairKey key, int value) {
        const Term first = first_of(key), second = second_of(key);
        for (Terms& row : rows_) {
            const auto a = find(row, first.value), b = find(row, second.value);
            if (a == row.end() || b == row.end() || pair_key(*a, *b) != key) continue;
            const Term kept = {value, a->sign}, gone[2] = {*a, *b};
            std::erase_if(row, [&](Term t) { return t.value == first.value || t.value == second.value; });
            for (const Term other : row) {
                for (const Term term : gone) count(other, term, -1);
                count(other, kept, 1);
            }
            counts_[key]--;
            row.push_back(kept);
        }
    }

  private:
    static Terms::iterator find(Terms& row, int value) {
        return std::find_if(row.begin(), row.end(), [&](Term t) { return t.value == value; });
    }

    void count(Term a, Term b, int change) {
        const PairKey key = pair_key(a, b);
        const int now = counts_[key] += change;
        if (change > 0) queue_.emplace(now, ~key);
    }

    std::vector<Terms>& rows_;
    std::unordered_map<PairKey, int> counts_;
    std::priority_queue<std::pair<int, PairKey>> queue_;
};

}  // namespace

int SumPlan::sum(const Terms& terms) {
    assert(!terms.empty());
    if (terms.size() == 1 && terms[0].sign > 0) return terms[0].value;
    sums_.push_back(terms);
    return values() - 1;
}

std::vector<int> SumPlan::sums(std::vector<Terms> rows, int uses_min) {
    PairSharing sharing(rows);
    for (;;) {
        const auto [key, uses] = sharing.most_frequent();
        if (uses < uses_min) break;
        sharing.replace(key, sum({first_of(key), second_of(key)}));
    }
    std::vector<int> numbers;
    for (const Terms& row : rows) numbers.push_back(sum(row));
    return numbers;
}

std::vector<int> SumPlan::append(const SumPlan& part, const std::vector<int>& inputs) {
    assert(int(inputs.size()) == part.inputs());
    std::vector<int> numbers = inputs;
    for (Terms terms : part.all_sums()) {
        for (Term& term : terms) term.value = numbers[size_t(term.value)];
        numbers.push_back(sum(terms));
    }
    std::vector<int> outputs;
    for (const int value : part.outputs()) outputs.push_back(numbers[size_t(value)]);
    return outputs;
}

int SumPlan::additions() const {
    size_t additions = 0;
    for (const Terms& terms : sums_) additions += terms.size() - 1;
    return int(additions);
}

std::vector<std::vector<int>> SumPlan::matrix() const {
    std::vector<std::vector<int>> weights(values(), std::vector<int>(inputs_));
    for (int n = 0; n < inputs_; ++n) weights[n][n] = 1;
    for (size_t s = 0; s < sums_.size(); ++s)
        for (const Term term : sums_[s])
            for (int n = 0; n < inputs_; ++n) weights[inputs_ + s][n] += term.sign * weights[term.value][n];
    std::vector<std::vector<int>> rows;
    for (const int value : outputs_) rows.push_back(weights[value]);
    return rows;
}

SumCode lay_out(const SumPlan& plan, const std::vector<int>& kept) {
    const auto& sums = plan.all_sums();
    constexpr size_t always = SIZE_MAX;
    std::vector<size_t> last_use(plan.values(), 0);
    for (size_t s = 0; s < sums.size(); ++s)
        for (const Term term : sums[s]) last_use[term.value] = s;
    for (const int value : plan.outputs()) last_use[value] = always;
    for (const int input : kept) last_use[input] = always;

    SumCode out;
    std::vector<uint16_t> place(plan.values());
    for (int n = 0; n < plan.inputs(); ++n) place[n] = uint16_t(n);
    out.places = plan.inputs();
    out.zero_place = uint16_t(out.places++);
    std::vector<uint16_t> free;
    for (size_t s = 0; s < sums.size(); ++s) {
        // A sum is kept in registers until it is complete, so it may take the place of one of its terms.
        Terms terms = sums[s];
        std::stable_sort(terms.begin(), terms.end(), [](Term a, Term b) { return a.sign > b.sign; });
        const size_t plus = size_t(std::count_if(terms.begin(), terms.end(), [](Term t) { return t.sign > 0; }));
        std::vector<uint16_t> sources;
        if (plus == 0) sources.push_back(out.zero_place);
        for (const Term term : terms) {
            sources.push_back(place[term.value]);
            if (last_use[term.value] == s) free.push_back(place[term.value]);
        }
        if (free.empty()) free.push_back(uint16_t(out.places++));
        const size_t value = size_t(plan.inputs()) + s;
        place[value] = free.back();
        free.pop_back();
        out.code.insert(out.code.end(),
                        {place[value], uint16_t(std::max<size_t>(plus, 1)), uint16_t(terms.size() - plus)});
        out.code.insert(out.code.end(), sources.begin(), sources.end());
    }
    for (const int value : plan.outputs()) out.outputs.push_back(place[value]);
    return out;
}

}  // namespace ols
