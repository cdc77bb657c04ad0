// SPDX-License-Identifier: MIT
// CAN_ISOTP sockets (Linux 5.10 and later, include/uapi/linux/can/isotp.h). With CAN_ISOTP_WAIT_TX_DONE a write returns when the
// board has taken the message, with the reason when it has not; without, what became of it is nobody's to know.
#include "device/kernel_isotp.hpp"

#include <fmt/format.h>
#include <linux/can/isotp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <thread>

#include "device/can_transfer.hpp"

namespace ols {

namespace {

// The kernel gives up by itself after a second without the board's frame and two without the bus', and says which: that comes
// first.
constexpr uint32_t kernel_timeout_us = 2'500'000;

// A signal that does nothing but end a system call.
int waking_signal() {
    static const int signal_number = [] {
        struct sigaction action {};
        action.sa_handler = [](int) {};
        sigaction(SIGRTMIN, &action, nullptr);  // without SA_RESTART
        return SIGRTMIN;
    }();
    return signal_number;
}

// Writes in a thread of its own: in the kernel it waits for as long as the board says "wait", which only a signal ends, and so
// does closing the socket then.
class PendingWrite {
  public:
    PendingWrite(int fd, std::span<const uint8_t> bytes)
        : done_(::eventfd(0, EFD_CLOEXEC)), sender_([this, fd, bytes] { write(fd, bytes); }) {}
    ~PendingWrite() {
        interrupt();
        sender_.join();
        ::close(done_);
    }

    int done_fd() const { return done_; }  // readable when it has ended

    // 0 or the error. Only when it has ended.
    int error() const { return error_; }

  private:
    void write(int fd, std::span<const uint8_t> bytes) {
        sigset_t others;
        sigfillset(&others);
        sigdelset(&others, waking_signal());
        pthread_sigmask(SIG_SETMASK, &others, nullptr);  // the program's own signals are for its other threads
        error_ = ::send(fd, bytes.data(), bytes.size(), 0) < 0 ? errno : 0;
        const uint64_t one = 1;
        (void)!::write(done_, &one, sizeof one);
    }

    // Until it has ended: a signal that comes just before the call is lost.
    void interrupt() {
        pollfd done{done_, POLLIN, 0};
        for (int wait_ms = 0; ::poll(&done, 1, wait_ms) <= 0; wait_ms = 10)
            pthread_kill(sender_.native_handle(), waking_signal());
    }

    int done_;
    int error_ = 0;
    std::thread sender_;
};

class KernelIsotp : public Transfer {
  public:
    KernelIsotp(int fd, CanPlace place, CanWatch& watch) : fd_(fd), place_(std::move(place)), watch_(watch) {}
    ~KernelIsotp() override { ::close(fd_); }

    std::string name() const override { return place_.name(); }

    Status write(std::span<const uint8_t> bytes, uint32_t timeout_us, const Deadline& deadline) override {
        // A reply that nobody read belongs to a request that was given up.
        while (::recv(fd_, message_, sizeof message_, MSG_DONTWAIT) >= 0) {
        }
        taken_ = received_ = 0;
        PendingWrite pending(fd_, bytes);
        const Status over = wait_for(pending.done_fd(), timeout_us, deadline, "take the message");
        if (!over.ok()) return over;
        if (pending.error() != 0) return sending_failed(pending.error());
        return Done{};
    }

    Result<std::vector<uint8_t>> read(size_t capacity, uint32_t timeout_us, const Deadline& deadline) override {
        while (taken_ == received_)
            if (const Status got = next_message(timeout_us, deadline); !got.ok()) return got.error();
        const size_t count = std::min(capacity, received_ - taken_);
        std::vector<uint8_t> bytes(message_ + taken_, message_ + taken_ + count);
        taken_ += count;
        return bytes;
    }

  private:
    Status next_message(uint32_t timeout_us, const Deadline& deadline) {
        if (const Status ready = wait_for(fd_, timeout_us, deadline, "answer"); !ready.ok()) return ready;
        const ssize_t got = ::recv(fd_, message_, sizeof message_, MSG_DONTWAIT | MSG_TRUNC);
        if (got < 0 && errno != EAGAIN && errno != EINTR) return receiving_failed(errno);
        if (got > ssize_t(sizeof message_))
            return fail(fmt::format("{} sends a message of {} bytes, where {} are the most: is it the stage's bus?",
                                    name(), got, sizeof message_));
        received_ = size_t(std::max<ssize_t>(got, 0));
        taken_ = 0;
        return Done{};
    }

    // Until `fd` is ready. The error says that the board did not do `what`: it was silent for so long, or said wait too often.
    Status wait_for(int fd, uint32_t timeout_us, const Deadline& deadline, const char* what) {
        using Clock = std::chrono::steady_clock;
        const std::chrono::microseconds silence(std::max(timeout_us, kernel_timeout_us));
        auto end = Clock::now() + silence;
        for (uint64_t heard = watch_.from_board();;) {
            pollfd ready[]{{fd, POLLIN, 0}, {watch_.fd(), POLLIN, 0}};
            const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now()).count();
            ::poll(ready, 2, int(std::clamp<int64_t>(left, 0, deadline.next_wait_ms())));
            if (ready[0].revents) return Done{};
            watch_.look();
            if (watch_.from_board() != heard) end = Clock::now() + silence;
            heard = watch_.from_board();
            if (watch_.waits_in_a_row() > ISOTP_WAITS_MAX) return given_up(ISOTP_WAIT_OVERRUN);
            if (Clock::now() >= end || deadline.left_ms() == 0)
                return fail(fmt::format("{} did not {} in time: reset it and start over", name(), what));
        }
    }

    Error sending_failed(int error) {
        watch_.look();
        switch (error) {
            case ECOMM: return given_up(watch_.has_sent() ? ISOTP_TIMEOUT_BS : ISOTP_TIMEOUT_A);
            case EMSGSIZE: return given_up(ISOTP_BUFFER_OVERFLOW);
            case EBADMSG: return given_up(ISOTP_INVALID_FS);
            default: return can_down(place_, error);
        }
    }

    Error receiving_failed(int error) const {
        switch (error) {
            case ETIMEDOUT: return given_up(ISOTP_TIMEOUT_CR);
            case EILSEQ: return given_up(ISOTP_WRONG_SN);
            default: return can_down(place_, error);
        }
    }

    Error given_up(isotp_error error) const { return fail(name() + ": " + isotp_error_text(error)); }

    int fd_;
    CanPlace place_;
    CanWatch& watch_;
    uint8_t message_[ISOTP_MESSAGE_BYTES_MAX];
    size_t received_ = 0, taken_ = 0;  // of the message
};

}  // namespace

bool kernel_has_isotp() {
    const int fd = ::socket(PF_CAN, SOCK_DGRAM | SOCK_CLOEXEC, CAN_ISOTP);
    if (fd >= 0) ::close(fd);
    return fd >= 0;
}

Result<std::unique_ptr<Transfer>> open_kernel_isotp(const CanPlace& place, CanWatch& watch) {
    auto opened = open_can_address(place, SOCK_DGRAM, CAN_ISOTP);
    if (!opened.ok()) return opened.error();
    auto transfer = std::make_unique<KernelIsotp>(opened->fd, place, watch);
    opened->address.can_addr.tp.tx_id = place.to_board();
    opened->address.can_addr.tp.rx_id = place.to_host();
    can_isotp_options options{};
    options.flags = CAN_ISOTP_WAIT_TX_DONE;
    options.frame_txtime = CAN_ISOTP_FRAME_TXTIME_ZERO;  // the next frame when the bus has taken the one before
    if (::setsockopt(opened->fd, SOL_CAN_ISOTP, CAN_ISOTP_OPTS, &options, sizeof options) != 0 ||
        ::bind(opened->fd, reinterpret_cast<const sockaddr*>(&opened->address), sizeof opened->address) != 0)
        return can_down(place, errno);
    return std::unique_ptr<Transfer>(std::move(transfer));
}

}  // namespace ols
