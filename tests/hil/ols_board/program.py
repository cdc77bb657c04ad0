# SPDX-License-Identifier: MIT
# Programs for the tests: slots as plain dictionaries, which JSON can hold.
import random

from ols_board.wire import BASIS, DARK, MATTE, TRACKING

CHAIN_BITS = 176
LAMPS = 162
PERIOD_TICKS = 57870  # 2160 Hz
EXPOSURE_TICKS = 51500  # 412 us


def paper_program(cycles, slots=180, seed=1):
    """Groups of 18: tracking, matte, 16 basis slots with random patterns, the last two of each cycle dark."""
    pick = random.Random(seed)
    program = []
    for n in range(slots):
        place = n % 18
        kind = TRACKING if place == 0 else MATTE if place == 1 else DARK if n >= slots - 2 else BASIS
        bits = [0] * CHAIN_BITS
        if kind == TRACKING:
            bits[:156] = [1] * 156
        elif kind == MATTE:
            bits[156:LAMPS] = [1] * 6
        elif kind == BASIS:
            bits[:156] = [pick.randint(0, 1) for _ in range(156)]
        exposure = 6250 if kind == TRACKING else EXPOSURE_TICKS
        program.append({"kind": kind, "trigger_mask": 1, "exposure_ticks": exposure, "period_ticks": PERIOD_TICKS,
                        "bits": bits})
    return {"cycles": cycles, "chain_bits": CHAIN_BITS, "slots": program}
