// SPDX-License-Identifier: MIT
// The emulated board's sockets when the other end is silent, gone, busy or not there: an error that says which, and no wait
// without end.
// links: ols_device
#include "device/unix_socket.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <thread>

#include "device/can_bus.hpp"
#include "device/transfer.hpp"
#include "device/unix_address.hpp"
#include "device/unix_listener.hpp"

using namespace ols;

namespace {

constexpr int short_ms = 30, long_ms = 60'000;

// An exchange that begins now, and has so long.
Deadline within(int ms) {
    static Patience patience(0);
    patience = Patience(ms);
    return patience.begin_exchange();
}

// Listens, and does with clients what the test says.
class OtherEnd : public testing::Test {
  protected:
    void SetUp() override {
        path_ = testing::TempDir() + "end" + std::to_string(getpid()) + ".sock";
        unlink(path_.c_str());
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        std::memcpy(address.sun_path, path_.c_str(), path_.size());
        listener_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
        ASSERT_EQ(bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
        ASSERT_EQ(listen(listener_, 0), 0);
    }
    void TearDown() override {
        close(listener_);
        unlink(path_.c_str());
    }
    int accept_client() { return accept(listener_, nullptr, nullptr); }

    std::string path_;
    int listener_ = -1;
};

std::string error_of(const Result<std::vector<uint8_t>>& result) {
    return result.ok() ? "" : result.error().message;
}

}  // namespace

TEST_F(OtherEnd, a_board_that_does_not_move_is_given_up_and_named) {
    auto transfer = open_socket_transfer(path_, within(short_ms));
    ASSERT_TRUE(transfer.ok());
    const int client = accept_client();
    const std::string error = error_of((*transfer)->read(64, 1000, within(short_ms)));
    EXPECT_NE(error.find("has not finished an exchange within 0.03 s"), std::string::npos) << error;
    EXPECT_NE(error.find(path_), std::string::npos) << error;
    close(client);
}

TEST_F(OtherEnd, a_board_that_takes_nothing_is_given_up_too) {
    auto transfer = open_socket_transfer(path_, within(short_ms));
    const int client = accept_client();
    const Status sent = (*transfer)->write(std::vector<uint8_t>(64 << 20), 1000, within(short_ms));
    ASSERT_FALSE(sent.ok());
    EXPECT_NE(sent.error().message.find("has not finished an exchange"), std::string::npos) << sent.error().message;
    close(client);
}

TEST_F(OtherEnd, connecting_to_one_that_lets_nobody_in_ends) {
    std::vector<UnixSocket> queue;
    for (int n = 0; n < 100; ++n) {
        auto socket = UnixSocket::connect(path_, "the board", within(short_ms));
        if (!socket.ok()) {
            EXPECT_NE(socket.error().message.find("has not finished an exchange"), std::string::npos)
                << socket.error().message;
            return;
        }
        queue.push_back(std::move(*socket));
    }
    FAIL() << "a hundred clients were let in";
}

TEST(UnixAddresses, that_the_system_has_no_room_for_are_refused) {
    EXPECT_TRUE(unix_address(std::string(107, 'a')).ok());
    for (const std::string& path : {std::string(), std::string(108, 'a')})
        for (const Error& error :
             {UnixSocket::connect(path, "the board", within(short_ms)).error(), listen_at(path).error()})
            EXPECT_NE(error.message.find("'" + path + "' is no path of a socket, which has 1 to 107 bytes"),
                      std::string::npos)
                << error.message;
}

TEST_F(OtherEnd, a_bus_that_does_not_tell_the_time_is_given_up) {
    const auto bus = open_can_socket(path_, within(short_ms));
    ASSERT_FALSE(bus.ok());
    EXPECT_NE(bus.error().message.find("the CAN bus"), std::string::npos) << bus.error().message;
    EXPECT_NE(bus.error().message.find("has not finished an exchange"), std::string::npos) << bus.error().message;
}

TEST_F(OtherEnd, a_board_that_went_is_gone) {
    auto transfer = open_socket_transfer(path_, within(long_ms));
    close(accept_client());
    const std::string error = error_of((*transfer)->read(64, 1000, within(long_ms)));
    EXPECT_NE(error.find("is gone"), std::string::npos) << error;
}

TEST_F(OtherEnd, a_board_that_turns_a_client_away_is_busy_and_not_gone) {
    auto transfer = open_socket_transfer(path_, within(long_ms));
    std::thread board([&] {
        const int client = accept_client();
        struct {
            uint32_t magic = 0x52425355, tag = 0;
            int32_t status = -6;
            uint32_t length = 0;
        } const busy;  // docs/architecture.md, "USB transfers over a socket"
        EXPECT_EQ(write(client, &busy, sizeof busy), ssize_t(sizeof busy));
        close(client);
    });
    board.join();  // it is gone when it is asked
    const std::string error = error_of((*transfer)->read(64, 1000, within(long_ms)));
    EXPECT_NE(error.find("busy"), std::string::npos) << error;
    EXPECT_EQ(error.find("gone"), std::string::npos) << error;
}

TEST_F(OtherEnd, what_is_not_there_says_to_start_the_stage) {
    const auto transfer = open_socket_transfer(path_ + "x", within(long_ms));
    ASSERT_FALSE(transfer.ok());
    EXPECT_NE(transfer.error().message.find("start the stage first"), std::string::npos);
}
