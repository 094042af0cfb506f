"""The motion chip: its profile, its filter, its registers."""

from math import floor, sqrt

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.ranger.motion_units import FRACTION
from catseye.simulator.servo.motion_chip import MotionChip, fastest_approach, next_velocity, stopping_distance

ENOUGH = 60_000  # samples


def started(**trajectory) -> MotionChip:
    """A chip on the way, its filter at zero, so that only the profile acts."""
    chip = MotionChip()
    chip.load_trajectory(**trajectory)
    assert chip.start()
    return chip


def profile(chip: MotionChip, samples: int = ENOUGH) -> list[int]:
    """Desired velocities until the trajectory is complete; the encoder follows without error."""
    speeds = []
    for _ in range(samples):
        chip.step(chip.position >> 16)
        speeds.append(chip.velocity)
        if chip.trajectory_complete:
            break
    return speeds


# acceleration, and a velocity at least as large: the ratio is drawn, or most moves would take hours
rates = st.tuples(st.integers(1, 2**21), st.integers(1, 2**8), st.integers(0, 2**21)).map(
    lambda drawn: (drawn[0], drawn[0] * drawn[1] + drawn[2])
)


@given(st.integers(0, 2**47), st.integers(1, 2**30 - 1))
def test_the_fastest_approach_is_the_largest_speed_that_stops_in_time(remaining, acceleration):
    speed = fastest_approach(remaining, acceleration)
    assert stopping_distance(speed, acceleration) <= remaining < stopping_distance(speed + 1, acceleration)


@given(st.integers(0, 3000), st.integers(1, 40))
def test_the_stopping_distance_is_the_sum_of_the_speeds(speed, acceleration):
    assert stopping_distance(speed, acceleration) == sum(range(speed, 0, -acceleration))


@given(st.integers(-(2**20), 2**20), rates)
def test_any_move_from_rest_arrives_exactly_without_overshoot_and_as_fast_as_it_may(counts, both):
    acceleration, velocity = both
    way = abs(counts) * FRACTION
    top = min(velocity, sqrt(way * acceleration))
    ideal = way / top + top / acceleration if way else 0.0  # samples of the continuous trapezoid
    assume(ideal < ENOUGH)
    chip = started(position=counts, velocity=velocity, acceleration=acceleration)
    speeds = profile(chip)
    assert chip.on_target
    assert sum(speeds) == counts * FRACTION  # the area of the trapezoid is the move
    assert chip.desired_position == counts
    assert chip.velocity == 0
    steps = np.diff([0, *speeds])
    assert np.max(np.abs(steps)) <= acceleration
    assert all(0 <= s * (1 if counts >= 0 else -1) <= velocity for s in speeds)  # never back, never too fast
    assert abs(len(speeds) - ideal) <= 4  # whole samples, and one to see that it is there


@given(st.integers(-(2**12), 2**12), st.integers(1, 60), st.integers(-(2**12), 2**12), st.integers(1, 2**20), rates)
def test_a_new_target_and_speed_during_a_move_still_arrive_exactly(first, after, then, other, both):
    acceleration, velocity = both
    assume(2**15 * FRACTION / min(velocity, other) + 4 * velocity / acceleration < ENOUGH)
    chip = started(position=first, velocity=velocity, acceleration=acceleration)
    before = [chip.velocity]
    for _ in range(after):
        chip.step(chip.position >> 16)
        before.append(chip.velocity)
    chip.load_trajectory(position=then, velocity=other)
    assert chip.start()
    speeds = before[-1:] + profile(chip)
    assert chip.on_target
    assert chip.position == then * FRACTION
    assert np.max(np.abs(np.diff(speeds))) <= acceleration
    assert max(abs(s) for s in speeds) <= max(abs(before[-1]), other)


@given(st.integers(-(2**40), 2**40), st.integers(-(2**26), 2**26), rates)
def test_no_sample_changes_the_speed_by_more_than_the_acceleration(remaining, velocity, both):
    acceleration, limit = both
    after = next_velocity(remaining, velocity, limit=limit, acceleration=acceleration)
    assert abs(after - velocity) <= acceleration
    assert abs(after) <= max(limit, abs(velocity))
    assert next_velocity(-remaining, -velocity, limit=limit, acceleration=acceleration) == -after


def test_the_data_sheet_s_hundred_turns():
    """[TEXAS13] page 11: up to 600 rpm at 1 turn/s^2 and back takes 20 s; with 15 loaded for 15.24, 20.16 s."""
    chip = started(position=200_000, velocity=446_956, acceleration=15)
    speeds = profile(chip)
    assert chip.desired_position == 200_000
    assert len(speeds) * 341e-6 == pytest.approx(20.0 * sqrt(15.24 / 15.0), abs=0.01)
    assert max(speeds) / FRACTION / 341e-6 / 2000 * 60 == pytest.approx(600 * sqrt(15.0 / 15.24), abs=1.0)


def test_velocity_mode_keeps_its_mean_speed_and_stops_smoothly():
    chip = started(velocity=70_000, acceleration=1_000, mode="velocity", direction=-1)
    for _ in range(1070):
        chip.step(chip.position >> 16)
    assert chip.velocity == -70_000
    assert chip.position == -(1_000 * 70 * 71 // 2 + 1_000 * 70_000)  # 70 samples of rise, 1000 at speed
    assert not chip.trajectory_complete
    chip.stop("smooth")
    speeds = profile(chip)
    assert chip.on_target
    assert np.max(np.abs(np.diff([-70_000, *speeds]))) <= 1_000


def test_an_abrupt_stop_stays_where_the_motor_is():
    chip = started(position=5000, velocity=200_000, acceleration=20_000)
    for _ in range(100):
        chip.step(chip.position >> 16)
    chip.step(123)
    chip.stop("abrupt")
    chip.step(123)
    assert chip.trajectory_complete
    assert (chip.desired_position, chip.velocity, chip.error) == (123, 0, 0)


def test_the_acceleration_changes_only_between_moves():
    chip = started(position=5000, velocity=200_000, acceleration=20_000)
    chip.step(0)
    chip.load_trajectory(acceleration=10_000, position=7000)
    assert not chip.start()
    assert chip.command_error
    profile(chip)
    assert (chip.desired_position, chip.acceleration) == (5000, 20_000)
    assert chip.start()
    profile(chip)
    assert (chip.desired_position, chip.acceleration) == (7000, 10_000)


def test_loaded_values_wait_for_their_command():
    chip = started(position=50, velocity=200_000, acceleration=20_000)
    chip.load_filter(kp=10)
    chip.load_trajectory(position=90)
    profile(chip)
    assert (chip.kp, chip.desired_position) == (0, 50)
    chip.update_filter()
    chip.start()
    profile(chip)
    assert (chip.kp, chip.desired_position) == (10, 90)


def reference(errors, kp, ki, kd, il, interval, wraps):
    """u(n) as [TEXAS13] pages 11 and 12 write it, from whole histories and 16-bit arithmetic of numpy."""
    found = []
    for n in range(len(errors)):
        m = interval + 1
        last = n - n % m
        previous = errors[last - m] if last >= m else 0
        terms = [kp * errors[n], ki * floor(sum(errors[: n + 1]) / 256), kd * (errors[last] - previous)]
        if wraps:
            terms = [int(np.int64(term).astype(np.int16)) for term in terms]
        else:
            terms = [int(np.clip(term, -32768, 32767)) for term in terms]
        terms[1] = int(np.sign(terms[1])) * min(abs(terms[1]), il)
        found.append(int(np.clip(sum(terms), -32768, 32767)))
    return found


gain = st.one_of(st.integers(0, 300), st.integers(0, 32_767))


@given(
    st.lists(st.integers(-300, 300), min_size=1, max_size=60),
    st.tuples(gain, gain, gain, st.integers(0, 32_767), st.integers(0, 9)),
    st.booleans(),
    st.sampled_from([8, 12]),
)
def test_the_filter_is_the_data_sheet_s(counts, values, wraps, bits):
    chip = MotionChip(output_bits=bits, overflow="wrap" if wraps else "saturate")
    chip.load_filter(**dict(zip(("kp", "ki", "kd", "il", "interval"), values, strict=True)))
    chip.update_filter()
    chip.start()  # a move of no length: the desired position stays zero
    words = [chip.step(-error) for error in counts]
    expected = reference(counts, *values, wraps)
    assert words == [u // 2 ** (16 - bits) for u in expected]


def test_a_positive_error_drives_forward():
    chip = MotionChip()
    chip.load_filter(kp=256)
    chip.update_filter()
    chip.start()
    assert chip.step(-7) == 7
    assert chip.step(7) == -7


def test_error_sum_and_output_stop_at_their_widths():
    chip = MotionChip()
    chip.load_filter(kp=1, ki=32_767, il=32_767)
    chip.update_filter()
    chip.start()
    for _ in range(400):
        word = chip.step(-40_000)
    assert chip.error == 32_767
    assert chip.error_sum == 2**23 - 1
    assert word == 127
    for _ in range(1200):
        word = chip.step(40_000)
    assert (chip.error, chip.error_sum, word) == (-32_768, -(2**23), -128)


def test_the_integral_never_passes_its_limit():
    chip = MotionChip(output_bits=12)
    chip.load_filter(ki=1000, il=160)
    chip.update_filter()
    chip.start()
    assert max(chip.step(-50) for _ in range(3000)) == 10  # 160/16 steps of 12 bits


def test_beyond_the_error_limit_the_motor_is_off_until_the_next_move():
    chip = MotionChip()
    chip.load_filter(kp=256)
    chip.update_filter()
    chip.limit_error(20, stop=True)
    chip.start()
    assert chip.step(-20) == 20
    assert chip.step(-21) == 0
    assert (chip.motor_off, chip.excessive_error, chip.trajectory_complete) == (True, True, True)
    assert chip.step(0) == 0
    chip.step(-500)
    assert chip.start()
    assert chip.step(-500) != 0 or chip.error == 0  # it begins where the motor is
    assert abs(chip.error) <= 20
    assert not chip.motor_off


def test_an_error_limit_that_only_tells_leaves_the_motor_on():
    chip = MotionChip()
    chip.load_filter(kp=256)
    chip.update_filter()
    chip.limit_error(20, stop=False)
    chip.start()
    assert chip.step(-30) == 30
    assert chip.excessive_error
    assert not chip.motor_off


def test_the_index_register_and_home():
    chip = started(position=5000, velocity=200_000, acceleration=20_000)
    chip.step(1, index=1)
    assert not chip.index_found  # nobody asked
    chip.find_index()
    chip.step(10, index=7)
    chip.step(20, index=15)
    assert (chip.index_position, chip.index_found) == (7, True)
    error = chip.error
    chip.define_home()
    assert chip.actual_position == 0
    assert chip.index_position == 7 - 20
    assert chip.desired_position == error
    profile(chip)
    assert chip.desired_position == 5000 - 20


def test_positions_wrap_and_set_a_flag():
    chip = started(velocity=2**30 - 1, acceleration=2**30 - 1, mode="velocity")
    for _ in range(2**30 // 2**14 + 10):
        chip.step(chip.position >> 16)
    assert chip.wraparound
    assert -(2**30) <= chip.desired_position < 0
    assert chip.actual_position == pytest.approx(chip.desired_position, abs=2**14 + 1)
    assert abs(chip.error) <= 2**14  # no jump of the error where the register wraps


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda c: c.load_trajectory(velocity=-1), "ABV: velocity -1 is outside"),
        (lambda c: c.load_trajectory(position=5, acceleration=2**30), "ABA: acceleration 1073741824"),
        (lambda c: c.load_trajectory(mode="torque"), "mode 'torque'"),
        (lambda c: c.load_trajectory(direction=0), "direction 0"),
        (lambda c: c.load_filter(kp=1, interval=256), "FSI: derivative interval 256"),
        (lambda c: c.stop("soon"), "stop 'soon'"),
        (lambda c: c.limit_error(40_000, stop=True), "position error limit 40000"),
        (lambda _: MotionChip(output_bits=10), "converter of 10 bits"),
        (lambda _: MotionChip(overflow="trap"), "overflow 'trap'"),
    ],
)
def test_values_beyond_a_register_are_refused_and_nothing_is_loaded(call, said):
    chip = MotionChip()
    with pytest.raises(ValidityError, match=said):
        call(chip)
    assert (chip.loaded_position, chip.loaded_velocity, chip.loaded_filter) == (0, 0, (0, 0, 0, 0, 0))
