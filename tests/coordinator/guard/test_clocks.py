"""This machine's clock against steady counter, kernel and rangers."""

from types import SimpleNamespace

import numpy as np
import pytest

from catseye.clock import PER_SECOND, KernelSync, SystemClock
from catseye.coordinator.event_log import EventLog
from catseye.coordinator.guard.clocks import SETTLE, SMALL, WAIT, ClockVote, HostClock
from catseye.coordinator.parts import TICKS_PER_SECOND, ticks_now
from catseye.errors import InputError
from catseye.ranger.status import StatusWord

NTP = KernelSync("NTP", 1e-4, 5e-4, 0.01)
JUMPS = [0.15, -0.15, 10.0, -10.0, 3600.0, -3600.0, -1.0]  # the last is a leap second
QUIET = ["host-clock"]  # what it says at first


class Machine:
    """A machine whose UTC is set now and then, its steady counter, and rangers whose clocks are right.

    truth   s by which true time is ahead of the count
    """

    def __init__(self, rangers=6, kernel=None, error=0.001):
        self.realtime, self.counter, self.truth, self.said = 1_700_000_000 * PER_SECOND, 5 * PER_SECOND, 0.0, []
        self.kernel, self.error = kernel, error
        self.clock = SystemClock(realtime=lambda: self.realtime, monotonic=lambda: self.counter)
        self.links = {
            f"ZY{k}": SimpleNamespace(
                connected=True, status=StatusWord(0), clock_offset=0.0, clock_error=error, clock_seen=0
            )
            for k in range(rangers)
        }
        log = EventLog("coordinator", self.clock, self.said.append)
        self.watch = HostClock(self.links, self.clock, log, kernel=lambda: self.kernel)
        self.across, self.corrections = [], []
        self.watch.jumped = lambda since, until: self.across.append((since, until))
        self.watch.corrected = self.correct

    def correct(self, seconds):
        self.corrections.append(seconds)
        self.truth -= seconds
        for link in self.links.values():  # as `ClockWatch.corrected` does
            link.clock_offset, link.clock_seen = float("nan"), 0

    def jump(self, seconds):
        self.realtime += round(seconds * PER_SECOND)

    def run(self, seconds, *, steered=0.0, wander=0.0):
        """So many looks, one each second; UTC steered, or the count itself wrong, by so much a second."""
        for _ in range(round(seconds)):
            self.counter += PER_SECOND
            self.realtime += round((1.0 + steered) * PER_SECOND)
            self.truth += wander
            for link in self.links.values():
                if link.clock_seen >= 0:
                    link.clock_offset, link.clock_seen = self.truth, ticks_now(self.clock)
            self.watch.look(self.counter / PER_SECOND)

    @property
    def kinds(self):
        return [what.kind for what in self.said]


@pytest.mark.parametrize("jump", JUMPS)
def test_jump_is_reported_and_the_count_continues_if_rangers_agree_with_it(jump):
    machine = Machine()
    machine.run(30)
    assert machine.watch.believed
    before = machine.clock.now_ns() - machine.counter
    machine.jump(jump)
    machine.run(1)
    assert not machine.watch.believed  # nothing is fired until it is known which is right
    assert machine.kinds == [*QUIET, "host-clock-jump", "host-clock-unsettled"]
    assert machine.said[1].severity == "alarm"
    assert f"jumped by {jump:+.3f} s" in machine.said[1].text
    machine.run(SETTLE)
    assert machine.watch.believed
    assert machine.clock.now_ns() - machine.counter == before
    assert machine.kinds[3:] == ["host-clock-off"]
    assert (
        f"6 of 6 rangers' clocks agree that this machine's is {jump:+.3f} s off: measuring continues"
        in machine.said[3].text
    )
    machine.run(60)
    machine.jump(-jump)
    machine.run(1)
    assert not machine.watch.believed
    machine.run(30)
    assert machine.watch.believed
    assert machine.kinds[4:] == ["host-clock-jump", "host-clock-off-over"]
    assert machine.corrections == []
    assert machine.watch.trouble is None


@pytest.mark.parametrize("jump", JUMPS)
def test_correct_jump_is_adopted_without_a_restart(jump):
    """It was wrong from the start: rangers contradict it, nothing is fired; its time service sets it right."""
    machine = Machine()
    machine.truth = jump
    machine.run(30)
    assert machine.kinds == [*QUIET, "host-clock-off"]
    assert f"6 of 6 rangers' clocks agree that this machine's is {-jump:+.3f} s off" in machine.said[1].text
    assert not machine.watch.believed
    machine.jump(jump)
    machine.run(1 + SETTLE)
    assert machine.corrections == [pytest.approx(jump, abs=1e-6)]
    assert machine.clock.departure() == pytest.approx(0.0, abs=1e-9)
    corrected = next(what for what in machine.said if what.kind == "clock-corrected")
    assert f"corrected by {jump:+.3f} s" in corrected.text
    assert "6 of 6 rangers' clocks agree with it" in corrected.text
    assert corrected.details["offset_s"] == pytest.approx(jump, abs=1e-6)
    machine.run(30)
    assert machine.watch.believed
    assert machine.watch.trouble is None
    assert machine.kinds[-1] == "host-clock-off-over"


@pytest.mark.parametrize("jump", JUMPS)
def test_shots_during_a_jump_are_rejected(jump):
    machine = Machine()
    machine.truth = jump
    machine.run(10)
    before = ticks_now(machine.clock)
    machine.jump(jump)
    machine.run(1)
    assert machine.across == [(before, None)]
    machine.run(SETTLE)
    since, until = machine.across[-1]
    assert until == ticks_now(machine.clock)
    passed = (until - since) / TICKS_PER_SECOND  # a shot under way has the count's stamps, or true ones
    assert passed == pytest.approx(1.0 + SETTLE + max(0.0, jump), abs=0.01)


def test_synchronised_kernel_decides_without_ranger_time_signals():
    machine = Machine(rangers=0, kernel=NTP)
    machine.run(10)
    machine.jump(3600.0)
    machine.run(SETTLE + 1)
    assert machine.corrections == [pytest.approx(3600.0)]
    assert "the kernel is synchronised by NTP" in machine.said[-1].text
    assert machine.watch.believed


@pytest.mark.parametrize("jump", [SMALL - 0.01, -1.0, 0.03])
def test_uncontradicted_leap_second_is_adopted(jump):
    machine = Machine(rangers=0)
    machine.run(10)
    machine.jump(jump)
    machine.run(SETTLE + 1)
    assert machine.corrections == [pytest.approx(jump)]
    assert machine.watch.believed


@pytest.mark.parametrize(("jump", "kernel"), [(3600.0, None), (-2.0, None), (0.5, NTP)])
def test_unconfirmed_jump_waits_for_a_person(jump, kernel):
    """The last was set by hand: the kernel, which was synchronised, says so no more."""
    machine = Machine(rangers=2, kernel=kernel)  # two are too few to judge by
    machine.run(10)
    machine.kernel = None
    machine.jump(jump)
    machine.run(600)
    assert machine.corrections == []
    assert not machine.watch.believed
    assert "CLOCK ACCEPT" in machine.watch.trouble
    assert machine.watch.accept() == pytest.approx(jump)
    machine.run(5)
    assert machine.watch.believed
    assert machine.watch.trouble is None
    with pytest.raises(InputError, match="agrees with the count"):
        machine.watch.accept()


def test_resynchronised_kernel_ends_the_wait():
    machine = Machine(rangers=0, kernel=NTP)
    machine.run(5)
    machine.kernel = None
    machine.jump(-7200.0)
    machine.run(100)
    assert machine.corrections == []
    machine.kernel = NTP
    machine.run(1)
    assert machine.corrections == [pytest.approx(-7200.0)]


def test_rangers_with_a_third_time_suspend_measuring():
    machine = Machine()
    machine.truth = 50.0
    machine.run(10)
    machine.jump(20.0)
    machine.run(100)
    assert machine.corrections == []
    assert not machine.watch.believed
    assert "the count is -50.000 s off, and this machine's -30.000 s" in machine.watch.trouble


def test_two_jumps_share_one_wait_and_reject_shots_from_the_first_on():
    machine = Machine()
    machine.run(10)
    before = ticks_now(machine.clock)
    machine.jump(5.0)
    machine.run(2)
    machine.jump(7.0)
    machine.run(SETTLE)
    assert not machine.watch.believed
    machine.run(1)
    assert machine.watch.believed
    assert machine.kinds.count("host-clock-jump") == 2
    assert machine.across[-1] == (before, ticks_now(machine.clock))


def test_offsets_before_a_jump_do_not_vote_on_it():
    """A machine that slept: its counter stood, so that what was heard before looks fresh, and says that nothing was."""
    machine = Machine()
    machine.run(10)
    machine.truth = 600.0
    machine.jump(600.0)
    for link in machine.links.values():
        link.clock_seen = -link.clock_seen  # not heard since
    machine.run(SETTLE + 2)
    assert machine.corrections == []
    assert not machine.watch.believed
    for link in machine.links.values():
        link.clock_seen = 0
    machine.run(1)
    assert machine.corrections == [pytest.approx(600.0)]


def test_slewed_clock_is_followed_without_a_jump():
    machine = Machine()
    machine.run(300, steered=4e-4)
    assert machine.kinds == QUIET
    assert abs(machine.clock.departure()) < 1e-3


def test_drift_of_clock_and_counter_is_detected_by_the_rangers():
    machine = Machine()
    machine.run(80, wander=-5e-4)
    assert machine.kinds == QUIET
    machine.run(100, wander=-5e-4)
    assert machine.kinds == [*QUIET, "host-clock-off"]
    assert not machine.watch.believed


def test_one_or_two_deviating_rangers_do_not_outvote_the_machine():
    machine = Machine()
    machine.links["ZY0"].clock_seen = -1
    machine.run(5)
    machine.links["ZY0"].clock_offset, machine.links["ZY0"].clock_seen = 5.0, ticks_now(machine.clock)
    machine.watch.look(machine.counter / PER_SECOND)
    assert machine.watch.believed
    few = Machine(rangers=2)
    few.truth = 10.0
    few.run(5)
    assert few.watch.believed  # two are too few to judge by


def test_clocks_without_signal_connection_or_recent_samples_have_no_vote():
    machine = Machine()
    machine.run(5)
    for k, link in enumerate(machine.links.values()):
        link.clock_offset = 10.0
        link.status = StatusWord.CLOCK_FREE if k < 2 else StatusWord(0)
        link.connected = k != 2
        link.clock_seen = ticks_now(machine.clock) - round((0.0 if k < 4 else 60.0) * TICKS_PER_SECOND)
    machine.watch.look(machine.counter / PER_SECOND)
    assert machine.watch.believed


def test_undecided_jump_and_return_leave_no_condition():
    machine = Machine(rangers=0)
    machine.run(10)
    machine.jump(3600.0)
    machine.run(60)
    assert not machine.watch.believed
    machine.jump(-3600.0)
    machine.run(SETTLE + 1)
    assert machine.watch.believed
    assert machine.watch.trouble is None


def test_no_shots_before_the_rangers_clocks_are_sampled_or_timed_out():
    machine = Machine()
    for link in machine.links.values():
        link.connected = False
    machine.run(WAIT - 1)
    assert not machine.watch.believed
    machine.run(2)
    assert machine.watch.believed  # nobody to contradict
    heard = Machine()
    heard.watch.look(heard.counter / PER_SECOND)
    assert not heard.watch.believed
    heard.run(1)
    assert heard.watch.believed


def test_silent_rangers_do_not_withdraw_their_vote_against_the_machine():
    machine = Machine()
    machine.truth = 3600.0
    machine.run(5)
    assert not machine.watch.believed
    for link in machine.links.values():
        link.clock_seen = -1
    machine.run(60)
    assert not machine.watch.believed


def test_silent_rangers_do_not_withdraw_their_vote_for_the_count():
    machine = Machine(kernel=NTP)
    machine.run(5)
    machine.jump(3600.0)
    machine.run(SETTLE + 1)
    assert machine.watch.believed
    for link in machine.links.values():
        link.clock_seen = -1
    machine.run(60)
    assert machine.watch.believed
    assert machine.corrections == []


def test_wrong_machine_sets_no_ranger_with_a_time_signal_before_the_vote():
    """At start they come one by one: two that had been set would have outvoted the two that had not."""
    machine = Machine(rangers=4)
    machine.truth = 3600.0
    links = list(machine.links.values())
    for link in links:
        link.connected = False
    for link in links:
        link.connected = True
        machine.run(3)
        assert not any(machine.watch.may_set(each) for each in links)
    machine.truth = 0.0
    machine.run(2)
    assert all(machine.watch.may_set(each) for each in links)
    links[0].status = StatusWord.CLOCK_FREE
    for link in links[1:]:
        link.clock_seen = -1
    machine.run(60)
    assert [machine.watch.may_set(each) for each in links] == [True, False, False, False]


# Load ----------------------------------------------------------------------------------------------------------------


def test_short_round_trip_among_long_ones_decides():
    """Offsets by half a long way: taken without their bounds most rangers once agreed that this machine was wrong."""
    rng, ways = np.random.default_rng(3), np.array([1.0, 0.8, 0.5, 0.6, 0.9, 0.02])
    for _ in range(200):
        offsets = rng.uniform(0.2, 0.5, 6) * ways  # all replies late: the stamps look old
        assert abs(np.median(offsets)) > 0.05
        vote = ClockVote.of(zip(offsets, 0.5 * ways, strict=True))
        assert vote.allows(0.0)
        assert abs(vote.middle) < 0.03  # the short way counts


def test_true_time_within_all_bounds_is_never_outvoted():
    rng = np.random.default_rng(4)
    for _ in range(500):
        truth, errors = rng.uniform(-5.0, 5.0), 10.0 ** rng.uniform(-3.0, 0.5, rng.integers(3, 19))
        vote = ClockVote.of(zip(truth + errors * rng.uniform(-1.0, 1.0, len(errors)), errors, strict=True))
        assert vote.of_one_mind == len(errors)
        assert vote.allows(truth)
        wrong = truth + np.sign(rng.uniform(-1, 1)) * (0.2 + 2.0 * errors.min())
        assert not vote.allows(wrong)


def test_no_false_alarm_under_load_and_an_hours_jump_is_still_judged():
    machine = Machine(error=0.8)
    for k, link in enumerate(machine.links.values()):
        link.clock_error = 0.4 + 0.1 * k
    rng = np.random.default_rng(5)
    for _ in range(1800):
        machine.counter += PER_SECOND
        machine.realtime += PER_SECOND
        for link in machine.links.values():
            link.clock_offset = float(rng.uniform(0.5, 0.99)) * link.clock_error
            link.clock_seen = ticks_now(machine.clock)
        machine.watch.look(machine.counter / PER_SECOND)
        assert machine.watch.believed
    assert machine.kinds == QUIET
    machine.truth = 0.3
    machine.jump(3600.0)
    machine.run(SETTLE + 1)
    assert machine.watch.believed
    assert machine.kinds[-1] == "host-clock-off"


def test_bounds_too_wide_for_a_decision_are_waited_for():
    machine = Machine(error=2.0)
    machine.run(5)
    machine.truth = 0.5
    machine.jump(0.5)
    machine.run(WAIT - 1)
    assert not machine.watch.believed
    for link in machine.links.values():
        link.clock_error = 0.01
    machine.run(1)
    assert machine.corrections == [pytest.approx(0.5)]


# Kernel --------------------------------------------------------------------------------------------------------------


def test_lost_or_uncertain_kernel_synchronisation_is_reported_once():
    machine = Machine(kernel=NTP)
    machine.run(5)
    assert "synchronised by NTP, error 0.500 ms" in machine.said[0].text
    machine.kernel = KernelSync("NTP", 0.0, 0.2, 0.5)
    machine.run(5)
    machine.kernel = None
    machine.run(5)
    machine.kernel = NTP
    machine.run(5)
    assert machine.kinds == [
        "host-clock",
        "host-clock-unsure",
        "host-clock-free",
        "host-clock-unsure-over",
        "host-clock-free-over",
    ]
    assert machine.watch.believed


def test_unknown_synchronisation_is_not_an_alarm():
    machine = Machine()
    machine.run(60)
    assert [what.severity for what in machine.said] == ["note"]
    assert "unknown" in machine.said[0].text
