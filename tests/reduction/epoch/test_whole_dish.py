"""A large night's engine, states and blocks, against the dense one; and what only a large night shows."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

from catseye.constants import ARCSECOND
from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch import unknowns
from catseye.reduction.epoch.coordinates import adjust_coordinates
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.strengths import Processes
from catseye.reduction.epoch.unknowns import build_network
from catseye.simulator.night.schedule import Schedule
from catseye.simulator.night.simulate import SimulatedTelescope, simulate_night
from kept_scene import night_directory

STATES = ReductionSettings(dense_shots=0)
MANY = {"telescope": SimulatedTelescope(dish_prisms=160), "schedule": Schedule(again=0.7)}


@pytest.fixture(scope="module")
def both(night_01, reduced_night_01):
    """Night-01 densely and by all states, with the same strengths of its processes, which each finds by itself."""
    strength = reduced_night_01.coordinates.strength
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Processes, "estimated", lambda *_: strength)
        patch.setattr(unknowns, "SOME_MODES", STATES.most_states)
        return reduce_epoch(night_01), reduce_epoch(night_01, STATES)


@pytest.fixture(scope="module")
def dense(both):
    return both[0]


@pytest.fixture(scope="module")
def by_states(both):
    return both[1]


def test_both_engines_find_the_same_strengths_and_so_the_same_points(night_01, reduced_night_01):
    """Strengths come of the shots' tests, in which the electronics are shared here and parameters there."""
    one, other = reduced_night_01.coordinates, reduce_epoch(night_01, STATES).coordinates
    assert other.strength.near(one.strength)
    u = np.where(one.u > 0.0, one.u, 1.0)
    assert np.abs((other.x - one.x) / u).max() < 0.02  # against ourselves: 0.005, of strengths that differ by 4 %
    np.testing.assert_allclose(other.u, one.u, rtol=5e-3)


@pytest.fixture(scope="module")
def many():
    """A night of more than 1500 shots and 150 typed points on the dish."""
    return read_campaign(night_directory(31, **MANY))


@pytest.fixture(scope="module")
def reduced_many(many):
    return reduce_epoch(many)


def test_the_states_are_the_dense_answer(dense, by_states):
    rejected = dense.rejected
    dense, states = dense.coordinates, by_states.coordinates
    u = np.where(dense.u > 0.0, dense.u, 1.0)
    assert np.abs((states.x - dense.x) / u).max() < 1e-4
    np.testing.assert_allclose(states.u, dense.u, rtol=2e-3)
    assert {k: str(v)[:40] for k, v in by_states.rejected.items()} == {k: str(v)[:40] for k, v in rejected.items()}
    assert states.variance_factor == pytest.approx(dense.variance_factor, abs=1e-4)
    assert states.degrees_of_freedom == pytest.approx(dense.degrees_of_freedom, abs=0.02)


def test_every_column_of_the_ranges_is_the_dense_one(dense, by_states):
    """The shared part counts as the shot's again: u, residual and redundancy are those of a range."""
    dense, states = dense.coordinates.ranges, by_states.coordinates.ranges
    for name in ("shot", "cycles", "used", "thin"):
        assert np.array_equal(getattr(dense, name), getattr(states, name)), name
    limits = {
        "range_": 1e-9,
        "residual": 1e-9,
        "u_range": 1e-12,
        "redundancy": 4e-3,
        "standardised": 5e-3,
        "zero": 1e-9,
    }
    for name, limit in limits.items():
        np.testing.assert_allclose(getattr(states, name), getattr(dense, name), atol=limit, err_msg=name)
    np.testing.assert_allclose(states.detectable, dense.detectable, rtol=5e-3)


def test_pose_and_surface_are_the_dense_ones(dense, by_states):
    dense, states = dense.surface, by_states.surface
    assert states.names == dense.names
    np.testing.assert_allclose(states.fit.deviation, dense.fit.deviation, atol=1e-9)
    np.testing.assert_allclose(states.u_deviation, dense.u_deviation, rtol=2e-3)
    p, q = (np.array(s.pose()["covariance"]) for s in (dense, states))
    np.testing.assert_allclose(q, p, atol=2e-3 * np.abs(p).max())


def test_fewer_states_keep_each_shots_variance_and_lose_little(night_01, reduced_night_01):
    few = reduce_epoch(night_01, dataclasses.replace(STATES, most_states=300)).coordinates
    dense = reduced_night_01.coordinates
    np.testing.assert_allclose(few.ranges.u_range, dense.ranges.u_range, rtol=1e-6)
    assert 1e-3 < np.abs(few.u[dense.u > 0] / dense.u[dense.u > 0] - 1.0).max() < 0.15


def test_repeats_on_a_line_share_its_air_in_both(few_01, reduced_few_01):
    """The few shots of this night repeat lines; with half a ppm the air is what they share most."""
    loud = dataclasses.replace(
        few_01,
        site=few_01.site.model_copy(
            update={"ranging": few_01.site.ranging.model_copy(update={"path_index_fluctuation_ppm": 2.0})}
        ),
    )
    dense, states = (reduce_epoch(loud, s).coordinates for s in (ReductionSettings(), STATES))
    u = np.where(dense.u > 0.0, dense.u, 1.0)
    assert np.abs((states.x - dense.x) / u).max() < 1e-3
    np.testing.assert_allclose(states.u, dense.u, rtol=3e-3)
    assert np.array_equal(states.ranges.thin, dense.ranges.thin)
    quiet = reduced_few_01.coordinates
    assert np.median(dense.u[dense.u > 0] / quiet.u[dense.u > 0]) > 1.2


def test_a_large_night_is_reduced_by_states_and_its_claims_hold(many, reduced_many):
    coordinates = reduced_many.coordinates
    assert reduced_many.electronics["ZY113"].covariance.ndim == 1
    truth = simulate_night(31, **MANY).truth
    dish = [n for n in coordinates.points if n.startswith("DP")]
    rows = coordinates.rows(dish)
    error = coordinates.x[rows] - np.array([truth.points[n] for n in dish])
    assert (
        chi2.ppf(1e-4, 12) < 12 * np.mean((error / coordinates.u[rows]) ** 2) < chi2.ppf(1 - 1e-4, 12)
    )  # tied together
    deviation = np.array([truth.paraboloid.deviations[n] for n in reduced_many.surface.names])
    off = (reduced_many.surface.fit.deviation - deviation) / reduced_many.surface.u_deviation
    assert np.mean(off**2) == pytest.approx(1.0, abs=0.3)
    assert 0.9 < coordinates.variance_factor < 1.1


def test_typed_positions_do_not_determine_the_dishs_pose(many, reduced_many):
    """All that is typed on the dish is moved and turned together, by some millimetres: the answer must not follow.

    As independent positions they would claim to know the dish's place to 10 mm over the root of 190, and pull it.
    """
    turn = 10 * ARCSECOND * np.array([[0.0, -1.0, 0.4], [1.0, 0.0, -0.2], [-0.4, 0.2, 0.0]])

    def moved(mm):
        return tuple(np.array(mm) + [3.0, -4.0, 2.0] + turn @ (np.array(mm) - [0.0, 54e3, 12e3]))

    on_dish = {
        name: t.model_copy(update={"position_mm": moved(t.position_mm)}) if name.startswith("DP") else t
        for name, t in many.targets.items()
    }
    triplets = {
        name: t.model_copy(update={"nominal_position_mm": moved(t.nominal_position_mm)})
        for name, t in many.triplets.items()
    }
    other = dataclasses.replace(many, targets=on_dish, triplets=triplets)
    found = adjust_coordinates(other, reduced_many.phases, reduced_many.electronics, settings=ReductionSettings())
    there = reduced_many.coordinates
    rows = [row for row, name in enumerate(there.points) if name.startswith(("DP", "TR"))]
    assert np.linalg.norm(found.start[rows] - there.start[rows], axis=1).min() > 3e-3
    assert np.abs((found.x[rows] - there.x[rows]) / there.u[rows]).max() < 0.1


def test_prisms_are_blocks_and_shared_parameters_the_border(many, reduced_many):
    network = build_network(many, reduced_many.phases, reduced_many.electronics, settings=ReductionSettings())
    border, at = network.border.columns, network.layout.at
    assert not border[network.layout.columns("DP007")].any()
    for parameter in (Parameter(ParameterKind.ZERO, "ZY113"), Parameter(ParameterKind.ELECTRONICS, "ZY113")):
        assert border[at[parameter]]
    assert border[network.layout.columns("ZY113")].all()
