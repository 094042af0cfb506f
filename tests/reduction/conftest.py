"""Night-01 taken apart: its electronics and network, and campaigns made of a part of it."""

import numpy as np
import pytest

from catseye.records.night.campaign import REFERENCE
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.unknowns import build_network
from few_scene import with_few_targets, with_shots


@pytest.fixture(scope="session")
def part():
    """Function (campaign, rows, **columns) -> campaign."""
    return with_shots


@pytest.fixture(scope="session")
def rangers_01(night_01):
    """Ranger of every shot."""
    return np.array(night_01.shots.ranger)


@pytest.fixture(scope="session")
def targets_01(night_01):
    """Target of every shot."""
    return np.array(night_01.shots.target)


@pytest.fixture(scope="session")
def references_01(targets_01):
    """Which shots are on the internal cube."""
    return targets_01 == REFERENCE


@pytest.fixture(scope="session")
def network_01(night_01, reduced_night_01):
    r = reduced_night_01
    return build_network(night_01, r.phases, r.electronics, settings=r.settings)


@pytest.fixture(scope="session")
def few_01(night_01):
    """Night-01 with 42 of its 107 targets."""
    return with_few_targets(night_01)


@pytest.fixture(scope="session")
def reduced_few_01(few_01):
    """Its reduction with default settings."""
    return reduce_epoch(few_01)


@pytest.fixture(scope="session")
def few_rangers(few_01):
    """Ranger of every shot."""
    return np.array(few_01.shots.ranger)


@pytest.fixture(scope="session")
def few_targets(few_01):
    """Target of every shot."""
    return np.array(few_01.shots.target)


@pytest.fixture(scope="session")
def few_references(few_targets):
    """Which shots are on the internal cube."""
    return few_targets == REFERENCE
