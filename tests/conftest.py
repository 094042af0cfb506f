"""What tests of every room share: the example night, read and reduced once."""

from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("seeded", derandomize=True, deadline=None)  # the same examples on every machine
settings.register_profile("explore", deadline=None, max_examples=300)  # for `make test-all`
settings.load_profile("seeded")

EXAMPLE = Path(__file__).parents[1] / "examples" / "night-01"


@pytest.fixture(scope="session")
def night_01():
    """The campaign that ships with catseye."""
    from catseye.records.campaign import read_campaign

    return read_campaign(EXAMPLE)


@pytest.fixture(scope="session")
def reduced_night_01(night_01):
    """Its reduction with default settings."""
    from catseye.reduction.epoch import reduce_epoch

    return reduce_epoch(night_01)
