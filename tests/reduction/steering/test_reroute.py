import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.geometry.clearance.keep_out import BoxZone
from catseye.geometry.mirror.pointing import counts
from catseye.geometry.mirror.slew import trapezoid
from catseye.reduction.steering.reroute import RouteStatus, route
from sun_scene import DEGREE, MORNING, PACE, STATION, STOPS, ZEROS, apart, astropy_sun, beam, boxes, guard, profile

AT_SUN = counts(STATION, STATION.scan_point + 100 * astropy_sun(np.array([MORNING]))[0])
START, END = AT_SUN - [3000, 500], np.add(AT_SUN, [3000, 300])


def test_a_free_slew_is_taken_as_it_is():
    start, end = np.add(AT_SUN, [-9000, 4000]), np.add(AT_SUN, [9000, 6000])
    found = route(guard(), MORNING, start, end)
    assert found.status == RouteStatus.DIRECT
    assert found.waypoints.tolist() == [start.tolist(), end.tolist()]
    assert found.duration == pytest.approx(float(trapezoid(start, end, PACE).total))


def test_a_way_round_the_sun_is_found_and_holds_by_an_independent_check():
    own = guard(margin_counts=(20, 20), boxes=boxes())
    assert not own.slew(MORNING, START, END).allowed
    found = route(own, MORNING, START, END)
    assert found.status == RouteStatus.AROUND
    assert found.waypoints[0].tolist() == START.tolist()
    assert found.waypoints[-1].tolist() == END.tolist()
    assert own.route(MORNING, found.waypoints).allowed
    time, n = profile(found.waypoints[:-1], found.waypoints[1:], 400)
    sun = astropy_sun(np.array([MORNING]))[0]
    assert np.max(time.sum(axis=0)) < 30
    # 0.16 degrees for the servo, less what the Sun moves in some seconds.
    assert np.min(apart(beam(n), sun)) / DEGREE > 5.1
    direct = float(trapezoid(START, END, PACE).total)
    assert direct < found.duration < 3 * direct
    assert np.all((found.waypoints[:, 0] >= STOPS[0]) & (found.waypoints[:, 0] <= STOPS[1]))


def test_the_other_setting_is_taken_where_it_is_sooner():
    # The target across the sky: the prime setting needs no half turn of azimuth.
    ne0 = ZEROS[1]
    start, target = np.array([0.0, ne0 + 1500]), np.array([50_000.0, ne0 + 1500])
    found = route(guard(place=None), MORNING, start, target)
    assert found.status == RouteStatus.DIRECT
    assert found.prime
    assert found.waypoints[-1] == pytest.approx([0.0, ne0 - 1500])
    assert apart(beam(found.waypoints[-1]), beam(target)) < 1e-12
    only = route(guard(place=None), MORNING, start, target, either=False)
    assert not only.prime
    assert only.duration > found.duration


def test_a_gap_in_a_wall_is_found_and_a_shut_wall_blocks():
    # Walls all about the ranger but the south side, which a bar parts; a gap in the bar is the only way down or up.
    here = STATION.scan_point
    sides = [
        BoxZone(np.add(here, [0, 12, 0]), [24, 0.5, 24], name="north"),
        BoxZone(np.add(here, [12, 0, 0]), [0.5, 24, 24], name="east"),
        BoxZone(np.add(here, [-12, 0, 0]), [0.5, 24, 24], name="west"),
        BoxZone(np.add(here, [0, 0, 12]), [24, 24, 0.5], name="top"),
        BoxZone(np.add(here, [0, 0, -12]), [24, 24, 0.5], name="floor"),
    ]
    low, high = counts(STATION, np.add(here, [8.0, -12.0, -6.0])), counts(STATION, np.add(here, [7.0, -12.0, 6.0]))
    bars = [
        BoxZone(np.add(here, [-8, -12, 0]), [8, 0.5, 1.0], name="bar"),
        BoxZone(np.add(here, [6, -12, 0]), [12, 0.5, 1.0], name="other bar"),
    ]
    own = guard(place=None, boxes=tuple(sides + bars), margin_counts=(5, 5))
    assert own.pointing(MORNING, low).allowed
    assert own.pointing(MORNING, high).allowed
    through = route(own, MORNING, low, high, either=False, step=(600.0, 300.0))
    assert through.status == RouteStatus.AROUND
    assert own.route(MORNING, through.waypoints).allowed
    slit = beam(profile(through.waypoints[:-1], through.waypoints[1:], 300)[1].reshape(-1, 2))
    crossing = slit[np.argmin(np.abs(slit[:, 2]))]
    assert -4.1 / 12 < crossing[0] / -crossing[1] < 0.1 / 12
    shut = BoxZone(np.add(here, [-2, -12, 0]), [8, 0.5, 1.0], name="shutter")
    own = guard(place=None, boxes=(*sides, *bars, shut), margin_counts=(5, 5))
    assert route(own, MORNING, low, high, step=(600.0, 300.0)).status == RouteStatus.BLOCKED


def test_forbidden_ends_are_reported():
    own = guard()
    assert route(own, MORNING, AT_SUN, END).status == RouteStatus.STARTS_INSIDE
    assert route(own, MORNING, START, AT_SUN).status == RouteStatus.TARGET_INSIDE
    beyond = route(own, MORNING, [STOPS[1] + 5, ZEROS[1] + 1000], END)
    assert beyond.status == RouteStatus.STARTS_INSIDE
    assert route(own, MORNING, START, [STOPS[1] + 5, ZEROS[1] + 1000], either=False).status == RouteStatus.TARGET_INSIDE
    assert not beyond.found
    assert len(beyond.waypoints) == 0


def test_random_ways_are_found_and_verified():
    own = guard(margin_counts=(20, 20), boxes=boxes())
    rng = np.random.default_rng(11)
    kinds = []
    while len(kinds) < 6:
        ends = AT_SUN + rng.uniform(-1, 1, (2, 2)) * [9000, 4000]
        if not all(own.pointing(MORNING, n).allowed for n in ends) or own.slew(MORNING, *ends).allowed:
            continue
        found = route(own, MORNING, *ends, either=False, step=(600.0, 300.0))
        kinds.append(found.status)
        assert found.found, found.status
        assert own.route(MORNING, found.waypoints).allowed
        assert found.waypoints[[0, -1]] == pytest.approx(ends)
    assert RouteStatus.AROUND in kinds


@pytest.mark.parametrize("target", [[np.nan, 5000.0], [0.0, 5000.0, 1.0], [np.inf, 0.0]])
def test_a_target_that_is_no_pair_of_counts_is_refused(target):
    with pytest.raises(ValidityError, match="two finite numbers"):
        route(guard(), MORNING, START, target)


def test_a_step_of_no_counts_is_refused():
    with pytest.raises(ValidityError, match="step"):
        route(guard(), MORNING, START, END, step=(0.0, 100.0))


def test_a_short_way_round_is_taken_before_a_free_but_long_slew_to_the_other_pointing():
    own = guard()
    start, target = np.add(AT_SUN, [-1400.0, -900.0]), np.add(AT_SUN, [1400.0, 900.0])
    prime = np.array([target[0] + 50_000.0, 2.0 * ZEROS[1] - target[1]])
    assert own.slew(MORNING, start, prime).allowed
    found = route(own, MORNING, start, target, step=(300.0, 150.0))
    assert (found.status, found.prime) == (RouteStatus.AROUND, False)
    assert found.duration < 0.5 * float(trapezoid(start, prime, PACE).total)
    assert own.route(MORNING, found.waypoints).allowed
