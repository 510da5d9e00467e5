"""The line through the robot's clock, over many logs."""

from acqd.dataset.align import Lag
from acqd.sidecar.clock_memory import ClockMemory


def test_the_clocks_line_holds_for_more_logs_than_it_remembers_and_begins_anew_when_it_was_set():
    clock = ClockMemory()
    located = []
    for number in range(45):
        middle = 3600.0 * number
        lag = 1.0 + 20e-6 * middle + (2.0 if number >= 38 else 0.0)
        seconds, how = clock.place(middle, Lag(lag, 0.9, 3.0))
        located.append((seconds - lag, how))
    assert max(abs(off) for off, _ in located) < 1e-3
    assert located[37][1] == "clock line" and located[38][1] == "own" and located[-1][1] == "clock line"
