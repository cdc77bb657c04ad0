// SPDX-License-Identifier: MIT
// spdlog for lines, sd_journal_send for fields.
#include "daemon/journal_log.hpp"

#include <fmt/format.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <syslog.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

#include <cstdlib>

namespace ols {

namespace {

// systemd.exec(5), $JOURNAL_STREAM: device and inode of the stream, so that a redirection is noticed.
bool is_journal(int fd) {
    const char* const stream = std::getenv("JOURNAL_STREAM");
    struct stat facts {};
    if (!stream || fstat(fd, &facts) != 0) return false;
    return fmt::format("{}:{}", facts.st_dev, facts.st_ino) == stream;
}

int priority_of(EventLevel level) {
    switch (level) {
        case EventLevel::debug: return LOG_DEBUG;
        case EventLevel::info: return LOG_INFO;
        case EventLevel::warning: return LOG_WARNING;
        case EventLevel::error: return LOG_ERR;
    }
    return LOG_INFO;
}

spdlog::level::level_enum spd_level_of(EventLevel level) {
    switch (level) {
        case EventLevel::debug: return spdlog::level::debug;
        case EventLevel::info: return spdlog::level::info;
        case EventLevel::warning: return spdlog::level::warn;
        case EventLevel::error: return spdlog::level::err;
    }
    return spdlog::level::info;
}

// An event's text may come from a device or a client: it stays on its line.
std::string on_one_line(std::string text) {
    for (char& c : text)
        if (static_cast<unsigned char>(c) < ' ') c = ' ';
    return text;
}

void send_to_journal(const Event& event) {
    const EventKindFacts& facts = facts_of(event.kind);
    sd_journal_send("MESSAGE=%d %s: %s", int(event.kind), facts.name, on_one_line(event.text).c_str(), "PRIORITY=%d",
                    priority_of(facts.level), "SYSLOG_IDENTIFIER=stagectl", "OLS_CODE=%d", int(event.kind),
                    "OLS_EVENT=%s", facts.name, "OLS_NUMBER=%llu", static_cast<unsigned long long>(event.number),
                    nullptr);
}

}  // namespace

EventLog::Listener make_log() {
    if (is_journal(STDERR_FILENO)) return send_to_journal;
    auto logger = std::make_shared<spdlog::logger>("stagectl", std::make_shared<spdlog::sinks::stderr_sink_mt>());
    logger->set_pattern("%Y-%m-%d %H:%M:%S.%e %l %v");
    logger->flush_on(spdlog::level::debug);
    return [logger](const Event& event) {
        const EventKindFacts& facts = facts_of(event.kind);
        logger->log(spd_level_of(facts.level), "{} {}: {}", int(event.kind), facts.name, on_one_line(event.text));
    };
}

}  // namespace ols
