"""UTC counted on beside this machine's, and the kernel's word on it."""

import ctypes
import subprocess
import sys

import pytest

from catseye.clock import (
    ERROR,
    FAILED,
    FLL,
    NANOSECONDS,
    PER_DAY,
    PER_SECOND,
    PLL,
    PPS_TIME,
    UNIX_EPOCH_DAY,
    UNSYNCHRONISED,
    KernelSync,
    SystemClock,
    Timex,
    kernel_sync,
)


class Machine:
    """CLOCK_REALTIME and CLOCK_MONOTONIC of a machine, ns."""

    def __init__(self):
        self.realtime, self.counter = 1_700_000_000 * PER_SECOND, 77 * PER_SECOND
        self.clock = SystemClock(realtime=lambda: self.realtime, monotonic=lambda: self.counter)

    def run(self, seconds):
        self.realtime += round(seconds * PER_SECOND)
        self.counter += round(seconds * PER_SECOND)

    def jump(self, seconds):
        self.realtime += round(seconds * PER_SECOND)

    @property
    def utc(self):
        return UNIX_EPOCH_DAY * PER_DAY + self.realtime


@pytest.mark.parametrize("jump", [3600.0, -3600.0, 0.5, -1.0])
def test_a_jump_of_the_machine_is_a_departure_and_moves_no_count(jump):
    machine = Machine()
    machine.run(10.0)
    before = machine.clock.now_ns()
    assert before == machine.utc
    machine.jump(jump)
    assert machine.clock.now_ns() == before
    assert machine.clock.departure() == pytest.approx(jump, abs=1e-9)
    machine.run(5.0)
    assert machine.clock.now_ns() == before + 5 * PER_SECOND
    assert machine.clock.correct() == pytest.approx(jump, abs=1e-9)
    assert machine.clock.now_ns() == machine.utc
    assert machine.clock.departure() == 0.0


@pytest.mark.parametrize("step", [0.01, -0.01])
def test_a_slewed_count_reaches_the_machine_in_20_s_and_never_goes_back(step):
    machine = Machine()
    machine.jump(step)
    last = machine.clock.now_ns()
    for second in range(25):
        machine.clock.slew()  # asked for each second, as the watch does
        for _ in range(1000):
            machine.run(0.001)
            now = machine.clock.now_ns()
            assert now > last
            last = now
        left = max(0.0, abs(step) - 5e-4 * (second + 1))
        assert abs(machine.clock.departure()) == pytest.approx(left, abs=1e-8)
    assert machine.clock.now_ns() == machine.utc


def test_the_offset_of_a_night_at_noon_is_no_departure():
    machine = Machine()
    clock = SystemClock(-86_400.5, realtime=lambda: machine.realtime, monotonic=lambda: machine.counter)
    assert clock.now_ns() == machine.utc - 86_400 * PER_SECOND - PER_SECOND // 2
    machine.jump(2.0)
    assert clock.departure() == 2.0
    clock.correct()
    assert clock.now_ns() == machine.utc - 86_400 * PER_SECOND - PER_SECOND // 2


def test_the_closest_pair_of_readings_counts_on_a_busy_machine():
    """Between two readings of the counter others may run: by 0.1 s, unless it is tried again."""
    delays = iter([100_000_000, 40_000_000, 1_000, 100_000_000])
    counter = [0]

    def monotonic():
        return counter[0]

    def realtime():
        counter[0] += next(delays)
        return counter[0]

    assert SystemClock(realtime=realtime, monotonic=monotonic).now_ns() - UNIX_EPOCH_DAY * PER_DAY - counter[0] == 500


def test_this_machines_clock_reads_what_it_is_started_at():
    clock = SystemClock.starting_at(60_635.125)
    assert abs(clock.now_ns() - round(60_635.125 * PER_DAY)) < PER_SECOND
    assert abs(SystemClock().departure()) < 0.02


def told(state, status, **fields):
    """An adjtimex that says so."""

    def adjtimex(timex):
        timex.status = status
        for name, value in fields.items():
            setattr(timex, name, value)
        return state

    return adjtimex


@pytest.mark.parametrize(
    ("status", "source", "unit"),
    [
        (PLL, "NTP", 1e-6),
        (FLL | NANOSECONDS, "NTP", 1e-9),
        (PPS_TIME | PLL, "PPS", 1e-6),
        (0, "PTP or NTP", 1e-6),
    ],
)
def test_a_synchronised_kernel_says_by_what_and_how_well(status, source, unit):
    sync = kernel_sync(told(0, status, offset=-1500, esterror=250, maxerror=8000))
    assert sync == KernelSync(source, -1500 * unit, 250e-6, 8e-3)


@pytest.mark.parametrize("said", [(FAILED, 0), (ERROR, UNSYNCHRONISED), (0, UNSYNCHRONISED), (ERROR, 0)])
def test_a_kernel_that_is_not_synchronised_or_does_not_say_is_unknown(said):
    assert kernel_sync(told(*said)) is None


@pytest.mark.skipif(sys.platform != "linux", reason="adjtimex is Linux's")
def test_the_kernels_own_structure_is_read_as_it_lies():
    """It holds this machine's UTC; another layout would give anything else."""
    timex = Timex()
    state = ctypes.CDLL(None).adjtimex(ctypes.byref(timex))
    if state == FAILED:
        pytest.skip("adjtimex is not allowed here")
    now = int(subprocess.run(["date", "+%s"], capture_output=True, text=True, check=True).stdout)
    assert 0 <= now - timex.seconds <= 5
    assert 0 <= timex.tai < 100
    assert kernel_sync() is None or kernel_sync().most >= 0.0
