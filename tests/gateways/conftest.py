"""The reduction of night-01, and what is written of it, made once for all workers."""

import pytest

from kept_scene import reduction_directory
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"


@pytest.fixture(scope="session")
def reduction(reduced_night_01):
    return reduced_night_01


@pytest.fixture(scope="session")
def written():
    """A directory with everything that a reduction writes."""
    return reduction_directory()
