// SPDX-License-Identifier: MIT
// The program at the other end of a ring, as a process of its own: it fills the ring as told, and can be killed.
#pragma once

#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

#include "camera_rig.hpp"
#include "device/ring.hpp"

namespace ols::test {

inline RingContent ring_content_of(const CameraSetup& setup) {
    RingContent content;
    content.width = uint32_t(setup.width);
    content.height = uint32_t(setup.height);
    content.cfa = setup.cfa;
    content.bits = uint32_t(setup.bits);
    return content;
}

// The child: a letter is an order, and the same letter back says that it was carried out.
class RingProgram {
  public:
    RingProgram(int orders, const std::string& path, const CameraSetup& setup)
        : orders_(orders), writer_(std::move(*RingWriter::create(path, 8, ring_content_of(setup)))) {
        frame_.width = uint32_t(setup.width);
        frame_.height = uint32_t(setup.height);
        frame_.cfa = setup.cfa;
        frame_.pitch_bytes = frame_.width * 2;
        frame_.samples.resize(size_t(frame_.pitch_bytes) * frame_.height);
    }

    void run() {
        answer('r');
        for (;;) {
            if (const auto start = writer_.start_asked()) writer_.confirm_start(*start, clock_ns_);
            pollfd order{orders_, POLLIN, 0};
            char letter = 0;
            if (poll(&order, 1, 1) <= 0) continue;
            if (::read(orders_, &letter, 1) != 1) return;
            if (letter == 'e' || letter == 'l') expose(letter == 'e');
            if (letter == 'c') writer_.close();
            answer(letter);
        }
    }

  private:
    void answer(char letter) { (void)!::write(orders_, &letter, 1); }
    void expose(bool delivered) {
        frame_.stamp = {next_id_++, clock_ns_};
        clock_ns_ += 1'000'000;
        if (delivered) (void)writer_.write(frame_, false, never_);
        writer_.set_watermark(clock_ns_);
    }

    int orders_;
    RingWriter writer_;
    Frame frame_;
    uint64_t next_id_ = 1, clock_ns_ = 5'000'000'000;
    std::atomic<bool> never_ = false;
};

class RingRig : public CameraRig {
  public:
    RingRig() {
        static int rigs = 0;
        path_ = std::filesystem::temp_directory_path() /
                ("rig" + std::to_string(getpid()) + "_" + std::to_string(rigs++) + ".ring");
        int ends[2];
        EXPECT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
        child_ = fork();
        if (child_ == 0) {
            ::close(ends[0]);
            RingProgram(ends[1], path_, fitting_setup()).run();
            _exit(0);
        }
        ::close(ends[1]);
        orders_ = ends[0];
        await('r');
    }
    ~RingRig() override {
        if (orders_ >= 0) ::close(orders_);
        if (child_ > 0) waitpid(child_, nullptr, 0);
        std::filesystem::remove(path_);
    }

    std::unique_ptr<Camera> open() override {
        auto camera = open_camera("ring:" + path_);
        EXPECT_TRUE(camera.ok()) << (camera.ok() ? "" : camera.error().message);
        return camera.ok() ? std::move(*camera) : nullptr;
    }
    CameraSetup fitting_setup() override {
        CameraSetup setup;
        setup.width = 16;
        setup.height = 8;
        return setup;
    }
    void expose(int count) override {
        for (int n = 0; n < count; ++n) order('e');
    }
    void lose_one() override { order('l'); }
    void end() override { order('c'); }
    void die() override {
        kill(child_, SIGKILL);
        waitpid(child_, nullptr, 0);
        child_ = -1;
    }
    pid_t process() const { return child_; }
    const std::string& path() const { return path_; }

  private:
    void order(char letter) {
        EXPECT_EQ(::write(orders_, &letter, 1), 1);
        await(letter);
    }
    void await(char letter) {
        char answer = 0;
        EXPECT_EQ(::read(orders_, &answer, 1), 1);
        EXPECT_EQ(answer, letter);
    }

    std::string path_;
    int orders_ = -1;
    pid_t child_ = -1;
};

}  // namespace ols::test
