"""External reliability against what happens when the error is really made."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.estimation.network.adjustment import adjust_network
from catseye.estimation.network.external import effects_at_ends


@pytest.mark.parametrize("engine", ["dense", "sparse", "ranging"])
def test_detectable_error_moves_its_points_by_the_predicted_amount(ranging_network, engine):
    network, _ = ranging_network(31, stations=8, sigma=1e-6)
    ranges = network.groups[0]
    solution = adjust_network(network, engine=engine)
    said = effects_at_ends(solution)[0]
    for row in (0, 17, 60):
        observed = ranges.observed.copy()
        observed[row] += solution.fits[0].detectable_error[row]
        wrong = adjust_network(replace(network, groups=(replace(ranges, observed=observed),)), engine="dense")
        moved = np.linalg.norm(wrong.x - solution.x, axis=1)
        named = max(moved[ranges.origin[row] // 3], moved[ranges.target[row] // 3])
        assert said[row] == pytest.approx(named, rel=1e-3)
        assert said[row] > 0.3 * moved.max()
