"""The digest changes with the last bit of x, u or covariance, and with nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.estimation.least_squares.covariance import Dense, JointPoints
from catseye.reduction.night import digest as module
from catseye.reduction.night.digest import digest


@pytest.fixture
def reduction(reduced_night_01):
    return reduced_night_01


def changed(reduction, **fields):
    return replace(reduction, coordinates=replace(reduction.coordinates, **fields))


def with_covariance(reduction, row, column):
    """The reduction with one element of its covariance larger by a bit."""
    full = reduction.coordinates.joint.matrix().copy()
    full[row, column] = np.nextafter(full[row, column], 1.0)
    columns = np.arange(len(full)).reshape(-1, 3)
    return changed(reduction, joint=JointPoints(Dense(full), columns))


def test_it_is_a_sha256_of_numbers_alone(reduction):
    assert len(digest(reduction)) == 64
    assert digest(reduction) == digest(changed(reduction, notes=("other",)))
    assert digest(reduction) == digest(reduction.held())


def test_the_last_bit_of_each_number_changes_it(reduction):
    x = reduction.coordinates.x.copy()
    x[-1, -1] = np.nextafter(x[-1, -1], np.inf)
    names = ("other", *reduction.coordinates.points[1:])
    several = [digest(reduction), digest(changed(reduction, x=x)), digest(changed(reduction, points=names))]
    several += [digest(with_covariance(reduction, row, column)) for row, column in ((0, 0), (0, 7), (7, 0))]
    assert len(set(several)) == len(several)


def test_of_a_large_night_it_is_blocks_a_sample_and_what_shots_have_in_common(reduction, monkeypatch):
    monkeypatch.setattr(module, "MOST_POINTS", 10)
    monkeypatch.setattr(module, "SAMPLE", 3)
    before, count = digest(reduction), len(reduction.coordinates.points)
    last = 3 * count - 1
    assert digest(with_covariance(reduction, 3, 4)) != before  # a block
    assert digest(with_covariance(reduction, 0, last)) != before  # of the sample
    name, (value, u) = next(iter(reduction.coordinates.zeros.items()))
    zeros = reduction.coordinates.zeros | {name: (value, np.nextafter(u, 1.0))}
    assert digest(changed(reduction, zeros=zeros)) != before
