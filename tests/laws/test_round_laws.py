"""No move that the planner plans, or that the guard lets pass, comes into the Sun's cone or a box; and a ranger that is
lied to refuses by itself.

Checked by the walk of coordinator/round_scene.py, which shares no formula with them, and shown to find planted bugs.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.coordinator.guard.guard import SafetyGuard
from catseye.coordinator.plan.round import RoundPlanner
from catseye.coordinator.plan.value import Knowledge
from catseye.coordinator.visibility.surroundings import KeepClear
from catseye.coordinator.visibility.sweep import nearest
from catseye.coordinator.visibility.vantage import Vantage
from catseye.geometry.mirror.pointing import MirrorStation
from catseye.ranger.cubes import Cubes
from catseye.ranger.line import Request
from catseye.records.night.live import TICK_SECONDS, LivePosture
from catseye.reduction.site.earth_rotation import FramePlace
from coordinator.round_scene import DEGREE, angle, axes, beams, gbt, hits, keep_out, origin, stands, state, walk
from draws import draws
from ranger.ranger_scene import ready
from sun_scene import astropy_sun

CONE = 5 * DEGREE
MODES = ("together", "azimuth first", "elevation first")
PLACE = FramePlace(38.433121 * DEGREE, -79.839835 * DEGREE, 806.42)  # no air: astropy's Sun has none either
DAY = 100_000_000
# Between astropy's Suns a round apart it runs straight within 0.1"; the site's corner is 0.5" from sun_scene's.
SLACK = 2 / 3600 * DEGREE


def clear_of(**changes):
    return KeepClear(gbt(), keep_out(), changes.pop("place", PLACE), **changes)


def day_times(rng, n):
    """Ticks while the Sun is up, 2000 to 2025, and the Sun there (n, 3)."""
    found = np.zeros((0,))
    while len(found) < n:
        mjd = rng.uniform(51_544, 60_600, 2 * n)
        found = np.concatenate([found, mjd[astropy_sun(mjd)[:, 2] > 0.02]])
    return np.rint(found[:n] * DAY).astype(np.int64)


def posture_of(rng, ticks):
    azimuth, elevation = rng.uniform(0, 2 * np.pi), rng.uniform(8, 85) * DEGREE
    rates = rng.uniform(-1, 1, 2) * rng.choice([0.0, 15 / 3600, 0.3]) * DEGREE
    return LivePosture(int(ticks), float(azimuth), float(elevation), float(rates[0]), float(rates[1]))


def moves_of(planned, told):
    """Moves of a round as their rangers make them: name, counts before, counts behind, ticks of the buffer."""
    found = []
    for name, shots in planned.shots.items():
        here = np.array(told.counts[name])
        zy = Cubes(stands()[name].stops)
        station = stands()[name].station
        for key, part in (("BP", station.fixed_point * 1e3), ("ALPHA", station.alpha), ("BETA", station.beta)):
            zy.set_geometry(key, tuple(part))
        zy.set_geometry("MO", tuple(station.offset * 1e3))
        zy.set_geometry("EZ", tuple(station.zeros))
        for shot in shots:
            there = np.array(stands()[name].reference if shot.target == "ZRG" else zy.look(tuple(shot.at_begin * 1e3)))
            for stop in [*(np.array(v) for v in shot.via), there]:
                found.append((name, here, stop, shot.begin_ticks))
                here = stop
    return found


def violations(moves, own, looks=17):
    """How many moves come into the cone, and how many into a box.

    A beam that begins outside the cone stays outside, whether mirror, Sun or telescope moves it. One that begins in it
    or in the guard's margin, where Sun or telescope brought it, leaves, and comes no nearer by the mirror's own turn:
    what the telescope turns meanwhile, 0.3 deg/s at most, is not the planner's.
    """
    into_sun = into_box = 0
    ticks = np.array([m[3] for m in moves])
    low, high = ticks.min() - 20_000, ticks.max() + 20_000
    suns = astropy_sun(np.array([low, high]) / DAY)
    for name in {m[0] for m in moves}:
        mine = [m for m in moves if m[0] == name]
        start, end = np.array([m[1] for m in mine]), np.array([m[2] for m in mine])
        when = np.array([m[3] for m in mine], dtype=float)
        for mode in MODES:
            counts = walk(start, end, stands()[name].pace, mode, looks)
            # The move is over when the buffer begins; it takes 8 s at most.
            before = np.linspace(-3.0, 0.0, counts.shape[1]) / TICK_SECONDS
            times = when[:, None] + before
            u = beams(name, counts, own, times)
            sun = suns[0] + (suns[1] - suns[0]) * ((times - low) / (high - low))[..., None]
            apart = angle(u, sun)
            up = suns[:, 2].max() > np.sin(-1.99 * DEGREE)
            begins = apart[:, 0] < CONE + 0.16 * DEGREE  # inside the guard's margin: it may leave, and come no nearer
            turned = angle(beams(name, counts, own, np.repeat(times[:, :1], counts.shape[1], axis=1)), sun[:, :1])
            nearer = (apart[:, -1] < CONE) | (turned.min(axis=1) < turned[:, 0] - 0.01 * DEGREE)
            enters = (apart[:, 0] >= CONE) & (apart.min(axis=1) < CONE - SLACK)
            bad = enters | (begins & nearer)
            into_sun += int(np.sum(bad & up))
            if mode == "together":  # boxes are asked for along the axes' profiles
                inside = hits(origin(name, own, times), u)
                into_box += int(np.sum(inside.any(axis=1) & ~inside[:, 0]))
    return into_sun, into_box


def resting(rng):
    """Counts where mirrors happen to stand: anywhere between the stops, beams at Phi from 20 to 160 degrees."""
    found = {}
    for name, v in stands().items():
        found[name] = (float(rng.uniform(*v.stops)), float(v.station.zeros[1] + rng.uniform(2_800, 22_200)))
    return found


def planned_violations(rng, rounds, planner):
    """Sun, boxes, moves planned, pairs left out for the Sun, rangers without a shot: of random rounds over 25 years."""
    totals = np.zeros(5, dtype=int)
    for ticks in day_times(rng, rounds):
        own = posture_of(rng, ticks)
        told = state(int(ticks), own, counts=resting(rng))
        planned = planner.round(told)
        moves = moves_of(planned, told)
        if moves:
            totals[:2] += violations(moves, own)
        totals[2] += len(moves)
        totals[3] += sum("Sun" in text for text in planned.unseen.values())
        totals[4] += sum(not shots for shots in planned.shots.values())
    return totals


@draws(48, name="rounds")
def test_no_planned_move_of_thousands_comes_into_the_sun_or_a_box(rounds):
    sun, box, moves, left_out, idle = planned_violations(
        np.random.default_rng(601), rounds, RoundPlanner(gbt(), keep_clear=clear_of())
    )
    assert moves > 10_000 / 48 * rounds
    assert (sun, box) == (0, 0)
    assert left_out > 100 / 48 * rounds  # the Sun was in the way
    assert idle < 0.05 * rounds * 18


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(602, 608))
def test_no_planned_move_of_a_million_comes_into_the_sun_or_a_box(seed):
    """Six times 170 000."""
    sun, box, moves, left_out, _ = planned_violations(
        np.random.default_rng(seed), 850, RoundPlanner(gbt(), keep_clear=clear_of())
    )
    assert moves > 167_000
    assert (sun, box) == (0, 0)
    assert left_out > 2_000


class Blind(KeepClear):
    """One that forgot something."""

    def __init__(self, forgets):
        super().__init__(gbt(), keep_out(), PLACE)
        self.forgets = forgets

    def around(self, vantage, since_ticks, until_ticks, **options):
        if self.forgets == "the ranger's own turn":
            turned = MirrorStation.of_parameters(vantage.station.parameters + np.eye(13)[3] * 0.3)
            vantage = Vantage(vantage.name, vantage.frame, turned, vantage.mirror, vantage.pace)
        found = super().around(vantage, since_ticks, until_ticks, **options)
        if self.forgets == "the boxes":
            return replace(found, pieces=(), guards=())
        if self.forgets == "that the Sun is up":
            return replace(found, suns=found.suns[:0])
        if self.forgets == "half of the cone":
            return replace(found, sun_limit=0.5 * found.sun_limit)
        return found


@pytest.mark.parametrize("bug", ["the ranger's own turn", "the boxes", "that the Sun is up", "half of the cone"])
def test_the_walk_finds_a_planted_bug(bug):
    sun, box, *_ = planned_violations(np.random.default_rng(604), 4, RoundPlanner(gbt(), keep_clear=Blind(bug)))
    assert (box if bug == "the boxes" else sun) > 3


def test_the_walk_finds_a_sun_of_another_longitude():
    wrong = clear_of(place=replace(PLACE, longitude=PLACE.longitude + 15 * DEGREE))
    assert planned_violations(np.random.default_rng(605), 4, RoundPlanner(gbt(), keep_clear=wrong))[0] > 3


def near_the_sun(rng, name, ticks, own, sun, n):
    """Counts (n, 2) between the stops, half of them about where the mirror would look into the Sun."""
    v = stands()[name]
    zero = v.station.zeros[1]
    c = np.stack([rng.uniform(*v.stops, n), zero + rng.uniform(2_000, 23_000, n)], axis=-1)
    if v.frame == "reflector":
        sun = sun @ axes(own, ticks)
    at = v.look(v.station.scan_point + 100.0 * sun)
    if np.isfinite(at).all():
        c[::2] = np.clip(
            at + rng.normal(0, 1, (len(c[::2]), 2)) * [4000, 2000],
            [v.stops[0], zero + 1500],
            [v.stops[1], zero + 23_500],
        )
    return np.rint(c)


@draws(14, name="times")
def test_no_move_that_the_guard_lets_pass_comes_into_the_sun_or_a_box(times):
    rng = np.random.default_rng(606)
    guard = SafetyGuard(gbt(), keep_clear=clear_of())
    passed, refused, totals = 0, 0, np.zeros(2, dtype=int)
    for ticks in day_times(rng, times):
        own = posture_of(rng, ticks)
        guard.telescope(own)
        moves, sun = [], astropy_sun(np.array([ticks / DAY]))[0]
        for name in stands():
            points = near_the_sun(rng, name, ticks, own, sun, 24)
            for here, there in zip(points[:12], points[12:], strict=True):
                guard.stands(name, tuple(here))
                request = Request("CIL", ("0", f"{there[0]:.0f}", f"{there[1]:.0f}"))
                if guard.refusal(name, request, int(ticks)) is None:
                    moves.append((name, here, there, int(ticks) + 3_000))
        totals += violations(moves, own, looks=25)
        passed, refused = passed + len(moves), refused + 18 * 12 - len(moves)
    assert passed + refused > 3_000 / 14 * times
    assert min(passed, refused) > 800 / 14 * times
    assert tuple(totals) == (0, 0)


@draws(5_000, quick=1_000, name="times")
def test_a_ranger_that_is_lied_to_refuses_every_move_into_the_sun(times):
    """Nobody asks a guard: the moves go straight to a ranger, whose own Sun is all that it has; SUN lies besides."""
    rng = np.random.default_rng(607)
    mjd = 52_889.65
    sun = astropy_sun(np.array([mjd]))[0]
    told = ready(sun=lambda _: sun)
    assert told.one("SUN 0, 0, -1").ok  # "the Sun is set"
    station = told.ranger.cubes.station
    at = np.array(told.ranger.cubes.look(tuple(1e5 * sun)))
    asked = 0
    for _ in range(times):
        off = rng.normal(0, 1, 3) * 0.02
        place = 1e5 * (sun + off - sun * (off @ sun))  # within 3.5 degrees, mostly
        counts = at + rng.uniform(-1, 1, 2) * [300, 150]
        for line in (
            f"CIL 1, {place[0]:.1f}, {place[1]:.1f}, {place[2]:.1f}",
            f"CIL 0, {counts[0]:.0f}, {counts[1]:.0f}",
        ):
            told.ranger.receive(1, line)
            said = [o.reply for o in told.ranger.turn() if o.reply.command == "CIL"]
            aimed = station.scan_point + place * 1e-3 if "1," in line[:6] else None
            if aimed is not None and angle(place / np.linalg.norm(place), sun) > CONE:
                continue
            assert len(said) == 1
            assert not said[0].ok
            assert "Sun" in said[0].text
            asked += 1
        told.head.advance(0.001)
    assert asked > 1.9 * times
    assert tuple(told.head.at) == (0.0, 0.0)


directions = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)
corner = st.tuples(st.floats(-60_000, 90_000), st.floats(-25_000, 25_000))


@given(
    corner,
    st.tuples(st.floats(0, 60_000), st.floats(0, 30_000)),
    directions,
    st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), min_size=1, max_size=20),
)
def test_no_beam_within_a_rectangle_of_counts_is_nearer_than_the_closed_form_says(low, size, direction, shares):
    name = "ZY105"
    v = stands()[name]
    s = np.array(direction) / np.linalg.norm(direction)
    low = np.array(low)
    high = low + size
    inside = low + np.array(shares) * size
    own = LivePosture(0, 0.0, 0.5)
    apart = angle(beams(name, inside, own, np.zeros(len(inside))), s)
    assert apart.min() >= nearest(v.station, low, high, directions=s[None])[0] - 1e-7


covariances = st.lists(st.floats(-1, 1), min_size=9, max_size=9).map(lambda v: np.reshape(v, (3, 3)))


@given(covariances, directions, st.floats(1e-3, 2.0))
def test_information_of_a_range_agrees_with_the_information_matrix(root, direction, sigma):
    before = root @ root.T + 0.05 * np.eye(3)
    e = np.array(direction) / np.linalg.norm(direction)
    know = Knowledge(("A",), before)
    worth = know.worth(np.array([0]), e[None], np.array([sigma**2]))
    know.learn(0, worth.across[0], float(worth.total[0]))
    after = np.linalg.inv(np.linalg.inv(before) + np.outer(e, e) / sigma**2)
    np.testing.assert_allclose(know.covariances[0], after, atol=1e-9 * np.trace(before))
    assert worth.gain[0] == pytest.approx(np.trace(before) - np.trace(after), rel=1e-6, abs=1e-9)
