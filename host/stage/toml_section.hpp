// SPDX-License-Identifier: MIT
// Strict reading of configuration files: every value is checked, every unknown key is an error, and every error names
// file, line and key, and for an unknown key the one that was meant.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "result.hpp"

namespace ols {

// A table of a TOML file. The read functions leave `value` as it is when the key is absent (so that the default stands)
// or wrong; the first thing that is wrong anywhere in the file is kept and returned by finish(). Every number is read with the
// range that it may have, both ends included: nothing outside of it, no NaN and no other type comes through.
class TomlSection {
  public:
    // Parses a file and returns its root table. Errors: no regular file, more than 4 MiB, nested deeper than toml_outline.hpp
    // allows, no TOML.
    static Result<TomlSection> open(const std::string& path);

    bool has(const std::string& key) const;
    void read(const std::string& key, double& value, double min, double max);
    void read(const std::string& key, int& value, int min, int max);
    void read(const std::string& key, int64_t& value, int64_t min, int64_t max);
    void read(const std::string& key, bool& value);
    void read(const std::string& key, std::string& value);  // of one line
    void read(const std::string& key, std::vector<int>& value, int min, int max);
    void read(const std::string& key, std::vector<std::string>& value);
    void read(const std::string& key, std::array<double, 3>& value, double min, double max);

    // A table of settings by names that are not ours, each a text, a number, true or false, as text.
    void read(const std::string& key, std::map<std::string, std::string>& value);

    // A vector of any length but zero.
    void read_direction(const std::string& key, std::array<double, 3>& value);

    // A word that stands for a value, such as the name of a colour filter layout.
    template <typename T>
    void read_choice(const std::string& key, T& value, const std::map<std::string, T>& choices) {
        std::string word, known;
        read(key, word);
        if (word.empty()) return;
        for (const auto& [name, choice] : choices) {
            if (name == word) {
                value = choice;
                return;
            }
            known += (known.empty() ? "" : ", ") + name;
        }
        reject(key, "is '" + word + "', which is none of: " + known);
    }

    // The table under `key`; an empty one when it is absent.
    TomlSection section(const std::string& key);

    // The tables of `[[key]]`, of which there may be so many; none when it is absent.
    std::vector<TomlSection> sections(const std::string& key, size_t most);

    // Notes that a value is wrong in a way the read functions cannot know: `what` follows "file:line: key ".
    void reject(const std::string& key, const std::string& what);

    // "stage.toml:12: daemon.quality": where a key stands, or its table where it is left out.
    std::string place(const std::string& key) const;

    // The first error of the whole file: a wrong value, or a key that nobody has read. Of such a key it says which
    // tables have it, or which of its own table's is nearest, of those that were asked for, or else all of these.
    Status finish() const;

    // A path of the file made relative to the file's own folder.
    std::string resolve_path(const std::string& path) const;

    static constexpr double direction_max = 1e6;  // of its coordinates

  private:
    struct File;
    TomlSection(std::shared_ptr<File> file, const void* table, std::string prefix);
    const void* find(const std::string& key);
    std::string describe_unread(const std::string& name) const;

    std::shared_ptr<File> file_;
    const void* table_;   // toml::table, kept out of this header: toml++ is slow to compile
    std::string prefix_;  // "camera.", for messages
};

}  // namespace ols
