"""Panels set by chance, read again and again: heights scatter as claimed, corners conform as often as foretold."""

import numpy as np
import pytest
from scipy.stats import chi2

from catseye.reduction.panels.heights import conformity, meetings, reduce_panels
from catseye.simulator.laboratory.panels import CornerTour, Crew, panel_readings, solid_panels
from draws import same_sigmas
from panel_scene import patch, read, standing_by_chance, survey, tool

RUNS = [pytest.param(10, id="quick"), pytest.param(600, id="long", marks=pytest.mark.slow)]
U_SURVEY = float(np.hypot(80e-6, 50e-6))


def relative(found, true):
    rest = np.full(true.shape, np.nan)
    for four in meetings(found.layout, found.times > 0):
        here = four[four >= 0]
        rest.ravel()[here] = true.ravel()[here] - true.ravel()[here].mean()
    return rest[found.known]


@pytest.mark.parametrize("runs", RUNS)
def test_corner_heights_scatter_as_their_full_covariance(tmp_path, runs):
    """Everything drawn from the sheet's own claims: heights, warps, zeros, levels, shafts, survey, gauges, digits.

    The squared departure over the full covariance is chi-square with a degree of freedom a corner; the bound is its
    sum's 1e-4 quantiles. The slopes of single panels are left out (1 µrad): the twin's panels have none here.
    """
    layout, sheet = patch(side=2), tool(u_slope_urad=1.0, u_shape_um=1.0, u_set_um=300.0)
    nees, z, factor, degrees, inside, told = 0.0, [], 0.0, 0.0, 0, 0.0
    for run in range(runs):
        rng = np.random.default_rng([206, run])
        solid = standing_by_chance(layout, sheet, rng)
        shafts = rng.normal(0.0, 3e-4, len(layout.corners))
        rows, stands = panel_readings(solid, sheet, Crew(rng), tour=CornerTour(a_day=8), shafts=shafts)
        found = reduce_panels(
            read(rows, tmp_path / "r.csv", layout, sheet),
            layout,
            sheet.model_copy(update={"u_stand_um": 1e-3}),
            survey=survey(stands, U_SURVEY, rng),
        )
        true = solid.heights()
        many = true.size
        q = found.solution.q.matrix()[:many, :many]
        miss = (found.departure - true).ravel()
        nees += float(miss @ np.linalg.solve(q, miss))
        rest = relative(found, true)
        z.append((found.relative[found.known] - rest) / found.u_relative[found.known])
        factor += found.variance_factor * found.degrees_of_freedom
        degrees += found.degrees_of_freedom
        inside += int(np.sum(np.abs(rest) < 100e-6))
        told += float(np.sum(conformity(found.relative, found.u_relative, 100e-6)[found.known]))
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], runs * many)
    assert low < nees < high
    assert np.sqrt(np.mean(np.concatenate(z) ** 2)) == pytest.approx(
        1.0, abs=same_sigmas(0.08, 30, runs) if runs < 100 else 0.03
    )
    assert factor / degrees == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / degrees) + 0.02)
    assert told == pytest.approx(inside, abs=4.0 * np.sqrt(len(np.concatenate(z)) * 0.05))


@pytest.mark.parametrize("runs", [pytest.param(10, id="quick"), pytest.param(150, id="long", marks=pytest.mark.slow)])
def test_bumps_of_panels_without_maps_are_covered_by_shape_and_slope(tmp_path, runs):
    """A wavy surface is no prior of slopes at points: what is promised is that the claim covers, by no more than 2."""
    layout = patch(side=2)
    z = []
    for run in range(runs):
        rng = np.random.default_rng([207, run])
        solid = solid_panels(layout, rng, piston=2.5e-4, slope=8e-5, twist=2e-5, bump=4e-5)
        slope = float(np.sqrt(np.mean(np.sum(solid.bumps**2 * np.sum(solid.bump_k**2, axis=1), axis=1)) / 4.0))
        sheet = tool(u_slope_urad=slope * 1e6, u_shape_um=40.0, u_set_um=300.0, u_twist_um=20.0)
        rows, stands = panel_readings(solid, sheet, Crew(rng), tour=CornerTour(a_day=8))
        readings = read(rows, tmp_path / "r.csv", layout, sheet)
        found = reduce_panels(readings, layout, sheet, survey=survey(stands, U_SURVEY, rng))
        z.append((found.relative[found.known] - relative(found, solid.heights())) / found.u_relative[found.known])
    assert 0.5 < np.sqrt(np.mean(np.concatenate(z) ** 2)) < 1.1


@pytest.mark.parametrize("runs", [pytest.param(10, id="quick"), pytest.param(300, id="long", marks=pytest.mark.slow)])
def test_without_inclinometers_the_unknown_lean_is_in_the_claim(tmp_path, runs):
    """Shafts lean within a minute of arc, which no one read: 17 µm at a gauge, alike in all turns of a corner."""
    layout, sheet = patch(side=2), tool(u_slope_urad=1.0, u_shape_um=1.0, u_set_um=300.0)
    z, u = [], []
    for run in range(runs):
        rng = np.random.default_rng([209, run])
        solid = standing_by_chance(layout, sheet, rng)
        blind = Crew(rng, inclinometer=np.nan, lean=np.radians(1.0 / 60.0) / np.sqrt(3.0))
        rows, stands = panel_readings(solid, sheet, blind)
        readings = read(rows, tmp_path / "r.csv", layout, sheet)
        found = reduce_panels(readings, layout, sheet, survey=survey(stands, U_SURVEY, rng))
        z.append((found.relative[found.known] - relative(found, solid.heights())) / found.u_relative[found.known])
        u.append(np.median(found.u_relative[found.known]))
    assert np.sqrt(np.mean(np.concatenate(z) ** 2)) == pytest.approx(
        1.0, abs=same_sigmas(0.12, 20, runs) if runs < 100 else 0.04
    )
    assert 10e-6 < np.median(u) < 20e-6


@pytest.mark.parametrize("runs", RUNS)
def test_false_alarms_are_as_rare_as_the_level(tmp_path, runs):
    """Any reading in doubt in a good table: one table in twenty, give or take what runs allow."""
    layout, sheet = patch(side=2), tool(u_slope_urad=1.0, u_shape_um=1.0, u_set_um=300.0)
    alarms = 0
    for run in range(runs):
        rng = np.random.default_rng([208, run])
        rows, _ = panel_readings(
            standing_by_chance(layout, sheet, rng), sheet, Crew(rng), tour=CornerTour(turns=(0, 1, 2))
        )
        found = reduce_panels(read(rows, tmp_path / "r.csv", layout, sheet), layout, sheet)
        alarms += bool(found.doubts)
    assert alarms <= 0.05 * runs + 4.0 * np.sqrt(0.05 * runs)
