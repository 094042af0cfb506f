"""The tables of a surface: each number is the one in memory over the unit in its column's name."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.gateways.surface.tables import actuators_csv, change_csv, epochs_csv, lookup_csv, prisms_csv, zernike_csv
from catseye.optics.zernike import Term
from catseye.records.panels.actuators import ActuatorCorrection
from catseye.reduction.surface.change import change_between
from catseye.reduction.surface.lookup import lookup_of
from catseye.reduction.surface.shape import ShapeSettings, shape_of
from column_scene import assert_columns
from surface_scene import APERTURE, half_path_of, prisms

ROWS = np.arange(0, 2209, 40)
SETTINGS = ShapeSettings(terms=6)
NOLL = {(0, 0): 1, (1, 1): 2, (1, -1): 3, (2, 0): 4, (2, -2): 5, (2, 2): 6}  # [NOLL76] table I
BENT = half_path_of(Term(2, 2), 3e-4)


def number(term):
    return NOLL[term.n, term.m]


def places(local):
    return {f"{'xyz'[a]}_dish_m": lambda i, a=a: local[i, a] for a in range(3)}


def prism_columns(found, local, deviation, covariance, half_path):
    return {
        "point": lambda i: found[i],
        **places(local),
        "deviation_mm": lambda i: deviation[i],
        "u_deviation_mm": lambda i: covariance[i, i] ** 0.5,
        "half_path_mm": lambda i: half_path[i],
    }


def term_columns(e):
    return {
        "number": lambda k: number(e.terms[k]),
        "n": lambda k: e.terms[k].n,
        "m": lambda k: e.terms[k].m,
        "name": lambda k: e.terms[k].name,
        "value_mm": lambda k: e.value[k],
        "u_mm": lambda k: e.covariance[k, k] ** 0.5,
        "share_taken": lambda k: e.share[k],
        "joint_mm": lambda k: e.joint[k],
        "u_joint_mm": lambda k: e.joint_covariance[k, k] ** 0.5,
        "orthonormal_mm": lambda k: e.orthonormal[k],
        "u_orthonormal_mm": lambda k: e.u_orthonormal[k],
    }


@pytest.fixture(scope="module")
def shape():
    return shape_of(prisms(BENT, rows=ROWS), APERTURE, SETTINGS)


@pytest.fixture(scope="module")
def change():
    return change_between(prisms(0.5 * BENT, rows=ROWS), prisms(BENT, rows=ROWS, seed=1), APERTURE, settings=SETTINGS)


@pytest.fixture(scope="module")
def lookup():
    made = []
    for seed, (elevation, warm) in enumerate(zip([10.0, 40.0, 70.0, 85.0, 60.0, 30.0, 15.0], range(7), strict=True)):
        seen = replace(prisms(BENT * np.sin(np.radians(elevation)), rows=ROWS, seed=seed), source=f"night {seed}")
        seen = replace(seen, elevation_deg=elevation, temperature_c=float(warm))
        made.append(shape_of(seen, APERTURE, SETTINGS))
    return lookup_of(made)


def test_every_column_of_the_prisms_has_the_unit_of_its_name(shape):
    fit = shape.fit
    told = prism_columns(shape.prisms.names, fit.local, fit.deviation, fit.deviation_covariance, fit.half_path)
    told["weight"] = lambda i: shape.weights[i]
    assert_columns(prisms_csv(shape), told, range(len(ROWS)))


def test_every_column_of_a_change_has_the_unit_of_its_name(change):
    told = prism_columns(change.names, change.local, change.deviation, change.deviation_covariance, change.half_path)
    told["weight"] = lambda i: change.weights[i]
    assert_columns(change_csv(change), told, range(len(ROWS)))


def test_every_column_of_the_zernike_terms_has_the_unit_of_its_name(shape, change):
    for expansion, silent in ((shape.expansion, ()), (change.expansion, ("joint_mm", "u_joint_mm"))):
        rows = range(len(expansion.terms))
        assert_columns(zernike_csv(expansion, "noll"), term_columns(expansion), rows, silent)


def test_every_column_of_the_look_up_table_has_the_unit_of_its_name(lookup):
    told = {
        "elevation_deg": lambda at: np.radians(lookup.table_deg[at[0]]),
        "number": lambda at: number(lookup.models[at[1]].term),
        "name": lambda at: lookup.models[at[1]].term.name,
    }
    for way, word in enumerate(("rising", "mean", "falling")):
        told[f"{word}_mm"] = lambda at, way=way: lookup.table[*at, way]
        told[f"u_{word}_mm"] = lambda at, way=way: lookup.u_table[*at, way]
    assert_columns(lookup_csv(lookup), told, list(np.ndindex(lookup.table.shape[:2])))


def test_every_column_of_the_epochs_has_the_unit_of_its_name(lookup):
    told = {
        "epoch": lambda at: at[0] + 1,
        "source": lambda at: f"night {at[0]}",
        "elevation_deg": lambda at: np.radians(lookup.elevation_deg[at[0]]),
        "rising": lambda at: "yes" if at[0] < 4 else "no",
        "number": lambda at: number(lookup.models[at[1]].term),
        "name": lambda at: lookup.models[at[1]].term.name,
        "value_mm": lambda at: lookup.measured[at],
        "u_mm": lambda at: lookup.u_measured[at],
        "residual_mm": lambda at: lookup.models[at[1]].residual[at[0]],
        "w": lambda at: lookup.models[at[1]].standardised[at[0]],
    }
    assert_columns(epochs_csv(lookup), told, list(np.ndindex(lookup.measured.shape)))


def test_every_column_of_the_actuators_is_the_record_s_own():
    """Its record holds mm under the same names: nothing may be done to a number on the way."""
    lengths = ("deviation", "u_deviation", "correction", "u_correction", "left", "position", "target")
    numbers = {f"{name}_mm": 0.1 * (k + 1) for k, name in enumerate(lengths)}
    row = ActuatorCorrection(
        actuator="A1",
        **{f"{axis}_m": 10.5 + k for k, axis in enumerate("xyz")},
        **numbers,
        steps=-3,
        within_limits="yes",
        how="measured",
        prisms="DP001 DP002",
        weight=0.75,
    )
    told = {name: lambda r, name=name: getattr(r, name) for name in ActuatorCorrection.model_fields}
    for name in told:
        if name.endswith("_mm"):
            told[name] = lambda r, name=name: 1e-3 * getattr(r, name)
    assert_columns(actuators_csv([row]), told, [row])
