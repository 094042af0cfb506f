"""The claimed uncertainty of a triplet's H_corr against its scatter over whole sheets with every entry off."""

import numpy as np
import pytest

from catseye.reduction.triplet.unit import reduce_triplet
from triplet_scene import U, noisy_unit

LOUD = U | {"phase": 0.002}  # phases outweigh all else: their average over placements is under test
STILL = U | {"phase": 0.0001}  # what the placements share outweighs


def assert_claim_holds(cases, seed, u):
    rng = np.random.default_rng(seed)
    z, w, chi, degrees = [], [], 0.0, 0
    for _ in range(cases):
        sheet, truth = noisy_unit(rng, u=u)
        found = reduce_triplet(sheet)
        z.append((found.h_corr - truth) / found.u_h_corr)
        w.append(found.difference / found.u_difference)
        chi += found.chi_square
        degrees += found.degrees_of_freedom
    share = 3.5 / np.sqrt(2 * cases)  # of a standard deviation from so many cases, 3.5 sigma
    assert abs(np.mean(z)) < 3.5 / np.sqrt(cases)
    assert np.std(z) == pytest.approx(1.0, abs=share)
    assert np.std(w) == pytest.approx(1.0, abs=share)  # the plate's own, and what it shares with ranging
    assert chi / degrees == pytest.approx(1.0, abs=3.5 * np.sqrt(2 / degrees))


@pytest.mark.parametrize("u", [U, LOUD, STILL], ids=["usual", "loud phases", "still phases"])
def test_the_claimed_uncertainty_is_the_scatter(u):
    assert_claim_holds(150, 5, u)


@pytest.mark.slow
@pytest.mark.parametrize("u", [U, LOUD, STILL], ids=["usual", "loud phases", "still phases"])
def test_the_claimed_uncertainty_is_the_scatter_to_three_percent(u):
    assert_claim_holds(5000, 6, u)
