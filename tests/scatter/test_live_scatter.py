"""Claimed covariances of the living site against scatter: twins of many seeds, what Live says against where things are.

The mean squared deviation of a coordinate in units of its claim is 1 where the claim is the scatter. Below 1 it is too
careful: in the quiet night of these twins most of what a state is loosened by between epochs does not happen.
"""

from functools import cache

import numpy as np
import pytest

from catseye.geometry.frames.frame import Transforms
from catseye.records.night.live import TICKS_PER_DAY
from catseye.reduction.live.live import LiveSettings
from catseye.reduction.site.motion import ground_from
from catseye.simulator.twin.beam import TracedDish
from draws import draws, same_chance
from live_scene import Night, begun, deviations, lasting, site

TRACK, NIGHTS, FEWER, EPOCHS = "track 145.3 45", 60, 20, 8
FAULTS = (
    "blocked-beam ZY103 20 45",
    "wrong-target ZY105:ZEG41040L 30 60",
    "wrong-target ZY114 50 60",
    "saturated-adc ZY107 35 55",
    "dew ZEG41030L",
    "lying-station WX2 32",
    "silent-station WX1 60",
    "dead-ranger ZY109 25 70",
    "dead-ranger ZY115",
    "dead-ranger ZY101",
)


@cache
def night(motion, seed, epochs, *, faults=(), filter_="random_walk"):
    """Deviations {(epoch, point): (3,)} of points with three shots and more, and of the beam [(3,)]."""
    night, live = begun(motion, seed=seed, faults=faults, settings=LiveSettings(filter=filter_))
    night.renew = motion.startswith("slew")
    found, beams, then = {}, [], {}
    for k in range(epochs):
        night.round(k).into(live)
        answer = live.solve(night.ticks(k))
        assert answer is not None, f"seed {seed}, epoch {k}: {live.failed}"
        names = lasting(live, answer, fewest=3)
        z = deviations(night, live, answer, k, names)
        found |= {(k, name): row for name, row in zip(names, z, strict=True)}
        now = own_places(night, live, k)
        if k == live.settings.reference_after - 1:
            then = now
        elif then and answer.pose.missing == "":
            off = answer.pose.offset - true_offset(then, now, live.bodies)
            beams.append(np.linalg.solve(np.linalg.cholesky(answer.pose.covariance), off))
    return found, beams


def own_places(night: Night, live, k):
    """Mean true place over an epoch of each moving point, in its frame."""
    names = [n for n in live.lasting if live.bodies.get(n) in ("dish", "arm")]
    grid = 10.0 * k + np.linspace(0.3, 9.5, 48)
    mjd = np.array([night.world.ticks(s) / TICKS_PER_DAY for s in grid])
    back: Transforms = ground_from(night.world.site, "reflector", *live.track.at(mjd)).inverse()
    true = night.world.points(names, grid)
    return {name: back.points(true[:, i]).mean(axis=0) for i, name in enumerate(names)}


def true_offset(then, now, bodies):
    """Azimuth times cos E, elevation, focus: of rigid motions fitted to true points, by the ray trace."""
    motion = {}
    for body in ("dish", "arm"):
        names = [n for n in then if bodies[n] == body]
        design, change = [], []
        for n in names:
            x, y, z = then[n]
            design.append(np.hstack([np.eye(3), [[0, z, -y], [-z, 0, x], [y, -x, 0]]]))
            change.append(now[n] - then[n])
        motion[body] = np.linalg.lstsq(np.vstack(design), np.concatenate(change), rcond=None)[0]
    dish = TracedDish.of(site().site.paraboloid)
    shift, turn = motion["arm"][:3], motion["arm"][3:]
    return dish.offset(motion["dish"], np.concatenate([shift + np.cross(turn, dish.focus), turn]))


def tally(motion, seeds, epochs, **more):
    """Mean square of all, {point: mean square}, mean square of the beam, {point: mean deviation (3,) of the nights}."""
    rows, beams = {}, []
    for seed in seeds:
        found, beam = night(motion, seed, epochs, **more)
        beams += beam
        for (_, name), z in found.items():
            rows.setdefault(name, {}).setdefault(seed, []).append(z)
    square = {name: np.mean([np.mean(np.square(z)) for z in each.values()]) for name, each in rows.items()}
    everything = np.concatenate([z for each in rows.values() for z in each.values()])
    means = {name: np.array([np.mean(z, axis=0) for z in each.values()]) for name, each in rows.items()}
    return float(np.mean(everything**2)), square, float(np.mean(np.square(beams))) if beams else np.nan, means


@draws(3, name="nights")
def test_a_few_nights_of_tracking_err_as_claimed(nights):
    """Single nights were seen between 0.5 and 1.6: ten bodies and airs, not fifty points, are what is drawn."""
    mean, square, beam, _ = tally(TRACK, range(301, 301 + nights), 4)
    low, high, middle = (same_chance(bound, 3 * 10, nights * 10) for bound in (0.35, 1.5, 1.2))
    assert low < mean < high
    assert np.median(list(square.values())) < middle
    assert same_chance(0.05, 3 * 3, nights * 3) < beam < same_chance(2.5, 3 * 3, nights * 3)  # three angles a night


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "nights", "faults", "filter_"),
    [
        pytest.param(TRACK, NIGHTS, (), "random_walk", id="track at 45"),
        pytest.param("track 145.3 80", FEWER, (), "random_walk", id="track at 80"),
        pytest.param("fixed 145.3 30", FEWER, (), "random_walk", id="fixed"),
        pytest.param("slew 100 40 160 60", FEWER, (), "random_walk", id="slew"),
        pytest.param(TRACK, FEWER, FAULTS, "random_walk", id="faults"),
        pytest.param(TRACK, FEWER, (), "constant_velocity", id="constant velocity"),
    ],
)
def test_many_nights_err_as_claimed(motion, nights, faults, filter_):
    mean, square, beam, means = tally(motion, range(401, 401 + nights), EPOCHS, faults=faults, filter_=filter_)
    assert 0.5 < mean < 1.25
    assert max(square.values()) < 3.0, "no point is far worse than the rest"
    assert 0.3 < beam < 1.6
    for name, each in means.items():
        if len(each) >= 15:  # nights are independent: their means have no mean
            t = each.mean(axis=0) / (each.std(axis=0, ddof=1) / np.sqrt(len(each)))
            assert np.abs(t).max() < 5.0, f"{name} is off by {t} standard errors night after night"


@draws(50, 3, name="nights")
def test_the_first_epoch_errs_as_claimed(nights):
    """It has typed places and no history. These fifty nights give 0.83 with u 0.04, 1.97 in the worst;
    `simulate --fast` with seeds 101 to 150 gave 0.75 and none beyond its band of 99 %. 3.75 was seen before typed
    places were told from known ones."""
    each = []
    for seed in range(601, 601 + nights):
        found, _ = night(TRACK, seed, 1)
        each.append(np.mean([np.mean(z**2) for z in found.values()]))
    assert same_chance(0.3, 3 * 10, nights * 10) < np.mean(each) < same_chance(1.5, 3 * 10, nights * 10)
    assert max(each) < 3.0


@pytest.mark.slow
def test_over_ten_minutes_the_ground_stays_honest():
    """What is local to a path lasts half an hour, so that sixty epochs of one line are no sixty observations of it.

    Six nights of 36 epochs gave 0.93 in the first two minutes and 1.05 in the last; 1.07 and 1.42 while each epoch took
    the index of a path as new. One night scatters from 0.6 to 1.6: stations share the air and the telescope.
    """
    late = []
    for seed in (30, 31):
        found, _ = night("fixed 145.3 30", seed, 60)
        late += [z for (k, name), z in found.items() if k >= 40 and "ZY101" <= name <= "ZY112"]
    assert 0.5 < np.mean(np.square(late)) < 1.25
