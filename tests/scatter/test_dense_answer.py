"""States and blocks beside the dense solution, on night-01 and on nights with all that nature does."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.strengths import Processes
from catseye.simulator.night.sheets import write_night
from nature_scene import natural_night

DENSE, STATES = (ReductionSettings(dense_shots=most) for most in (100_000, 0))
QUICK, SLOW = (2201,), range(2202, 2265)


def furthest(campaign, monkeypatch):
    """Largest difference of a coordinate over its u, and the range of the ratios of the u.

    Both have the strengths and the shots that a reduction chose: these two are choices, of a quarter and at a limit,
    and a shot at the limit that one takes and the other does not moves its point by up to three u.
    """
    chosen = reduce_epoch(campaign)
    strength = chosen.coordinates.strength
    monkeypatch.setattr(Processes, "estimated", lambda *of: strength)
    left_out = {int(campaign.shots.shot[k]): reason.text for k, reason in chosen.rejected.items()}
    campaign = replace(campaign, doubted=left_out)
    dense, states = (reduce_epoch(campaign, settings).coordinates for settings in (DENSE, STATES))
    assert dense.ranges.shot.tolist() == states.ranges.shot.tolist()
    assert dense.ranges.used.tolist() == states.ranges.used.tolist()
    known = dense.u > 0.0
    ratio = states.u[known] / dense.u[known]
    return np.abs((states.x - dense.x)[known] / dense.u[known]).max(), ratio.min(), ratio.max()


def assert_the_dense_answer(found):
    moved, low, high = found
    assert moved < 0.03  # modes of the electronics left to the shots' own errors
    assert 0.99 < low <= high < 1.01


def test_night_01_by_states_and_blocks_is_the_dense_answer(night_01, monkeypatch):
    assert_the_dense_answer(furthest(night_01, monkeypatch))


@pytest.mark.parametrize("seed", [*QUICK, *(pytest.param(seed, marks=pytest.mark.slow) for seed in SLOW)])
def test_a_natural_night_by_states_and_blocks_is_the_dense_answer(tmp_path, seed, monkeypatch):
    campaign = read_campaign(write_night(natural_night(seed, 60), tmp_path / "night"))
    assert_the_dense_answer(furthest(campaign, monkeypatch))
