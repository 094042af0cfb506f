"""Night-01 taken apart: its electronics and network, and campaigns made of a part of it."""

import dataclasses

import numpy as np
import pytest

from catseye.records.night.campaign import REFERENCE
from catseye.reduction.epoch.unknowns import build_network


def with_shots(campaign, rows, **columns):
    """The campaign with some rows of its shots, in that order, and columns replaced."""
    shots, rows = campaign.shots, np.asarray(rows)
    rows = np.flatnonzero(rows) if rows.dtype == bool else rows
    picked = {
        f.name: tuple(getattr(shots, f.name)[k] for k in rows)
        if isinstance(getattr(shots, f.name), tuple)
        else getattr(shots, f.name)[rows]
        for f in dataclasses.fields(shots)
    }
    return dataclasses.replace(campaign, shots=dataclasses.replace(shots, **(picked | columns)))


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
    return build_network(night_01, r.phases, r.electronics, r.settings)
