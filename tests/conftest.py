"""What tests of every room share: the example night, read and reduced once."""

import gc

import pytest
from hypothesis import settings

from repository import ROOT

settings.register_profile("seeded", derandomize=True, deadline=None, max_examples=50)  # the same on every machine
settings.register_profile("explore", deadline=None, max_examples=300)  # for `make test-all`
settings.load_profile("seeded")

gc.set_threshold(20_000, 20, 50)  # what a test leaves is little beside what all the modules hold, which it walks over


def pytest_configure(config):
    """One of several workers."""
    if hasattr(config, "workerinput"):
        from kept_scene import compile_once

        compile_once()


def pytest_collection_modifyitems(items):
    """First those that wait for processes most of their time, while types are checked beside them."""
    items.sort(key=lambda item: not item.nodeid.startswith(("tests/faults/", "tests/cli/live/")))


def pytest_collection_finish():
    """What was imported stays: the collector need not walk over it again and again."""
    gc.collect()
    gc.freeze()


EXAMPLE = ROOT / "examples" / "night-01"


@pytest.fixture(scope="session")
def night_01():
    """The campaign that ships with catseye."""
    from catseye.records.night.campaign import read_campaign

    return read_campaign(EXAMPLE)


@pytest.fixture(scope="session")
def reduced_night_01():
    """Its reduction with default settings."""
    from kept_scene import reduction_of_example

    return reduction_of_example()


@pytest.fixture(scope="session")
def ranging_network():
    """A function that makes networks of ranges: stations about targets, all free, stations marked as the datum."""
    import numpy as np

    from catseye.estimation.network.model import NetworkPoints, ObservationNetwork
    from catseye.estimation.observations.kinds import Distances

    def made(seed=0, *, stations=6, targets=12, sigma=5e-5, size=100.0, off=0.01, seen=1.0, flat=False):
        """The network and its true coordinates (n, 3); `off` is how wrong its given coordinates are, over the size."""
        rng = np.random.default_rng(seed)
        angle = 2 * np.pi * np.arange(stations) / stations
        ring = np.stack([np.cos(angle), np.sin(angle), 0.3 * rng.uniform(-1, 1, stations)], axis=1)
        cloud = rng.uniform(-0.5, 0.5, (targets, 3)) + np.array([0.0, 0.0, 0.5])
        true = size * np.concatenate([ring, cloud])
        if flat:
            true[:, 2] = 0.0
        pairs = np.stack(np.meshgrid(np.arange(stations), stations + np.arange(targets), indexing="ij"), -1)
        pairs = pairs.reshape(-1, 2)
        pairs = pairs[rng.random(len(pairs)) < seen]
        length = np.linalg.norm(true[pairs[:, 1]] - true[pairs[:, 0]], axis=1)
        ranges = Distances(
            "ranges",
            length + sigma * rng.standard_normal(len(length)),
            np.full(len(length), sigma**2),
            3 * pairs[:, 0],
            3 * pairs[:, 1],
        )
        names = (*(f"S{i + 1:02d}" for i in range(stations)), *(f"T{i + 1:03d}" for i in range(targets)))
        given = true + off * size / 100.0 * rng.standard_normal(true.shape)
        datum = np.zeros(true.shape, dtype=bool)
        datum[:stations] = True
        return ObservationNetwork(NetworkPoints(names, given, np.zeros_like(datum), datum), (), (ranges,)), true

    return made


def pytest_terminal_summary(terminalreporter):
    """Say plainly that browsers were not tried."""
    skipped = [r for r in terminalreporter.stats.get("skipped", []) if "browser tests: " in str(r.longrepr)]
    if skipped:
        terminalreporter.write_line(f"{len(skipped)} browser tests SKIPPED: no chromium (expected Debian's)")
