// SPDX-License-Identifier: MIT
// Reading [daemon] of stage.toml.
#include "stage/daemon_setup.hpp"

#include "stage/toml_section.hpp"

namespace ols {

DaemonSetup read_daemon(TomlSection daemon) {
    DaemonSetup setup;
    const auto read_path = [&](const char* key, std::string& path) {
        daemon.read(key, path);
        if (daemon.has(key) && path.empty()) daemon.reject(key, "is empty: give a path, or leave it out");
        if (!path.empty()) path = daemon.resolve_path(path);
    };
    read_path("socket", setup.socket);
    daemon.read("socket_group", setup.socket_group);
    daemon.read("http_port", setup.http_port, 0, 65535);
    read_path("token_file", setup.token_file);
    read_path("takes", setup.takes);
    read_path("sequences", setup.sequences);
    daemon.read("sequence", setup.sequence);
    daemon.read("memory_mb", setup.memory_mb, 0, 1 << 24);
    read_path("spill", setup.spill);
    daemon.read("spill_mb", setup.spill_mb, 0, 1 << 28);
    daemon.read("reserve_mb", setup.reserve_mb, 0, 1 << 24);
    daemon.read("production", setup.production);
    daemon.read("slate", setup.slate);
    daemon.read("seconds", setup.seconds, 0.001, 86'400);
    daemon.read("fps", setup.fps, 0, 100'000);
    daemon.read("quality", setup.quality);
    daemon.read("fill", setup.fill);
    daemon.read("estimate", setup.estimate);
    daemon.read("witness_step", setup.witness_step, 0, 1000);
    daemon.read("nominal", setup.nominal);
    daemon.read("float", setup.single_float);
    for (const char* key : {"sequence", "slate", "quality", "fill", "estimate", "fps", "socket", "socket_group",
                            "http_port", "token_file", "takes", "spill"})
        setup.places[key] = daemon.place(key);
    return setup;
}

}  // namespace ols
