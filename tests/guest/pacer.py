# SPDX-License-Identifier: MIT
"""Keeps an emulated board and the guest in step, whatever the machine does besides: time-outs of libusb and of the kernel's ISO-TP
go by the guest's clock and those of the firmware by the board's, and neither may run away from the other. Who is ahead waits."""
import select
import signal
import threading
import time

TICKS_PER_S = 125_000_000
APART_S, TOGETHER_S = 0.1, 0.02  # time-outs are a second


class Pacer:
    def __init__(self, guest, board):
        self.guest, self.process, self.bus = guest, board.process, board.bus()
        self.over = threading.Event()
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _look(self):
        """The board's time, in seconds."""
        while select.select([self.bus.socket], [], [], 0)[0]:
            self.bus.receive()
        return self.bus.tick / TICKS_PER_S

    def _run(self):
        try:
            while self.bus.tick == 0:
                self.bus.receive()
            ahead_at_first = self._look() - self.guest.elapsed_s()
            waits = False  # the board
            while not self.over.wait(0.005):
                ahead = self._look() - self.guest.elapsed_s() - ahead_at_first
                if ahead < -APART_S:
                    self.guest.pause()
                elif ahead > -TOGETHER_S:
                    self.guest.resume()
                if ahead > APART_S and not waits or ahead < TOGETHER_S and waits:
                    waits = not waits
                    self.process.send_signal(signal.SIGSTOP if waits else signal.SIGCONT)
        except OSError:
            pass  # the board has gone
        finally:
            self.process.send_signal(signal.SIGCONT)
            self.guest.resume()

    def close(self):
        self.over.set()
        self.thread.join()
        self.bus.close()
