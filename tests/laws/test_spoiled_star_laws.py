"""Spoiled tables of star offsets: refused, or not good, while the answer is more than five u from the honest one.

Exempt, since no file can show it: columns of the sky and of the encoders exchanged. Every offset changes its sign, and
with it every term; only where azimuths or elevations alone are exchanged does the axis's lean, AN and AW, which is in
both, contradict itself, if it is there. And azimuths counted the other way mirror the whole sky: what shows them is
that they are all below zero.
"""

import numpy as np
import pytest

from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import InputError
from catseye.geometry.antenna.pointing_series import PUBLISHED_ARCSEC, TERMS, PointingSeries
from catseye.records.laboratory.star_offsets import parsed
from catseye.reduction.pose.pointing_fit import fit_pointing

LEANING = (-284.0, -180.0, 80.0, 9.0, 71.0, 39.0, 31.0, 6.0)  # an axis that leans by a minute of arc
HOUR = 15.0
SPOILED = {
    "zenith distances": lambda t: t * [1, -1, 1, -1] + [0, 90, 0, 90],
    "azimuths negated": lambda t: t * [-1, 1, -1, 1],
    "elevations negated": lambda t: t * [1, -1, 1, -1],
    "radians": lambda t: t * DEGREE,
    "azimuths in radians": lambda t: t * [DEGREE, 1, DEGREE, 1],
    "elevations in radians": lambda t: t * [1, DEGREE, 1, DEGREE],
    "hours": lambda t: t / HOUR,
    "azimuths in hours": lambda t: t / [HOUR, 1, HOUR, 1],
    "elevations in hours": lambda t: t / [1, HOUR, 1, HOUR],
    "azimuth and elevation exchanged": lambda t: t[:, [1, 0, 3, 2]],
    **{f"column {c} negated": lambda t, c=c: t * np.where(np.arange(4) == c, -1, 1) for c in range(4)},
    **{f"column {c} doubled": lambda t, c=c: t * np.where(np.arange(4) == c, 2, 1) for c in range(4)},
    **{f"column {c} constant": lambda t, c=c: np.where(np.arange(4) == c, t[0], t) for c in range(4)},
    **{f"column {c} shifted": lambda t, c=c: np.where(np.arange(4) == c, np.roll(t, 1, axis=0), t) for c in range(4)},
    **{f"columns {c}, {c + 1} exchanged": lambda t, c=c: exchanged(t, c, c + 1) for c in range(3)},
}


def exchanged(table, one, other):
    order = list(range(4))
    order[one], order[other] = other, one
    return table[:, order]


def table(seed, terms, noise):
    """Stars over the whole sky above 10 degrees: azimuth, elevation of sky and encoders, degrees."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(40, 80))
    a, e = rng.uniform(0, 360, n), np.degrees(np.arcsin(rng.uniform(0.18, 0.99, n)))
    series = PointingSeries(TERMS, np.array(terms) * ARCSECOND, np.zeros((8, 8)))
    off = series.correction(a * DEGREE, e * DEGREE) / DEGREE + rng.normal(0, noise / 3600, (n, 2))
    return np.column_stack([a, e, a + off[:, 0] / np.cos(e * DEGREE), e + off[:, 1]])


def fitted(rows):
    text = "\n".join(" ".join(f"{v:.7f}" for v in row) for row in rows)
    stars = parsed(f"made\n: ALTAZ\n38 25 59.2\n{text}\nEND\n", "made.dat")
    return fit_pointing(stars.azimuth, stars.elevation, stars.correction)


@pytest.mark.parametrize("terms", [PUBLISHED_ARCSEC, LEANING], ids=["published", "leaning"])
@pytest.mark.parametrize("seed", range(4))
def test_a_spoiled_table_is_never_good_while_its_terms_are_five_u_off(terms, seed):
    rows = table(seed, terms, noise=5.2)
    honest = fitted(rows)
    assert honest.verdict.word == "good"
    wrong = []
    for name, spoil in SPOILED.items():
        try:
            fit = fitted(spoil(rows))
        except InputError:
            continue
        u = np.sqrt(np.maximum(np.diag(fit.series.covariance), np.diag(honest.series.covariance)))
        off = np.abs(fit.series.values - honest.series.values) / u
        if fit.verdict.word == "good" and off.max() > 5.0:
            wrong.append(f"{name}: {off.max():.1f} u")
    assert not wrong


@pytest.mark.parametrize(("columns", "said"), [((0, 2), "azimuths of sky and"), ((1, 3), "elevations of sky and")])
@pytest.mark.parametrize("seed", range(4))
def test_a_leaning_axis_shows_that_sky_and_encoders_are_exchanged(columns, said, seed):
    found = fitted(exchanged(table(seed, LEANING, noise=5.2), *columns)).verdict
    assert found.word == "doubtful"
    assert said in found.why


@pytest.mark.parametrize("seed", range(40))
def test_honest_tables_of_any_telescope_stay_good(seed):
    rng = np.random.default_rng(seed)
    assert fitted(table(seed, rng.normal(0, 300, 8), noise=rng.uniform(0.5, 15))).verdict.word == "good"
