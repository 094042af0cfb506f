"""How often seeded Monte Carlo draws: a third as often in `make test`, as often as it can say most in `make test-all`.

Bounds follow the number of draws by their chance: fewer draws are judged by bounds that a good programme passes as
seldom as those of all draws.
"""

import numpy as np
import pytest
from hypothesis import settings
from scipy.stats import chi2


def draws(full, quick=None, name="runs"):
    """The mark of a test that draws a third, or `quick` times, and in `make test-all` `full` times too."""
    few = full // 3 if quick is None else quick
    return pytest.mark.parametrize(
        name, [pytest.param(few, id="quick"), pytest.param(full, id="full", marks=pytest.mark.slow)]
    )


def examples(full):
    """The settings of a law of which `make test` tries a third of the examples, and `make test-all` all."""
    return settings(deadline=None, max_examples=full if settings.default.max_examples > 100 else max(full // 3, 2))


def same_sigmas(bound, full, runs):
    """Bound of a mean or variance of so many draws, in standard deviations what `bound` is where there are `full`."""
    return bound * np.sqrt(full / runs)


def same_chance(bound, full, degrees):
    """Bound of a mean square of so many degrees of freedom, passed as seldom as `bound` is by that of `full`."""
    if bound < 1.0:
        return chi2.ppf(chi2.cdf(bound * full, full), degrees) / degrees
    return chi2.isf(chi2.sf(bound * full, full), degrees) / degrees
