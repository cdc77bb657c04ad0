// SPDX-License-Identifier: MIT
// A board that is in use, shared: other programs' messages to it, which are put between the user's own.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "device/board.hpp"

namespace ols {

// Listens on an AF_UNIX socket as the emulated board's USB does (docs/architecture.md, "USB transfers over a socket"), for one
// client at a time: "socket:PATH" is then a link to the board.
class BoardRelay {
  public:
    // Replaces a socket that nobody listens at any more. Errors: it cannot be made there, or another program listens.
    static Result<std::unique_ptr<BoardRelay>> listen(const std::string& path);
    ~BoardRelay();

    // Takes in what has come and answers it, without waiting; asks the board at most one message. From the thread that uses the
    // board. The error is the board's: it is heard no more.
    Status serve(Board& board);

    BoardRelay(const BoardRelay&) = delete;

  private:
    struct Client;
    BoardRelay(std::string path, int listener);
    Status serve_client(Board& board);

    const std::string path_;
    const int listener_;
    std::unique_ptr<Client> client_;
};

}  // namespace ols
