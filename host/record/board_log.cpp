// SPDX-License-Identifier: MIT
// Reading the trigger log while the board plays.
#include "record/board_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <optional>

#include "device/log_reader.hpp"
#include "exceptions.hpp"
#include "steady_clock.hpp"

namespace ols {

namespace {

// Between two looks at a board that has no more than one message of news. At 2160 triggers a second a message of 48
// fills in 22 ms, at 20 000 in 2.4 ms; the board keeps 1024.
constexpr std::chrono::milliseconds poll_pause(2);

// Why a board that no longer plays has stopped; empty when it played to the end.
Reason reason_to_end(const ols_status_reply& status, const Reason& why_told) {
    if (status.state == OLS_STATE_DONE) return {};
    if (status.state == OLS_STATE_FAULT)
        return {Cause::board_did_not_fire, "the board stopped with fault " + fault_text(status)};
    return why_told.empty() ? Reason{Cause::stopped, "somebody stopped the board"} : why_told;
}

LogEnd lost(std::string why) {
    return {{Cause::board_gone, std::move(why)}, true};
}

}  // namespace

PlayBounds::PlayBounds(const Sequence& sequence) {
    // Of the sequence's own time; a cycle for what comes before its first light, and a second.
    if (sequence.config.cycles == 0) return;
    triggers = std::min<uint64_t>(triggers, sequence.trigger_count());
    if (sequence.config.playback.start == StartSource::photo) return;  // each cycle waits for as long as it must
    ticks = (uint64_t(sequence.config.cycles) + 1) * sequence.cycle_ticks() + tick_hz;
}

BoardLog::BoardLog(Board& board, const PlayBounds& bounds, std::function<std::vector<uint64_t>()> arrivals,
                   std::function<Reason()> why_stop, std::function<void(LogNews)> on_news,
                   std::function<void(LogEnd)> on_end, std::function<Status()> between, RecordMonitor* monitor)
    : board_(board),
      bounds_(bounds),
      arrivals_(std::move(arrivals)),
      why_stop_(std::move(why_stop)),
      on_news_(std::move(on_news)),
      between_(std::move(between)),
      monitor_(monitor ? *monitor : own_monitor_),
      beat_(monitor_.stages().add("board log")) {
    thread_ = std::thread([this, on_end = std::move(on_end)] { on_end(follow()); });
}

BoardLog::~BoardLog() {
    thread_.join();
}

LogEnd BoardLog::follow() {
    auto read = guarded("the board's log cannot be followed", [this] { return Result<LogEnd>(read_to_end()); });
    LogEnd end = read ? std::move(*read) : lost(read.error().message);
    if (end.is_lost) board_.tell_to_stop();
    monitor_.change_board([&](BoardProgress& board) { board.has_ended = true, board.end = end.why; });
    beat_.beat(StageActivity::ended);
    return end;
}

// A board that plays has a clock that goes on, and not for longer than the program.
Status BoardLog::check_clock(const ols_status_reply& status) {
    if (!next_tick_ || status.now_ticks != last_tick_ || status.state != OLS_STATE_PLAYING) {
        last_tick_ = status.now_ticks;
        next_tick_.emplace(board_.begin_exchange());
    }
    if (next_tick_->left_ms() == 0)
        return fail(fmt::format("{} says that it plays, and its clock has stood still at tick {}: reset it",
                                board_.name(), last_tick_));
    if (status.now_ticks > bounds_.ticks && status.state == OLS_STATE_PLAYING)
        return fail(fmt::format("{} plays on at tick {}, and the program ends before tick {}: reset it", board_.name(),
                                last_tick_, bounds_.ticks));
    return Done{};
}

// The board's status, and what it tells of the clocks and of the light.
Result<ols_status_reply> BoardLog::ask_status() {
    const uint64_t asked_ns = steady_ns();
    auto status = board_.status();
    const uint64_t answered_ns = steady_ns();
    if (!status.ok()) return status;
    if (status->boot_nonce != board_.info().boot_nonce) return fail("the board was reset");
    if (status->state == OLS_STATE_PLAYING) host_clock_.add(asked_ns, answered_ns, status->now_ticks);
    const bool is_dark = status->state != OLS_STATE_PLAYING && status->state != OLS_STATE_WAITING;
    monitor_.change_board([&](BoardProgress& board) {
        board.now_ticks = status->now_ticks;
        if (is_dark && board.dark_confirmed_ns == 0) board.dark_confirmed_ns = answered_ns;
    });
    return status;
}

// Its word that it is dark comes before what is left of its log, which takes longer. A board that has finished or failed meanwhile
// refuses the stop, which its status then explains.
void BoardLog::tell_to_stop() {
    monitor_.change_board([](BoardProgress& board) { board.stop_told_ns = steady_ns(); });
    (void)board_.stop();
    (void)ask_status();  // what fails here fails again when it is asked next
}

LogEnd BoardLog::read_to_end() {
    LogReader reader(board_, bounds_.triggers);
    Reason told_to_stop;
    std::optional<Reason> ending;
    for (std::optional<uint32_t> fired_at_end;;) {
        beat_.beat();
        if (told_to_stop.empty() && !(told_to_stop = why_stop_()).empty()) tell_to_stop();
        if (between_)
            if (const Status done = between_(); !done.ok()) return lost(done.error().message);
        std::vector<uint64_t> arrivals = arrivals_();
        auto log = reader.read_on();
        if (!log.ok()) return lost(log.error().message);
        const size_t count = log->entries.size();
        monitor_.change_board([&](BoardProgress& board) { board.triggers_fired = reader.fired(); });
        on_news_({std::move(log->entries), reader.fired(), std::move(arrivals)});
        if (ending && fired_at_end.value_or(reader.fired()) != reader.fired())
            return lost(board_.name() + " fires on although it says that it has stopped: reset it");
        if (ending) fired_at_end = reader.fired();
        if (count >= OLS_LOG_ENTRIES_MAX) continue;
        if (ending && count == 0) return {*ending};
        if (ending) continue;
        const auto status = ask_status();
        if (!status.ok()) return lost(status.error().message);
        if (const Status goes_on = check_clock(*status); !goes_on.ok()) return lost(goes_on.error().message);
        if (status->state != OLS_STATE_PLAYING && status->state != OLS_STATE_WAITING)
            ending = reason_to_end(*status, told_to_stop);
        else
            std::this_thread::sleep_for(poll_pause);
    }
}

}  // namespace ols
