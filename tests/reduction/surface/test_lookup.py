"""A surface's way with elevation, temperature and direction, planted term by term, comes back with what it claims."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.errors import EstimationError
from catseye.optics.zernike import Term
from catseye.reduction.surface.lookup import COS, HYSTERESIS, SIN, THERMAL, directions, lookup_of
from catseye.reduction.surface.shape import ShapeSettings, shape_of
from surface_scene import APERTURE, half_path_of, prisms

BENT = Term(2, 2)
HELD = ShapeSettings(free=(), terms=6)  # what is free takes its share of the term: the table is of what is left
UP = [10.0, 25.0, 40.0, 55.0, 70.0, 85.0]
ELEVATIONS = np.array([*UP, *UP[::-1], *UP])
SEEN = np.arange(0, 2209, 12)
TRUE = {"constant": 1e-4, SIN: 3e-4, COS: -2e-4, THERMAL: 1.5e-5, HYSTERESIS: 5e-5}  # m, m/°C


def epochs(rng, *, u=5e-5, temperatures=None, elevations=ELEVATIONS):
    """Shapes of a dish whose astigmatism follows TRUE, each measured anew."""
    way = directions(elevations)
    warm = np.zeros(len(elevations)) if temperatures is None else temperatures - np.mean(temperatures)
    made = []
    for k, e in enumerate(np.radians(elevations)):
        size = TRUE["constant"] + TRUE[SIN] * np.sin(e) + TRUE[COS] * np.cos(e)
        size += TRUE[THERMAL] * warm[k] + 0.5 * TRUE[HYSTERESIS] * way[k]
        seen = prisms(half_path_of(BENT, size), u=u, seed=int(rng.integers(2**31)), rows=SEEN)
        told = None if temperatures is None else float(temperatures[k])
        made.append(shape_of(replace(seen, elevation_deg=float(elevations[k]), temperature_c=told), APERTURE, HELD))
    return made


def test_gravity_temperature_and_hysteresis_come_back_as_sure_as_claimed():
    rng, squares = np.random.default_rng(3), []
    for _ in range(6):
        found = lookup_of(epochs(rng, temperatures=rng.uniform(-5.0, 25.0, len(ELEVATIONS))))
        assert found.columns == ("constant", SIN, COS, THERMAL, HYSTERESIS)
        model = found.models[found.shapes[0].expansion.terms.index(BENT)]
        off = model.value - [TRUE[c] for c in found.columns]
        squares.append(off @ np.linalg.solve(model.covariance, off) / len(off))
        assert 0.2 < model.variance_factor < 2.5  # 13 degrees of freedom
    assert 0.4 < np.mean(squares) < 1.9  # of 30: 99.9 % of chi-square over 30
    rows = dict(zip(found.columns, np.sqrt(np.diag(model.covariance)), strict=True))
    assert rows[THERMAL] < 0.1 * TRUE[THERMAL]
    assert rows[HYSTERESIS] < 0.2 * TRUE[HYSTERESIS]


def test_the_table_holds_rising_and_falling_at_the_mean_temperature():
    found = lookup_of(epochs(np.random.default_rng(4), u=1e-8, temperatures=np.linspace(0.0, 20.0, len(ELEVATIONS))))
    k = found.shapes[0].expansion.terms.index(BENT)
    assert found.table_deg[0] == 10.0
    assert found.table_deg[-1] == 85.0
    e = np.radians(found.table_deg)
    middle = TRUE["constant"] + TRUE[SIN] * np.sin(e) + TRUE[COS] * np.cos(e)
    for column, half in enumerate((0.5, 0.0, -0.5)):  # rising, mean, falling
        np.testing.assert_allclose(found.table[:, k, column], middle + half * TRUE[HYSTERESIS], rtol=0, atol=1e-7)


def test_terms_undetermined_by_the_epochs_are_left_out_with_a_reason():
    rng = np.random.default_rng(5)
    up = lookup_of(epochs(rng, elevations=np.array(UP), temperatures=np.full(6, 10.0)))
    assert up.columns == ("constant", SIN, COS)
    assert up.left_out[HYSTERESIS] == "elevation moved in one direction only"
    assert up.left_out[THERMAL] == "temperatures within 0.00 °C"
    two = lookup_of(epochs(rng, elevations=np.array([20.0, 60.0, 20.0])))
    assert SIN in two.left_out
    with pytest.raises(EstimationError, match="2 epochs at least, not 1"):
        lookup_of(epochs(rng, elevations=np.array([20.0, 30.0]))[:1])
