"""Limits of the Sun watch: 5 degrees, the servo's overshoot, half the sampling step."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.geometry.mirror import pointing
from catseye.ranger.sun_watch import LARGEST_STEP, nearest_sun, refusal
from ranger.ranger_scene import ready
from sun_scene import DEGREE, STATION, ZEROS, apart, beam

CONE = 5.0 * DEGREE
OVERSHOOT = np.array([20.0, 20.0])  # counts of each axis, as in the site's keep-out record
NEAR = 2.0 / 3600.0 * DEGREE  # 2": a sixth of a count of azimuth, and what a turn of 1.6 deg bends on the sphere
LEVEL = np.add(ZEROS, [3_000.0, 12_500.0])  # Phi of 90 deg, where a count of azimuth turns the beam most


def turn(counts, at=LEVEL):
    """Angle, rad, by which axes off by counts (2,) turn the beam."""
    return float(apart(beam(at), beam(at + np.asarray(counts, dtype=float))))


def beyond(at, counts, angle):
    """The Sun at an angle, rad, from the beam at counts `at`, on the side to which axes going on by counts turn it."""
    here = beam(at)
    aside = beam(at + 0.01 * np.asarray(counts, dtype=float)) - here
    aside -= here * (aside @ here)
    return np.cos(angle) * here + np.sin(angle) * aside / np.linalg.norm(aside)


@pytest.mark.parametrize("away", [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)])
def test_rest_is_refused_if_the_servo_could_overshoot_into_the_cone(away):
    corner = OVERSHOOT * away
    boundary = CONE + turn(corner)
    assert boundary - CONE == pytest.approx(580.0 / 3600 * DEGREE, rel=1e-3)  # 20 sqrt(12.96^2 + 25.92^2) arc seconds
    outside, inside = (beyond(LEVEL, corner, boundary + by) for by in (NEAR, -NEAR))
    assert refusal(STATION, LEVEL, LEVEL, suns=[outside]) is None
    said = refusal(STATION, LEVEL, LEVEL, suns=[inside])
    assert said is not None
    assert "of the Sun (expected at least 5.2)" in said
    # what the margin is for: the axes twenty counts on
    assert apart(beam(LEVEL + corner), outside) > CONE > apart(beam(LEVEL + corner), inside)


def test_allowed_rest_stays_out_of_the_cone_within_the_overshoot():
    rng = np.random.default_rng(21)
    corners = OVERSHOOT * np.array([(1, 1), (1, -1), (-1, 1), (-1, -1), (1, 0), (-1, 0), (0, 1), (0, -1)])
    allowed = 0
    for _ in range(150):
        at = np.add(ZEROS, rng.uniform([-20_000, -20_000], [20_000, 20_000]))
        sun = beyond(at, rng.normal(size=2), CONE + rng.uniform(0.0, 0.2) * DEGREE)
        if refusal(STATION, at, at, suns=[sun]) is None:
            allowed += 1
            assert apart(beam(at + corners), sun).min() > CONE
    assert 10 < allowed < 60  # 0.04 of the 0.2 deg


MOVES = {  # counts: the step between two looks
    (LARGEST_STEP, 0): (400.0, 0.0),
    (0, LARGEST_STEP): (0.0, 400.0),
    (LARGEST_STEP, LARGEST_STEP): (400.0, 400.0),
    (-LARGEST_STEP, LARGEST_STEP): (-400.0, 400.0),
    (0, -100): (0.0, -100.0),
    (0, 600): (0.0, 300.0),  # three looks
    (1000, 200): (1000.0 / 3.0, 200.0),  # four by two
}


@pytest.mark.parametrize("move", MOVES)
def test_move_is_refused_if_the_beam_could_enter_the_cone_between_samples(move):
    """The Sun beyond the end of the move, in the direction of half a cell's diagonal: the end is the nearest look."""
    half = 0.5 * np.array(MOVES[move])
    end = LEVEL + np.array(move, dtype=float)
    between, boundary = turn(half), CONE + turn(OVERSHOOT) + turn(half)
    for by in (NEAR, -NEAR):
        sun = beyond(end, half, boundary + by)
        assert nearest_sun(STATION, LEVEL, end, suns=[sun]) == pytest.approx(boundary + by - between, abs=0.5 * NEAR)
        assert nearest_sun(STATION, LEVEL, end, suns=[sun], exact=True) == pytest.approx(boundary + by, abs=1e-9)
        assert (refusal(STATION, LEVEL, end, suns=[sun]) is None) == (by > 0.0)
    nearer = beyond(end, half, boundary - 0.5 * between)  # half a cell's margin less
    assert refusal(STATION, LEVEL, end, suns=[nearer]) is not None


def test_least_angle_of_a_move_is_a_lower_bound_over_its_rectangle():
    rng = np.random.default_rng(22)
    for _ in range(100):
        start = np.add(ZEROS, rng.uniform([-20_000, -20_000], [20_000, 20_000]))
        end = start + rng.uniform(-900, 900, 2)
        sun = rng.normal(size=3)
        sun /= np.linalg.norm(sun)
        looks = beam(start + rng.uniform(size=(300, 2)) * (end - start))
        assert nearest_sun(STATION, start, end, suns=[sun]) <= apart(looks, sun).min()


def passing(aside, start=-2.5 * DEGREE, end=8.0 * DEGREE):
    """A move of azimuth past a Sun: start and end (2,), the Sun; it begins and ends at angles beside it, rad."""
    per_count = turn((1.0, 0.0))
    sun = beyond(LEVEL, (0.0, 1.0), aside)
    return *(np.add(LEVEL, [angle / per_count, 0.0]) for angle in (start, end)), sun


def slack(aside):
    """How much less than it may a move past the Sun is as far off as it began, by looks 400 counts apart or less."""
    start, end, sun = passing(aside)
    count = int(np.ceil(abs(end[0] - start[0]) / LARGEST_STEP)) + 1
    looks = np.linspace(start, end, count)
    least = apart(beam(looks), sun).min() - turn(0.5 * (looks[1] - looks[0]))
    return least - (apart(beam(start), sun) - turn((200.0, 200.0)))


def test_move_out_of_the_cone_may_come_nearer_only_within_grid_resolution():
    low, high = 0.0, 4.0 * DEGREE  # beside the Sun: straight over it, and hardly nearer than it began
    assert slack(low) < 0.0 < slack(high)
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if slack(middle) > 0.0 else (middle, high)
    for by in (10.0 * NEAR, -10.0 * NEAR):  # 20": the way begins 2.5 deg aside, where slack grows slower than the angle
        start, end, sun = passing(high + by)
        assert apart(beam(start), sun) < CONE < apart(beam(end), sun) - turn(OVERSHOOT)
        assert (refusal(STATION, start, end, suns=[sun]) is None) == (by > 0.0)


def test_ranger_refuses_moves_at_the_same_boundary():
    z = ready().ranger
    station = z.cubes.station
    at = np.array([3_000.0, 12_500.0])

    def looks(counts):
        return pointing.beam(station, counts) @ station.mirror_from_ground

    here, corner = looks(at), looks(at + OVERSHOOT)
    aside = corner - here * (corner @ here)
    aside /= np.linalg.norm(aside)
    boundary = CONE + np.arccos(corner @ here)
    for by in (NEAR, -NEAR):
        z.sun_vector = tuple(np.cos(boundary + by) * here + np.sin(boundary + by) * aside)
        if by > 0.0:
            z.refuse_sun(at, start=at)
        else:
            with pytest.raises(InputError, match=r"of the Sun \(expected at least 5\.2\)"):
                z.refuse_sun(at, start=at)
        assert z.sun_refused == (by < 0.0)
