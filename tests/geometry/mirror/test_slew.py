import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.geometry.mirror.encoder import BEAM_PER_COUNT
from catseye.geometry.mirror.slew import Pace, straight, trapezoid
from sun_scene import PACE, profile

COUNT = st.floats(-60_000, 60_000).map(lambda v: round(v, 3))
PAIR = st.tuples(COUNT, COUNT).map(np.array)


def dense(move, looks=4001):
    time = np.linspace(0, float(move.total), looks)
    return time, move.position(time)


def test_a_long_move_by_hand():
    # v = 10 000, a = 20 000: ramps of 0.5 s and 2500 counts; 12 500 counts take 12 500/10 000 + 0.5 = 1.75 s.
    move = trapezoid([0, 0], [12_500, 0], PACE)
    assert move.duration.tolist() == [1.75, 0.0]
    at = move.position(np.array([0.0, 0.25, 0.5, 0.875, 1.25, 1.5, 1.75]))[:, 0]
    assert at == pytest.approx([0, 625, 2500, 6250, 10_000, 11_875, 12_500], abs=1e-9)


def test_a_short_move_is_a_triangle():
    # 3200 counts at 20 000/s^2: half of it in 0.4 s, at 8000 counts/s.
    move = trapezoid([0, 0], [-3200, 0], PACE)
    assert move.total == pytest.approx(0.8)
    assert move.top_speed[0] == pytest.approx(-8000)
    assert move.position(0.4)[0] == pytest.approx(-1600)


def test_each_axis_takes_its_own_time_and_then_stands():
    move = trapezoid([0, 0], [50_000, 100], PACE)
    end = float(move.duration[1])
    assert end < float(move.duration[0])
    assert move.position(end + 0.1)[1] == 100.0
    assert move.position(end / 2) @ [0, 1] == pytest.approx(50)
    straight_on = move.position(float(move.duration[0]) / 2) / [50_000, 100]
    assert abs(straight_on[0] - straight_on[1]) > 0.4  # not straight in counts


def test_coordinated_axes_end_together_on_a_straight_line():
    pace = Pace(PACE.velocity, PACE.acceleration, coordinated=True)
    start, end = np.array([100.0, -200.0]), np.array([40_100.0, 9800.0])
    time, at = dense(trapezoid(start, end, pace))
    share = (at - start) / (end - start)
    assert np.max(np.abs(share[:, 0] - share[:, 1])) < 1e-12
    rate = np.gradient(at, time, axis=0)
    assert np.all(np.abs(rate) <= np.array(pace.velocity) * (1 + 1e-9))
    assert np.max(np.abs(np.gradient(rate, time, axis=0)) / pace.acceleration) < 1.01
    assert np.all(trapezoid(start, start, pace).duration == 0)


@given(PAIR, PAIR)
def test_the_ends_are_met_exactly_and_never_passed(start, end):
    move = trapezoid(start, end, PACE)
    assert move.position(0.0).tolist() == start.tolist()
    assert move.position(move.total).tolist() == end.tolist()
    _, at = dense(move, 101)
    low, high = np.minimum(start, end), np.maximum(start, end)
    assert np.all((at >= low - 1e-9) & (at <= high + 1e-9))


@given(PAIR, PAIR, st.booleans())
def test_the_beam_never_turns_faster_than_its_bound(start, end, coordinated):
    move = trapezoid(start, end, Pace(PACE.velocity, PACE.acceleration, coordinated))
    time, at = dense(move, 501)
    theta, phi = (at * BEAM_PER_COUNT).T
    u = np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)], axis=-1)
    way = np.linalg.norm(np.diff(u, axis=0), axis=-1)  # a chord is no longer than its arc
    assert np.all(way <= move.beam_rate(time[:-1]) * np.diff(time) + 1e-12)


def test_the_bound_is_reached_across_the_axis():
    move = trapezoid([0, 12_500], [50_000, 12_500], PACE)  # Phi = 90 degrees: azimuth moves the beam fully
    u = move.position(np.array([2.0, 2.001]))[:, 0] * BEAM_PER_COUNT[0]
    assert np.diff(u) / 0.001 == pytest.approx(float(move.beam_rate(2.0)), rel=1e-9)
    down = trapezoid([0, 0], [0, 20_000], PACE)
    phi = down.position(np.array([2.0, 2.001]))[:, 1] * 4 * np.pi / 1e5
    assert np.diff(phi) / 0.001 == pytest.approx(float(down.beam_rate(2.0)), rel=1e-9)


def test_the_rate_of_one_count_is_that_of_the_notes():
    assert (BEAM_PER_COUNT * 648_000 / np.pi).tolist() == pytest.approx([12.96, 25.92])


def test_integrated_speeds_give_the_same_way():
    rng = np.random.default_rng(5)
    start, end = rng.uniform(-5e4, 5e4, (2, 50, 2))
    time, counts = profile(start, end, 2001)
    own = trapezoid(start, end, PACE)[:, None].position(time)
    assert np.max(np.abs(own - counts)) < 1e-6  # counts: rounding of sums


def test_straight_is_eq_2_45():
    move = straight([[10.0, 20.0]], [[30.0, 10.0]], 0.128)
    t = 0.05
    assert move[0].position(t).tolist() == pytest.approx([10 + 20 * t / 0.128, 20 - 10 * t / 0.128])
    assert float(move.beam_rate()[0]) == pytest.approx(np.hypot(*(np.array([20, 10]) / 0.128 * BEAM_PER_COUNT)))
    assert straight([1.0, 2.0], [1.0, 2.0], 0.0).total == 0


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (lambda: Pace((0.0, 1.0), (1.0, 1.0)), "velocity"),
        (lambda: Pace((1.0, 1.0), (1.0, np.inf)), "acceleration"),
        (lambda: straight([0, 0], [1, 0], 0.0), "duration"),
        (lambda: straight([0, 0], [1, 0], np.nan), "duration"),
        (lambda: trapezoid([0, 0, 0], [1, 0, 0], PACE), "shape"),
        (lambda: trapezoid([0, np.nan], [1, 0], PACE), "finite"),
    ],
)
def test_invalid_input_is_refused(act, said):
    with pytest.raises(ValidityError, match=said):
        act()
