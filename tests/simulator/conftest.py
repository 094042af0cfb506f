import pytest

from catseye.simulator.night.faults import Faults, Planted
from kept_scene import night_of

QUIET = ("drift", "warm_up", "index_fluctuation")


@pytest.fixture(scope="session")
def night():
    return night_of(11)


@pytest.fixture(scope="session")
def still_night():
    """Without drift, fluctuation and faults: what remains is geometry, air, glass, leakage and white noise."""
    return night_of(12, faults=Faults(0.0, 0.0), planted=Planted(ignore=QUIET))
