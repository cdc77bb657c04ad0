// SPDX-License-Identifier: MIT
// Counting, and comparing with the first.
#include "photographs/set_notes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

namespace ols {

namespace {

struct Note {
    std::string text, first;
    size_t count = 0;
};

void add(std::vector<Note>& notes, const std::string& text, const std::string& path) {
    const auto same = std::ranges::find(notes, text, &Note::text);
    if (same == notes.end())
        notes.push_back({text, path, 1});
    else
        ++same->count;
}

std::string line(const Note& note, size_t all) {
    const std::string who = all == 1 ? fmt::format("'{}'", note.first)
                            : note.count == all
                                ? fmt::format("all {} pictures", all)
                                : fmt::format("{} of {} pictures ('{}' the first)", note.count, all, note.first);
    return who + ": " + note.text;
}

bool differ(double a, double b) {
    return a > 0 && b > 0 && std::abs(std::log(a / b)) > 0.01;
}

std::vector<std::string> warnings(const std::vector<std::string>& paths, const std::vector<PictureFacts>& facts,
                                  const PictureOptions& options) {
    std::vector<std::string> warnings;
    const auto& first = facts.front().exposure;
    for (size_t i = 1; i < facts.size(); ++i) {
        const auto& exposure = facts[i].exposure;
        const char* what = differ(first.seconds, exposure.seconds)     ? "times of exposure"
                           : differ(first.f_number, exposure.f_number) ? "apertures"
                           : differ(first.iso, exposure.iso)           ? "sensitivities"
                                                                       : nullptr;
        if (!what) continue;
        warnings.push_back(
            fmt::format("warning: '{}' and '{}' have different {}: their light is not comparable; --intensities can "
                        "say by how much",
                        paths[0], paths[i], what));
        break;
    }
    const auto largest = std::ranges::max(facts, {}, &PictureFacts::largest_code);
    const int bits = std::bit_width(unsigned(largest.largest_code));
    if (options.full_scale == 0 && largest.last_code == 65535 && bits >= 9 && bits <= 14)
        warnings.push_back(
            fmt::format("warning: no 16-bit sample is above {:g}: if the camera has {} bits, say --full-scale {}",
                        largest.largest_code, bits, (1 << bits) - 1));
    return warnings;
}

}  // namespace

Result<std::vector<std::string>> check_set(const std::vector<std::string>& paths,
                                           const std::vector<PictureFacts>& facts, const PictureOptions& options) {
    std::vector<Note> notes;
    for (size_t i = 0; i < facts.size(); ++i) {
        const PictureFacts &fact = facts[i], &first = facts.front();
        if (options.turn && fact.orientation != first.orientation)
            return fail(fmt::format(
                "'{}' says it is turned or mirrored (orientation {}), '{}' says {}: a camera that looks up or down "
                "guesses; say --orientation ignore to take all as they lie, or correct the tags",
                paths[i], fact.orientation, paths[0], first.orientation));
        if (fact.cfa != first.cfa && (is_mosaic(fact.cfa) || is_mosaic(first.cfa)))
            return fail(
                fmt::format("'{}' and '{}' are mosaics of different filters: all pictures must be of one camera",
                            paths[0], paths[i]));
        if (fact.was_unlabelled)
            add(notes, "no colour space is said: taken as sRGB (--transfer says otherwise)", paths[i]);
        if (fact.orientation != 1)
            add(notes,
                options.turn ? fmt::format("turned or mirrored as the file says (orientation {})", fact.orientation)
                             : "orientation is left out",
                paths[i]);
        for (const auto& text : fact.said) add(notes, text, paths[i]);
    }
    std::vector<std::string> said;
    for (const auto& note : notes) said.push_back(line(note, facts.size()));
    for (auto& warning : warnings(paths, facts, options)) said.push_back(std::move(warning));
    return said;
}

}  // namespace ols
