"""Retroreflector offset: the sign of the constant, drift, seatings, several unknowns, scatter."""

import numpy as np
import pytest

from calibration_scene import RUNS
from catseye.errors import InputError
from catseye.reduction.calibrations.ranging.retroreflector import LAYOUT, calibrate_retroreflector

BASE = {"reference": "A", "pc_mm": -10.0, "u_pc_mm": 0.002, "u_cyclic_mm": 0.0}
EXCESS = {"A": 0.0, "B": 0.0235, "C": 0.1637}


def sequence(names, per=3, hours=0.2):
    """Times and names of readings: each seating `per` readings."""
    which = np.repeat(list(names), per)
    time = np.repeat(hours * np.arange(len(names)), per) + np.tile(0.01 * np.arange(per), len(names))
    return time, which


def made(table, time, which, range_, position=None, **sheet):
    words = {"retroreflector": tuple(map(str, which))}
    if position is not None:
        words["position"] = tuple(position)
    numbers = {"mjd_utc": 61_280.0 + time / 24, "range_m": range_}
    return table(LAYOUT, numbers, words, **{**BASE, **sheet})


def test_a_longer_reading_means_a_more_negative_constant(table):
    time, which = sequence("ABABAB")
    range_ = 6.2 + np.array([EXCESS[w] for w in which])
    found = calibrate_retroreflector(made(table, time, which, range_, u_range_mm=0.003, u_seating_mm=0.002))
    assert found.value("pc_mm") == pytest.approx(-10.0 - 23.5, abs=1e-9)
    assert found.record == {"pc_mm": found.value("pc_mm"), "u_pc_mm": found.u("pc_mm")}


def test_a_linear_drift_goes_and_an_unremoved_one_biases(table):
    time, which = sequence("ABAB")
    range_ = 6.2 + np.array([EXCESS[w] for w in which]) + 40e-6 * time
    readings = made(table, time, which, range_, u_range_mm=0.003, u_seating_mm=0.002)
    # The time of mjd is good to 1e-11 d, 1e-11 m here.
    assert calibrate_retroreflector(readings).value("pc_mm") == pytest.approx(-33.5, abs=1e-6)
    held = made(table, time, which, range_, u_range_mm=0.003, u_seating_mm=0.002, drift=False)
    # B stands later than A by one seating, 0.2 h: it reads 8 um too long.
    assert calibrate_retroreflector(held).value("pc_mm") == pytest.approx(-33.5 - 0.008, abs=1e-6)


def test_u_of_single_seatings_in_closed_form(table):
    time, which = sequence("ABABABAB", per=2)
    range_ = 6.2 + np.array([EXCESS[w] for w in which])
    found = calibrate_retroreflector(
        made(table, time, which, range_, u_range_mm=0.003, u_seating_mm=0.004, drift=False)
    )
    seating = 0.004**2 + 0.003**2 / 2
    assert found.u("pc_mm") == pytest.approx(np.sqrt(2 * seating / 4 + 0.002**2), rel=1e-9)


def test_several_unknowns_share_the_reference(table):
    time, which = sequence("ABCABC")
    range_ = 6.2 + np.array([EXCESS[w] for w in which])
    found = calibrate_retroreflector(
        made(table, time, which, range_, u_range_mm=0.003, u_seating_mm=0.004, drift=False)
    )
    assert found.value("pc_C_mm") == pytest.approx(-173.7, abs=1e-9)
    shared = (0.004**2 + 0.003**2 / 3) / 2 + 0.002**2
    assert found.covariance[0, 1] == pytest.approx(shared, rel=1e-9)
    assert set(found.record) == {"B", "C"}


def test_positions_have_their_own_level_and_drift(table):
    time, which = sequence("ABAB")
    time, which = np.concatenate([time, 5 + time]), np.concatenate([which, which])
    position = ["near"] * 12 + ["far"] * 12
    level = np.where(np.arange(24) < 12, 6.2 + 1e-5 * time, 31.0 - 3e-5 * time)
    range_ = level + np.array([EXCESS[w] for w in which])
    found = calibrate_retroreflector(made(table, time, which, range_, position, u_range_mm=0.003, u_seating_mm=0.002))
    assert found.value("pc_mm") == pytest.approx(-33.5, abs=1e-6)


def test_cyclic_terms_count_where_the_two_lengths_stand_at_two_phases(table):
    time, which = sequence("ABAB", per=1)
    quiet = {"u_range_mm": 1e-4, "u_seating_mm": 1e-4, "drift": False, "u_cyclic_mm": 0.01, "u_pc_mm": 0.0}
    u = {}
    for name, excess in (("none", 0.0), ("half", 0.0499654), ("whole", 0.0999308)):  # of the half wavelength in vacuum
        range_ = 6.2 + np.where(which == "B", excess, 0.0)
        u[name] = calibrate_retroreflector(made(table, time, which, range_, **quiet)).u("pc_mm")
    assert u["none"] < 3e-4
    assert u["whole"] < 3e-4
    # Half a turn apart: order 1 changes sign, twice 10 um; order 2 is the same.
    assert u["half"] == pytest.approx(0.02, rel=1e-2)


def test_a_wrong_reading_is_rejected_and_missing_input_reported(table):
    rng = np.random.default_rng(0)
    time, which = sequence("ABABABAB", per=4)
    range_ = 6.2 + np.array([EXCESS[w] for w in which]) + 2e-6 * rng.standard_normal(32)
    range_[13] += 5e-5
    found = calibrate_retroreflector(made(table, time, which, range_), reject=True)
    assert [k for k, row in enumerate(found.rows) if row[-1] == "rejected"] == [13]
    with pytest.raises(InputError, match="no reading of 'Z'"):
        calibrate_retroreflector(made(table, time, which, range_, reference="Z"))
    with pytest.raises(InputError, match=r"holds 'A' \(expected an unknown one too\)"):
        calibrate_retroreflector(made(table, time, np.full(32, "A"), range_))


@pytest.mark.parametrize("runs", RUNS)
@pytest.mark.parametrize("claimed", [True, False])
def test_constants_scatter_as_claimed(table, scatters_as_claimed, claimed, runs):
    rng, values, covariances = np.random.default_rng(1), [], []
    time, which = sequence("ABC" * 8)
    sheet = {"u_range_mm": 0.003, "u_seating_mm": 0.002} if claimed else {}
    for _ in range(runs):
        seat = np.repeat(2e-6 * rng.standard_normal(24), 3)
        range_ = 6.2 + np.array([EXCESS[w] for w in which]) + 5e-6 * time + seat + 3e-6 * rng.standard_normal(72)
        reference = BASE["pc_mm"] + 0.002 * rng.standard_normal()
        range_ = range_ + (BASE["pc_mm"] - reference) * 1e-3 * (which != "A")
        found = calibrate_retroreflector(made(table, time, which, range_, **sheet))
        values.append([q.value for q in found.quantities])
        covariances.append(found.covariance)
    if not claimed:  # each claim scatters itself, with 20 degrees of freedom: compare with their mean
        covariances = np.broadcast_to(np.mean(covariances, axis=0), (runs, 2, 2))
    scatters_as_claimed(values, covariances, [-33.5, -173.7])
