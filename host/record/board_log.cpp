// SPDX-License-Identifier: MIT
// Reading the trigger log while the board plays.
#include "record/board_log.hpp"

#include <chrono>
#include <optional>

#include "exceptions.hpp"

namespace ols {

namespace {

// Between two looks at a board that has no more than one message of news. At 2160 triggers a second a message of 48
// fills in 22 ms, at 20 000 in 2.4 ms; the board keeps 1024.
constexpr std::chrono::milliseconds poll_pause(2);

// Why a board that no longer plays has stopped; "" when it played to the end.
std::string reason_to_end(const ols_status_reply& status, const std::string& why_told) {
    if (status.state == OLS_STATE_DONE) return "";
    if (status.state == OLS_STATE_FAULT) return "the board stopped with fault " + fault_text(status);
    return why_told.empty() ? "somebody stopped the board" : why_told;
}

}  // namespace

BoardLog::BoardLog(Board& board, const std::atomic<uint64_t>& arrivals, std::function<std::string()> why_stop,
                   std::function<void(LogNews)> on_news, std::function<void(LogEnd)> on_end)
    : board_(board), arrivals_(arrivals), why_stop_(std::move(why_stop)), on_news_(std::move(on_news)) {
    thread_ = std::thread([this, on_end = std::move(on_end)] {
        auto end = guarded("the board's log cannot be followed", [this] { return Result<LogEnd>(follow()); });
        on_end(end ? std::move(*end) : LogEnd{end.error().message, true});
    });
}

BoardLog::~BoardLog() {
    thread_.join();
}

LogEnd BoardLog::follow() {
    uint32_t next = 0, known = 0;
    std::string told_to_stop;
    std::optional<std::string> ending;
    for (;;) {
        if (told_to_stop.empty() && !(told_to_stop = why_stop_()).empty()) {
            // A board that has finished or failed meanwhile refuses, which its status then explains.
            (void)board_.stop();
        }
        const uint64_t arrivals = arrivals_;
        auto log = board_.read_trigger_log(next, known);
        if (!log.ok()) return {log.error().message, true};
        const size_t count = log->entries.size();
        if (count) next = log->entries.back().counter + 1;
        known = log->next_counter;
        on_news_({std::move(log->entries), log->next_counter, arrivals});
        if (count >= OLS_LOG_ENTRIES_MAX) continue;
        if (ending && count == 0) return {*ending};
        const auto status = board_.status();
        if (!status.ok()) return {status.error().message, true};
        if (status->boot_nonce != board_.info().boot_nonce) return {"the board was reset", true};
        if (status->state != OLS_STATE_PLAYING && status->state != OLS_STATE_WAITING)
            ending = reason_to_end(*status, told_to_stop);
        else
            std::this_thread::sleep_for(poll_pause);
    }
}

}  // namespace ols
