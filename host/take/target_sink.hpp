// SPDX-License-Identifier: MIT
// Target sink: where a take's targets go; an archive, or whoever looks at them as they come.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "archive/archive.hpp"
#include "image/target.hpp"

namespace ols {

// The functions are ArchiveWriter's. Called from one thread at a time.
class TargetSink {
  public:
    virtual ~TargetSink() = default;
    virtual Status expect_targets(uint32_t camera, uint32_t count) = 0;
    virtual Status take_place() = 0;
    virtual Status write_target(const Target& target) = 0;
    virtual Status note_missing_target(uint32_t camera, uint32_t index, const std::string& why,
                                       const nlohmann::json& detail) = 0;
    virtual Status note_missing_targets(uint32_t camera, uint32_t first, uint32_t last, const std::string& why) = 0;
    virtual void add_to_manifest(const nlohmann::json& extra) = 0;
    virtual Status finish() = 0;
};

class ArchiveSink : public TargetSink {
  public:
    // The archive must outlive it.
    explicit ArchiveSink(ArchiveWriter& archive) : archive_(archive) {}

    Status expect_targets(uint32_t camera, uint32_t count) override { return archive_.expect_targets(camera, count); }
    Status take_place() override { return archive_.take_place(); }
    Status write_target(const Target& target) override { return archive_.write_target(target); }
    Status note_missing_target(uint32_t camera, uint32_t index, const std::string& why,
                               const nlohmann::json& detail) override {
        return archive_.note_missing_target(camera, index, why, detail);
    }
    Status note_missing_targets(uint32_t camera, uint32_t first, uint32_t last, const std::string& why) override {
        return archive_.note_missing_targets(camera, first, last, why);
    }
    void add_to_manifest(const nlohmann::json& extra) override { archive_.add_to_manifest(extra); }
    Status finish() override { return archive_.finish(); }

  private:
    ArchiveWriter& archive_;
};

}  // namespace ols
