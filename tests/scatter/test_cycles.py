"""Whole cycles found across a network: as often right as claimed, and the position as uncertain as claimed.

`make test-all` runs 3000 seeded cases of each, `make test` a fifteenth; bounds follow from their number.
"""

import numpy as np
import pytest

from catseye.estimation.ambiguity.search import AmbiguityLimits, AmbiguityStatus, locate

HALF = 0.0999
RUNS = [pytest.param(200, id="quick"), pytest.param(3000, id="full", marks=pytest.mark.slow)]


def drawn(rng, *, ranges, u, sigma, common=0.0, wrong=0.0):
    """Stations, point, lengths with noise of each range and one that all share, whole cycles, wrong ranges."""
    away = rng.normal(size=(ranges, 3))
    away[:, 2] = -np.abs(away[:, 2])
    stations = away / np.linalg.norm(away, axis=1)[:, None] * rng.uniform(50.0, 120.0, (ranges, 1))
    point = u * rng.standard_normal(3)
    noise = sigma * rng.standard_normal(ranges) + common * rng.standard_normal()
    elsewhere = rng.random(ranges) < wrong
    reached = np.linalg.norm(stations - point, axis=1) + np.where(elsewhere, rng.uniform(0.0, HALF, ranges), noise)
    return stations, point, np.mod(reached, HALF), np.floor(reached / HALF), elsewhere


def searched(runs, seed, *, ranges, u, sigma, common=0.0, wrong=0.0):
    """Per run: all cycles of good ranges right, claimed probability, status, squared departure over the covariance."""
    rng = np.random.default_rng(seed)
    c = sigma**2 * np.eye(ranges) + common**2
    right, claimed, status, square = [], [], [], []
    for _ in range(runs):
        stations, point, lengths, cycles, elsewhere = drawn(
            rng, ranges=ranges, u=u, sigma=sigma, common=common, wrong=wrong
        )
        found = locate(
            np.zeros(3),
            u**2 * np.eye(3),
            stations,
            lengths=lengths,
            period=HALF,
            covariance=c,
            limits=AmbiguityLimits(wrong=wrong),
        )
        off = found.x - point
        right.append(np.array_equal(found.cycles[~elsewhere], cycles[~elsewhere]))
        claimed.append(found.probability)
        status.append(found.status)
        square.append(off @ np.linalg.solve(found.covariance, off))
    return np.array(right), np.array(claimed), np.array(status), np.array(square)


@pytest.mark.parametrize("runs", RUNS)
@pytest.mark.parametrize(
    ("ranges", "sigma", "common"),
    [(4, 5e-4, 0.0), (5, 2e-3, 0.0), (6, 2e-3, 3e-3), (6, 1e-3, 0.02)],
    ids=["4", "5", "shared", "much-shared"],
)
def test_the_search_is_right_as_often_as_it_claims(runs, ranges, sigma, common):
    right, claimed, status, _ = searched(runs, ranges, ranges=ranges, u=0.06, sigma=sigma, common=common)
    scatter = np.sqrt(np.mean(claimed * (1 - claimed)) / runs)
    assert 0.3 < np.mean(claimed) < 0.995  # a case that says something
    assert np.mean(right) == pytest.approx(np.mean(claimed), abs=4 * scatter)
    assert right[status == AmbiguityStatus.FOUND].all()


@pytest.mark.parametrize("runs", RUNS)
def test_a_point_that_is_found_is_as_uncertain_as_claimed(runs):
    right, _, status, square = searched(runs, 7, ranges=7, u=0.06, sigma=5e-5, common=1e-4)
    found = status == AmbiguityStatus.FOUND
    assert found.mean() > 0.95
    assert right[found].all()
    assert np.mean(square[found]) == pytest.approx(3.0, abs=4 * np.sqrt(6 / runs))  # chi-square of three


@pytest.mark.parametrize("runs", RUNS)
def test_with_light_from_elsewhere_in_one_range_of_fifty_hardly_any_answer_is_wrong(runs):
    right, claimed, status, _ = searched(runs, 8, ranges=6, u=0.06, sigma=1e-4, wrong=0.02)
    found = status == AmbiguityStatus.FOUND
    assert found.mean() > 0.7
    # each may be wrong once in a thousand, and two wrong ranges, 0.6 % of the cases, are not considered
    assert np.mean(~right[found]) < 0.004 + 4 * np.sqrt(0.001 / runs)
    assert np.mean(claimed[found]) > 0.999
