"""Following the antenna at slew rates, with the rangers of the example night."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catseye.constants import DEGREE
from catseye.errors import InputError, ValidityError
from catseye.geometry.antenna.frames import (
    ELEVATION_AXIS_HEIGHT,
    alidade_from_elevation,
    ground_from_alidade,
    ground_from_reflector,
)
from catseye.geometry.mirror.pointing import MirrorStation
from catseye.geometry.mirror.track import apparent_motion, line_bound
from catseye.geometry.sky.time_tag import TimeTag
from catseye.reduction.site.stations import station_of
from catseye.reduction.steering.tracking import (
    AZIMUTH_SLEW,
    BUFFER,
    ELEVATION_SLEW,
    AntennaPath,
    Drive,
    Following,
    carried,
    fixed,
    follow,
    misses,
    mounted,
    smear,
)

START = TimeTag.parse("52889.12500000000")
SLEW = AntennaPath(
    Drive(100 * DEGREE, 190 * DEGREE, rate=AZIMUTH_SLEW), Drive(10 * DEGREE, 55 * DEGREE, rate=ELEVATION_SLEW)
)
DISH = np.array([[x, y, (x**2 + y**2) / 240.0] for x in (-45.0, 0.0, 45.0) for y in (5.0, 54.0, 103.0)])


@pytest.fixture(scope="module")
def ground(night_01):
    """The twelve ground rangers as one batch, and their stops."""
    names = sorted(night_01.monuments)
    each = [station_of(night_01.monuments[name], night_01.mirror_of(name)) for name in names]
    limits = [[night_01.mirror_of(n).az_low_limit, night_01.mirror_of(n).az_high_limit] for n in names]
    return MirrorStation.of_parameters(np.stack([s.parameters for s in each])), np.array(limits, dtype=float)


@pytest.mark.parametrize(("start", "end"), [(0.0, 1.0), (1.0, 0.2), (0.3, 0.3005), (0.5, 0.5)])
def test_a_drive_goes_from_rest_to_rest_and_its_rates_are_derivatives(start, end):
    drive = Drive(start, end, rate=0.01, acceleration=0.004, begin=3.0)
    assert drive.at([0.0, 3.0])[0].tolist() == [start, start]
    assert drive.at(3.0 + drive.duration + 5.0)[0] == pytest.approx(end, abs=1e-15)
    assert np.all(drive.at([-1.0, 1e6])[1] == 0.0)
    t, h = 3.0 + np.linspace(0.02, 0.98, 97) * drive.duration, 1e-3
    angle, rate, bend = drive.at(t)
    kinks = 3.0 + np.array([0.004**-1 * drive.peak, drive.duration - drive.peak / 0.004])
    smooth = np.min(np.abs(t[:, None] - kinks), axis=1) > 2 * h
    np.testing.assert_allclose((drive.at(t + h)[0] - drive.at(t - h)[0])[smooth] / (2 * h), rate[smooth], atol=1e-10)
    np.testing.assert_allclose((drive.at(t + h)[1] - drive.at(t - h)[1])[smooth] / (2 * h), bend[smooth], atol=1e-10)
    assert np.max(np.abs(rate)) <= 0.01
    assert np.all(angle == np.sort(angle)) or np.all(angle == np.sort(angle)[::-1])


def test_a_drive_that_cannot_move_is_refused():
    with pytest.raises(ValidityError, match=r"rate 0.0 of a drive"):
        Drive(0.0, 1.0, rate=0.0)
    with pytest.raises(ValidityError, match=r"end inf of a drive"):
        Drive(0.0, np.inf, rate=0.1)


@pytest.mark.parametrize("frame", ["ground", "alidade", "elevation", "reflector"])
def test_points_move_with_their_frame_like_the_antennas_transforms(frame):
    points = np.array([[10.0, 40.0, 20.0], [-5.0, 70.0, 1.0]])
    t = np.array([0.2, 30.0, 60.0, 153.3])
    place, speed, bend = SLEW.motion(points, frame, t)
    for k, when in enumerate(t):
        azimuth, elevation = float(SLEW.azimuth.at(when)[0]), float(SLEW.elevation.at(when)[0])
        alidade = ground_from_alidade(azimuth)
        known = {
            "ground": points,
            "alidade": alidade.points(points),
            "elevation": (
                alidade @ alidade_from_elevation(elevation, elevation_axis_height=ELEVATION_AXIS_HEIGHT)
            ).points(points),
            "reflector": ground_from_reflector(azimuth, elevation).points(points),
        }[frame]
        np.testing.assert_allclose(place[k], known, atol=1e-12)
    h = 1e-3
    ahead, back = SLEW.motion(points, frame, t + h), SLEW.motion(points, frame, t - h)
    np.testing.assert_allclose((ahead[0] - back[0]) / (2 * h), speed, atol=1e-7)
    np.testing.assert_allclose((ahead[1] - back[1]) / (2 * h), bend, atol=1e-7)
    turn, change = SLEW.spin(t)
    if frame == "reflector":  # a rigid body: v = w x r about the moving vertex
        vertex, vertex_speed, vertex_bend = SLEW.motion(np.zeros((1, 3)), frame, t)
        np.testing.assert_allclose(speed - vertex_speed, np.cross(turn[:, None], place - vertex), atol=1e-12)
        arm = place - vertex
        whirl = np.cross(change[:, None], arm) + np.cross(turn[:, None], np.cross(turn[:, None], arm))
        np.testing.assert_allclose(bend - vertex_bend, whirl, atol=1e-12)


def test_a_clockwise_slew_carries_the_dish_from_north_to_east():
    """A sign that a person sees: azimuth grows from 0: what is north moves east; elevation grows: the front rises."""
    path = AntennaPath(Drive(0.0, 1.0, rate=0.01), Drive(0.3, 1.0, rate=0.005))
    place, speed, _ = path.motion([[0.0, 10.0, 5.0]], "alidade", 10.0)
    assert place[0, 1] > 0.0
    assert speed[0, 0] > 0.0
    _, speed, _ = path.motion([[0.0, 0.0, 60.0]], "elevation", 10.0)  # z of the elevation frame looks at the sky
    assert speed[0, 2] > 0.0
    assert path.rotation(0.0) @ [0.0, 0.0, 1.0] == pytest.approx([0.0, np.cos(0.3), np.sin(0.3)])


def test_an_unknown_frame_is_refused():
    with pytest.raises(InputError, match="frame 'feed' is unknown"):
        SLEW.motion([[0.0, 0.0, 0.0]], "feed", 0.0)


def test_at_slew_rates_the_lines_stay_within_a_millimetre(ground):
    """Both axes at full rate; interpolated counts before rounding; all twelve rangers, targets all over the dish."""
    stations, limits = ground
    begin = 20.0  # both are at full rate until 77 s
    moved = fixed(
        DISH,
        "reflector",
        AntennaPath(
            Drive(100 * DEGREE, 190 * DEGREE, rate=AZIMUTH_SLEW, begin=-begin),
            Drive(10 * DEGREE, 55 * DEGREE, rate=ELEVATION_SLEW, begin=-begin),
        ),
    )
    track = follow(mounted(stations), moved, START, intervals=200, limits=limits)
    good = track.status == Following.FOLLOWED
    off = misses(track, mounted(stations), moved)
    assert good.mean() > 0.5
    assert 1e-5 < off[:, :, good].max() < 1e-3  # m
    assert track.begin.seconds_since(START)[10] == 1.28
    # the parameter is the count: on whole counts the beam is off by as much as half a count of each
    whole = misses(track, mounted(stations), moved, whole_counts=True)
    r = np.linalg.norm(moved(np.zeros(1))[0] - stations.scan_point[:, None], axis=-1)
    assert 4e-3 < whole[:, :, good].max() < (r.max() + 60) * 0.5 * np.hypot(6.3e-5, 12.6e-5)
    elsewhere = track.lines.start[1:] - track.lines.end[:-1]
    assert np.abs(elsewhere[:, good]).max() < 1e-9  # one after the other, without a jump
    na = track.lines.start[..., 0]
    assert np.all((na >= limits[:, 0][:, None]) & (na <= limits[:, 1][:, None]) | ~good)


def test_the_miss_holds_its_bound(ground):
    stations, _ = ground
    t = np.array([40.0, 55.0])
    place, speed, bend = SLEW.motion(DISH, "reflector", t)
    seen = apparent_motion(
        stations.mirror_from_ground[:, None],
        place[:, None] - stations.scan_point[:, None],
        speed[:, None],
        acceleration=bend[:, None],
    )
    _, _, way = line_bound(seen[0], np.linalg.norm(seen[1], axis=-1), 0.06, interval=BUFFER)
    path = AntennaPath(SLEW.azimuth, SLEW.elevation)

    def targets(since):
        return path.motion(DISH, "reflector", since + 40.0)[0][:, None]

    track = follow(mounted(stations), targets, START, intervals=1)
    off = misses(track, mounted(stations), targets, shares=[0.5])[0, 0]
    assert np.median(way[0] / off) < 30.0  # and it is no idle one
    assert np.all(off <= way[0])


def own_counts(vector):
    """Counts for a vector in mirror axes, zeros 0."""
    x, y, z = vector
    return np.array([np.arctan2(y, x) / (2 * np.pi), np.arccos(z / np.linalg.norm(vector)) / (4 * np.pi)]) * 1e5


def test_a_feed_arm_ranger_rides_with_the_reflector_and_follows_a_ground_target(ground):
    stations, _ = ground
    first = ground_from_reflector(*(float(d.at(30.0)[0]) for d in (SLEW.azimuth, SLEW.elevation)))
    turn = Rotation.from_euler("xyz", [2.0, 0.3, 0.4]).as_matrix()
    arm = MirrorStation.from_matrix(
        first.points([[2.0, -9.0, 52.0]]),
        (turn @ first.rotation.T)[None],
        offset=stations.offset[:1],
        beta=stations.beta[:1],
        zeros=stations.zeros[:1],
    )
    riding = carried(arm, SLEW, 30.0)
    there = riding(np.array([30.0, 50.0]))
    np.testing.assert_allclose(there[0, 0, 0].parameters, arm[0].parameters, atol=1e-9)
    later = ground_from_reflector(*(float(d.at(50.0)[0]) for d in (SLEW.azimuth, SLEW.elevation)))
    np.testing.assert_allclose(there[1, 0, 0].scan_point, later.points([2.0, -9.0, 52.0]), atol=1e-9)
    np.testing.assert_allclose(there[1, 0, 0].gamma, turn @ later.rotation.T, atol=1e-12)
    on_dish, on_ground = fixed(DISH, "reflector", SLEW), fixed([[60.0, 20.0, 1.0], [-30.0, 90.0, 2.0]], "ground", SLEW)

    def shifted(f):
        return lambda since: f(since + 30.0)

    still = follow(shifted(riding), shifted(on_dish), START, intervals=20)
    assert np.abs(still.lines.rate).max() < 1e-6  # counts/s: it moves with them
    moving = follow(shifted(riding), shifted(on_ground), START, intervals=20)
    off = misses(moving, shifted(riding), shifted(on_ground))
    assert 1e-6 < off.max() < 1e-3
    # what it sees by the formulas of a turning ranger: rates of the lines
    when = 30.0 + 0.5 * BUFFER
    place, speed, bend = SLEW.motion([[60.0, 20.0, 1.0]], "ground", when)
    s, vs, as_ = SLEW.motion([[2.0, -9.0, 52.0]], "reflector", when)
    spin, change = SLEW.spin(when)
    m = riding(np.array([when]))[0, 0, 0].mirror_from_ground
    seen = apparent_motion(m, place - s, speed - vs, acceleration=bend - as_, spin=spin, spin_rate=change)
    ahead, behind = (seen[0][0] + sign * 1e-4 * seen[1][0] for sign in (1.0, -1.0))
    np.testing.assert_allclose(moving.lines.rate[0, 0, 0], (own_counts(ahead) - own_counts(behind)) / 2e-4, rtol=1e-5)


def test_stops_take_the_other_pointing_and_refuse_what_neither_reaches(ground):
    stations, _ = ground
    still = AntennaPath(Drive(1.0, 1.0, rate=0.01), Drive(0.7, 0.7, rate=0.01))
    targets = fixed(DISH, "reflector", still)
    free = follow(mounted(stations), targets, START, intervals=2)
    assert not free.prime.any()
    na = free.lines.start[0, 0, 4, 0]
    low, high = na + 30_000.0, na + 70_000.0  # only half a turn on
    narrow = np.tile([low, high], (12, 1))
    other = follow(mounted(stations), targets, START, intervals=2, limits=narrow)
    assert other.prime[0, 4]
    assert misses(other, mounted(stations), targets)[..., 0, 4].max() < 1e-9  # the same beam
    assert other.lines.start[0, 0, 4, 0] == pytest.approx(na + 50_000.0)
    none = follow(mounted(stations), targets, START, intervals=2, limits=np.tile([na + 10.0, na + 20.0], (12, 1)))
    assert none.status[0, 4] == Following.BEYOND_STOPS
    assert "azimuth stops" in none.reason(0, 4)
    fast = follow(mounted(stations), fixed(DISH, "reflector", SLEW), START, intervals=300, most_rate=1.0)
    assert np.any(fast.status == Following.TOO_FAST)
    at_home = follow(
        mounted(stations), lambda t: np.zeros((len(t), 1, 1, 3)) + stations.scan_point[0], START, intervals=1
    )
    assert at_home.status[0, 0] == Following.NOWHERE
    for told, message in (
        ({"intervals": 0}, "empty track"),
        ({"intervals": 1, "interval": np.inf}, "empty track"),
        ({"intervals": 1, "interval": 1e-10}, "not a whole number of nanoseconds"),
        ({"intervals": 1, "interval": 0.1234567894}, "not a whole number of nanoseconds"),
        ({"intervals": 1, "limits": (75_000, -25_000)}, "not in order"),
    ):
        with pytest.raises(ValidityError, match=message):
            follow(mounted(stations), targets, START, **told)
    assert follow(mounted(stations), targets, START, intervals=1, interval=0.1 + 0.2).since[1] == 0.3


def test_a_range_change_of_half_a_wavelength_cancels_a_buffer():
    """The sum itself, sample by sample, as the electronics take it."""
    v, wave = np.array([0.02, 0.4, -0.9]), 0.19981
    _, left = smear(v, wavelength=wave)
    t = (np.arange(8192) + 0.5) * BUFFER / 8192
    taken = np.abs(np.mean(np.exp(-4j * np.pi * v[:, None] * t / wave), axis=1))
    np.testing.assert_allclose(left, taken, atol=1e-6)
    with pytest.raises(ValidityError, match=r"wavelength -0\.2 m"):
        smear(v, wavelength=-0.2)
