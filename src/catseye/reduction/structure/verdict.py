"""Verdict on a structure's model.

By its predictions of epochs left out, omissions from its claims, and its inputs' verdicts.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from catseye.reduction.structure.check import LeaveOut
from catseye.verdict import Verdict

LARGEST_RATIO = 1.5  # of departure over claim, epochs left out


def structure_verdict(
    check: LeaveOut | None, *, sources: Mapping[str, Verdict | None], doubts: Sequence[str] = ()
) -> Verdict:
    """Verdict by the epochs left out and the doubts.

    check     epochs left out; None: none was
    sources   verdict of each epoch, by its label
    doubts    notes that the claimed uncertainties are too small, or that a prediction is extrapolated
    """
    return _own_verdict(check).hearing(doubts).resting_on(sources)


def _own_verdict(check: LeaveOut | None) -> Verdict:
    if check is None:
        return Verdict("doubtful", "no epoch was left out to check the model's predictions")
    if not np.isfinite(check.ratio):
        return Verdict("doubtful", "too few epochs to check the model's predictions")
    if check.ratio > LARGEST_RATIO:
        return Verdict(
            "doubtful", f"epochs left out miss their prediction by {check.ratio:.2f} times the claimed uncertainty"
        )
    return Verdict("good", f"epochs left out are predicted as claimed (ratio {check.ratio:.2f})")
