"""Budget of the coordinates: its parts against the claimed covariance, and against nights with one record changed."""

import dataclasses

import numpy as np
import pytest

from catseye.reduction.budget.network import (
    ALLOWANCE,
    FLUCTUATION,
    NOISE,
    WALK,
    network_budget,
    point_functions,
)
from catseye.reduction.epoch.allowance import Allowance
from catseye.reduction.epoch.coordinates import settled_network
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.head import IMAGE, LASER
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.settings import ReductionSettings

ARM = tuple(f"ZY{number}" for number in range(113, 119))


def settled_night(reduction):
    return settled_network(reduction.campaign, reduction.phases, reduction.electronics, settings=reduction.settings)[0]


@pytest.fixture(scope="module")
def settled(reduced_few_01):
    return settled_night(reduced_few_01)


def mean_of(points):
    """Weights (3, 3n) of the mean place of n points."""
    return np.tile(np.eye(3), len(points)) / len(points)


def mean_place(coordinates):
    return np.mean([coordinates.x[coordinates.index(name)] for name in ARM], axis=0)


def test_parts_add_up_to_the_claimed_variance(settled, reduced_few_01):
    """One prism, the mean of the arm, the height between two rangers; derivatives are of the last pass but one."""
    coordinates = reduced_few_01.coordinates
    prism = next(n for n in coordinates.points if n.startswith("DP"))
    points = (*ARM, prism)
    weights = np.zeros((7, 21))
    weights[:3, :18], weights[3:6, 18:] = mean_of(ARM), np.eye(3)
    weights[6, [2, 5]] = -1.0, 1.0
    budget = network_budget(settled, point_functions(settled.network, points, weights))
    claimed = np.einsum("ki,ij,kj->k", weights, coordinates.block(points), weights)
    np.testing.assert_allclose(budget.total, claimed, rtol=1e-9)
    np.testing.assert_allclose(budget.variance.sum(axis=0), claimed, rtol=1e-3)  # settled to 0.02 of u
    assert budget.variance.min() >= 0.0
    np.testing.assert_allclose(budget.share.sum(axis=0), 1.0, rtol=1e-3)


def test_thermometers_off_by_their_u_move_the_arm_by_their_part(few_01, settled, reduced_few_01):
    """Each station's readings moved by one u and the night reduced anew: squares of the shifts add up to the part."""
    field, before = settled.network.field, mean_place(reduced_few_01.coordinates)
    weather, squares = few_01.weather, np.zeros(3)
    for station, u in zip(field.stations, field.sigmas, strict=False):
        own = np.array([name == station for name in weather.station])
        moved = dataclasses.replace(weather, temperature_c=weather.temperature_c + np.where(own, u, 0.0))
        again = reduce_epoch(dataclasses.replace(few_01, weather=moved)).coordinates
        squares += (mean_place(again) - before) ** 2
    budget = network_budget(settled, point_functions(settled.network, ARM, mean_of(ARM)))
    part = budget.variance[budget.sources.index("thermometers")]
    assert part[2] > 0.3 * budget.total[2]  # up, they are the largest input
    np.testing.assert_allclose(np.sqrt(squares), np.sqrt(part), rtol=0.05, atol=2e-6)  # m: settled to 0.02 of u


def test_the_states_of_a_large_night_have_the_sources_of_a_small_one(few_01, settled):
    """The walk of the electronics as parameters, not as a covariance: the same parts but for weak modes."""
    large = settled_night(reduce_epoch(few_01, ReductionSettings(dense_shots=0)))
    assert large.network.states
    budgets = [network_budget(s, point_functions(s.network, ARM, mean_of(ARM))) for s in (settled, large)]
    assert set(budgets[0].sources) == set(budgets[1].sources)
    for source in (NOISE, WALK, FLUCTUATION, "monuments", "thermometers"):
        small, big = (np.sqrt(b.variance[b.sources.index(source)]) for b in budgets)
        assert np.all(np.abs(small - big) < 0.02 * budgets[0].u), source


def test_an_allowance_for_a_wrong_thermometer_is_a_source(settled):
    held = frozenset({Parameter(ParameterKind.THERMOMETER, "WX2")})
    allowance = Allowance(held=held, thermometers={"WX2": 1.0})
    lenient = settled._replace(network=dataclasses.replace(settled.network, allowance=allowance))
    budget = network_budget(lenient, point_functions(lenient.network, ARM, mean_of(ARM)))
    assert budget.share[budget.sources.index(ALLOWANCE), 2] > 0.3
    np.testing.assert_allclose(budget.share.sum(axis=0), 1.0, rtol=1e-3)


def test_what_a_head_adds_to_each_shot_has_lines_of_its_own(few_01, settled):
    """Not the line of the air: fringes of the laser and images on the detector, in the ratio of their variances."""
    added = {"u_feedback_rad": 0.4e-3, "detector_radius_mm": 0.1, "detector_lag_rad": 0.04, "u_image_um": 10.0}
    mirrors = {zp: mirror.model_copy(update=added) for zp, mirror in few_01.mirrors.items()}
    noisy = settled_night(reduce_epoch(dataclasses.replace(few_01, mirrors=mirrors)))
    budget = network_budget(noisy, point_functions(noisy.network, ARM, mean_of(ARM)))
    plain = network_budget(settled, point_functions(settled.network, ARM, mean_of(ARM)))
    assert not {LASER, IMAGE} & set(plain.sources)
    laser, image, air = (budget.variance[budget.sources.index(name)] for name in (LASER, IMAGE, FLUCTUATION))
    np.testing.assert_allclose(image / laser, (2 * 0.04 * 0.1**2 / 0.4e-3) ** 2, rtol=1e-6)  # 0.8 and 0.4 mrad
    np.testing.assert_allclose(air, plain.variance[plain.sources.index(FLUCTUATION)], rtol=0.2)
    np.testing.assert_allclose(budget.share.sum(axis=0), 1.0, rtol=1e-3)
