// SPDX-License-Identifier: MIT
// What goes on around a link on a SocketCAN interface: who else uses the board's identifiers, and what the controller says of
// the bus (Linux, Documentation/networking/can.rst and include/uapi/linux/can/error.h). ISO-TP itself knows neither.
#pragma once

#include <linux/can.h>

#include <cstdint>
#include <memory>
#include <string>

#include "device/can_place.hpp"
#include "result.hpp"

namespace ols {

// Holds a board for this process, as claiming the interface does on USB: two programs on one pair of identifiers would take each
// other's replies and answer each other's flow control. Ends with the process, however that ends.
class CanClaim {
  public:
    static Result<std::unique_ptr<CanClaim>> take(const CanPlace& place);
    ~CanClaim();
    CanClaim(const CanClaim&) = delete;
    CanClaim& operator=(const CanClaim&) = delete;

  private:
    explicit CanClaim(int fd) : fd_(fd) {}
    int fd_;
};

class CanWatch {
  public:
    static Result<std::unique_ptr<CanWatch>> open(const CanPlace& place);
    ~CanWatch();
    CanWatch(const CanWatch&) = delete;
    CanWatch& operator=(const CanWatch&) = delete;

    int fd() const { return fd_; }  // readable when there is something to look at

    // Takes in what has happened.
    void look();
    // Begins anew, with what has happened already.
    void forget();

    uint64_t from_board() const { return from_board_; }  // ISO-TP frames
    int waits_in_a_row() const { return waits_in_a_row_; }
    bool has_sent() const { return has_sent_; }  // a frame of ours was on the bus

    // What explains a failure since forget(), as a sentence behind it; or nothing.
    std::string trouble() const;

  private:
    CanWatch(int fd, CanPlace place) : fd_(fd), place_(std::move(place)) {}
    void take(const can_frame& frame, bool is_local);
    void take_error(const can_frame& frame);

    int fd_;
    CanPlace place_;
    uint64_t from_board_ = 0, of_others_ = 0;
    int waits_in_a_row_ = 0;
    int interface_error_ = 0;  // that it went down, or away
    bool has_sent_ = false, bus_off_ = false, passive_ = false, unacknowledged_ = false;
};

}  // namespace ols
