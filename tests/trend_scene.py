"""Points of a body through simulated nights, with planted gravity, expansion, drift, wind, steps and outliers."""

from dataclasses import dataclass

import numpy as np

from catseye.estimation.harmonic.body import rigid_design
from catseye.reduction.structure.group import Nominal, carrier_of
from catseye.reduction.trends.bodies import BodyPoints

YEAR = 365.25


@dataclass(frozen=True)
class BodyTruth:
    """What the simulated body does; m, rad, per degree C, per year.

    motion   (6,) arrays by cause: sine and cosine of elevation, temperature, year
    own      (n, 3) likewise
    steps    (night, point) -> (3,) m
    """

    motion: dict
    own: dict
    steps: dict
    outliers: np.ndarray


def simulated_body(nights=150, points=24, seed=1, *, frame="reflector", wind=2e-4, steps=None, outliers=0.003):
    """Points in the ground frame, and the truth.

    Covariances differ between nights; a tenth of the readings is absent.
    """
    rng = np.random.default_rng(seed)
    mjd = 61000.3 + np.sort(rng.choice(int(1.3 * nights), nights, replace=False))
    azimuth, elevation = rng.uniform(0.0, 6.0, nights), np.radians(rng.uniform(15.0, 85.0, nights))
    warm = 10.0 + 10.0 * np.sin(2.0 * np.pi * (mjd - 61100.0) / YEAR) + 4.0 * rng.normal(size=nights)
    place = rng.uniform(-50.0, 50.0, (points, 3)) * (1.0, 1.0, 0.3)
    causes = {
        "sin": (np.sin(elevation), 1.0),
        "cos": (np.cos(elevation), 1.0),
        "t": (warm - warm.mean(), 0.02),
        "year": ((mjd - mjd.mean()) / YEAR, 0.3),
    }
    size = np.repeat([2e-3, 3e-5], 3)
    motion = {name: rng.normal(size=6) * size * share for name, (_, share) in causes.items()}
    own = {name: rng.normal(size=(points, 3)) * 3e-4 * share for name, (_, share) in causes.items()}
    six = sum(np.outer(value, motion[name]) for name, (value, _) in causes.items())
    six = six + rng.normal(size=(nights, 6)) * np.repeat([wind, wind / 50.0], 3)
    x = place + np.einsum("nij,tj->tni", rigid_design(place - place.mean(axis=0)), six)
    x = x + sum(value[:, None, None] * own[name] for name, (value, _) in causes.items())
    for (night, point), step in (steps or {}).items():
        x[night:, point] += step
    root = 1e-4 * (0.25 * rng.normal(size=(nights, points, 3, 3)) + np.eye(3))
    covariance = root @ np.swapaxes(root, 2, 3)
    x = x + np.einsum("tnij,tnj->tni", root, rng.normal(size=x.shape))
    wrong = rng.random((nights, points)) < outliers
    x[wrong] += 3e-3 * rng.choice([-1.0, 1.0], (int(wrong.sum()), 3))
    x[rng.random((nights, points)) < 0.1] = np.nan
    carriers = [carrier_of(frame, a, e, nominal=Nominal()) for a, e in zip(azimuth, elevation, strict=True)]
    turn = np.array([carrier.rotation for carrier in carriers])
    body = BodyPoints(
        name="prism",
        names=tuple(f"P{k:03d}" for k in range(points)),
        mjd=mjd,
        azimuth=azimuth,
        elevation=elevation,
        temperature_c=warm,
        x=x @ np.swapaxes(turn, 1, 2) + np.array([carrier.translation for carrier in carriers])[:, None],
        covariance=turn[:, None] @ covariance @ np.swapaxes(turn, 1, 2)[:, None],
    )
    return body, BodyTruth(motion, own, dict(steps or {}), wrong & np.isfinite(x).all(axis=2))
