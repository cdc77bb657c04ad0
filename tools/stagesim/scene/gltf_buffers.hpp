// SPDX-License-Identifier: MIT
// The data of a glTF file: its JSON, its buffers, and numbers out of them.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "result.hpp"

namespace ols {

// A whole number of 0 or more under a key; `otherwise` where it is absent. Throws std::runtime_error for anything else.
uint64_t gltf_whole(const nlohmann::json& object, const char* key, uint64_t otherwise);

class GltfBuffers {
  public:
    // Splits .gltf or .glb and reads every buffer: the .glb's own, of a data: URI, or of a file in the folder of `path` or below.
    static Result<GltfBuffers> open(const std::string& path, const std::string& bytes);

    const nlohmann::json& root() const { return json_; }
    uint64_t bytes() const { return bytes_; }  // of everything that was read

    // The numbers of an accessor of so many components ("VEC3": 3), normalised ones as shares of 1. Throws std::runtime_error with
    // what is wrong with it.
    std::vector<double> read(uint64_t accessor, int components) const;

  private:
    nlohmann::json json_;
    std::vector<std::string> buffers_;
    uint64_t bytes_ = 0;
};

}  // namespace ols
