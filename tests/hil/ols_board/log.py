# SPDX-License-Identifier: MIT
# Reading the trigger log without end while the board plays, as a host must that wants every trigger.
from ols_board import wire

MESSAGE_ENTRIES = 48
MESSAGES_AT_ONCE = 4  # of 22 bytes: two packets, which the board takes before it is asked for its first reply


class TriggerStream:
    """Follows the log from counter 0 on. Keeps every entry, and what the board says it has lost."""

    def __init__(self, link, messages_at_once=MESSAGES_AT_ONCE):
        self.link = link
        self.messages_at_once = messages_at_once
        self.entries = []
        self.skipped = 0  # counters that were gone when we asked for them
        self.lost = 0  # as the board counts them
        self.next_counter = 0  # that the next trigger will have
        self.backlog_max = 0
        self.requests = 0
        self._next = 0

    def poll(self):
        """Asks once: for as many messages as are known to be full. Returns how many entries came."""
        known = (self.next_counter - self._next) // MESSAGE_ENTRIES
        messages = max(1, min(self.messages_at_once, known))
        firsts = [self._next + n * MESSAGE_ENTRIES for n in range(messages)]
        came = 0
        for reply in self.link.ask_many(wire.READ_TRIGGER_LOG, [wire.READ_LOG.pack(n, MESSAGE_ENTRIES) for n in firsts]):
            came += self._take(reply)
        self.requests += messages
        return came

    def _take(self, reply):
        first, self.next_counter, self.lost, count, _ = wire.LOG_REPLY.unpack_from(reply)
        new = [wire.LOG_ENTRY.unpack_from(reply, wire.LOG_REPLY.size + n * wire.LOG_ENTRY.size) for n in range(count)]
        assert [entry[1] for entry in new] == list(range(first, first + count)), "counters within a message"
        self.skipped += max(0, first - self._next)
        self.backlog_max = max(self.backlog_max, self.next_counter - self._next)
        # When what was asked for is gone, the replies to several requests begin alike, at the oldest entry.
        new = [entry for entry in new if entry[1] >= self._next]
        self.entries += new
        self._next = max(self._next, first + count)
        return len(new)

    def follow_to_the_end(self):
        """Until the board plays no longer and everything is read; returns its status."""
        while True:
            if self.poll() < MESSAGE_ENTRIES:
                status = self.link.status()
                if status["state"] != wire.PLAYING:
                    while self.poll():
                        pass
                    return status
