// SPDX-License-Identifier: MIT
// Camera and counts as JSON.
#include "record/camera_record.hpp"

namespace ols {

nlohmann::json camera_record(const CameraInfo& info, const CameraCounts& counts) {
    return {{"name", info.name},         {"link", info.link},           {"missing_ids", counts.missing_ids},
            {"dropped", counts.dropped}, {"underrun", counts.underrun}, {"stale", counts.stale}};
}

}  // namespace ols
