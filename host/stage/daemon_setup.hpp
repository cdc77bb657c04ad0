// SPDX-License-Identifier: MIT
// The daemon as configured (`[daemon]` of stage.toml): where it listens, where takes go, what a take is unless it is said otherwise.
#pragma once

#include <map>
#include <string>

namespace ols {

class TomlSection;

struct DaemonSetup {
    bool is_there = false;  // the stage has [daemon]

    // Where it listens.
    std::string socket = "/run/stagectl/control.sock";
    std::string socket_group;  // that may use the socket beside its owner; empty: the daemon's own group
    int http_port = 0;         // on the loopback; 0: no HTTP
    std::string token_file;    // of HTTP; empty: "token" beside the socket

    // Where things are.
    std::string takes = "/var/lib/stagectl/takes";
    std::string sequences = "/etc/stagectl/sequences";  // NAME.toml each
    std::string sequence = "s159";                      // of these, or a basis
    int memory_mb = 0;                                  // for frames of a take; 0: what developing needs at least
    std::string spill;                                  // folder for frames beyond that; empty: none
    int spill_mb = 0;                                   // at most; 0: as much as the disk has
    int reserve_mb = 1024;                              // of the disk that stay free: a take ends before

    // What a take is.
    std::string production, slate = "untitled";
    double seconds = 10;
    double fps = 0;  // targets a second of a performance; 0: one target a cycle
    std::string quality, fill = "none", estimate = "none";
    int witness_step = 5;
    bool nominal = false, single_float = false;

    // "stage.toml:12: daemon.quality": where the keys above stand, for what is found wrong with their words later.
    std::map<std::string, std::string> places;
};

// Paths are made relative to the file's own folder.
DaemonSetup read_daemon(TomlSection daemon);

}  // namespace ols
