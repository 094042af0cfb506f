import pytest

from catseye.gateways.epoch.files import write_reduction
from catseye.gateways.writers.output import whole_directory
from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.epoch import reduce_epoch
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"


@pytest.fixture(scope="session")
def reduction():
    return reduce_epoch(read_campaign(NIGHT))


@pytest.fixture(scope="session")
def written(reduction, tmp_path_factory):
    """A directory with everything that a reduction writes."""
    out = tmp_path_factory.mktemp("written") / "out"
    with whole_directory(out, NIGHT) as directory:
        write_reduction(reduction, directory)
    return out
