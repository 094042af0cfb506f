from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.geometry.clearance.keep_out import TOUCH, BoxZone, servo_margin
from catseye.geometry.mirror.pointing import counts, ray
from catseye.geometry.mirror.slew import straight, trapezoid
from catseye.geometry.sky.time_tag import utc_text
from catseye.records.files.reading import read_record
from catseye.records.site.keep_out import KeepOut
from catseye.records.site.site import Location
from catseye.reduction.site.earth_rotation import FramePlace, place_of, sun_at
from catseye.reduction.steering.guard import _cut, guard_of
from sun_scene import (
    DEGREE,
    GREEN_BANK,
    MORNING,
    PACE,
    ROOT,
    STATION,
    STOPS,
    ZEROS,
    apart,
    astropy_sun,
    beam,
    boxes,
    guard,
    random_counts,
)

AT_SUN = counts(STATION, STATION.scan_point + 100 * astropy_sun(np.array([MORNING]))[0])
SECOND = 1 / 86_400


def sun_angle(mjd, n):
    """From a beam at counts to astropy's Sun."""
    return float(apart(beam(np.asarray(n, dtype=float)), astropy_sun(np.array([mjd]))[0]))


def test_a_beam_at_the_sun_is_refused_in_one_clear_line():
    verdict = guard(margin_counts=(20, 20)).pointing(MORNING, np.add(AT_SUN, [300, 0]))
    assert not verdict.allowed
    assert verdict.reason == (
        "ZY101: pointing at counts 21627.2, 12660.8 is 1.0 deg from the Sun "
        "(limit 5.0 deg and 0.16 deg for the servo); free at 2003-09-07T16:00:10Z"
    )
    assert verdict.clearance / DEGREE == pytest.approx(
        sun_angle(MORNING, np.add(AT_SUN, [300, 0])) / DEGREE - 5.1609, abs=1e-3
    )


def test_the_time_when_it_becomes_free_is_right_by_astropys_sun():
    own = guard()
    verdict = own.pointing(MORNING, AT_SUN)
    free = verdict.free_at_mjd
    assert sun_angle(free, AT_SUN) / DEGREE == pytest.approx(5.0 + TOUCH / DEGREE, abs=1e-3)
    assert sun_angle(free - 30 * SECOND, AT_SUN) < 5 * DEGREE
    assert own.pointing(free + SECOND, AT_SUN).allowed
    assert not own.pointing(free - SECOND, AT_SUN).allowed


def test_the_time_when_the_sun_comes_is_right_by_astropys_sun():
    own = guard()
    n = counts(STATION, STATION.scan_point + 100 * astropy_sun(np.array([MORNING + 0.06]))[0])  # where the Sun goes
    assert own.pointing(MORNING, n).allowed
    comes = own.until(MORNING, n)
    assert sun_angle(comes, n) / DEGREE == pytest.approx(5.0 + TOUCH / DEGREE, abs=1e-3)
    assert own.pointing(comes - SECOND, n).allowed
    assert not own.pointing(comes + SECOND, n).allowed
    assert own.until(MORNING, AT_SUN) == MORNING
    north = counts(STATION, np.add(STATION.scan_point, [0, 100, 10]))
    assert own.until(MORNING, north) is None


def test_the_cone_counts_while_the_sun_is_up_and_no_longer():
    night = 52_889.2  # 04:48 UTC, midnight in West Virginia
    down = sun_at(night, guard().place).direction
    assert down[2] < -0.5
    n = counts(STATION, STATION.scan_point + 100 * down)
    assert guard().pointing(night, n).allowed
    assert not guard(horizon=-np.pi / 2).pointing(night, n).allowed
    assert guard(place=None).pointing(MORNING, AT_SUN).allowed


def test_at_sunrise_the_cone_begins_at_the_horizon_given():
    mjd = 52_889.0 + np.arange(0.4, 0.6, 1e-4)
    rise = mjd[np.flatnonzero(np.diff(np.sign(sun_at(mjd, guard().place).direction[:, 2] + np.sin(2 * DEGREE))))[0]]
    n = counts(STATION, STATION.scan_point + 100 * sun_at(rise, guard().place).direction)
    assert guard().pointing(rise - 30 * SECOND, n).allowed
    assert not guard().pointing(rise + 30 * SECOND, n).allowed
    assert guard().until(rise - 0.01, n) == pytest.approx(rise, abs=20 * SECOND)


def test_a_sun_that_rises_and_sets_during_one_long_move_counts():
    north = FramePlace(68.0 * DEGREE, GREEN_BANK.longitude, 0.0)
    mjd = 52_990.72 + np.linspace(-0.1, 0.1, 801)  # December: the Sun stays low
    altitude = np.arcsin(sun_at(mjd, north).direction[:, 2])
    top = int(np.argmax(altitude))
    begin, end = top - 60, top + 60
    own = guard(place=north, horizon=float(0.7 * altitude[top] + 0.3 * altitude[begin]))
    assert max(altitude[begin], altitude[end]) < own.horizon < altitude[top]
    n = counts(STATION, STATION.scan_point + 100 * sun_at(mjd[top], north).direction)
    seconds = (mjd[end] - mjd[begin]) * 86_400
    assert own.entries(mjd[begin], straight(n, n, seconds)).status != 0
    assert not own.pointing(mjd[top], n).allowed


def test_refraction_moves_the_cone_near_the_horizon():
    air = FramePlace(guard().place.latitude, guard().place.longitude, 807.0, 920.0, 10.0)
    mjd = 52_889.458  # 11 UTC: the Sun rises
    bare, raised = (sun_at(mjd, place).direction for place in (guard().place, air))
    assert 15 / 60 < apart(bare, raised) / DEGREE < 40 / 60
    n = counts(STATION, STATION.scan_point + 100 * raised)
    gap = [float(guard(place=place).clearance(mjd, n)[0]) for place in (guard().place, air)]
    assert gap[1] / DEGREE == pytest.approx(-5)
    assert gap[0] - gap[1] == pytest.approx(apart(bare, raised), rel=1e-6)


def test_the_stops_are_kept():
    low, high = STOPS
    ne = ZEROS[1] + 2000
    assert guard(place=None).pointing(MORNING, [low, ne]).allowed
    over = guard(place=None).pointing(MORNING, [high + 1, ne])
    assert over.reason == "ZY101: pointing at counts 78932.0, 5062.0: azimuth count 78932.0 is outside -18069 to 78931"
    assert not guard(place=None).slew(MORNING, [0, ne], [high + 1, ne]).allowed


def test_a_slew_through_the_sun_is_refused_with_the_time_when_it_may_go():
    own = guard()
    start, end = AT_SUN - [3000, 500], np.add(AT_SUN, [3000, 300])
    assert own.pointing(MORNING, start).allowed
    assert own.pointing(MORNING, end).allowed
    verdict = own.slew(MORNING, start, end)
    assert not verdict.allowed
    assert "slew to counts" in verdict.reason
    assert "5.0 deg from the Sun" in verdict.reason
    assert own.slew(verdict.free_at_mjd, start, end).allowed
    for early in np.linspace(0, 1, 12):
        assert not own.slew(MORNING + early * (verdict.free_at_mjd - 12 * SECOND - MORNING), start, end).allowed


def test_a_slew_into_the_sunrise_reports_its_clearance():
    # The cone counts for the whole of a move during which the Sun may rise: also where it has not yet.
    mjd = 52_889.0 + np.arange(0.4, 0.5, 1e-5)
    height = sun_at(mjd, GREEN_BANK).direction[:, 2] + np.sin(2 * DEGREE)
    rise = float(mjd[np.flatnonzero(np.diff(np.sign(height)))[0]])
    n = counts(STATION, STATION.scan_point + 100 * sun_at(rise, GREEN_BANK).direction)
    for early in (2.0, 1.5, 0.5):
        verdict = guard().slew(rise - early * SECOND, n - [9000, 0], n)
        assert not verdict.allowed
        assert "is 5.0 deg from the Sun" in verdict.reason
        assert 0.0 <= verdict.clearance <= TOUCH


def test_no_time_is_reported_beyond_the_look_ahead(monkeypatch):
    own = guard()
    n = counts(STATION, STATION.scan_point + 100 * sun_at(MORNING + 0.16, GREEN_BANK).direction)
    comes = own.until(MORNING, n)
    assert 0.13 < comes - MORNING < 0.15
    monkeypatch.setattr("catseye.reduction.steering.guard.LOOK_AHEAD", 0.12)
    assert own.until(MORNING, n) is None


def test_boxes_are_named_and_never_become_free():
    target = np.array([147.0, -21.0, 4.0])  # in the control room
    own = guard(boxes=boxes()[:1])
    verdict = own.pointing(MORNING, counts(STATION, target))
    assert "hits control-room; a box is permanent (people work behind the windows): choose" in verdict.reason
    assert verdict.free_at_mjd is None
    over = counts(STATION, [135.0, -21.0, 9.3])  # 0.3 m above its near edge, and rising
    near = own.pointing(MORNING, over)
    assert near.allowed
    wide = replace(own, margin_counts=(200, 200)).pointing(MORNING, over)
    assert "0.10 deg from control-room (limit 1.61 deg for the servo)" in wide.reason


def test_the_sun_behind_a_box_does_not_promise_a_time():
    sun = sun_at(MORNING, guard().place).direction
    wall = BoxZone(STATION.scan_point + 30 * sun, [3, 3, 3], name="a wall")
    verdict = guard(boxes=(wall,)).pointing(MORNING, AT_SUN)
    assert not verdict.allowed
    assert verdict.free_at_mjd is None


def test_a_route_is_refused_where_any_of_its_moves_is():
    own = guard()
    over = ZEROS[1] + 18_000
    around = [AT_SUN - [9000, 0], [AT_SUN[0] - 9000, over], [AT_SUN[0] + 9000, over], np.add(AT_SUN, [9000, 0])]
    assert own.route(MORNING, around).allowed
    through = own.route(MORNING, [*around, around[0]])
    assert not through.allowed
    legs = [float(np.max(own_time(a, b))) for a, b in pairwise(around)]
    assert sum(legs) < through.at < sum(legs) + 3
    assert own.route(MORNING, around, dwell=2.0).allowed
    # A dwell long enough lets the Sun come to a waypoint that was free at first.
    waits = np.add(AT_SUN, [1800, 150])
    assert own.route(MORNING, [around[1], around[2], waits]).allowed
    late = own.route(MORNING, [around[1], around[2], waits], dwell=600.0)
    assert not late.allowed


def own_time(a, b):
    way, v, s = np.abs(np.subtract(b, a)), np.array(PACE.velocity), np.array(PACE.acceleration)
    return np.where(way > v**2 / s, way / v + v / s, 2 * np.sqrt(way / s))


def test_a_track_is_checked_between_its_time_tags():
    own = guard()
    tags = MORNING + np.array([0.0, 10.0, 20.0]) * SECOND
    beside = np.array([np.add(AT_SUN, [-6000, 2500]), np.add(AT_SUN, [0, 2500]), np.add(AT_SUN, [6000, 2500])])
    assert own.track(tags, beside).allowed
    across = np.array([AT_SUN - [4000, 0], np.add(AT_SUN, [4000, 0]), np.add(AT_SUN, [5000, 0])])
    assert all(own.pointing(t, n).allowed for t, n in zip(tags, across, strict=True))
    verdict = own.track(tags, across)
    assert not verdict.allowed
    n = across[0] + (across[1] - across[0]) * verdict.at / 10
    assert sun_angle(MORNING + verdict.at * SECOND, n) / DEGREE == pytest.approx(5.0, abs=0.01)


@pytest.mark.parametrize("air", [None, 920.0])
def test_an_hours_halt_ends_when_the_sun_comes_and_not_before(air):
    own = guard(place=replace(GREEN_BANK, pressure_hpa=air))
    later = counts(STATION, STATION.scan_point + 100 * sun_at(MORNING + 0.06, own.place).direction)
    comes = own.until(MORNING, later)
    seconds = (comes - MORNING) * 86_400
    assert seconds > 3000
    tags = MORNING + np.array([0, seconds - 5]) * SECOND
    assert own.track(tags, [later, later]).allowed
    stays = own.track(MORNING + np.array([0, seconds + 600]) * SECOND, [later, later])
    assert not stays.allowed
    assert stays.at == pytest.approx(seconds, abs=5)  # the cone is wider by 0.2" to 9" where the Sun's way is cut


def test_pieces_of_a_track_make_the_same_track():
    moves = straight([[0.0, 0.0], [100.0, 50.0]], [[100.0, 50.0], [-500.0, 80.0]], [30.0, 200.0])
    before, cut = _cut(np.array([0.0, 30.0]), moves)
    assert before.tolist() == [0.0, 30.0, 80.0, 130.0, 180.0]
    assert cut.start[1:].tolist() == [[100.0, 50.0], [-50.0, 57.5], [-200.0, 65.0], [-350.0, 72.5]]
    assert cut.end[:-1] == pytest.approx(cut.start[1:])
    assert cut.end[-1] == pytest.approx(moves.end[-1])
    slew = trapezoid([[0.0, 0.0]], [[60_000.0, 0.0]], PACE)
    assert _cut(np.zeros(1), slew)[1] is slew


def test_many_moves_are_answered_at_once():
    own = guard()
    moves = trapezoid(
        np.tile(AT_SUN - [3000, 500], (4, 1)), AT_SUN + np.array([[3000, 300], [-3000, 0], [0, 0], [0, 9000]]), PACE
    )
    found = own.entries(MORNING, moves)
    assert found.status.tolist() == [1, 0, 1, 0]
    hour_later = own.entries(MORNING + np.array([0, 0, 1 / 24, 0]), moves)
    assert hour_later.status.tolist() == [1, 0, 0, 0]


def test_a_guard_by_its_records(night_01):
    from catseye.reduction.site.stations import station_of

    mirror = night_01.mirror_of("ZY101")
    station = station_of(night_01.monuments["ZY101"], mirror)
    kept = read_record(ROOT / "examples" / "keep-out.toml", KeepOut)
    own = guard_of("ZY101", station, mirror, keep_out=kept, place=place_of(night_01.site.site), pace=PACE)
    assert own.azimuth_limits == (mirror.az_low_limit, mirror.az_high_limit)
    assert own.half_angle == pytest.approx(5 * DEGREE)
    assert own.margin == pytest.approx(servo_margin([20, 20]))
    assert [box.name for box in own.boxes] == ["control-room", "visitors-path", "weather-tower"]
    sun = sun_at(MORNING, night_01.site.site).direction
    assert not own.pointing(MORNING, counts(station, station.scan_point + 100 * sun)).allowed
    tilted = mirror.model_copy(update={"face_tilt_rad": -1e-3, "beam_tilt_x_rad": 3e-4, "beam_tilt_y_rad": 4e-4})
    wider = guard_of("ZY101", station, tilted, keep_out=kept, place=None, pace=PACE)
    assert wider.margin - own.margin == pytest.approx(2.5e-3)


def test_the_margin_covers_the_beam_of_an_imperfect_mirror(night_01):
    from catseye.geometry.mirror import imperfect
    from catseye.reduction.site.stations import imperfections_of, station_of

    mirror = night_01.mirror_of("ZY101").model_copy(
        update={
            "face_tilt_rad": 8e-4,
            "beam_tilt_x_rad": 5e-4,
            "beam_tilt_y_rad": -3e-4,
            "u_tilt_rad": 1e-5,
            "azimuth_encoder_cosine_counts": (6.0,),
            "azimuth_encoder_sine_counts": (-3.0,),
            "elevation_encoder_cosine_counts": (2.0, 1.0),
            "elevation_encoder_sine_counts": (0.0, 4.0),
            "u_encoder_counts": 1.0,
        }
    )
    station = station_of(night_01.monuments["ZY101"], mirror)
    kept = KeepOut(margin_counts=(0.0, 0.0))
    own = guard_of("ZY101", station, mirror, keep_out=kept, place=None, pace=PACE)
    n = random_counts(np.random.default_rng(6), 3000)
    real = imperfect.imperfect_ray(station, imperfections_of(mirror), n).direction
    off = apart(real, ray(station, n).direction)
    assert 0.5 * own.margin < np.max(off) < own.margin


def test_a_time_is_written_rounded_up():
    assert utc_text(51_544.5) == "2000-01-01T12:00:00Z"
    assert utc_text(51_544.5 + 0.4 * SECOND) == "2000-01-01T12:00:01Z"


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (lambda: guard(azimuth_limits=(10, -10)), "azimuth limits"),
        (lambda: guard(half_angle=5.0), "half angle"),
        (lambda: guard(horizon=-2.0), "horizon"),  # degrees; at 5.0 or NaN the Sun would never count
        (lambda: guard(horizon=5.0), "horizon"),
        (lambda: guard(horizon=np.nan), "horizon"),
        (lambda: guard().route(MORNING, [[0, 0], [1, 1]], dwell=np.inf), "dwell"),
        (lambda: guard().pointing(MORNING, [1, 2, 3]), "two finite numbers"),
        (lambda: guard().slew(MORNING, [0, np.nan], [1, 2]), "two finite numbers"),
        (lambda: guard().route(MORNING, [[0, 0]]), "waypoints"),
        (lambda: guard().track([MORNING, MORNING], [[0, 0], [1, 1]]), "rising"),
        (lambda: guard().pointing(2_452_889.5, [0, 0]), "mjd"),
    ],
)
def test_nonsense_is_refused(act, said):
    with pytest.raises(ValidityError, match=said):
        act()


def test_axes_that_start_apart_widen_the_margin_and_elevations_beyond_a_turn_are_refused():
    together, apart_by = guard(), guard(pace=replace(PACE, start_skew=0.01))
    late = np.linalg.norm(np.array(PACE.velocity) * 0.01 * 2 * np.pi / 1e5 * [1, 2])
    assert apart_by.margin - together.margin == pytest.approx(late, rel=0.05)
    assert "more than a turn" in guard().pointing(MORNING, [20_000.0, 1e9]).reason
    with pytest.raises(ValidityError, match=r"start_skew = -1 s is not 0 or more"):
        replace(PACE, start_skew=-1)


def test_the_sun_is_kept_off_where_it_is_seen_not_where_it_would_be_without_air():
    """Near the horizon the air lifts it by half a degree: a beam 5.02 degrees above the airless Sun is 4.5 off."""
    site = Location(latitude_deg=38.433, longitude_deg=280.16, elevation_of_z0_m=807.0)
    mjd = 52_889.459  # just after sunrise
    bare = sun_at(mjd, place_of(site, pressure_hpa=0.0)).direction
    up = np.array([0.0, 0.0, 1.0]) - bare[2] * bare
    beam_up = np.cos(5.02 * DEGREE) * bare + np.sin(5.02 * DEGREE) * up / np.linalg.norm(up)
    n = counts(STATION, STATION.scan_point + 1e3 * beam_up)
    assert abs(np.degrees(np.arcsin(bare[2]))) < 2.0
    assert guard(place=place_of(site, pressure_hpa=0.0)).pointing(mjd, n).allowed
    assert not guard(place=place_of(site)).pointing(mjd, n).allowed
