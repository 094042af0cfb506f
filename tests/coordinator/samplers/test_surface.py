"""Sampler SURFACE: shape of the dish of an epoch, beside the loop."""

import asyncio

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.coordinator.journal.entries import EpochSolution
from catseye.coordinator.samplers.columns import COLUMNS
from catseye.coordinator.samplers.surface import FEWEST, SurfaceWatch, surface_row
from catseye.reduction.site.motion import ground_from
from coordinator.link_scene import run, until
from coordinator.round_scene import few_prisms

RAISED, NOISE = 0.3e-3, 20e-6  # m: raised and lowered in turn, known to that


def epoch(count, *, seed=3):
    """An epoch of so many prisms of the dish on the record's paraboloid, raised and lowered, in noise."""
    site = few_prisms()
    names = [n for n, t in site.targets.items() if t.shapes_dish][:count]
    f = site.site.paraboloid.focal_length_mm * MILLIMETRE
    local = np.array([site.targets[n].position_mm for n in names]).reshape(-1, 3) * MILLIMETRE
    local[:, 2] = (local[:, 0] ** 2 + local[:, 1] ** 2) / (4.0 * f)
    normal = np.column_stack([-local[:, 0] / (2.0 * f), -local[:, 1] / (2.0 * f), np.ones(count)])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    local += normal * (RAISED * (-1.0) ** np.arange(count))[:, None]
    local += np.random.default_rng(seed).normal(0.0, NOISE, local.shape)
    posture = site.site.campaign.azimuth_deg * DEGREE, site.site.campaign.elevation_deg * DEGREE
    ground = ground_from(site, "reflector", *posture).single.points(local)
    answer = {"number": 7, "names": names, "x": ground.tolist(), "azimuth": posture[0], "elevation": posture[1]}
    return EpochSolution(5_288_900_000_000, answer, NOISE**2 * np.eye(3 * count)), site


def named(row):
    return dict(zip(COLUMNS["SURFACE"], row[1:], strict=True))


def test_known_bumps_are_the_rms():
    """45 prisms raised by 0.3 mm in turn: the paraboloid takes a little of it, 6 parameters of 45."""
    solution, site = epoch(45)
    found = named(surface_row(solution, site))
    assert (found["epoch"], found["prisms"]) == ("7", "45")
    assert 0.8 * RAISED < float(found["rms_m"]) < 1.05 * RAISED
    assert 0.8 * NOISE < float(found["u_deviation_m"]) < 1.05 * NOISE
    designed = site.site.paraboloid.focal_length_mm * MILLIMETRE
    assert abs(float(found["focal_length_m"]) - designed) < 5e-3


def test_few_prisms_give_no_row_and_many_one():
    async def story():
        rows = []
        few, site = epoch(FEWEST - 1)
        watch = SurfaceWatch(site, rows.append)
        watch.entry(few)
        await asyncio.sleep(0.1)
        assert rows == []
        many, _ = epoch(45)
        watch.entry(many)
        watch.entry(many)  # while the first is computed: passed over
        await until(lambda: rows)
        assert len(rows) == 1
        await watch.stop()

    run(story)
