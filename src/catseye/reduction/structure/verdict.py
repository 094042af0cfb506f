"""Verdict of a structure's model: its forecasts of epochs left out, what claims leave out, what it rests on."""

from collections.abc import Mapping, Sequence

import numpy as np

from catseye.reduction.structure.check import LeaveOut
from catseye.verdict import Verdict

LARGEST_RATIO = 1.5  # of departure over claim, epochs left out


def structure_verdict(
    check: LeaveOut | None, *, sources: Mapping[str, Verdict | None], doubts: Sequence[str] = ()
) -> Verdict:
    """Whether epochs left out are predicted as the model claims, and what speaks against its claims.

    check     epochs left out; None: none was
    sources   verdict of each epoch, by its label
    doubts    notes that the claimed uncertainties are too small, or that a prediction is extrapolated
    """
    return _own_verdict(check).hearing(doubts).resting_on(sources)


def _own_verdict(check: LeaveOut | None) -> Verdict:
    if check is None:
        return Verdict("doubtful", "no epoch was left out to check what the model foretells")
    if not np.isfinite(check.ratio):
        return Verdict("doubtful", "too few epochs to check what the model foretells")
    if check.ratio > LARGEST_RATIO:
        return Verdict("doubtful", f"epochs left out miss what was foretold {check.ratio:.2f} times as far as claimed")
    return Verdict("good", f"epochs left out are foretold as claimed (ratio {check.ratio:.2f})")
