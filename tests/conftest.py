# SPDX-License-Identifier: MIT
"""For all tests: Ctrl-C reaches the programs they start, also where the tests themselves run in the background."""
import signal

# What a shell starts in the background ignores SIGINT, and so does everything below it; a handler ends that at the next exec.
signal.signal(signal.SIGINT, signal.default_int_handler)
