"""Scaling of the Beckhoff EL3783 terminal: 16 bit, LSB = measuring-range end value / 32768."""

from __future__ import annotations

from typing import Literal

U_V_PER_DIGIT = 737.2575 / 32768
"""22.5 mV."""
CurrentRange = Literal[1, 5]
I_A_PER_DIGIT: dict[CurrentRange, float] = {5: 9.207527 / 32768, 1: 1.8415054 / 32768}
"""281 uA in the 5 A range, 56.2 uA in the 1 A range."""
RATE = 20_000.0
"""Samples/s at 50 us conversion time."""
