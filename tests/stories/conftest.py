"""End to end on written campaigns: simulate, write, read, reduce."""

import itertools

import numpy as np
import pytest

from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.simulator.night.faults import Faults
from catseye.simulator.night.sheets import write_night
from few_scene import with_few_targets
from kept_scene import night_directory, night_of, reduction_of

SEED = 4711
CLEAR = Faults(fraction_blocked=0.0, fraction_reflected=0.0, weak_ranger=None, wrong_position_mm=0.0)


@pytest.fixture(scope="session")
def written(tmp_path_factory):
    """Function night -> campaign, by way of its files."""
    root, count = tmp_path_factory.mktemp("stories"), itertools.count()
    return lambda night: read_campaign(write_night(night, root / f"night-{next(count)}"))


@pytest.fixture(scope="session")
def night():
    """A night with all the usual faults."""
    return night_of(SEED)


@pytest.fixture(scope="session")
def campaign():
    return read_campaign(night_directory(SEED))


@pytest.fixture(scope="session")
def whole():
    """Its reduction."""
    return reduction_of(SEED)


@pytest.fixture(scope="session")
def clear_night():
    """The same site in a night in which nothing was in the way."""
    return night_of(SEED, faults=CLEAR)


@pytest.fixture(scope="session")
def clear():
    """Its campaign and reduction."""
    return read_campaign(night_directory(SEED, faults=CLEAR)), reduction_of(SEED, faults=CLEAR)


def of_few_targets(campaign):
    """The campaign with shots on 44 of its targets, those that the stories name among them."""
    return with_few_targets(campaign, "DP017", "DP021")


@pytest.fixture(scope="session")
def written_few(written):
    """Function night -> campaign with few targets."""
    return lambda night: of_few_targets(written(night))


@pytest.fixture(scope="session")
def few(campaign):
    """Reduction of the night with all the usual faults, of few targets."""
    return reduce_epoch(of_few_targets(campaign))


@pytest.fixture(scope="session")
def few_clear():
    """Campaign and reduction of the clear night, of few targets."""
    campaign = of_few_targets(read_campaign(night_directory(SEED, faults=CLEAR)))
    return campaign, reduce_epoch(campaign)


@pytest.fixture(scope="session")
def errors():
    """Function (coordinates, truth, names) -> found minus true, (k, 3) m."""
    return lambda c, truth, names: np.array([c.x[c.index(n)] - truth.points[n] for n in names])


@pytest.fixture(scope="session")
def u():
    """Function (coordinates, name) -> (3,) standard uncertainties, m."""
    return lambda c, name: np.sqrt(np.diag(c.block([name])))
