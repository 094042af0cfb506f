"""Recipe for positions: many targets, each from its own ranges to known stations."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.estimation.network.positions.dispatch import Positions, positions
from catseye.estimation.network.positions.status import PositionStatus
from catseye.verdict import Verdict


@dataclass(frozen=True, eq=False)
class LocatedTargets:
    """Positions of m targets.

    positions   coordinates, covariances and statuses; nan where there is none
    """

    positions: Positions

    @cached_property
    def found(self) -> np.ndarray:
        """Mask (m,) of targets with a position that its ranges confirm."""
        return np.asarray(self.positions.status == PositionStatus.FOUND)

    @cached_property
    def words(self) -> np.ndarray:
        """Status (m,) of each target: "found", or the problem and its remedy."""
        return np.array([self.positions.text(k) if not good else "found" for k, good in enumerate(self.found)])

    @cached_property
    def verdict(self) -> Verdict:
        """Verdict on the positions: good where all were found and checked."""
        found, words = self.found, self.words
        lost = np.flatnonzero(~found)
        if not found.any():
            return Verdict(
                "failed", f"no target was found; target 0: {words[0]}" if len(words) else "there is no target"
            )
        if len(lost):
            return Verdict(
                "doubtful", f"{len(lost)} of {len(found)} targets were not found; target {lost[0]}: {words[lost[0]]}"
            )
        if not (self.positions.degrees_of_freedom > 0).all():
            return Verdict("doubtful", "some targets have three ranges only, which nothing checks")
        return Verdict("good", "every target was found, and its ranges agree with each other")


def located(
    stations: np.ndarray, ranges: np.ndarray, sigma: np.ndarray, *, near: np.ndarray | None = None
) -> LocatedTargets:
    """Targets located by least squares.

    stations   (n, 3) m
    ranges     (m, n) m, nan where missing
    sigma      m, standard uncertainties: a number, (n,) or (m, n)
    near       (3,) or (m, 3) m, on the target's side of the stations' plane

    Raises InputError for shapes that do not join and for stations that are not finite.
    """
    each = np.full(ranges.shape[1], float(sigma)) if sigma.ndim == 0 else sigma
    return LocatedTargets(positions(stations, ranges, each, near=near))
