"""Limits: inside of both stops by margin and scatter, whole counts, what cannot be reached."""

import numpy as np
import pytest
from scipy.stats import norm, poisson

from catseye.errors import EstimationError, InputError
from catseye.reduction.calibrations.mirror.limits import RECIPE
from draws import draws
from lab_scene import table

WORDS = {"stop": ["low"] * 3 + ["high"] * 3}
TOUCHES = [-21_809.0, -21_810.0, -21_811.0, 76_190.0, 76_191.0, 76_192.0]


def calibrated(touches=TOUCHES, words=WORDS, reject=False, **sheet):
    return RECIPE.recipe(table(RECIPE, {"azimuth_counts": touches}, words, margin_counts=500.0, **sheet), reject)


def test_limits_stand_inside_of_the_stops_by_the_margin_and_three_deviations_of_a_touch():
    found = calibrated(u_touch_counts=1.0)
    inside = 500 + 3 * (1 + 1 / 3) ** 0.5  # a touch and the mean of three
    assert found.value("az_low_stop_counts") == pytest.approx(-21_810.0)
    assert found.record == {"az_low_limit": -21_306, "az_high_limit": 75_687}
    assert found.record["az_low_limit"] - 1 < -21_810 + inside <= found.record["az_low_limit"]
    assert found.record["az_high_limit"] <= 76_191 - inside < found.record["az_high_limit"] + 1
    assert all(isinstance(v, int) for v in found.record.values())


def test_unstated_scatter_comes_from_the_touches():
    assert calibrated().u("az_low_stop_counts") == pytest.approx(1 / 3**0.5, rel=1e-6)


@draws(2000)
def test_a_touch_to_come_passes_the_limit_as_seldom_where_the_touches_show_the_scatter(runs):
    passed = 0
    for seed in range(runs):
        rng = np.random.default_rng([2, seed])
        stop = np.repeat([-21_810.0, 76_191.0], 2)
        touches = stop + 40.0 * rng.standard_normal(4)  # many counts: the rounding is no help
        words = {"stop": ["low", "low", "high", "high"]}
        record = RECIPE.recipe(table(RECIPE, {"azimuth_counts": touches}, words, margin_counts=0.0), False).record
        passed += -21_810.0 + 40.0 * rng.standard_normal() > record["az_low_limit"]
        passed += 76_191.0 + 40.0 * rng.standard_normal() < record["az_high_limit"]
    # 0.135 % of 4000 are 5.4, and more than 15 of them a chance of 2e-4;
    # with three deviations of so few touches it is 5 %
    assert passed <= poisson.isf(2e-4, 2 * runs * norm.sf(3.0))


def test_the_directions_out_of_reach_are_named_by_theta():
    found = calibrated(u_touch_counts=1.0, na0=2691.0)
    first, last = (75_687 - 2691) * 0.0036, (-21_306 + 100_000 - 2691) * 0.0036
    assert found.notes[0].startswith(f"Theta from {first:.2f} to {last:.2f} degrees is not reached")
    assert found.decisions[0].passed is True
    narrow = calibrated([0.0, 0.0, 0.0, 40_000.0, 40_000.0, 40_000.0], u_touch_counts=1.0)
    assert narrow.decisions[0].passed is False  # less than half a turn: prime does not help everywhere


def test_a_touch_of_another_object_is_rejected_on_request():
    found = calibrated([*TOUCHES, 76_100.0], {"stop": [*WORDS["stop"], "high"]}, True, u_touch_counts=1.0)
    assert found.states[-1] == "rejected"
    assert found.value("az_high_stop_counts") == pytest.approx(76_191.0)


def test_swapped_or_missing_stops_are_refused():
    with pytest.raises(InputError, match=r"nothing is left between .*swapped"):
        calibrated(words={"stop": ["high"] * 3 + ["low"] * 3}, u_touch_counts=1.0)
    with pytest.raises(InputError, match="'high' was never touched"):
        calibrated(words={"stop": ["low"] * 6}, u_touch_counts=1.0)
    with pytest.raises(InputError, match="line 2, stop = 'left' is unknown"):
        calibrated(words={"stop": ["left"] + ["low"] * 5}, u_touch_counts=1.0)
    with pytest.raises(EstimationError, match="show no scatter"):
        calibrated([-100.0, 9000.0], {"stop": ["low", "high"]})
