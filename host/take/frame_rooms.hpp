// SPDX-License-Identifier: MIT
// Frame rooms: how the memory that a take may use is shared among its cameras.
#pragma once

#include <memory>
#include <vector>

#include "record/frame_room.hpp"
#include "take/take.hpp"

namespace ols {

struct FrameRooms {
    std::vector<std::shared_ptr<FrameRoom>> of_camera;  // of the stage's, in their order
    std::shared_ptr<SpillFile> spill;                   // theirs; null without

    // Null where there are no rooms, as for frames that lie in files.
    std::shared_ptr<FrameRoom> room_of(size_t camera) const { return of_camera.empty() ? nullptr : of_camera[camera]; }
    MemoryReport report() const;
};

// Frames of each camera that the take has room for whatever happens: those that developing must hold at once.
size_t frames_held(const TakeDescription& take, const std::vector<TakeOutput>& outputs);

// Errors: memory that is too small for what developing must hold at once, or not to be had; a folder that nothing can be spilled to.
Result<FrameRooms> make_frame_rooms(const TakeDescription& take, const std::vector<TakeOutput>& outputs);

}  // namespace ols
