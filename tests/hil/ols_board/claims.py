# SPDX-License-Identifier: MIT
# What a run has shown of the board, by what it was shown: told at the end of `make hil`.

# On the emulated board, PIO's edges are right to the tick: what was seen of them was measured.
measured_claims = []
# The processor's times there are counted cycles, without flash or bus wait states: they bound, and no more.
counted_claims = []


def measured(text):
    """Something about edges that PIO made, as seen on the trace or by the board's own witness."""
    print(text)
    measured_claims.append(text)


def counted(text):
    """Something that hangs on how long the processor takes."""
    print(text)
    counted_claims.append(text)


def summary():
    """Lines to print."""
    parts = (("Measured: edges made by PIO, right to the tick", measured_claims),
             ("Bounded: hangs on the processor, whose cycles were counted", counted_claims))
    return [line for title, claims in parts if claims for line in ["", f"{title}:", *(f"  {text}" for text in claims)]]
