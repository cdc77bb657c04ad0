// SPDX-License-Identifier: MIT
// A V4L2 capture device as the kernel's documents describe one: Linux 6.1, Documentation/userspace-api/media/v4l, the file named
// where a behaviour is from. It forgives nothing: what a document calls an error is one.
#pragma once

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <span>
#include <vector>

#include "device/v4l2_device.hpp"

namespace ols::test {

struct ModelControl {
    uint32_t id;
    std::string name;
    uint32_t type = V4L2_CTRL_TYPE_INTEGER;
    int64_t minimum = 0, maximum = 255, step = 1, value = 0;
    uint32_t flags = 0;
    std::vector<std::string> items = {};  // of a menu
    std::string text = "";
    uint32_t held_by = 0;  // cannot be set (EACCES) while this one is not 0
};

class V4l2Model : public V4l2Device {
  public:
    // The device, as a test makes it before it is opened.
    std::string driver = "model", card = "Model camera", bus = "platform:model";
    uint32_t device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
    std::vector<std::pair<uint32_t, std::string>> formats = {{V4L2_PIX_FMT_GREY, "8-bit Greyscale"},
                                                             {V4L2_PIX_FMT_SRGGB12, "12-bit Bayer RGRG/GBGB"}};
    std::vector<ModelControl> controls;
    uint32_t width_max = 4096, height_max = 4096, buffers_max = 8, row_align = 32, field = V4L2_FIELD_NONE;
    uint32_t row_bytes = 0, image_bytes = 0;  // what it says of them, where it is wrong
    std::function<size_t(uint32_t fourcc, uint32_t width)> least_row_bytes = [](uint32_t, uint32_t w) { return w * 2; };
    uint32_t buffer_flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_EOF;
    uint32_t first_sequence = 0;
    std::map<unsigned long, int> refusals;  // a call's errno
    uint32_t changes_format_to = 0;         // of any that is asked for
    bool keeps_no_control = false;          // says that it took it
    std::function<uint64_t()>
        clock_ns;  // the machine's; where there is none, one that an exposure takes a millisecond ahead

    // How it is driven. Each returns once it is done.
    struct Exposure {
        uint32_t flags = 0;
        std::vector<uint8_t> bytes = {};  // all zeros without
        size_t bytes_short = 0;
        int64_t clock_offset_ns = 0;
    };
    void expose() { expose(Exposure{}); }
    void expose(const Exposure& exposure) {
        const std::lock_guard lock(mutex_);
        ahead_ns_ += 1'000'000;
        if (!is_streaming_) return;
        const uint32_t sequence = sequence_++;
        if (queued_.empty()) return;  // dropped: nowhere to put it
        const uint32_t index = queued_.front();
        queued_.pop_front();
        Buffer& buffer = buffers_[index];
        buffer.is_queued = false;
        std::fill(buffer.memory.begin(), buffer.memory.end(), std::byte{0});
        const auto bytes = std::as_bytes(std::span(exposure.bytes));
        std::ranges::copy(bytes.first(std::min(bytes.size(), buffer.memory.size())), buffer.memory.begin());
        buffer.bytesused = uint32_t(format_.sizeimage - exposure.bytes_short);
        buffer.sequence = sequence;
        buffer.flags = exposure.flags;
        buffer.time_ns = uint64_t(int64_t(now()) + exposure.clock_offset_ns);
        done_.push_back(index);
        changed_.notify_all();
    }
    size_t free_buffers() {
        const std::lock_guard lock(mutex_);
        return queued_.size();
    }
    void lose() {
        const std::lock_guard lock(mutex_);
        ahead_ns_ += 1'000'000;
        if (is_streaming_) ++sequence_;
    }
    void finish() { set(is_finished_); }    // V4L2_BUF_FLAG_LAST is out: no frame will follow
    void unplug() { set(is_unplugged_); }   // video_unregister_device()
    void break_down() { set(is_broken_); }  // vb2_queue_error()
    void set_sequence(uint32_t sequence) {
        const std::lock_guard lock(mutex_);
        sequence_ = sequence;
    }
    // As v4l2loopback's writer does: the buffer holds this frame now, whoever reads it.
    void overwrite(uint32_t index, uint32_t sequence) {
        const std::lock_guard lock(mutex_);
        buffers_[index].sequence = sequence;
    }
    void hang_in(unsigned long request) {
        const std::lock_guard lock(mutex_);
        hanging_ = request;
    }
    void hang_no_more() {
        const std::lock_guard lock(mutex_);
        hanging_ = 0;
        changed_.notify_all();
    }
    bool is_streaming() {
        const std::lock_guard lock(mutex_);
        return is_streaming_;
    }
    bool is_called(unsigned long request) {
        const std::lock_guard lock(mutex_);
        return calls_[request] > 0;
    }
    const ModelControl& control(uint32_t id) {
        const std::lock_guard lock(mutex_);
        return *find_control(id);
    }
    uint32_t row_bytes_in_force() {
        const std::lock_guard lock(mutex_);
        return format_.bytesperline;
    }

    // The kernel's side.
    int ioctl(unsigned long request, void* argument) override {
        std::unique_lock lock(mutex_);
        ++calls_[request];
        changed_.wait(lock, [&] { return hanging_ != request; });
        if (is_unplugged_) return ENODEV;  // v4l2_ioctl() of an unregistered node
        if (const auto refusal = refusals.find(request); refusal != refusals.end()) return refusal->second;
        switch (request) {
            case VIDIOC_QUERYCAP: return query_capabilities(*static_cast<v4l2_capability*>(argument));
            case VIDIOC_ENUM_FMT: return enumerate(*static_cast<v4l2_fmtdesc*>(argument));
            case VIDIOC_S_FMT: return set_format(*static_cast<v4l2_format*>(argument));
            case VIDIOC_G_FMT: return static_cast<v4l2_format*>(argument)->fmt.pix = format_, 0;
            case VIDIOC_S_PARM: return set_rate(*static_cast<v4l2_streamparm*>(argument));
            case VIDIOC_QUERY_EXT_CTRL: return query_control(*static_cast<v4l2_query_ext_ctrl*>(argument));
            case VIDIOC_QUERYMENU: return query_menu(*static_cast<v4l2_querymenu*>(argument));
            case VIDIOC_S_EXT_CTRLS: return set_control(*static_cast<v4l2_ext_controls*>(argument));
            case VIDIOC_G_EXT_CTRLS: return get_control(*static_cast<v4l2_ext_controls*>(argument));
            case VIDIOC_REQBUFS: return request_buffers(*static_cast<v4l2_requestbuffers*>(argument));
            case VIDIOC_QUERYBUF: return query_buffer(*static_cast<v4l2_buffer*>(argument));
            case VIDIOC_QBUF: return queue(*static_cast<v4l2_buffer*>(argument));
            case VIDIOC_DQBUF: return dequeue(*static_cast<v4l2_buffer*>(argument));
            case VIDIOC_STREAMON: return stream_on();
            case VIDIOC_STREAMOFF: return stream_off();
            default: return ENOTTY;
        }
    }
    // func-poll.rst: POLLERR where capturing has not been started, of a queue with an error, and of a node that is gone.
    short poll(int timeout_ms) override {
        std::unique_lock lock(mutex_);
        const auto events = [&]() -> short {
            if (is_unplugged_) return POLLERR | POLLHUP;
            if (!is_streaming_ || is_broken_) return POLLERR;
            return !done_.empty() || is_finished_ ? POLLIN : 0;
        };
        changed_.wait_for(lock, std::chrono::milliseconds(timeout_ms), [&] { return events() != 0; });
        return events();
    }
    std::byte* map(size_t bytes, uint32_t offset) override {
        const std::lock_guard lock(mutex_);
        for (Buffer& buffer : buffers_)
            if (buffer.offset == offset && bytes <= buffer.memory.size()) return ++mapped_, buffer.memory.data();
        errno = EINVAL;
        return nullptr;
    }
    void unmap(std::byte*, size_t) override {
        const std::lock_guard lock(mutex_);
        --mapped_;
    }
    uint64_t now_ns() const override {
        const std::lock_guard lock(mutex_);
        return now();
    }

  private:
    struct Buffer {
        std::vector<std::byte> memory;
        uint32_t offset = 0, sequence = 0, bytesused = 0, flags = 0;
        uint64_t time_ns = 0;
        bool is_queued = false;
    };

    uint64_t now() const {
        if (clock_ns) return clock_ns();
        const auto steady = std::chrono::steady_clock::now().time_since_epoch();
        return uint64_t(std::chrono::duration_cast<std::chrono::nanoseconds>(steady).count()) + ahead_ns_;
    }
    void set(bool& flag) {
        const std::lock_guard lock(mutex_);
        flag = true;
        changed_.notify_all();
    }

    int query_capabilities(v4l2_capability& is) const {
        is = {};
        std::strncpy(reinterpret_cast<char*>(is.driver), driver.c_str(), sizeof is.driver - 1);
        std::strncpy(reinterpret_cast<char*>(is.card), card.c_str(), sizeof is.card - 1);
        std::strncpy(reinterpret_cast<char*>(is.bus_info), bus.c_str(), sizeof is.bus_info - 1);
        is.device_caps = device_caps;
        is.capabilities = device_caps | V4L2_CAP_DEVICE_CAPS | V4L2_CAP_VIDEO_OUTPUT;  // of all its nodes together
        return 0;
    }
    // vidioc-enum-fmt.rst: EINVAL beyond the last.
    int enumerate(v4l2_fmtdesc& description) const {
        if (description.index >= formats.size()) return EINVAL;
        description.pixelformat = formats[description.index].first;
        std::strncpy(reinterpret_cast<char*>(description.description), formats[description.index].second.c_str(), 31);
        return 0;
    }
    // vidioc-g-fmt.rst: parameters are adjusted; EBUSY while there are buffers.
    int set_format(v4l2_format& format) {
        if (!buffers_.empty()) return EBUSY;
        v4l2_pix_format& pix = format.fmt.pix;
        pix.width = std::clamp(pix.width, 8u, width_max);
        pix.height = std::clamp(pix.height, 8u, height_max);
        const bool is_offered = std::any_of(formats.begin(), formats.end(),
                                            [&](const auto& offered) { return offered.first == pix.pixelformat; });
        if (!is_offered) pix.pixelformat = formats.front().first;
        if (changes_format_to) pix.pixelformat = changes_format_to;
        const auto least = uint32_t(least_row_bytes(pix.pixelformat, pix.width));
        pix.bytesperline = row_bytes ? row_bytes : (least + row_align - 1) / row_align * row_align;
        pix.sizeimage = image_bytes ? image_bytes : pix.bytesperline * pix.height;
        pix.field = field;
        format_ = pix;
        return 0;
    }
    static int set_rate(v4l2_streamparm& parameters) {
        parameters.parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
        parameters.parm.capture.timeperframe = {1, 120};
        return 0;
    }

    ModelControl* find_control(uint32_t id) {
        const auto found = std::find_if(controls.begin(), controls.end(), [&](const auto& c) { return c.id == id; });
        return found == controls.end() ? nullptr : &*found;
    }
    // vidioc-queryctrl.rst: with V4L2_CTRL_FLAG_NEXT_CTRL the one with the next higher id.
    int query_control(v4l2_query_ext_ctrl& query) {
        const uint32_t after = query.id & ~(V4L2_CTRL_FLAG_NEXT_CTRL | V4L2_CTRL_FLAG_NEXT_COMPOUND);
        const ModelControl* next = nullptr;
        for (const ModelControl& each : controls)
            if (each.id > after && (!next || each.id < next->id)) next = &each;
        if (!next) return EINVAL;
        query = {};
        query.id = next->id;
        query.type = next->type;
        std::strncpy(query.name, next->name.c_str(), sizeof query.name - 1);
        query.minimum = next->minimum;
        query.maximum = next->maximum;
        query.step = uint64_t(next->step);
        query.flags = next->flags;
        return 0;
    }
    int query_menu(v4l2_querymenu& menu) {
        const ModelControl* const control = find_control(menu.id);
        if (!control || menu.index >= control->items.size() || control->items[menu.index].empty()) return EINVAL;
        std::strncpy(reinterpret_cast<char*>(menu.name), control->items[menu.index].c_str(), sizeof menu.name - 1);
        return 0;
    }
    // vidioc-g-ext-ctrls.rst; the control framework moves a number to the nearest that there is (v4l2-controls.rst).
    int set_control(v4l2_ext_controls& all) {
        v4l2_ext_control& one = all.controls[0];
        ModelControl* const control = find_control(one.id);
        if (!control) return EINVAL;
        const ModelControl* const holder = control->held_by ? find_control(control->held_by) : nullptr;
        if ((control->flags & V4L2_CTRL_FLAG_READ_ONLY) || (holder && holder->value != 0)) return EACCES;
        if (keeps_no_control) return 0;
        if (control->type == V4L2_CTRL_TYPE_STRING) {
            if (std::strlen(one.string) > size_t(control->maximum)) return ERANGE;
            control->text = one.string;
            return 0;
        }
        const int64_t wanted = control->type == V4L2_CTRL_TYPE_INTEGER64 ? one.value64 : one.value;
        const bool is_menu = control->type == V4L2_CTRL_TYPE_MENU;
        if (is_menu && (wanted < control->minimum || wanted > control->maximum)) return ERANGE;
        const int64_t held = std::clamp(wanted, control->minimum, control->maximum) - control->minimum;
        control->value = control->minimum + (held + control->step / 2) / control->step * control->step;
        return 0;
    }
    int get_control(v4l2_ext_controls& all) {
        v4l2_ext_control& one = all.controls[0];
        const ModelControl* const control = find_control(one.id);
        if (!control) return EINVAL;
        if (control->type == V4L2_CTRL_TYPE_STRING) {
            if (one.size <= control->text.size()) return ENOSPC;
            std::strcpy(one.string, control->text.c_str());
        } else if (control->type == V4L2_CTRL_TYPE_INTEGER64) {
            one.value64 = control->value;
        } else {
            one.value = int32_t(control->value);
        }
        return 0;
    }

    // vidioc-reqbufs.rst: a count of 0 frees them; EBUSY while they are mapped or the device streams.
    int request_buffers(v4l2_requestbuffers& request) {
        if (is_streaming_ || mapped_ > 0) return EBUSY;
        if (request.memory != V4L2_MEMORY_MMAP || request.type != V4L2_BUF_TYPE_VIDEO_CAPTURE) return EINVAL;
        buffers_.clear();
        queued_.clear();
        done_.clear();
        request.count = std::min(request.count, buffers_max);
        for (uint32_t n = 0; n < request.count; ++n) {
            Buffer& buffer = buffers_.emplace_back();
            buffer.memory.resize((format_.sizeimage + 4095) / 4096 * 4096);
            buffer.offset = n * uint32_t(buffer.memory.size());
        }
        return 0;
    }
    void describe(v4l2_buffer& to) const {
        const Buffer& buffer = buffers_[to.index];
        to.length = uint32_t(buffer.memory.size());
        to.m.offset = buffer.offset;
        to.bytesused = buffer.bytesused;
        to.sequence = buffer.sequence;
        to.flags = buffer_flags | buffer.flags | (buffer.is_queued ? V4L2_BUF_FLAG_QUEUED : 0);
        to.timestamp.tv_sec = time_t(buffer.time_ns / 1'000'000'000);
        to.timestamp.tv_usec = suseconds_t(buffer.time_ns / 1000 % 1'000'000);
    }
    int query_buffer(v4l2_buffer& buffer) const {
        if (buffer.index >= buffers_.size()) return EINVAL;
        describe(buffer);
        return 0;
    }
    // vidioc-qbuf.rst: EINVAL for one that is queued already.
    int queue(const v4l2_buffer& buffer) {
        if (buffer.memory != V4L2_MEMORY_MMAP || buffer.index >= buffers_.size()) return EINVAL;
        if (buffers_[buffer.index].is_queued) return EINVAL;
        buffers_[buffer.index].is_queued = true;
        queued_.push_back(buffer.index);
        return 0;
    }
    // vidioc-qbuf.rst: EINVAL when not streaming (vb2), EIO after a fatal error, EPIPE after the last buffer, EAGAIN.
    int dequeue(v4l2_buffer& buffer) {
        if (!is_streaming_) return EINVAL;
        if (is_broken_) return EIO;
        if (done_.empty()) return is_finished_ ? EPIPE : EAGAIN;
        buffer.index = done_.front();
        done_.pop_front();
        describe(buffer);
        return 0;
    }
    // vidioc-streamon.rst: off gives all buffers back, filled or not.
    int stream_on() {
        if (buffers_.empty()) return EINVAL;
        is_streaming_ = true;
        sequence_ = first_sequence;
        return 0;
    }
    int stream_off() {
        is_streaming_ = false;
        for (Buffer& buffer : buffers_) buffer.is_queued = false;
        queued_.clear();
        done_.clear();
        changed_.notify_all();
        return 0;
    }

    mutable std::mutex mutex_;
    std::condition_variable changed_;
    v4l2_pix_format format_{};
    std::vector<Buffer> buffers_;
    std::deque<uint32_t> queued_, done_;
    std::map<unsigned long, int> calls_;
    unsigned long hanging_ = 0;
    uint64_t ahead_ns_ = 0;
    uint32_t sequence_ = 0;
    int mapped_ = 0;
    bool is_streaming_ = false, is_finished_ = false, is_unplugged_ = false, is_broken_ = false;
};

}  // namespace ols::test
