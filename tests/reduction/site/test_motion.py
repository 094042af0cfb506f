"""Postures between readings, and where they carry points: against closed forms and the printed numbers of eq. 2.44."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catseye.errors import InputError
from catseye.records.night.live import TICKS_PER_DAY, LivePosture
from catseye.reduction.site.motion import PostureTrack, TelescopeCarrier, carried_point, frames_of, ground_from
from live_scene import site

ARCSECOND = np.pi / 648000
T0 = 60635 * TICKS_PER_DAY
PER_SECOND = TICKS_PER_DAY / 86400.0
angles = st.floats(-7.0, 7.0)


def ticks(seconds):
    return T0 + round(seconds * PER_SECOND)


def mjd(seconds):
    return 60635.0 + np.asarray(seconds) / 86400.0


def track(times, azimuth, elevation, rates=None):
    """A track with readings of functions of s; rates by hand."""
    made = PostureTrack()
    for t in times:
        now = (ticks(t) - T0) / PER_SECOND  # what a tick can say
        made.add(LivePosture(ticks(t), azimuth(now), elevation(now), *([0.0, 0.0] if rates is None else rates(now))))
    return made


def test_a_cubic_motion_is_followed_exactly():
    c, d = (0.3, 0.02, -1e-3, 2e-4), (0.8, -0.01, 5e-4, 1e-4)
    p, q = np.polynomial.Polynomial(c), np.polynomial.Polynomial(d)
    followed = track([0.0, 0.7, 1.0, 2.5], p, q, lambda t: (p.deriv()(t), q.deriv()(t)))
    t = np.linspace(0.0, 2.49, 101)
    azimuth, elevation = followed.at(mjd(t))
    # a float64 MJD steps by 0.6 us, in which 0.03 rad/s moves 2e-8 rad
    np.testing.assert_allclose(azimuth, p(t), rtol=0, atol=4e-8)
    np.testing.assert_allclose(elevation, q(t), rtol=0, atol=4e-8)


def test_an_acceleration_that_begins_between_readings_is_off_by_the_hundredth_of_an_arc_second_that_is_claimed():
    a = np.radians(0.2)
    followed = track(
        np.arange(0.0, 2.0, 0.1),
        lambda t: 0.5 * a * max(t - 1.05, 0.0) ** 2,
        lambda t: 0.5,
        lambda t: (a * max(t - 1.05, 0.0), 0.0),
    )
    t = np.linspace(0.9, 1.3, 401)
    off = followed.at(mjd(t))[0] - 0.5 * a * np.maximum(t - 1.05, 0.0) ** 2
    assert np.abs(off).max() < 0.05 * ARCSECOND
    assert np.abs(off).max() > 1e-4 * ARCSECOND, "there is something to be off by"


@pytest.mark.parametrize("count", [1, 2, 5])
def test_beyond_the_readings_the_last_rates_go_on(count):
    times = np.arange(count) * 0.1
    followed = track(times, lambda t: 1.0 + 0.01 * t, lambda t: 0.5 - 0.002 * t, lambda t: (0.01, -0.002))
    t = np.array([-1.5, -0.2, times[-1] + 0.3, times[-1] + 1.9])
    azimuth, elevation = followed.at(mjd(t))
    np.testing.assert_allclose(azimuth, 1.0 + 0.01 * t, rtol=0, atol=2e-8)
    np.testing.assert_allclose(elevation, 0.5 - 0.002 * t, rtol=0, atol=4e-9)


@settings(max_examples=40)
@given(order=st.permutations(range(8)), ahead=st.floats(-1.0, 2.0))
def test_the_order_in_which_readings_come_does_not_matter(order, ahead):
    reads = [LivePosture(ticks(0.1 * k), 0.3 + 0.001 * k**2, 0.5, 0.02 * k, 0.0) for k in range(8)]
    sorted_, shuffled = PostureTrack(), PostureTrack()
    for k in range(8):
        sorted_.add(reads[k])
        shuffled.add(reads[order[k]])
        shuffled.at(mjd(0.0))  # whatever was asked before
    np.testing.assert_array_equal(sorted_.at(mjd(ahead)), shuffled.at(mjd(ahead)))
    assert sorted_.angles(float(mjd(ahead))) == shuffled.angles(float(mjd(ahead)))
    assert shuffled.latest == reads[7]


def test_a_second_reading_of_an_instant_replaces_the_first():
    followed = track([0.0], lambda t: 1.0, lambda t: 0.5)
    followed.at(mjd(0.0))
    followed.add(LivePosture(ticks(0.0), 2.0, 0.6))
    assert len(followed) == 1
    assert [float(v) for v in followed.at(mjd(0.0))] == [2.0, 0.6]


@settings(max_examples=60)
@given(
    start=angles,
    speed=st.floats(-0.5, 0.5),
    where=st.floats(-1.0, 3.0),
    gaps=st.lists(st.floats(0.05, 0.9), min_size=1, max_size=6),
)
def test_one_angle_without_arrays_is_that_of_arrays_through_north_too(start, speed, where, gaps):
    times = np.concatenate([[0.0], np.cumsum(gaps)])
    followed = track(
        times,
        lambda t: (start + speed * t) % (2 * np.pi),  # an encoder that goes back at north
        lambda t: 0.7 + 0.1 * np.sin(t),
        lambda t: (speed, 0.1 * np.cos(t)),
    )
    azimuth, elevation = followed.angles(float(mjd(where)))
    expected = [float(v) for v in followed.at(mjd(where))]
    turn = (azimuth - expected[0]) / (2 * np.pi)
    assert abs(turn - round(turn)) < 1e-8  # a float64 MJD is 0.6 us; half of that times 0.5 rad/s
    assert elevation == pytest.approx(expected[1], abs=1e-7)
    true = (azimuth - start - speed * where) / (2 * np.pi)
    assert abs(true - round(true)) < 1e-7


def test_the_age_is_that_of_the_nearest_reading():
    followed = track([0.0, 1.0, 5.0], lambda t: 0.0, lambda t: 0.5)
    np.testing.assert_allclose(
        followed.age(mjd([-2.0, 0.4, 2.0, 4.0, 9.0])), [2.0, 0.4, 1.0, 1.0, 4.0], atol=1e-3
    )  # a tick
    assert np.isinf(PostureTrack().age(mjd([0.0])))[0]
    np.testing.assert_allclose(track([1.0], lambda t: 0.0, lambda t: 0.5).age(mjd([3.0])), [2.0], atol=1e-3)


def test_without_a_reading_an_error_is_raised():
    for ask in (lambda t: t.at(mjd(0.0)), lambda t: t.angles(float(mjd(0.0)))):
        with pytest.raises(InputError, match="no telescope position received"):
            ask(PostureTrack())
    assert PostureTrack().latest is None


def test_old_readings_are_forgotten_and_new_ones_kept():
    followed = track(np.arange(0.0, 3 * 3600.0, 20.0), lambda t: 1e-4 * t, lambda t: 0.5, lambda t: (1e-4, 0.0))
    assert 3600 / 20 <= len(followed) <= 1.25 * 3600 / 20 + 2
    t = np.array([7300.0, 9000.0, 10770.0])
    np.testing.assert_allclose(followed.at(mjd(t))[0], 1e-4 * t, rtol=0, atol=1e-9)


def test_older_readings_are_thinned_out_and_those_of_five_minutes_are_whole():
    """Ten a second for an hour are 36 000; a shot comes within two minutes, and is as exact as before."""
    whole, seconds = PostureTrack(), np.arange(0.0, 1200.0, 0.1)
    for s in seconds:
        whole.add(LivePosture(ticks(s), 1e-4 * s, 0.5 + 1e-5 * s, 1e-4, 1e-5))
    assert len(whole) < 3000 + 750 + 900 + 10
    late = mjd(np.linspace(900.0, 1199.0, 997))
    whole_late = track(seconds[8900:], lambda t: 1e-4 * t, lambda t: 0.5 + 1e-5 * t, lambda t: (1e-4, 1e-5))
    np.testing.assert_allclose(whole.at(late)[1], whole_late.at(late)[1], rtol=0, atol=1e-8)  # stamps have steps
    early = mjd(np.linspace(1.0, 800.0, 997))
    assert whole.age(early).max() <= 0.55, "so old a reference shot has its posture still"
    np.testing.assert_allclose(whole.at(early)[0], 1e-4 * np.linspace(1.0, 800.0, 997), rtol=0, atol=1e-6)


def test_a_late_reading_is_thinned_out_like_the_others():
    made = PostureTrack()
    for s in [*np.arange(0.0, 900.0, 0.1), *np.arange(100.05, 200.0, 0.1), *np.arange(900.0, 1300.0, 0.1)]:
        made.add(LivePosture(ticks(s), 1e-4 * s, 0.5, 1e-4, 0.0))
    assert len(made) < 3750 + 1000 + 20
    assert made.latest.ticks == ticks(1299.9)


def test_readings_between_two_times_stay_as_they_were():
    times = np.arange(0.0, 100.0, 0.5)
    followed = track(times, lambda t: 1e-3 * t**2 % (2 * np.pi), lambda t: 0.5, lambda t: (2e-3 * t, 0.0))
    asked = np.array([40.0, 41.23, 44.9])
    expected = followed.at(mjd(asked))[0]
    part = followed.between(mjd(40.0), mjd(44.9))
    assert 14 <= len(part) <= 20  # 10 of them, and a gap of 2 s each side
    followed.add(LivePosture(ticks(41.25), 99.0, 0.5))
    turns = (part.at(mjd(asked))[0] - expected) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.rint(turns[0]), rtol=0, atol=1e-12)
    beyond = followed.between(mjd(500.0), mjd(510.0))
    assert 2 <= len(beyond) <= 3
    assert beyond.latest == followed.latest


def test_a_track_does_not_depend_on_earlier_queries():
    asked, silent, late = PostureTrack(), PostureTrack(), np.random.default_rng(3).permutation(300)
    order = np.concatenate([np.arange(0, 2000), 2000 + late, np.arange(2300, 4000)])  # across several turns
    for k in order:
        read = LivePosture(ticks(0.1 * k), (0.01 * k) % (2 * np.pi), 0.5 + 1e-5 * k, 0.1, 1e-4)
        for each in (asked, silent):
            each.add(read)
        asked.at(mjd(0.1 * k))
    times = mjd(np.linspace(0.0, 399.9, 1777))
    np.testing.assert_array_equal(asked.at(times), silent.at(times))
    np.testing.assert_allclose(
        np.diff(silent.at(mjd(0.1 * np.arange(4000.0)))[0]), 0.01, rtol=0, atol=1e-4
    )  # stamps have steps


# [PARKER04] eq. 2.44: facts/gbt-site.md, mm; half of the last printed digit is 0.5 um
PRINTED = [
    (0.0, 90.0, [0.0, 0.0, 0.0], [0.0, -54839.108, 53259.990]),
    (0.0, 90.0, [0.0, 0.0, 60000.0], [0.0, -54839.108, 113259.990]),
    (90.0, 45.0, [0.0, 0.0, 0.0], [-35241.578, 0.0, 90572.632]),
    (90.0, 45.0, [0.0, 0.0, 60000.0], [7184.829, 0.0, 132999.039]),
]


@pytest.mark.parametrize(("azimuth", "elevation", "own", "ground"), PRINTED)
def test_the_printed_numbers_of_equation_2_44(azimuth, elevation, own, ground):
    posture = np.radians(azimuth), np.radians(elevation)
    one = carried_point(site(), "reflector", 1e-3 * np.array(own), *posture)
    many = ground_from(site(), "reflector", *np.atleast_1d(*posture)).points(1e-3 * np.array(own))[0]
    np.testing.assert_allclose(1e3 * np.array(one), ground, rtol=0, atol=5.1e-4)
    np.testing.assert_allclose(1e3 * many, ground, rtol=0, atol=5.1e-4)


@given(
    frame=st.sampled_from(["ground", "alidade", "reflector"]),
    azimuth=angles,
    elevation=st.floats(0.0, 1.6),
    seed=st.integers(0, 10**6),
)
def test_one_carried_point_is_that_of_the_transforms(frame, azimuth, elevation, seed):
    own = np.random.default_rng(seed).uniform(-100, 100, 3)
    expected = ground_from(site(), frame, np.array([azimuth]), np.array([elevation])).points(own)[0]
    np.testing.assert_allclose(carried_point(site(), frame, own, azimuth, elevation), expected, rtol=0, atol=1e-12)


def test_an_alidade_point_turns_clockwise_and_the_ground_stands():
    east = carried_point(site(), "alidade", np.array([0.0, 10.0, 3.0]), np.radians(90.0), 0.4)
    np.testing.assert_allclose(east, [10.0, 0.0, 3.0], rtol=0, atol=1e-14)
    assert carried_point(site(), "ground", np.array([1.0, 2.0, 3.0]), 2.0, 1.0) == (1.0, 2.0, 3.0)


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6))
def test_points_are_carried_from_the_epoch_to_their_shots(seed):
    rng = np.random.default_rng(seed)
    a, e, va, ve = rng.uniform(0, 6), rng.uniform(0.2, 1.4), *rng.normal(0.0, 0.01, 2)
    followed = track(np.arange(0.0, 3.0, 0.1), lambda t: a + va * t, lambda t: e + ve * t, lambda t: (va, ve))
    names, own = ("DP01C", "G", "ALI", "ARM"), rng.uniform(-50, 50, (4, 3))
    frames = dict(zip(names, ("reflector", "ground", "alidade", "reflector"), strict=True))
    motion = TelescopeCarrier(site(), followed, frames, float(mjd(1.234)))
    t = rng.uniform(0.0, 2.9, 4)
    turn, shift = motion.carried(names, mjd(t))
    for k, name in enumerate(names):
        x = [np.array(carried_point(site(), frames[name], own[k], a + va * s, e + ve * s)) for s in (1.234, t[k])]
        np.testing.assert_allclose(turn[k] @ x[0] + shift[k], x[1], rtol=0, atol=3e-6)  # 0.6 us, 0.03 rad/s, 100 m
        np.testing.assert_allclose(turn[k] @ turn[k].T, np.eye(3), rtol=0, atol=1e-14)


def test_ranges_shake_only_where_their_ends_shake_apart():
    bodies, jitter = {"A": "arm", "B": "arm", "D": "dish"}, {"arm": 0.3, "dish": 0.4}
    motion = TelescopeCarrier(site(), PostureTrack(), {}, 60635.0, bodies, jitter)
    np.testing.assert_allclose(motion.jitter("A", ("B", "D", "G")), [0.0, 0.25e-6, 0.09e-6], rtol=1e-12, atol=0)
    np.testing.assert_allclose(motion.jitter("G", ("D", "G")), [0.16e-6, 0.0], rtol=1e-12, atol=0)


def test_every_point_of_the_site_has_its_frame():
    frames = frames_of(site())
    assert frames["ZY101"] == frames["ZY101-F"] == "ground"
    assert frames["ZY113"] == frames["DP01C"] == "reflector"
    assert {frames[n] for t in site().triplets.values() for n in t.targets} >= {"reflector"}
    expected = {*site().monuments, *(f"{m}-F" for m in site().monuments), *(r.name for r in site().feedarm.ranger)}
    assert set(frames) == expected | set(site().targets) | {n for t in site().triplets.values() for n in t.targets}


def test_an_unknown_frame_does_not_move():
    still = SimpleNamespace(site=None)
    assert ground_from(still, "ground", np.zeros(2), np.zeros(2)).points(np.ones(3)).tolist() == [[1.0] * 3] * 2


@pytest.mark.parametrize(("start", "speed"), [(6.2, 0.1), (0.05, -0.1)])
def test_through_north_it_goes_on_and_not_round(start, speed):
    followed = track(
        np.arange(0.0, 3.0, 0.5),
        lambda t: (start + speed * t) % (2 * np.pi),
        lambda t: 0.5,
        lambda t: (speed, 0.0),
    )
    t = np.linspace(0.0, 2.5, 51)
    np.testing.assert_allclose(followed.at(mjd(t))[0], start + speed * t, rtol=0, atol=1e-7)
