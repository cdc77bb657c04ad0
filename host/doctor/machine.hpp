// SPDX-License-Identifier: MIT
// The machine as its kernel shows it: files under a root, which in tests is a made-up tree, and the few things that have no file.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace ols {

// What adjtimex(2) says of the wall's clock.
struct WallClock {
    bool is_synchronised = false;
    double error_bound_s = 0;  // "maxerror"
};

// What `ip -details link` says of an interface; only asked of the kernel, which has no file for it.
struct LinkDetails {
    std::string kind;              // "can", "vcan"; empty for hardware that says nothing
    uint32_t can_bit_rate_hz = 0;  // 0: none is set, or it has none
    bool is_bus_off = false;
};

// A limit of this process (getrlimit(2)), soft and hard.
struct Limit {
    uint64_t soft = 0, hard = 0;
    static constexpr uint64_t none = UINT64_MAX;
};

// Changes nothing. What is not there, or not to be read, is an empty optional or list.
class Machine {
  public:
    explicit Machine(std::string root = "") : root_(std::move(root)) {}
    virtual ~Machine() = default;
    Machine(const Machine&) = delete;
    Machine& operator=(const Machine&) = delete;

    // Paths are absolute: "/proc/meminfo".
    std::string place(const std::string& path) const { return root_ + path; }
    std::optional<std::string> read(const std::string& path) const;  // without the last end of line
    std::optional<int64_t> read_number(const std::string& path) const;
    std::vector<std::string> list(const std::string& folder) const;  // names, sorted
    bool exists(const std::string& path) const;

    // "MemAvailable" of /proc/meminfo in bytes, "CapEff" of /proc/self/status as text.
    std::optional<uint64_t> memory_bytes(const std::string& key) const;
    std::optional<std::string> process_status(const std::string& key) const;
    // As /proc/self/limits names it: "Max locked memory".
    std::optional<Limit> limit(const std::string& name) const;

    bool is_root() const;
    bool has_capability(unsigned number) const;  // in effect (capabilities(7))
    std::set<std::string> groups() const;        // names of this process' groups
    bool is_member(const std::string& user, const std::string& group) const;
    std::string user() const;  // its name, or number

    // Whether this process may read and write it; access lists count.
    virtual bool may_open(const std::string& path) const;
    virtual std::optional<WallClock> wall_clock() const;
    virtual std::optional<LinkDetails> link_details(const std::string& interface) const;

  private:
    std::string root_;
};

// Words between spaces and tabs.
std::vector<std::string> words_in(const std::string& text);
std::vector<std::string> lines_in(const std::string& text);

}  // namespace ols
