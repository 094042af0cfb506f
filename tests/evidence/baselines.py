"""Baseline of real distances, by catseye and by plain least squares."""

import csv

import numpy as np

from catseye.records.laboratory.baseline import read_heights, read_observations
from catseye.reduction.baseline.instrument import calibrate_baseline
from repository import ROOT

DATA = ROOT / "examples" / "baselines" / "busselton"
TS30 = "ts30-baseline-observations.csv"


def by_hand(file, y):
    """Horizontal distances and their sines, with the closed formula of the index (IAG 1999), flat earth but for scale.

    Nothing of catseye: 0.07 ppm between the two indices is 0.04 mm at 510 m, and nearly all of it scale.
    """
    with (DATA / "pillar-heights.csv").open() as stream:
        top = {r["pillar_name"]: float(r["pillar_rl"]) for r in csv.DictReader(stream)}
    with (DATA / file).open() as stream:
        rows = list(csv.DictReader(stream))
    d, t, p, h, hi, ht = (
        np.array([float(r[k]) for r in rows])
        for k in ("slope_distance", "temperature", "pressure", "humidity", "height_of_instrument", "height_of_target")
    )
    vapour = h / 100 * 6.1121 * np.exp(17.502 * t / (240.97 + t)) * 1.004  # Magnus form, over water
    lam = 0.658
    standard = 287.6155 + 4.88660 / lam**2 + 0.06800 / lam**4
    n = 1 + 1e-6 * (273.15 / 1013.25 * standard * p / (273.15 + t) - 11.27 * vapour / (273.15 + t))
    a, b = (np.array([top[r[k]] for r in rows]) for k in ("from_pillar", "to_pillar"))
    rise = b + ht - a - hi
    level = np.sqrt((d * 1.000286338 / n) ** 2 - rise**2) * (1 - ((a + hi + b + ht) / 2 - top["1"]) / 6_371_000)
    i, j = (np.array([int(r[k]) - 1 for r in rows]) for k in ("from_pillar", "to_pillar"))
    return i, j, np.sqrt(level**2 - (y[j] - y[i]) ** 2)


def solved_by_hand(y):
    """Five distances, zero and scatter, m, of all shots by plain least squares."""
    i, j, d = by_hand(TS30, y)
    a = np.zeros((len(d), 6))
    for k in range(len(d)):
        for pillar, sign in ((i[k], -1), (j[k], 1)):
            if pillar:
                a[k, pillar - 1] += sign * np.sign(j[k] - i[k])
    a[:, 5] = 1.0
    values, *_ = np.linalg.lstsq(a, d, rcond=None)
    return values[:5], values[5], np.sqrt(np.sum((d - a @ values) ** 2) / (len(d) - 6))


def compared():
    """Row of the Busselton baseline: quantity, ours, by hand, m."""
    found = calibrate_baseline(read_observations(DATA / TS30), read_heights(DATA / "pillar-heights.csv"))
    x, zero, s = solved_by_hand(found.solution.y)
    own = found.all_shots
    return {
        "baseline": "Busselton, six pillars over 510 m, 127 distances of a TS30",
        "s_m": float(found.test.s),
        "degrees_of_freedom": int(found.test.degrees_of_freedom),
        "zero_m": float(found.solution.of("zero")[0]),
        "u_zero_m": float(found.solution.of("zero")[1]),
        "zero_difference_m": float(abs(own.zero - zero)),
        "s_difference_m": float(abs(own.s - s)),
        "distance_difference_m": float(np.abs(np.asarray(own.x[1:]) - x).max()),
    }
