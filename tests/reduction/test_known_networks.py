"""Networks with answers from elsewhere: a textbook, established programs, an independent solver; see SOURCE."""

import numpy as np
import pytest

from catseye.estimation.network.adjustment import adjust_network
from catseye.records.network.any_file import read_network
from evidence.networks import NETWORKS, answers, ours


def test_baumanns_point():
    solution = adjust_network(read_network(NETWORKS / "baumann3d" / "network.gkf"))
    names, x, u = answers(NETWORKS / "baumann3d" / "expected.csv")
    found, claimed = ours(solution, names)
    assert solution.status == "converged"
    assert np.abs(found - x).max() < 1e-6
    # printed a posteriori: the variance factor applied
    np.testing.assert_allclose(claimed * np.sqrt(solution.variance_factor), u, rtol=3e-4)
    assert solution.degrees_of_freedom == 5


@pytest.mark.parametrize(("epoch", "degrees"), [("phase-0-1TK", 47), ("phase-1-1TK", 70)])
@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_the_metro_tunnel(epoch, degrees, engine):
    solution = adjust_network(read_network(NETWORKS / "monitoring" / f"{epoch}.gkf"), engine=engine)
    names, x, u = answers(NETWORKS / "monitoring" / f"expected-{epoch}.csv")
    found, claimed = ours(solution, names)
    assert solution.status == "converged"
    assert np.abs(found - x).max() < 1e-6
    np.testing.assert_allclose(claimed, u, rtol=3e-4)
    assert solution.degrees_of_freedom == degrees


@pytest.mark.parametrize("engine", ["dense", "sparse", "ranging"])
def test_eighteen_stations_and_five_hundred_targets_from_ranges_alone(engine):
    solution = adjust_network(read_network(NETWORKS / "ranging-18x500"), engine=engine)
    names, x, u = answers(NETWORKS / "ranging-18x500" / "expected.csv")
    found, claimed = ours(solution, names)
    assert solution.status == "converged"
    assert np.abs(found - x).max() < 3e-9
    np.testing.assert_allclose(claimed, u, rtol=1e-4)  # printed with nine decimals, 11 um with five digits
    assert solution.variance_factor * solution.degrees_of_freedom == pytest.approx(7362.7388, abs=1e-4)
    assert solution.degrees_of_freedom == 7452
    redundancy = sum(float(f.redundancy.sum()) for f in solution.fits)
    assert redundancy == pytest.approx(7452, abs=1e-4)
