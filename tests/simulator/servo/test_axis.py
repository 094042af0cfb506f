"""An axis in a loop: against linear theory, and the ZY's commands on it."""

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from catseye.errors import ValidityError
from catseye.ranger.motion_units import SAMPLE_TIME, acceleration_integer, velocity_integer
from catseye.simulator.servo.axis import ServoAxis, Settling
from catseye.simulator.servo.motion_chip import MotionChip
from catseye.simulator.servo.motor import AxisDesign, Motor
from catseye.simulator.servo.tuning import closed_loop, design_filter, plant_of

TURN = 100_000
FILTER = design_filter(plant_of(AxisDesign()), crossover_hz=30.0, interval=3).values
TRAVEL = (-18_069, 78_931)  # counts between the stops of ZP101


def axis(design: AxisDesign | None = None, *, filter_=FILTER, bits=8, angle=0.0, seed=None) -> ServoAxis:
    generator = None if seed is None else np.random.default_rng(seed)
    made = ServoAxis(MotionChip(output_bits=bits), Motor(design or AxisDesign(), angle, generator=generator))
    made.axis(True)
    made.flt(*filter_)
    made.erl(2000)
    made.abv(velocity_integer(12_000))
    made.aba(acceleration_integer(40_000))
    return made


def go(made: ServoAxis, target: int, samples: int):
    made.abp(target)
    assert made.stt()
    return made.run(samples)


@pytest.mark.parametrize("direction", [1, -1])
def test_a_move_of_ten_thousand_counts_ends_on_its_count(direction):
    """30 Hz: the drive for 40 000 counts/s^2 and friction, 9 steps, is given by kp 356/256 from about 7 counts."""
    made = axis()
    trace = go(made, 10_000 * direction, 6000)
    assert made.chip.on_target
    assert np.max(np.abs(trace.error[3400:])) <= 1.0  # from the end of the profile on
    assert np.all(trace.actual[-500:] == 10_000 * direction)
    assert 3.0 < np.max(np.abs(trace.error)) < 10.0
    assert np.max(np.abs(trace.output)) < 64  # half of the converter's range
    assert trace.desired[-1] == 10_000 * direction
    assert np.max(np.abs(trace.velocity)) == pytest.approx(12_000, rel=1e-4)
    assert np.sum(trace.velocity) * SAMPLE_TIME == pytest.approx(10_000 * direction, rel=1e-9)


@pytest.mark.parametrize("hertz", [6.0, 12.0])
def test_the_loop_is_the_one_of_linear_theory(hertz):
    """Without friction the encoder follows the profile as the discrete transfer function says: to the roundings."""
    design = AxisDesign(coulomb=0.0, static=0.0)
    plant = plant_of(design)
    chosen = design_filter(plant, crossover_hz=hertz)
    trace = go(axis(design, filter_=(chosen.kp, chosen.ki, chosen.kd, 32_767, 0), bits=12), 10_000, 5000)
    above, below = closed_loop(plant, chosen)
    padded = np.concatenate([np.zeros(len(below) - len(above)), above])
    expected = lfilter(padded, below, np.floor(trace.desired))
    following = trace.desired - expected
    assert np.max(np.abs(following)) > 10.0
    off = trace.angle / (2 * pi) * TURN - expected
    assert np.max(np.abs(off)) < 2.0  # encoder and converter round, the sum of errors counts in 256
    assert np.std(off) < 0.6


def test_the_same_seed_gives_the_same_motion_and_another_does_not():
    design = AxisDesign(disturbance=5e-3, ripple=0.05)
    first, again, other = (go(axis(design, seed=seed), 500, 800).angle for seed in (3, 3, 4))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_drive_works_from_the_sample_after_the_one_that_computed_it():
    made = axis(AxisDesign(coulomb=0.0, static=0.0), filter_=(32_767, 0, 0, 0, 0))
    made.aba(0)
    made.abv(65_536 * 1000)
    made.aba(65_536 * 1000)
    trace = go(made, 100, 4)
    assert trace.output[0] == 127  # computed at the first reading
    assert list(trace.angle[:2]) == [0.0, 0.0]
    assert trace.angle[2] > 0.0


def test_an_axis_whose_amplifier_is_off_trips_its_error_limit():
    made = axis()
    made.axis(False)
    made.erl(300)
    trace = go(made, 10_000, 2000)
    assert np.all(trace.angle == 0.0)
    assert made.chip.motor_off
    assert np.max(np.abs(trace.error)) <= 303  # 300, and what one sample adds
    assert made.wai().status == "motor off"
    assert not made.wai().success


def test_a_jam_trips_and_the_next_move_works():
    made = axis(AxisDesign(high_stop=2 * pi * 500 / TURN))
    made.erl(400)
    go(made, 5000, 3000)
    assert made.chip.excessive_error
    assert made.acp() == 500
    trace = go(made, 100, 3000)
    assert not made.chip.motor_off
    assert trace.actual[-1] == 100


@settings(max_examples=12)
@given(st.integers(*TRAVEL), st.integers(-17_000, 77_000), st.sampled_from([1, -1]))
def test_homing_finds_the_index_from_anywhere_between_the_stops(start, index, direction):
    low, high = (2 * pi * count / TURN for count in TRAVEL)
    made = axis(AxisDesign(low_stop=low, high_stop=high, index_count=index), angle=2 * pi * start / TURN)
    found = made.fhm(direction)
    assert found.success, found.text
    assert found.seconds < 30.0
    assert made.chip.home == index - start  # the encoder's count at zero, since power came on
    made.skip(300)
    assert abs(made.acp()) <= 1  # nothing jerks; friction may let it hunt by a count
    trace = go(made, 700, 2500)
    assert abs(trace.actual[-1] - 700) <= 1
    assert abs(made.motor.count - index - 700) <= 1


def test_homing_reports_a_missing_index_and_a_timeout():
    jammed = axis(AxisDesign(low_stop=-0.5, high_stop=0.5, index_count=50_000))
    failed = jammed.fhm()
    assert not failed.success
    assert "no index pulse" in failed.text
    slow = axis(AxisDesign(index_count=90_000))
    hurried = slow.fhm(timeout=2.0)
    assert not hurried.success
    assert hurried.seconds == pytest.approx(2.0, abs=1e-3)
    whole = axis(AxisDesign(index_count=90_000))
    assert whole.fhm().success


def test_wai_waits_for_the_profile_and_cwt_for_the_mirror():
    made = axis()
    made.abp(10_000)
    made.stt()
    waited = made.wai()
    assert (waited.success, waited.status) == (True, "done")
    assert waited.seconds == pytest.approx(10_000 / 12_000 + 12_000 / 40_000, abs=3 * SAMPLE_TIME)
    settled = made.cwt(10_000, Settling(tolerance=1, reads=5))
    assert settled.success
    assert settled.seconds < 0.1


def test_cwt_counts_reads_in_a_row():
    made = axis()
    ready = made.cwt(0, Settling(tolerance=0, reads=7, every=3 * SAMPLE_TIME))
    assert ready.seconds == pytest.approx(6 * 3 * SAMPLE_TIME)
    made.abp(20)
    made.stt()
    near = made.cwt(0, Settling(tolerance=5, reads=10_000, timeout=0.3))  # it leaves: never 10 000 in a row
    assert (near.success, near.status) == (False, "timeout")
    assert near.seconds == pytest.approx(0.3, abs=SAMPLE_TIME)


def test_reads_that_come_and_go_do_not_settle():
    """An axis without damping swings 100 counts about its target: 2 or 3 ms within 5 counts at a time."""
    made = axis(AxisDesign(viscous=0.0, coulomb=0.0, static=0.0), filter_=(50, 0, 0, 0, 0))
    made.abv(65_536 * 100)
    made.aba(65_536 * 100)
    made.abp(100)
    made.stt()
    assert not made.cwt(100, Settling(tolerance=5, reads=6, timeout=1.0)).success
    assert made.cwt(100, Settling(tolerance=5, reads=2, timeout=1.0)).success


def test_with_wmd_0_a_timeout_still_succeeds():
    made = axis()
    made.stt()
    late = made.cwt(50, Settling(timeout=0.05, strict=False))
    assert (late.success, late.status) == (True, "timeout")
    assert not made.cwt(50, Settling(timeout=0.05)).success


@pytest.mark.parametrize("rate", [162.0, -162.0, 900.0])
def test_a_moving_target_is_followed(rate):
    """162 counts/s: the antenna's azimuth at 35 degrees a minute. A new speed every 128 ms."""
    made = axis()
    targets = rate * 0.128 * np.arange(1, 31)
    trace = made.follow(list(targets))
    assert len(trace.time) == 30 * 375
    passed = trace.desired[374::375]
    # Half a unit of speed over 375 samples; the start from rest is made good in the first three intervals.
    assert np.max(np.abs(passed[3:] - targets[3:])) < 0.5 * 375 / 65_536 + 1e-6
    late = trace.time > 1.0
    straight = rate * (trace.time + SAMPLE_TIME)
    assert np.max(np.abs(trace.desired - straight)[late]) < 0.02
    assert np.max(np.abs(trace.error[late])) < 3.0
    assert abs(np.mean(trace.error[late]) - 0.5) < 0.2  # whole counts of the profile, rounded down
    assert np.std(trace.angle[late] / (2 * pi) * TURN - straight[late]) < 0.6


def test_a_target_that_turns_back_is_followed():
    made = axis()
    phase = 2 * pi * 0.128 * np.arange(1, 40) / 4.0
    trace = made.follow(list(300.0 * (1 - np.cos(phase))))
    expected = np.interp(trace.time + SAMPLE_TIME, 0.128 * np.arange(40), 300.0 * (1 - np.cos(np.append(0.0, phase))))
    assert np.max(np.abs(trace.desired - expected)) < 1.0  # each bend is taken with 40 000 counts/s^2
    assert np.max(np.abs(trace.error)) < 4.0


def test_after_a_track_a_move_is_as_fast_as_before():
    made = axis()
    usual = made.abv()
    made.follow([20.7, 20.7, 20.7])
    assert made.abv() == usual  # not the 0 counts/s of the track's end, below the acceleration
    made.abp(10_000)
    assert made.stt()
    assert made.wai(2.0).success


@pytest.mark.parametrize(("to", "samples"), [([np.nan], 375), ([1.0, np.inf], 375), ([], 375), ([5.0], 0)])
def test_a_track_that_cannot_be_is_refused(to, samples):
    with pytest.raises(ValidityError, match="counts to follow"):
        axis().follow(to, samples)


def test_homing_during_a_move_with_another_acceleration_says_so_and_does_not_wait():
    made = axis(AxisDesign(index_count=3000))
    made.abp(10_000)
    made.stt()
    made.skip(100)
    made.aba(acceleration_integer(20_000))
    refused = made.fhm()
    assert not refused.success
    assert "ABA" in refused.text
    assert refused.seconds == 0.0
    assert not made.chip.seeking
    assert made.wai().success
    assert made.fhm().success


@pytest.mark.parametrize("seconds", [np.inf, np.nan])
def test_no_wait_is_without_end(seconds):
    with pytest.raises(ValidityError, match="no end"):
        axis().wai(seconds)


def test_commands_answer_what_is_loaded_and_refuse_the_rest():
    made = ServoAxis(MotionChip(), Motor(AxisDesign()))
    assert not made.enabled
    assert made.flt() == (0, 0, 0, 0, 0)
    assert (made.fkp(5), made.fki(6), made.fkd(7), made.fil(8), made.fsi(9)) == (5, 6, 7, 8, 9)
    assert made.flt() == (5, 6, 7, 8, 9) == (made.chip.kp, made.chip.ki, made.chip.kd, made.chip.il, made.chip.interval)
    with pytest.raises(ValidityError, match="ABA: velocity 0 is below acceleration 10"):
        made.aba(10)
    assert (made.abv(20), made.aba(20), made.abv(), made.aba()) == (20, 20, 20, 20)
    with pytest.raises(ValidityError, match="ABV: velocity 19 is below acceleration 20"):
        made.abv(19)
    with pytest.raises(ValidityError, match="ERL: position error limit 25001"):
        made.erl(25_001)
    with pytest.raises(ValidityError, match="FKD: derivative gain -1"):
        made.fkd(-1)
    with pytest.raises(ValidityError, match="ABP: target position"):
        made.abp(2**30)
    assert (made.abv(), made.aba(), made.erl(25_000), made.fkd()) == (20, 20, 25_000, 7)


def test_the_acceleration_does_not_change_during_a_move():
    made = axis()
    made.abp(5000)
    made.stt()
    made.skip(100)
    made.aba(made.aba() // 2)
    assert not made.stt()
    assert made.wai().success
    assert made.stt()
    made.abp(9000)
    made.stt()
    made.skip(10)
    made.aba(made.aba() // 2)
    with pytest.raises(ValidityError, match="acceleration was changed during a move"):
        made.follow([10_000.0])


@pytest.mark.parametrize("keys", [{"tolerance": -1}, {"reads": 0}, {"timeout": 0.0}, {"every": -1.0}])
def test_a_settling_that_cannot_be_is_refused(keys):
    with pytest.raises(ValidityError, match="settling: tolerance"):
        Settling(**keys)
