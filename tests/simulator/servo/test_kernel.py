"""The compiled axes against their Python form: the same bits, whatever is commanded."""

import time
from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catseye.simulator.servo.axis import ServoAxis
from catseye.simulator.servo.kernel import AT_END, AT_INDEX, CHIP, CompiledAxes
from catseye.simulator.servo.motion_chip import MotionChip
from catseye.simulator.servo.motor import AxisDesign, Motor

FILTER = (356, 465, 4355, 4096, 3)  # docs/studies/servo.md, 30 Hz
TURN = 100_000
SPEED, RATE = 268_435, 305  # 12 000 counts/s, 40 000 counts/s^2
DESIGNS = (
    AxisDesign(),
    AxisDesign(ripple=0.05, index_count=137),
    AxisDesign(amplifier="voltage", viscous=0.5, index_count=-60),  # decay above 1e-2 a sample: the other closed form
    AxisDesign(low_stop=-2 * pi * 300 / TURN, high_stop=2 * pi * 200 / TURN, index_count=50),
    AxisDesign(coulomb=0.0, static=0.0, viscous=0.0, index_count=1),
    AxisDesign(disturbance=5e-3, index_count=20),
)


def axis(design=DESIGNS[0], *, bits=8, overflow="saturate", angle=0.0) -> ServoAxis:
    generator = np.random.default_rng(7) if design.disturbance else None
    made = ServoAxis(MotionChip(output_bits=bits, overflow=overflow), Motor(design, angle, generator=generator))
    made.axis(True)
    made.flt(*FILTER)
    made.chip.limit_error(2000, stop=True)
    return made


def everything(made: ServoAxis):
    state = {name: getattr(made.chip, name) for name in CHIP}
    return state | {"angle": made.motor.angle, "rate": made.motor.velocity, "drive": made._drive, "n": made.samples}


def compiled(made: ServoAxis, do=None):
    axes = CompiledAxes([made])
    if do is not None:
        do(axes.axis(0))
        axes.take(0)
    return axes


gain = st.one_of(st.integers(0, 500), st.integers(0, 32_767))
commands = st.one_of(
    st.tuples(st.just("move"), st.integers(-3000, 3000), st.integers(0, 400_000), st.integers(0, 5000)),
    st.tuples(st.just("follow"), st.sampled_from([1, -1]), st.integers(0, 50_000)),
    st.tuples(st.just("filter"), gain, gain, gain, st.integers(0, 32_767), st.integers(0, 9)),
    st.tuples(st.just("limit"), st.integers(0, 3000), st.booleans()),
    st.tuples(st.just("stop"), st.sampled_from(["smooth", "abrupt", "off"])),
    st.tuples(st.sampled_from(["seek", "home", "on", "off"])),
)
stories = st.lists(st.tuples(commands, st.integers(0, 700)), min_size=1, max_size=8)


def told(made: ServoAxis, command) -> None:
    name, *values = command
    chip = made.chip
    if name == "move":
        chip.load_trajectory(position=values[0], velocity=values[1], acceleration=values[2], mode="position")
        chip.start()
    elif name == "follow":
        chip.load_trajectory(velocity=values[1], mode="velocity", direction=values[0])
        chip.start()
    elif name == "filter":
        made.flt(*values)
    elif name == "limit":
        chip.limit_error(values[0], stop=values[1])
    elif name == "stop":
        chip.stop(values[0])
    elif name == "seek":
        chip.find_index()
    elif name == "home":
        chip.define_home()
    else:
        made.axis(name == "on")


@settings(max_examples=60, deadline=None)
@given(
    stories,
    st.sampled_from(DESIGNS),
    st.sampled_from([8, 12]),
    st.sampled_from(["saturate", "wrap"]),
    st.integers(-200, 150),
)
def test_any_story_leaves_the_same_bits(story, design, bits, overflow, count):
    options = {"bits": bits, "overflow": overflow, "angle": 2 * pi * count / TURN}
    plain, other = axis(design, **options), CompiledAxes([axis(design, **options)])
    for command, samples in story:
        told(plain, command)
        told(other.axis(0), command)
        other.take(0)
        plain.skip(samples)
        assert other.skip(samples) == samples
        assert everything(other.axis(0)) == everything(plain)


@settings(max_examples=15, deadline=None)
@given(st.integers(-2000, 2000), st.integers(0, 9), st.lists(st.integers(1, 900), min_size=2, max_size=6))
def test_an_axis_at_rest_is_skipped_without_the_loss_of_a_bit(target, interval, waits):
    def begin(made):
        made.flt(interval=interval)
        told(made, ("move", target, SPEED, RATE))

    plain = axis()
    begin(plain)
    other = compiled(axis(), begin)
    plain.skip(6000)
    other.skip(6000)
    for samples in waits:
        plain.skip(samples)
        other.skip(samples)
        assert everything(other.axis(0)) == everything(plain)


def test_a_settled_axis_is_at_rest_and_a_command_wakes_it():
    axes = compiled(axis(), lambda made: told(made, ("move", 700, SPEED, RATE)))
    axes.skip(50)
    assert not axes.at_rest
    axes.skip(5000)
    axes.skip(100)
    assert axes.at_rest
    assert axes.actual(0) == axes.desired(0) == 700
    begin = time.perf_counter()
    assert axes.skip(3_000_000_000) == 3_000_000_000  # twelve days
    assert time.perf_counter() - begin < 0.5
    told(axes.axis(0), ("move", 0, SPEED, RATE))
    axes.take(0)
    assert not axes.at_rest
    axes.skip(5000)
    assert axes.actual(0) == 0


def test_a_drive_that_is_left_over_is_no_rest():
    """The chip is off and the axis stands, but the last word still acts for a sample: it moves by less than a count."""
    plain, other = axis(), axis()
    plain._drive = other._drive = 0.3
    axes = CompiledAxes([other])
    plain.skip(100)
    axes.skip(100)
    assert 0.0 < plain.motor.angle < 2 * pi / TURN
    assert everything(axes.axis(0)) == everything(plain)


def test_an_axis_at_rest_can_be_watched():
    axes = compiled(axis(), lambda made: told(made, ("move", 700, SPEED, RATE)))
    axes.skip(5000)
    axes.skip(100)
    axes.watch(0, AT_END)
    assert axes.skip(100) == 0


def test_a_disturbed_axis_never_rests():
    axes = CompiledAxes([axis(DESIGNS[-1])])
    axes.skip(500)
    axes.skip(500)
    assert not axes.at_rest


def test_two_axes_share_a_call_and_nothing_else():
    one, two = axis(), axis(DESIGNS[1])
    both = CompiledAxes([axis(), axis(DESIGNS[1])])
    for k, (made, target) in enumerate(((one, 900), (two, -400))):
        told(made, ("move", target, SPEED, RATE))
        told(both.axis(k), ("move", target, SPEED, RATE))
        both.take(k)
    for samples in (1, 40, 3000, 3, 500):
        for made in (one, two):
            made.skip(samples)
        both.skip(samples)
        assert everything(both.axis(0)) == everything(one)
        assert everything(both.axis(1)) == everything(two)


@pytest.mark.parametrize("design", [AxisDesign(index_count=137), AxisDesign(index_count=137, disturbance=5e-3)])
@pytest.mark.parametrize("watch", [AT_INDEX, AT_END, AT_INDEX | AT_END])
def test_a_watched_axis_stops_all_at_the_sample_of_the_event(design, watch):
    plain = axis(design)
    axes = CompiledAxes([axis(design), axis()])
    for made in (plain, axes.axis(0)):
        made.chip.find_index()
        told(made, ("move", 400, SPEED, RATE))
    axes.take(0)
    axes.watch(0, watch)
    n = 0
    while not ((watch & AT_INDEX and plain.chip.index_found) or (watch & AT_END and plain.chip.trajectory_complete)):
        plain.skip(1)
        n += 1
    assert 50 < n < 5000
    assert axes.skip(10_000) == n
    assert everything(axes.axis(0)) == everything(plain)
    assert axes.axis(1).samples == n
    assert axes.skip(10) == 0
    axes.watch(0, 0)
    assert axes.skip(10) == 10


def test_a_stuck_axis_does_not_turn_and_trips_its_error_limit():
    axes = compiled(axis(), lambda made: told(made, ("move", 9000, SPEED, RATE)))
    axes.skip(500)
    at = axes.counts[0]
    axes.spoil(0, stuck=True, blind=False)
    axes.skip(5000)
    assert axes.counts[0] == at
    assert axes.motor_off(0)
    assert axes.excessive(0)
    axes.spoil(0, stuck=False, blind=False)
    told(axes.axis(0), ("move", 100, SPEED, RATE))
    axes.take(0)
    axes.skip(6000)
    assert axes.actual(0) == 100


def test_a_blind_axis_passes_its_index_unseen():
    axes = CompiledAxes([axis(AxisDesign(index_count=137))])
    for blind, goal in ((True, 300), (False, -300)):
        axes.spoil(0, stuck=False, blind=blind)
        made = axes.axis(0)
        made.chip.find_index()
        told(made, ("move", goal, SPEED, RATE))
        axes.take(0)
        axes.skip(4000)
        assert axes.index_found(0) is not blind
    assert axes.axis(0).chip.index_position == 137


def test_a_sample_costs_a_tenth_of_the_python_form_at_most():
    """About 75 ns against 3.5 us, a fiftieth; a tenth leaves room for a busy machine."""
    plain = axis()
    other = compiled(axis(), lambda made: told(made, ("move", 2**29, SPEED, RATE)))
    told(plain, ("move", 2**29, SPEED, RATE))
    other.skip(10)

    def best(skip, samples):
        took = []
        for _ in range(5):
            begin = time.perf_counter()
            skip(samples)
            took.append((time.perf_counter() - begin) / samples)
        return min(took)

    assert best(other.skip, 20_000) < 0.1 * best(plain.skip, 1000)
