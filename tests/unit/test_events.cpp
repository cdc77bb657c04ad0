// SPDX-License-Identifier: MIT
// Events: numbers without gaps, what is kept, and a subscriber that is behind.
// links: ols_daemon
#include "daemon/events.hpp"

#include <gtest/gtest.h>

#include <set>
#include <thread>

#include "daemon/subscriber.hpp"

namespace ols {
namespace {

using namespace std::chrono_literals;

TEST(Events, every_kind_has_one_code_and_one_name) {
    std::set<int> codes;
    std::set<std::string> names;
    for (const EventKindFacts& facts : event_kinds()) {
        EXPECT_TRUE(codes.insert(int(facts.kind)).second);
        EXPECT_TRUE(names.insert(facts.name).second);
        EXPECT_EQ(&facts_of(facts.kind), &facts);
    }
}

TEST(Events, times_are_written_as_iso_8601_has_them) {
    EXPECT_EQ(utc_text(0), "1970-01-01T00:00:00.000Z");
    EXPECT_EQ(utc_text(951'782'400'007), "2000-02-29T00:00:00.007Z");
}

TEST(Events, progress_is_told_and_neither_kept_nor_logged) {
    int logged = 0;
    EventLog log([&](const Event&) { ++logged; });
    Subscriber subscriber(log);
    log.add(EventKind::take_progress, "a");
    log.add(EventKind::fault, "b");
    EXPECT_EQ(subscriber.next(0ms)->number, 1u);
    EXPECT_EQ(subscriber.next(0ms)->number, 2u);
    EXPECT_FALSE(subscriber.next(0ms));
    ASSERT_EQ(log.since(0, 10).size(), 1u);
    EXPECT_EQ(log.since(0, 10)[0].number, 2u);
    EXPECT_EQ(logged, 1);
}

TEST(Events, a_bounded_past_is_kept_and_asked_for_by_number) {
    EventLog log({});
    for (size_t n = 0; n < EventLog::kept_max + 5; ++n) log.add(EventKind::note, std::to_string(n));
    EXPECT_EQ(log.since(0, 1'000'000).size(), EventLog::kept_max);
    EXPECT_EQ(log.since(0, 3).front().number, EventLog::kept_max + 3);
    EXPECT_EQ(log.since(EventLog::kept_max + 4, 100).size(), 1u);
    EXPECT_EQ(log.since(UINT64_MAX, 100).size(), 0u);
}

TEST(Events, a_subscriber_that_takes_nothing_is_known_and_bounded) {
    EventLog log({});
    Subscriber subscriber(log);
    for (size_t n = 0; n < Subscriber::waiting_max; ++n) log.add(EventKind::note, "");
    EXPECT_FALSE(subscriber.is_behind());
    log.add(EventKind::note, "");
    EXPECT_TRUE(subscriber.is_behind());
    size_t taken = 0;
    while (subscriber.next(0ms)) ++taken;
    EXPECT_EQ(taken, Subscriber::waiting_max);
}

TEST(Events, of_many_threads_have_each_number_once_in_order) {
    EventLog log({});
    Subscriber subscriber(log);
    {
        std::vector<std::jthread> threads;
        for (int t = 0; t < 4; ++t)
            threads.emplace_back([&] {
                for (int n = 0; n < 200; ++n) log.add(EventKind::note, "");
            });
    }
    for (uint64_t number = 1; number <= 800; ++number) EXPECT_EQ(subscriber.next(0ms)->number, number);
}

}  // namespace
}  // namespace ols
