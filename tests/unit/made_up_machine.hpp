// SPDX-License-Identifier: MIT
// A machine of files that a test writes: /proc, /sys, /etc and /dev under a folder of its own.
#pragma once

#include <map>
#include <set>

#include "doctor/check_up.hpp"
#include "scratch_folder.hpp"

namespace ols {

class MadeUpMachine : public Machine {
  public:
    explicit MadeUpMachine(const std::string& root) : Machine(root) {}

    std::set<std::string> closed;  // nodes that may not be opened
    std::optional<WallClock> clock = WallClock{true, 0.02};
    std::map<std::string, LinkDetails> links;

    bool may_open(const std::string& path) const override { return !closed.contains(path); }
    std::optional<WallClock> wall_clock() const override { return clock; }
    std::optional<LinkDetails> link_details(const std::string& interface) const override {
        const auto found = links.find(interface);
        return found == links.end() ? std::nullopt : std::optional(found->second);
    }
};

// Of the default stage, with nothing named.
inline CheckUp plain_check_up(const Machine& machine) {
    return {.machine = machine,
            .stage = default_stage(),
            .needs = {},
            .board_link = "",
            .cameras = {},
            .takes_folder = "",
            .spill_folder = "",
            .open_board = {}};
}

// A user `ada` (1000) with no groups but her own, on a machine of which everything else is for the test to write.
class DoctorTest : public ScratchFolder {
  protected:
    DoctorTest() {
        be_user("1000", "1000", 0);
        put("/etc/passwd", "root:x:0:0::/root:/bin/sh\nada:x:1000:1000::/home/ada:/bin/sh\n");
        put("/etc/group", "root:x:0:\nvideo:x:44:\nplugdev:x:46:\nada:x:1000:\n");
        up.open_board = []() -> Result<Board> { return fail("no board in this test"); };
    }

    void put(const std::string& path, const std::string& text) {
        const auto place = std::filesystem::path(machine.place(path));
        std::filesystem::create_directories(place.parent_path());
        std::ofstream(place) << text;
    }
    void be_user(const std::string& uid, const std::string& groups, uint64_t capabilities) {
        char bits[17];
        std::snprintf(bits, sizeof bits, "%016llx", static_cast<unsigned long long>(capabilities));
        put("/proc/self/status", "Name:\tstagectl\nUid:\t" + uid + "\t" + uid + "\t" + uid + "\t" + uid + "\nGid:\t" +
                                     uid + "\t" + uid + "\t" + uid + "\t" + uid + "\nGroups:\t" + groups +
                                     " \nCapEff:\t" + bits + "\nCpus_allowed_list:\t" + cores + "\n");
    }
    void put_limit(const std::string& name, const std::string& soft) {
        put("/proc/self/limits", "Limit                     Soft Limit           Hard Limit           Units     \n" +
                                     name + "            " + soft + "              unlimited            bytes     \n");
    }
    // One camera of that source, of 1 MB/s on its link and 2 MB/s raw times `megabytes_a_second`.
    void give_camera(const std::string& source, double megabytes_a_second, std::vector<AravisListing> listing = {}) {
        sources_.push_back(source);
        up.stage.cameras.resize(sources_.size());
        up.needs.cameras.push_back({.frames_per_s = megabytes_a_second,
                                    .frame_bytes = 2'000'000,
                                    .link_frame_bytes = 1'000'000,
                                    .target_bytes = 10'000'000});
        up.needs.frames_held = 4;
        up.needs.targets_per_s = 10;
        up.needs.take_s = 10;
        up.cameras = place_cameras(sources_, listing);
    }

    static const Finding& only(const Findings& findings, Check check) {
        const Finding* found = nullptr;
        for (const Finding& finding : findings) {
            if (finding.check != check) continue;
            EXPECT_EQ(found, nullptr) << "twice: " << finding.id();
            found = &finding;
        }
        if (!found) throw std::runtime_error("no finding of " + std::string(check_names[size_t(check)].id));
        return *found;
    }
    static void expect(const Findings& findings, Check check, CheckVerdict verdict, const std::string& words = "") {
        const Finding& finding = only(findings, check);
        EXPECT_EQ(finding.verdict, verdict) << finding.id() << ": " << finding.found;
        EXPECT_NE(finding.found.find(words), std::string::npos) << finding.id() << ": " << finding.found;
        const bool wants_help = verdict == CheckVerdict::warn || verdict == CheckVerdict::fail;
        if (wants_help) {
            EXPECT_FALSE(finding.commands.empty()) << finding.id();
        }
        if (wants_help) {
            EXPECT_FALSE(finding.needed.empty()) << finding.id();
        }
    }

    std::string cores = "0-3";
    MadeUpMachine machine{folder_};
    CheckUp up = plain_check_up(machine);

  private:
    std::vector<std::string> sources_;
};

}  // namespace ols
