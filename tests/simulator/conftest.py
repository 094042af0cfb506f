import pytest

from catseye.simulator.night.faults import Faults, Planted
from catseye.simulator.night.simulate import simulate_night

QUIET = ("drift", "warm_up", "index_fluctuation")


@pytest.fixture(scope="session")
def night():
    return simulate_night(11)


@pytest.fixture(scope="session")
def still_night():
    """Without drift, fluctuation and faults: what remains is geometry, air, glass, leakage and white noise."""
    return simulate_night(12, faults=Faults(0.0, 0.0), planted=Planted(ignore=QUIET))
