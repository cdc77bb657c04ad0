// SPDX-License-Identifier: MIT
// Camera: a source of frames. To add a kind of camera, implement this, name its scheme in camera.cpp, and let it pass
// tests/unit/camera_conformance.hpp. docs/cameras.md says how to go about it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "device/row_copy.hpp"
#include "image/frame.hpp"
#include "result.hpp"
#include "stage/camera_setup.hpp"

namespace ols {

// What a camera says it is.
struct CameraInfo {
    std::string name;   // maker, model and serial number, or whatever tells it from others
    std::string link;   // how frames come, with what was chosen: "GigE Vision, packets of 8228 bytes, 64 buffers"
    CameraSetup setup;  // in force, as read back from the device
    uint64_t clock_step_ns = 1;  // resolution of its clock
};

// What became of frames since the camera was opened.
struct CameraCounts {
    uint64_t missing_ids =
        0;                  // ids that were passed over and have not come: all that is known to be lost, and of these
    uint64_t dropped = 0;   // by us: the frame came whole, and there was no room for it
    uint64_t underrun = 0;  // by the device or its link: no buffer was free, or not all of the frame came
    uint64_t stale = 0;     // not lost: exposed before start(), and not handed on

    CameraCounts since(const CameraCounts& earlier) const {
        return {missing_ids - earlier.missing_ids, dropped - earlier.dropped, underrun - earlier.underrun,
                stale - earlier.stale};
    }
};

// Whether frames can still come. `ended` is as it should be (a recording is over), `gone` a failure, and `why` says which
// and what to do. While frames wait to be read a camera is live.
struct CameraState {
    enum Kind { live, ended, gone } kind = live;
    std::string why;
};

// Threads: read() from one thread at a time; stop(), watermark_ns(), counts() and state() from any, also during read(), stop()
// also during a start() that waits, which then fails; the rest while nobody reads. Objects share nothing: several cameras are several objects, each with its thread.
// Bounds: every function returns, also when the device hangs. What the device has to answer gets `device_patience_ms` and
// fails after that; a device that shows no sign of life for so long is `gone` (a watchdog of the driver's own where its
// library may wait for ever).
class Camera {
  public:
    static constexpr int device_patience_ms = 60'000;
    // Buffers of a driver, at most; how many a ring has is its writer's to say.
    static constexpr int buffers_max = 1024;

    virtual ~Camera() = default;

    virtual CameraInfo info() const = 0;

    // Sets the camera up and reads back what it took. The error names every key of [[camera]] that it lacks or did not
    // take, with its own value (check_setup() words it). Nothing is rounded without a word.
    virtual Status set_up(const CameraSetup& wanted) = 0;

    // From here on frames are delivered. Returns the camera's time in nanoseconds on its own clock: frames exposed before
    // it are not handed on, and not counted as lost. Starting again after stop() begins anew; ids may go on or begin anew.
    virtual Result<uint64_t> start() = 0;

    // No frames are wanted any more; a read() that waits ends with its time-out at the latest. What was not read is gone.
    virtual void stop() = 0;

    // The next frame in order of delivery, or nothing within `timeout_ms` (a pause for the caller to look at its stop
    // flag; nothing else is decided by it). Its stamp is the device's: id (unwrapped, where the device counts in 16 bits)
    // and time of the begin of the exposure.
    virtual std::optional<Frame> read(int timeout_ms) = 0;

    // Camera time before which every frame has been delivered, late ones within the reorder window excepted; it goes on
    // while no frames come. Read it before read() comes back empty, not after, or a frame may have slipped in between.
    virtual uint64_t watermark_ns() const = 0;

    virtual CameraCounts counts() const = 0;
    // Frames that wait in its buffers to be read, at most.
    virtual size_t buffers() const { return buffers_max; }
    virtual CameraState state() const = 0;
    // The same of a device that is asked first, where it tells nothing by itself while nobody reads.
    virtual CameraState look() { return state(); }

    // Frames that are read from now on have their samples in what is lent, where the driver makes them as they are read (new_frame());
    // null: in memory of their own. Not during read().
    void borrow_from(std::shared_ptr<SampleLender> lender) { lender_ = std::move(lender); }
    // Who sees the rows of frames that are read from now on as they are copied, where the driver copies rows (copy_rows()); null:
    // nobody. Not during read().
    void show_to(RowWatcher* watcher) { watcher_ = watcher; }

  protected:
    // For drivers, in read(): a frame without samples, and with room for them.
    Frame new_frame() const {
        Frame frame;
        if (lender_) frame.samples = lender_->lend();
        return frame;
    }

    // For drivers whose frames lie in memory as they are to be: the samples of a frame of which all else is set.
    void copy_rows(const std::byte* samples, Frame& frame) {
        if (lender_) frame.samples = lender_->lend();
        row_copy_.copy(samples, frame, watcher_);
    }

  private:
    std::shared_ptr<SampleLender> lender_;
    RowWatcher* watcher_ = nullptr;
    RowCopy row_copy_;
};

// "aravis:SERIAL" is a GigE Vision or USB3 Vision camera, "aravis:" the only one there is (device/aravis_camera.hpp);
// "ring:PATH" is a shared-memory ring that another program fills (device/ring.hpp), as the virtual stage does;
// "v4l2:/dev/video0" one of the kernel's (device/v4l2_camera.hpp); "fake:RATE" one without hardware (device/fake_camera.hpp). Frames are marked as camera `index`'s.
Result<std::unique_ptr<Camera>> open_camera(const std::string& source, uint32_t index = 0);

// What set_up returns: Done when `accepted`, read back from the device, is what was wanted; otherwise an error that names
// each key that differs, and those in `lacks` as what this camera does not have.
Status check_setup(const std::string& camera, const CameraSetup& wanted, const CameraSetup& accepted,
                   const std::set<std::string>& lacks = {});

}  // namespace ols
