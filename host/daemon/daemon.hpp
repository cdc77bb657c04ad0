// SPDX-License-Identifier: MIT
// Daemon: conductor, API and links put together, with systemd looked after.
#pragma once

#include <string>

#include "result.hpp"

namespace ols {

struct DaemonOptions {
    std::string config_path;
    std::string program_version;
};

// What is wrong with the configuration, with file and line; folders are looked at with this user's rights, and none is made.
Status check_configuration(const std::string& path);

// Runs until SIGTERM or SIGINT: then the light goes out, what was recorded is developed and written, and it returns. A second one
// ends at once. SIGHUP reads the configuration anew. Errors: the configuration, with file and line; it cannot listen; another daemon does.
Status run_daemon(const DaemonOptions& options);

}  // namespace ols
