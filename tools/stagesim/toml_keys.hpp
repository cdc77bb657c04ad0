// SPDX-License-Identifier: MIT
// Typed reading of one TOML table that remembers the first mistake and which keys nobody asked for.
#pragma once

#include <toml++/toml.h>

#include <set>
#include <string>

#include "stage/lamps.hpp"

namespace ols {

class TomlKeys {
  public:
    // `what` is the table's name in messages; `error` collects the first message of a whole file.
    TomlKeys(const toml::table& table, std::string what, std::string file, std::string& error)
        : table_(table), what_(std::move(what)), file_(std::move(file)), error_(error) {}

    double number(const std::string& key, double otherwise, double low, double high);
    std::string text(const std::string& key, const std::string& otherwise);
    bool flag(const std::string& key, bool otherwise);
    Vec3 triple(const std::string& key, Vec3 otherwise);
    // The sub-table or array under a key, null when it is absent.
    const toml::table* table(const std::string& key);
    const toml::array* tables(const std::string& key);

    bool has(const std::string& key) const { return table_.contains(key); }
    // Complains at a key (or, if it is absent, at the table).
    void complain(const std::string& key, const std::string& why);
    // Complains of the first key that was never read.
    void reject_unknown();

  private:
    const toml::node* find(const std::string& key);

    const toml::table& table_;
    std::string what_, file_;
    std::string& error_;
    std::set<std::string, std::less<>> known_;
};

}  // namespace ols
