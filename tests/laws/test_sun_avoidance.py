"""No pointing, slew, track or search path that the guard accepts comes into the Sun's cone.

The check shares nothing with the guard: astropy's Sun, scipy's rotations, integrated speeds (tests/sun_scene.py). It is
shown to fail where the guard is wrong.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from catseye.geometry.clearance.keep_out import TOUCH
from catseye.geometry.mirror.pointing import MirrorStation, counts
from catseye.geometry.mirror.search_pattern import spiral
from catseye.geometry.mirror.slew import trapezoid
from catseye.reduction.site.earth_rotation import FramePlace
from draws import draws
from sun_scene import (
    DEGREE,
    GREEN_BANK,
    STATION,
    STOPS,
    ZEROS,
    apart,
    astropy_sun,
    beam,
    guard,
    profile,
    random_counts,
)

LOOKS = 65
CONE = 5 * DEGREE


def days(rng, n):
    """Times while the Sun is up, within the Earth rotation tables: 1973 to 2025."""
    found = []
    while len(found) < n:
        mjd = rng.uniform(41_700, 61_000)
        if astropy_sun(np.array([mjd]))[0, 2] > 0.05:
            found.append(mjd)
    return found


@cache
def suns(mjd):
    """astropy's Sun as a function of seconds after mjd, a straight line over two minutes: 2" at most beside it."""
    a, b = astropy_sun(np.array([mjd, mjd + 120 / 86_400]))
    return lambda s: a + (b - a) * (s / 120)[..., None]


@cache
def seen_at(mjd):
    return counts(STATION, STATION.scan_point + 100 * astropy_sun(np.array([mjd]))[0])


def accepted_pointings(own, mjd, n):
    return np.min(own.clearance(mjd, n), axis=-1) > TOUCH


def violations_of_pointings(own, rng, times, each):
    """How many accepted pointings lie in the cone; how many are accepted; how many free ones are refused."""
    inside = accepted = needless = 0
    for mjd in times:
        n = random_counts(rng, each, near=seen_at(mjd))
        ok = accepted_pointings(own, mjd, n)
        angle = apart(beam(n), astropy_sun(np.array([mjd]))[0])
        inside += np.sum(ok & (angle < CONE))
        accepted += np.sum(ok)
        needless += np.sum(~ok & (angle > CONE + 20 / 3600 * DEGREE))
    return inside, accepted, needless


def violations_of_slews(own, rng, times, each, accept=None):
    """The same for slews, by dense looks at the accepted ones (all of them for what is needless)."""
    inside = accepted = needless = 0
    for mjd in times:
        near = seen_at(mjd)
        start, end = random_counts(rng, each, near), random_counts(rng, each, near)[rng.permutation(each)]
        ok = (
            own.entries(mjd, trapezoid(start, end, own.pace)).status == 0 if accept is None else accept(mjd, start, end)
        )
        sun = suns(mjd)
        for part in np.array_split(np.arange(each), max(1, each // 5000)):
            time, way = profile(start[part], end[part], LOOKS)
            angle = np.min(apart(beam(way), sun(time)), axis=-1)
            inside += np.sum(ok[part] & (angle < CONE - 0.2 / 3600 * DEGREE))
            needless += np.sum(~ok[part] & (angle > CONE + DEGREE))
        accepted += np.sum(ok)
    return inside, accepted, needless


def test_no_accepted_pointing_of_a_hundred_thousand_is_in_the_cone():
    rng = np.random.default_rng(471)
    inside, accepted, needless = violations_of_pointings(guard(), rng, days(rng, 10), 10_000)
    assert inside == 0
    assert needless == 0
    assert 50_000 < accepted < 99_000


def test_no_accepted_slew_of_twenty_thousand_comes_into_the_cone():
    rng = np.random.default_rng(472)
    inside, accepted, needless = violations_of_slews(guard(), rng, days(rng, 5), 4_000)
    assert inside == 0
    assert needless <= 10  # looks are up to a degree apart: the cone's edge may be cut between two of them
    assert 5_000 < accepted < 19_000


WRONG = {
    "a Sun one degree of longitude off": {
        "place": FramePlace(GREEN_BANK.latitude, GREEN_BANK.longitude + DEGREE, 807.0)
    },
    "a Sun of the other hemisphere": {"place": FramePlace(-GREEN_BANK.latitude, GREEN_BANK.longitude, 807.0)},
    "west longitudes counted positive": {"place": FramePlace(GREEN_BANK.latitude, -GREEN_BANK.longitude, 807.0)},
    "a cone given its whole angle for the half": {"half_angle": 2.5 * DEGREE},
    "a mount turned the wrong way": {"alpha": 0.2492780},
    "encoder zeros with the wrong sign": {"zeros": [-ZEROS[0], -ZEROS[1]]},
}


@pytest.mark.parametrize("bug", WRONG)
def test_the_check_finds_a_planted_bug(bug):
    changes = dict(WRONG[bug])
    if "alpha" in changes:
        alpha = [changes.pop("alpha"), *STATION.alpha[1:]]
        changes["station"] = MirrorStation(STATION.fixed_point, alpha, STATION.offset, STATION.beta, STATION.zeros)
    if "zeros" in changes:
        changes["station"] = MirrorStation(
            STATION.fixed_point, STATION.alpha, STATION.offset, STATION.beta, changes.pop("zeros")
        )
    wrong = replace(guard(), **changes)
    rng = np.random.default_rng(473)
    assert violations_of_pointings(wrong, rng, days(rng, 2), 2_000)[0] > 5
    assert violations_of_slews(wrong, rng, days(rng, 2), 500)[0] > 5


def test_a_guard_that_looks_only_at_the_ends_is_found_out():
    own = guard()

    def ends_only(mjd, start, end):
        return accepted_pointings(own, mjd, start) & accepted_pointings(own, mjd, end)

    rng = np.random.default_rng(474)
    assert violations_of_slews(own, rng, days(rng, 2), 500, ends_only)[0] > 20


def deepest_of_track(mjd, seconds, points):
    """Least angle, rad, from astropy's Sun to a beam that goes straight between counts (n, 2) at times (n,), s."""
    time = np.linspace(0.0, seconds[-1], 4001)
    way = np.stack([np.interp(time, seconds, points[:, k]) for k in (0, 1)], axis=-1)
    return np.min(apart(beam(way), suns(mjd)(time)))


@draws(25, name="tracks")
def test_no_accepted_track_of_many_comes_into_the_cone(tracks):
    own, rng = guard(), np.random.default_rng(477)
    accepted = refused = ends_only = 0
    for mjd in days(rng, 4):
        for _ in range(tracks):
            # Three minutes about the Sun, four time tags.
            seconds = np.array([0.0, 45.0, 120.0, 180.0])
            points = seen_at(mjd) + rng.normal(0, 1, (4, 2)) * [4000, 2000]
            points[:, 0] = np.clip(points[:, 0], *STOPS)
            tags = mjd + seconds / 86_400
            deepest = deepest_of_track(mjd, seconds, points)
            if own.track(tags, points).allowed:
                accepted += 1
                assert deepest > CONE
            else:
                refused += 1
                assert deepest < CONE + 60 / 3600 * DEGREE  # looks are apart, pieces of the Sun's way widen the cone
                ends_only += bool(np.all(own.clearance(tags, points) > TOUCH))
    assert min(accepted, refused) > 20 / 25 * tracks
    assert ends_only > 3 / 25 * tracks  # what looks at the time tags alone would have let pass


def test_no_accepted_search_of_many_comes_into_the_cone():
    own, rng = guard(), np.random.default_rng(478)
    accepted = refused = moved_in = 0
    for mjd in days(rng, 4):
        for _ in range(10):
            off = rng.choice([-1, 1]) * rng.uniform(5.2, 6.2) * DEGREE
            centre = np.add(seen_at(mjd), [0.0, off / (4 * np.pi) * 1e5])
            looks = spiral(np.rint(centre), STATION.zeros, 0.4 * DEGREE, reach=2e-3, limits=STOPS).counts
            verdict = own.route(mjd, looks, dwell=3.0)
            moves = trapezoid(looks[:-1], looks[1:], own.pace)
            time, way = profile(looks[:-1], looks[1:], 17)
            begin = 3.0 * np.arange(1, len(looks)) + np.concatenate([[0.0], np.cumsum(moves.total)[:-1]])
            sun = suns(mjd)(begin[:, None] + time)
            deepest = np.min(apart(beam(way), sun))
            if verdict.allowed:
                accepted += 1
                assert deepest > CONE
            else:
                refused += 1
                assert deepest < CONE + 60 / 3600 * DEGREE
                # A list of counts asked for at one time goes stale while the search goes on: the Sun moves.
                moved_in += bool(np.all(own.clearance(mjd, looks) > TOUCH))
    assert accepted > 5
    assert refused > 5
    assert moved_in > 0


@pytest.mark.slow
def test_no_accepted_pointing_of_ten_million_is_in_the_cone():
    rng = np.random.default_rng(475)
    inside, accepted, needless = violations_of_pointings(guard(), rng, days(rng, 100), 100_000)
    assert inside == 0
    assert needless == 0
    assert accepted > 5_000_000


@pytest.mark.slow
def test_no_accepted_slew_of_ten_million_comes_into_the_cone():
    rng = np.random.default_rng(476)
    inside, accepted, needless = violations_of_slews(guard(), rng, days(rng, 100), 100_000)
    assert inside == 0
    assert needless < 5_000
    assert accepted > 3_000_000
