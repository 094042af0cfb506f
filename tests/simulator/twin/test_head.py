"""A twin's head: the suite of all heads, its clock, its faults, its buffers, and a ranger that works with it."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catseye.errors import InputError
from catseye.geometry.sky.time_tag import PER_SECOND, TimeTag
from catseye.ranger.head import SamplingSettings
from catseye.ranger.motion_units import acceleration_integer, velocity_integer
from catseye.ranger.ranger import Ranger
from catseye.records.files.reading import read_record
from catseye.records.site.mirror import MirrorGeometry
from catseye.simulator.clock.world_clock import ManualClock
from catseye.simulator.twin.converter import Converter
from catseye.simulator.twin.faults import Fault, FaultBoard
from catseye.simulator.twin.head import HeadBuild, TwinHead
from catseye.simulator.twin.mirror import travel_of
from ranger.head_conformance import HeadConformance
from ranger.ranger_scene import CUBES, GEOMETRY
from repository import ROOT

START = 52889.125
ZP3 = ROOT / "examples/mirrors/ZP3.toml"
VELOCITY, ACCELERATION = velocity_integer(12_000), acceleration_integer(40_000)
BY_COUNTS = np.array([1e-3, 2e-3])  # rad of phase a count: a world whose returns tell where the mirror is
SHORT = SamplingSettings(64, 8, 1000)


class World:
    """A return of 3 V whose phase is the mirror's counts and the time."""

    def __init__(self, rate=0.0):
        self.start, self.rate, self.asked = ManualClock(START).now_ns(), rate, []

    def seconds(self, ns, /):
        return (ns - self.start) / PER_SECOND

    def phasors(self, ranger, counts, seconds, /):
        self.asked.append((ranger, counts, seconds))
        return 3.0 * np.exp(1j * (counts @ BY_COUNTS + self.rate * seconds))


def made(*faults, seed=5, world=None, **options):
    clock = ManualClock(START)
    head = TwinHead("ZY101", world or World(), clock, seed=seed, faults=FaultBoard(faults), **options)
    for axis in (0, 1):
        head.enable(axis, True)
    return head, clock


def homed(*faults, **options):
    head, clock = made(*faults, **options)
    for axis in (0, 1):
        head.find_home(axis)
    clock.advance(20.0)
    assert [head.homing(axis) for axis in (0, 1)] == ["home", "home"]
    return head, clock


def shot(head, clock, sampling=SHORT):
    head.trigger(sampling)
    clock.advance(sampling.duration)
    return head.buffer()


def phase(buffer):
    n = buffer.sampling.samples
    turn = np.exp(2j * np.pi * np.arange(n) / n)
    return np.angle(buffer.samples.reshape(-1, n).sum(axis=0) @ turn)


class TestTwinHead(HeadConformance):
    def head(self):
        self.clock = ManualClock(START)
        return TwinHead("ZY101", World(), self.clock, seed=5)

    def pass_time(self, head, seconds):
        self.clock.advance(seconds)


def test_a_buffer_is_there_when_its_last_sample_is_and_not_before():
    head, clock = homed()
    head.trigger(SHORT)
    clock.advance(SHORT.duration - 1e-6)
    assert head.buffer() is None
    clock.advance(1e-6)
    assert head.buffer() is head.buffer() is not None


def test_the_world_is_asked_along_the_buffer_for_the_mirror_s_true_counts():
    world = World()
    head, clock = homed(world=world)
    head.start(0, 3000, velocity=VELOCITY, acceleration=ACCELERATION)
    clock.advance(0.1)
    begun = world.seconds(clock.now_ns())
    head.trigger(SamplingSettings())
    clock.advance(0.06)
    between = head._caught_up(exactly=True).axes.counts
    clock.advance(0.068)
    head.buffer()
    ranger, counts, seconds = world.asked[-1]
    assert ranger == "ZY101"
    assert len(seconds) >= 16
    assert begun - 4e-4 < seconds[0] <= begun
    assert begun + 0.128 - 4e-4 < seconds[-1] <= begun + 0.128
    # A count of encoder is half a count of truth wide, and straight between 5 ms it is 40 000/8 0.005^2 = 0.13 off.
    assert np.interp(begun + 0.06, seconds, counts[:, 0]) == pytest.approx(between[0], abs=5.0)
    assert counts[-1, 0] - counts[0, 0] > 500  # it moves all the while
    assert np.abs(counts[-1, 0] - head.actual(0)) < 5


@pytest.mark.parametrize("late", [0.0, 1e-4, 2e-4, 3e-4])  # within a sample of the motion chip
def test_the_phase_of_a_buffer_on_the_move_is_the_mean_of_its_way(late):
    world = World(rate=40.0)  # less than a turn in a buffer
    head, clock = homed(world=world, build=HeadBuild(converter=Converter(0.1, 1e-6)))
    begin = head.now().after(0.5)
    head.follow((np.array([100.0, 50.0]), np.array([300.0, 0.0])), (begin, begin.after(2.0)))
    clock.advance(1.5 + late)
    buffer = shot(head, clock, SamplingSettings())
    middle = world.seconds(clock.now_ns()) - 0.064
    expected = np.array([200.0, 25.0]) + np.array([100.0, -25.0]) * (0.064 + late + off(head, clock))
    wanted = expected @ BY_COUNTS + 40.0 * (middle - 0.5e-3 / 64)  # the middle of the samples
    # A count of the mirror is 2 mrad at most, and it follows to half a count on average.
    assert abs(np.angle(np.exp(1j * (phase(buffer) - wanted)))) < 4e-3


def test_a_run_can_be_repeated_and_another_seed_differs():
    runs = []
    for seed in (5, 5, 6):
        head, clock = homed(seed=seed)
        runs.append((shot(head, clock), head.supplies(), head.enclosure_temperature_c(), head.now()))
    assert np.array_equal(runs[0][0].samples, runs[1][0].samples)
    assert runs[0][1:3] == runs[1][1:3]
    assert (runs[0][3] - runs[1][3]).item() == 0
    assert not np.array_equal(runs[0][0].samples, runs[2][0].samples)
    assert runs[0][1] != runs[2][1]


def test_two_buffers_of_a_still_mirror_differ_by_noise_alone():
    head, clock = homed()
    first, second = shot(head, clock), shot(head, clock)
    assert not np.array_equal(first.samples, second.samples)
    assert abs(phase(first) - phase(second)) < 5 * np.sqrt(2) * 0.245 / 3.0 * np.sqrt(2 / 512)


def test_two_rangers_stand_elsewhere_at_power_on_and_home_to_the_same_zero():
    heads = []
    for ranger in ("ZY101", "ZY102"):
        clock = ManualClock(START)
        head = TwinHead(ranger, World(), clock, seed=1)
        before = head._mirror.axes.counts
        assert head.actual(0) == head.actual(1) == 0
        for axis in (0, 1):
            head.enable(axis, True)
            head.find_home(axis)
        clock.advance(20.0)
        head.homing(0)
        assert np.max(np.abs(head._mirror.axes.counts)) < 1.5
        heads.append(before)
    assert np.min(np.abs(heads[0] - heads[1])) > 100


def test_stops_are_those_of_the_mirror_s_record():
    record = read_record(ZP3, MirrorGeometry)
    (low, high), (least, most) = travel_of(record)
    assert low < record.az_low_limit < record.az_high_limit < high
    assert least < record.ne0 - 25_000
    assert most > record.ne0 + 25_000
    head, clock = homed(build=HeadBuild(travel_of(record)))
    head.set_error_limit(0, 300)
    head.start(0, round(high) + 3000, velocity=VELOCITY, acceleration=ACCELERATION)
    clock.advance(20.0)
    assert head.motor_off(0)
    assert head._mirror.axes.counts[0] == pytest.approx(high)


# The clock ----------------------------------------------------------------------------------------------------------


def off(head, clock):
    return (head.now() - TimeTag(np.asarray(0), np.asarray(clock.now_ns()))).item() / PER_SECOND


def test_a_locked_clock_is_off_by_half_a_millisecond_at_most():
    offs = []
    for seed in range(8):
        head, clock = made(seed=seed)
        offs.append(off(head, clock))
        clock.advance(1e5)
        assert off(head, clock) == pytest.approx(offs[-1], abs=1e-9)
        assert head.clock_locked()
    assert 0.0 < max(np.abs(offs)) <= 5e-4
    assert len(set(offs)) == 8
    head, clock = made(build=HeadBuild(clock_error=0.0))
    assert off(head, clock) == 0.0


def test_a_drifting_clock_runs_away_says_so_and_can_be_set():
    head, clock = made(Fault("drifting-clock", "ZY101", 100.0, 1000.0, 2e-3), build=HeadBuild(clock_error=0.0))
    clock.advance(99.0)
    assert head.clock_locked()
    clock.advance(201.0)
    assert not head.clock_locked()
    assert off(head, clock) == pytest.approx(0.4, abs=1e-6)
    head.set_clock(TimeTag(np.asarray(0), np.asarray(clock.now_ns())))
    assert off(head, clock) == pytest.approx(0.0, abs=1e-6)
    clock.advance(50.0)
    assert off(head, clock) == pytest.approx(0.1, abs=1e-6)
    before = head.now()
    clock.advance(649.95)  # to 999.95 s, 1.4 s ahead
    ahead = head.now()
    clock.advance(0.1)  # locked again: never backwards
    assert head.clock_locked()
    assert (head.now() - ahead).item() == 0
    assert (ahead - before).item() > 0
    clock.advance(2.0)
    assert off(head, clock) == pytest.approx(0.0, abs=1e-6)


def test_a_buffer_s_stamp_and_a_track_s_times_are_of_the_head_s_clock():
    head, clock = homed(Fault("drifting-clock", "ZY101", 0.0, 1e9, 0.01), build=HeadBuild(clock_error=0.0))
    assert off(head, clock) == pytest.approx(0.2)
    asked = head.now()
    assert (shot(head, clock).triggered - asked).item() == 0
    begin = head.now().after(1.0)
    head.follow((np.array([0.0, 0.0]), np.array([400.0, 0.0])), (begin, begin.after(2.0)))
    clock.advance(2.0)
    assert abs(head.actual(0) - 200) <= 6  # by the world's clock it would stand 40 counts elsewhere
    with pytest.raises(InputError, match="expected later"):
        head.follow((np.zeros(2), np.zeros(2)), (begin, begin))


# Faults --------------------------------------------------------------------------------------------------------------


def test_a_saturated_converter_clips_and_recovers():
    head, clock = homed(Fault("saturated-adc", "ZY101", 30.0, 40.0, 5.0))
    assert np.abs(shot(head, clock).samples.astype(int)).max() < 20_000
    clock.advance(10.0)
    assert np.mean(np.abs(shot(head, clock).samples.astype(int)) >= 32_767) > 0.3
    clock.advance(10.0)
    assert np.abs(shot(head, clock).samples.astype(int)).max() < 20_000


def test_a_stuck_axis_does_not_arrive_and_its_motor_goes_off():
    head, clock = homed(Fault("stuck-axis", "ZY101:0", 20.0))
    for axis in (0, 1):
        head.start(axis, 9000, velocity=VELOCITY, acceleration=ACCELERATION)
    clock.advance(5.0)
    assert [head.motor_off(axis) for axis in (0, 1)] == [True, False]
    assert abs(head.actual(0)) <= 1
    assert abs(head.actual(1) - 9000) <= 1


def test_a_lost_index_fails_within_30_s():
    head, clock = made(Fault("lost-index", "ZY101:1"))
    for axis in (0, 1):
        head.find_home(axis)
    clock.advance(30.1)
    assert [head.homing(axis) for axis in (0, 1)] == ["home", "failed"]


def test_no_light_returns_while_the_laser_is_off():
    head, clock = homed()
    head.switch_laser(False)
    n = np.exp(2j * np.pi * np.arange(64) / 64)
    dark = shot(head, clock)
    assert abs(dark.samples.reshape(-1, 64).mean(axis=0) @ n) * 2 / 64 * dark.volts_per_code < 0.1
    head.reset()
    assert head.laser_on()


# Time ----------------------------------------------------------------------------------------------------------------


@settings(max_examples=10, deadline=None)
@given(st.lists(st.floats(1e-4, 0.4), min_size=1, max_size=60))
def test_query_frequency_of_a_head_changes_nothing(strides):
    found = []
    for looks in (strides, []):
        head, clock = made()
        end = clock.now_ns() + 9 * PER_SECOND
        head.find_home(0)
        for stride in looks:
            clock.advance(min(stride, (end - clock.now_ns()) / PER_SECOND))
            head.moving(0)
            head.buffer()
            head.status = [head.actual(1), head.motor_off(0), head.homing(1)]
        clock.advance((end - clock.now_ns()) / PER_SECOND)
        found.append((shot(head, clock).samples, head.actual(0), head.homing(0)))
    assert np.array_equal(found[0][0], found[1][0])
    assert found[0][1:] == found[1][1:]


def test_a_mirror_at_rest_is_not_stepped():
    head, clock = homed()
    clock.advance(1.0)
    head.actual(0)
    clock.advance(1.0)
    head.actual(0)
    steps = head._mirror.samples
    clock.advance(3600.0)
    assert abs(head.actual(0)) <= 1
    assert head._mirror.samples == steps
    begin = time.perf_counter()
    head.start(0, 100, velocity=VELOCITY, acceleration=ACCELERATION)  # ten million samples, caught up
    assert time.perf_counter() - begin < 0.5
    clock.advance(2.0)
    assert abs(head.actual(0) - 100) <= 1


def test_a_buffer_costs_less_than_its_share_of_a_core():
    """200 rangers at one shot a second are 5 ms each; measured 0.3 ms."""
    head, clock = homed()
    clock.advance(1.0)
    took = []
    for _ in range(20):
        begin = time.perf_counter()
        shot(head, clock, SamplingSettings())
        took.append(time.perf_counter() - begin)
    assert min(took) < 2.5e-3


# A ranger on it ------------------------------------------------------------------------------------------------------


def test_a_ranger_homes_points_and_measures_with_it_as_it_boots():
    """No filter is sent: the ranger's five zeros leave the head its own."""
    clock = ManualClock(START)
    ranger = Ranger("ZY101", TwinHead("ZY101", World(), clock, seed=5), limits=(-30_000, 80_000))
    lines = [*GEOMETRY, *CUBES, "AZM 0, -900", "ELV 0, 400", "AXIS 0,1", "AXIS 1,1", "FHM 0", "FHM 1", "PS 1"]
    for line in (*lines, "CMEAS 1, 0", "CIL 1", "CMEAS 2, 1", "BUF"):
        ranger.receive(1, line)
    replies = []
    for _ in range(20_000):
        replies += [out.reply for out in ranger.turn()]
        clock.advance(0.005)
        if ranger.idle:
            break
    assert all(reply.ok in (True, None) for reply in replies), [r.text for r in replies if r.ok is False]
    reference, found = (reply for reply in replies if reply.command == "CMEAS")
    assert float(reference.values[3]) == pytest.approx(3.0, abs=0.05)
    assert float(reference.values[4]) == pytest.approx(2 * np.pi - 900e-3 + 800e-3, abs=0.02)
    assert float(found.values[3]) == pytest.approx(3.0, abs=0.05)


def test_the_cheap_clock_is_the_clock():
    clock = ManualClock(START)
    head = TwinHead("ZY101", World(), clock, seed=3)
    for _ in range(3):
        clock.advance(0.1234567)
        tag = head.now()
        assert head.now_ns() == int(tag.day) * 86_400 * PER_SECOND + int(tag.nanoseconds)
