"""States and blocks beside the dense solution, on night-01 and on nights with all that nature does."""

import numpy as np
import pytest

from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.simulator.night.sheets import write_night
from nature_scene import natural_night

STATES = ReductionSettings(dense_shots=0)
QUICK, SLOW = (2201,), range(2202, 2265)


def furthest(campaign):
    """Largest difference of a coordinate over its u, and the range of the ratios of the u."""
    dense, states = (reduce_epoch(campaign, settings).coordinates for settings in (ReductionSettings(), STATES))
    known = dense.u > 0.0
    ratio = states.u[known] / dense.u[known]
    return np.abs((states.x - dense.x)[known] / dense.u[known]).max(), ratio.min(), ratio.max()


def assert_the_dense_answer(found):
    moved, low, high = found
    assert moved < 0.03  # each finds its own strengths, from tests that differ by rounding
    assert 0.99 < low <= high < 1.01


def test_night_01_by_states_and_blocks_is_the_dense_answer(night_01):
    assert_the_dense_answer(furthest(night_01))


@pytest.mark.parametrize("seed", [*QUICK, *(pytest.param(seed, marks=pytest.mark.slow) for seed in SLOW)])
def test_a_natural_night_by_states_and_blocks_is_the_dense_answer(tmp_path, seed):
    assert_the_dense_answer(furthest(read_campaign(write_night(natural_night(seed, 60), tmp_path / "night"))))
