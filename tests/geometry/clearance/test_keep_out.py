import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.geometry.clearance import keep_out
from catseye.geometry.clearance.keep_out import (
    TOUCH,
    BoxZone,
    ConeZone,
    EntryStatus,
    clearances,
    first_entry,
    servo_margin,
)
from catseye.geometry.mirror.pointing import ray
from catseye.geometry.mirror.slew import straight, trapezoid
from draws import draws
from sun_scene import PACE, STATION, apart, random_counts

DEGREE = np.pi / 180


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def surface(box, n=60):
    """Points all over the box's faces."""
    side = np.linspace(-0.5, 0.5, n)
    a, b = (v.ravel() for v in np.meshgrid(side, side))
    faces = [np.insert(np.stack([a, b], -1), axis, end, axis=-1) for axis in range(3) for end in (-0.5, 0.5)]
    c, s = np.cos(box.turn), np.sin(box.turn)
    return box.centre + np.concatenate(faces) * box.size @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def test_a_cone_by_hand():
    cone = ConeZone([0, 0, 2], 5 * DEGREE)
    d = np.array([[np.sin(a), 0, np.cos(a)] for a in np.array([0, 3, 5, 65, 180]) * DEGREE])
    assert cone.clearance(d) / DEGREE == pytest.approx([-5, -2, 0, 60, 175], abs=1e-6)


def test_a_moving_cone_reaches_both_ends_within_its_stated_rate():
    a, b = unit(np.array([1.0, 0, 0])), unit(np.array([np.cos(0.3), np.sin(0.3), 0]))
    cone = ConeZone(a, 0.0, b)
    assert cone.clearance(a, 0.0) == 0
    assert cone.clearance(b, 1.0) == pytest.approx(0, abs=1e-15)
    share = np.linspace(0, 1, 1001)
    angle = cone.clearance(np.broadcast_to(a, (1001, 3)), share)
    steps = np.diff(angle) / 1e-3
    assert np.max(steps) <= cone.rate(np.array(1.0)) * (1 + 1e-9)
    assert np.max(steps) > 0.999 * cone.rate(np.array(1.0))


BOXES = [
    BoxZone([10, 3, 1], [4, 6, 2], 0.4),
    BoxZone([-5, 0, 0], [0.5, 0.5, 30], -1.0),
    BoxZone([0, 40, 20], [70, 1, 12], 0.0),
    BoxZone([3, -4, 2], [6, 6, 3], 0.7),
]


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("reach", [np.inf, 1.15, 1.0])
def test_the_clearance_is_the_least_angle_to_points_of_the_box(box, reach):
    origin = np.array([0.5, -0.2, 0.1])
    points = surface(box) - origin
    size = np.linalg.norm(points, axis=-1)
    length = np.inf if np.isinf(reach) else (size.min() * reach if reach > 1 else 0.999 * size.min())
    limited = BoxZone(box.centre, box.size, box.turn, length)
    d = unit(np.random.default_rng(3).normal(size=(300, 3)))
    d[:100] = unit(unit(points[:: len(points) // 100][:100]) + 0.1 * d[:100])
    found = limited.clearance(origin, d)
    if reach == 1.0:
        nearest = np.max(np.abs(points[np.argmin(size)]))
        assert nearest > length or np.all(np.isinf(found)) or np.all(found >= 0)
        if np.linalg.norm(points, axis=-1).min() * 0.99 > length:
            assert np.all(np.isinf(found))
        return
    dense = surface(box, 120) - origin
    reachable = unit(dense[np.linalg.norm(dense, axis=-1) <= length])
    brute = np.arccos(np.clip(np.max(d @ reachable.T, axis=-1), -1, 1))
    # Points stand apart on the faces: they can only be further than the box, by less than their spacing seen from here.
    spacing = np.max(box.size) / 119 / max(size.min(), 0.1) * (1 if np.isinf(reach) else 3)
    assert np.all(found <= brute + 1e-7)
    assert np.all(found >= brute - 1.5 * spacing - 1e-7)
    assert np.any(found == 0)
    assert np.any(found > 0.5)


def test_the_rim_of_a_limited_beam_is_exact():
    # A wide floor 3 m under the scan point and a beam of 5 m: the circle is at acos(3/5) from the nadir.
    floor = BoxZone([0, 0, -4], [100, 100, 2], 0.0, 5.0)
    angles = np.array([30.0, 53.0, 54.0, 90.0, 180.0]) * DEGREE
    d = np.stack([np.sin(angles), np.zeros(5), -np.cos(angles)], axis=-1)
    expected = np.maximum(angles - np.arccos(3 / 5), 0)
    assert floor.clearance(np.zeros(3), d) == pytest.approx(expected, abs=1e-12)


def test_the_length_of_the_beam_ends_it():
    box = BoxZone([10, 0, 0], [2, 2, 2])
    forward = np.array([1.0, 0, 0])
    for length, hit in ((8.9, np.inf), (9.1, 0.0)):
        assert BoxZone(box.centre, box.size, 0.0, length).clearance(np.zeros(3), forward) == hit
    assert box.clearance(np.zeros(3), -forward) == pytest.approx(
        np.pi - np.arctan2(np.hypot(1, 1), 9)
    )  # half-line only


def test_inside_the_box_every_direction_is_refused():
    d = unit(np.random.default_rng(1).normal(size=(50, 3)))
    assert np.all(BoxZone([0, 0, 0], [2, 2, 2], 0.3).clearance([0.5, 0.5, 0.9], d) == 0)
    assert np.all(BoxZone([0, 0, 0], [2, 2, 2]).clearance([1.0, 0.0, 0.0], d) == 0)  # on its face


def test_a_box_turns_from_x_to_y():
    box = BoxZone([0, 0, 0], [20, 0.2, 0.2], 90 * DEGREE)
    origin = np.array([0.0, -30.0, 0.0])
    assert box.clearance(origin, [0.0, 1.0, 0.0]) == 0
    tilted = BoxZone([0, 0, 0], [20, 0.2, 0.2], 30 * DEGREE)
    tip = np.array([9.9 * np.cos(30 * DEGREE), 9.9 * np.sin(30 * DEGREE), 0])
    assert tilted.clearance(origin, unit(tip - origin)) == 0
    assert tilted.clearance(origin, unit(tip * [1, -1, 1] - origin)) > 0.05


@given(st.integers(0, 2**31))
def test_no_clearance_shrinks_faster_than_the_beam_turns(seed):
    rng = np.random.default_rng(seed)
    box = BoxZone(rng.normal(size=3) * 10, rng.uniform(0.3, 9, 3), rng.uniform(-3, 3), rng.choice([np.inf, 8.0]))
    a = unit(rng.normal(size=(200, 3)))
    b = unit(a + rng.uniform(0, 0.3, (200, 1)) * rng.normal(size=(200, 3)))
    found = [box.clearance(np.zeros(3), d) for d in (a, b)]
    if np.isfinite(found[0]).all():
        assert np.all(np.abs(found[0] - found[1]) <= apart(a, b) + 1e-7)


def test_the_sphere_about_a_box_promises_no_more_than_there_is():
    origin = np.array([0.5, -0.2, 0.1])
    d = unit(np.random.default_rng(4).normal(size=(2000, 3)))
    for box in BOXES:
        view = keep_out.Outline.of(box, origin)
        quick, exact = view.clearance(d, 0.05), view.clearance(d)
        assert np.all(quick <= exact + 1e-12)
        near = quick < 0.05
        assert np.array_equal(quick[near], exact[near])


def test_clearances_are_one_for_each_zone():
    cone = ConeZone([0, 0, 1.0], 0.1)
    found = clearances([cone, *BOXES], np.zeros(3), unit(np.ones((7, 3))))
    assert found.shape == (7, 5)
    assert clearances([], np.zeros(3), np.ones((7, 3))).shape == (7, 0)


def test_a_slew_over_a_cone_enters_when_it_reaches_the_edge():
    # At Phi = 90 degrees the azimuth moves the beam along a great circle: 5 degrees before the cone's middle.
    ne = STATION.zeros[1] + 12_500
    middle = ray(STATION, [20_000, ne]).direction
    move = straight([0, ne], [40_000, ne], 40.0)
    found = first_entry(STATION, move, [ConeZone(middle, 5 * DEGREE)])
    assert found.status == EntryStatus.ENTERS
    edge = 20 - 5 / 360 * 1e5 / 1000
    assert edge - 0.03 < found.time < edge + 1e-9  # TOUCH, 10", is 0.8 ms; the looks close in on it
    assert found.zone == 0


def test_paths_beside_a_cone_are_free_and_starts_inside_are_reported():
    ne = STATION.zeros[1] + 12_500
    beside = ray(STATION, [20_000, ne + 5.01 / 720 * 1e5]).direction
    move = straight([0, ne], [40_000, ne], 40.0)
    assert first_entry(STATION, move, [ConeZone(beside, 5 * DEGREE)]).status == EntryStatus.FREE
    assert first_entry(STATION, move, [ConeZone(beside, 5.02 * DEGREE)]).status == EntryStatus.ENTERS
    assert first_entry(STATION, move, [ConeZone(beside, 5 * DEGREE)], margin=0.02 * DEGREE).status == EntryStatus.ENTERS
    inside = first_entry(STATION, move, [ConeZone(ray(STATION, [10, ne]).direction, 5 * DEGREE)])
    assert inside.status == EntryStatus.STARTS_INSIDE
    assert inside.time == 0
    assert first_entry(STATION, move, []).status == EntryStatus.FREE


def test_a_zone_that_comes_to_a_standing_beam_is_seen():
    n = np.array([20_000.0, STATION.zeros[1] + 9000])
    d = ray(STATION, n).direction
    side = unit(np.cross(d, [0, 0, 1.0]))
    away = unit(d + 0.5 * side)
    hold = straight(n, n, 100.0)
    cone = ConeZone(away, 0.1, unit(d - 0.5 * side))
    found = first_entry(STATION, hold, [cone])
    assert found.status == EntryStatus.ENTERS
    share = found.time / 100.0
    assert cone.clearance(d, share) == pytest.approx(TOUCH, abs=TOUCH)
    assert first_entry(STATION, hold, [ConeZone(away, 0.1)]).status == EntryStatus.FREE


def batch(n, seed=7):
    rng = np.random.default_rng(seed)
    moves = trapezoid(random_counts(rng, n), random_counts(rng, n), PACE)
    sun = unit(rng.normal(size=(n, 3)))
    later = unit(sun + 1e-3 * rng.normal(size=(n, 3)))
    half = np.where(rng.random(n) < 0.1, -np.inf, 0.09)
    boxes = [
        BoxZone(np.add(STATION.scan_point, [30, 10, -5]), [8, 20, 9], 0.3, 200.0),
        BoxZone(np.add(STATION.scan_point, [0, -20, 4]), [3, 3, 2]),
    ]
    return moves, [boxes[0], ConeZone(sun, half, later), boxes[1]]


def test_the_kernel_answers_as_the_plain_form(monkeypatch):
    moves, zones = batch(3000)
    plain = first_entry(STATION, moves, zones, margin=0.002)
    monkeypatch.setattr(keep_out, "COMPILED_FROM", 1)
    fast = first_entry(STATION, moves, zones, margin=0.002)
    assert np.array_equal(plain.status, fast.status)
    assert np.array_equal(plain.zone, fast.zone)
    assert np.array_equal(np.isnan(plain.time), np.isnan(fast.time))
    assert np.nanmax(np.abs(plain.time - fast.time)) < 1e-9
    assert set(plain.status) == {0, 1, 2}
    assert set(plain.zone) == {-1, 0, 1, 2}


@draws(150)
def test_dense_looks_find_the_same_entries(runs):
    moves, zones = batch(runs, seed=8)
    found = first_entry(STATION, moves, zones)
    for i in range(runs):
        time = np.linspace(0, moves.total[i], 3001)
        d = ray(STATION, moves[i].position(time)).direction
        gap = np.min(
            [
                z[i].clearance(d, time / max(moves.total[i], 1e-9))
                if isinstance(z, ConeZone)
                else z.clearance(STATION.scan_point, d)
                for z in zones
            ],
            axis=0,
        )
        inside = np.flatnonzero(gap <= 0)
        if len(inside):
            assert found.status[i] != EntryStatus.FREE
            assert found.time[i] <= time[inside[0]] + 1e-9
        elif found.status[i] != EntryStatus.FREE:
            assert np.min(gap) <= 2e-3  # touching between two looks, 1 mrad apart


def test_the_servo_margin_covers_any_error_of_that_size():
    rng = np.random.default_rng(2)
    n = random_counts(rng, 5000)
    off = rng.uniform(-1, 1, n.shape) * [30, 40]
    turned = apart(ray(STATION, n).direction, ray(STATION, n + off).direction)
    assert np.max(turned) <= servo_margin([30, 40])
    assert np.max(turned) > 0.9 * servo_margin([30, 40])


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (lambda: ConeZone([0, 0, 0], 0.1), "non-zero vector"),
        (lambda: ConeZone([0, 0, 1], 5.0), "check its unit"),
        (lambda: BoxZone([0, 0, 0], [1, -1, 1]), "sizes"),
        (lambda: BoxZone([0, 0], [1, 1, 1]), "box"),
        (lambda: BoxZone([0, 0, 0], [1, 1, 1], 0.0, 0.0), "box"),
        (lambda: servo_margin([1.0, -2.0]), "margin"),
        (lambda: first_entry(STATION[None], trapezoid([0, 0], [1, 1], PACE), []), "one ranger"),
    ],
)
def test_invalid_input_is_refused(act, said):
    with pytest.raises(ValidityError, match=said):
        act()
