"""The tables of a baseline: each number is the one in memory over the unit in its column's name."""

from itertools import combinations

import numpy as np
import pytest

from catseye.gateways.baseline.objects import baseline_object
from catseye.gateways.baseline.tables import distances_csv, observations_csv, pillars_csv
from catseye.records.laboratory.baseline import read_heights, read_observations
from catseye.reduction.baseline.instrument import calibrate_baseline
from column_scene import assert_columns
from repository import ROOT

DATA = ROOT / "examples" / "baselines" / "busselton"


@pytest.fixture(scope="module")
def found():
    seen = read_observations(DATA / "ts30-baseline-observations.csv")
    return calibrate_baseline(seen, read_heights(DATA / "pillar-heights.csv"))


def spread(found):
    """Covariance (2n, 2n), m^2, of all x and then all y; zero where held."""
    rows, covariance = found.solution.places
    whole = np.zeros((2 * len(found.names),) * 2)
    whole[np.ix_(rows, rows)] = covariance
    return whole


def test_every_column_of_the_pillars_has_the_unit_of_its_name(found):
    s, n, u = found.solution, len(found.names), np.sqrt(np.diag(spread(found)))
    told = {
        "pillar": lambda i: found.names[i],
        "x_m": lambda i: s.x[i],
        "y_m": lambda i: s.y[i],
        "height_m": lambda i: found.heights[i],
        "u_x_mm": lambda i: u[i],
        "u_y_mm": lambda i: u[n + i],
    }
    assert_columns(pillars_csv(found), told, found.order.tolist())


def test_every_column_of_the_distances_has_the_unit_of_its_name(found):
    s, n, q = found.solution, len(found.names), spread(found)

    def u(i, j):
        along = np.zeros(2 * n)
        along[[j, n + j]] = np.array([s.x[j] - s.x[i], s.y[j] - s.y[i]])
        along[[i, n + i]] = -along[[j, n + j]]
        return (along @ q @ along) ** 0.5 / np.linalg.norm(along[[j, n + j]])

    told = {
        "from_pillar": lambda ij: found.names[ij[0]],
        "to_pillar": lambda ij: found.names[ij[1]],
        "distance_m": lambda ij: np.hypot(s.x[ij[1]] - s.x[ij[0]], s.y[ij[1]] - s.y[ij[0]]),
        "u_distance_mm": lambda ij: u(*ij),
    }
    assert_columns(distances_csv(found), told, list(combinations(found.order.tolist(), 2)))


def test_every_column_of_the_shots_has_the_unit_of_its_name(found):
    seen, way, s = found.observations, found.lengths, found.solution
    of = np.cumsum(found.keep) - 1  # row among those kept

    def kept(value):
        return lambda k: value(of[k]) if found.keep[k] else None

    told = {
        "row": lambda k: k + 1,
        "from_pillar": lambda k: found.names[seen.start[k]],
        "to_pillar": lambda k: found.names[seen.end[k]],
        "set": lambda k: seen.set[k] + 1,
        "setup": lambda k: seen.setup[k] + 1,
        "slope_m": lambda k: seen.slope[k],
        "group_refractivity_ppm": lambda k: way.index[k] - 1.0,
        "first_velocity_mm": lambda k: way.first[k],
        "second_velocity_um": lambda k: way.second[k],
        "arc_to_chord_um": lambda k: way.chord[k],
        "slope_to_level_mm": lambda k: way.level[k],
        "horizontal_m": lambda k: way.distance[k],
        "direction_deg": lambda k: seen.direction[k],
        "residual_mm": kept(lambda k: s.residual[s.used.set[k]] + s.used.within[k]),
        "w_shot": kept(lambda k: s.w_shot[k]),
        "w_set": kept(lambda k: s.w_set[s.used.set[k]]),
        "status": lambda k: found.rejected[k] or "used",
        "place": lambda k: seen.where[k],
    }
    assert_columns(observations_csv(found), told, range(len(seen)))


def test_standard_deviations_are_as_uncertain_as_their_variances_say(found):
    """u of a root, by differences."""
    told, (noise, u) = baseline_object(found)["noise"], (found.solution.noise, found.solution.u_noise)
    for k, (key, unit) in enumerate((("shot", 1.0), ("set", 1.0), ("air_ppm", 1e-6))):
        variance = (noise.shot, noise.set, noise.air)[k]
        if variance > 0.0:
            step = 1e-4 * variance
            slope = (np.sqrt(variance + step) - np.sqrt(variance - step)) / (2.0 * step)
            assert told[f"u_{key}"] == pytest.approx(u[k] * slope / unit, rel=1e-6)
    assert told["u_shot"] is not None
