"""Two adjusted epochs compared, in the axes of the first epoch's file."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.estimation.deformation.comparison import ComparisonOptions, PointMovements, compare
from catseye.estimation.deformation.congruence import VarianceFactor
from catseye.estimation.deformation.deformation import Deformation
from catseye.reduction.network.adjusted import AdjustedNetwork
from catseye.reduction.network.observations import in_file_axes
from catseye.verdict import Verdict

NAMED = 8  # moved points named in a sentence
UNTESTED = "not checked"


@dataclass(frozen=True, eq=False)
class ComparedEpochs:
    """Two epochs and the deformation between them.

    first, second   adjustments
    moved           deformation of the common points, in x east, y north, z up
    """

    first: AdjustedNetwork
    second: AdjustedNetwork
    moved: PointMovements

    @property
    def deformation(self) -> Deformation:
        return self.moved.deformation

    @property
    def variance_factor(self) -> VarianceFactor:
        """Variance factor of both epochs together, known (1) or estimated."""
        return self.moved.variance_factor

    @cached_property
    def rows(self) -> np.ndarray:
        """Rows of the common points in the first epoch, (n,)."""
        return np.array([self.first.solution.index[name] for name in self.deformation.names], dtype=int)

    @cached_property
    def displacement(self) -> np.ndarray:
        """Displacements in the axes of the file, (n, 3) m."""
        return in_file_axes(self.first.network, self.deformation.displacement, self.deformation.covariance)[0]

    @cached_property
    def covariance(self) -> np.ndarray:
        """Covariance of the displacements, (n, 3, 3) m^2."""
        return in_file_axes(self.first.network, self.deformation.displacement, self.deformation.covariance)[1]

    @cached_property
    def u(self) -> np.ndarray:
        """Standard uncertainties of the displacements, (n, 3) m."""
        return np.sqrt(np.maximum(np.diagonal(self.covariance, axis1=1, axis2=2), 0.0))

    @cached_property
    def difference(self) -> tuple[np.ndarray, np.ndarray]:
        """Plain difference of coordinates (n, 3) and its covariance (n, 3, 3), in the file's axes."""
        return in_file_axes(self.first.network, self.moved.difference, self.moved.difference_covariance)

    @cached_property
    def length(self) -> np.ndarray:
        """Length of the known components of the displacements, (n,) m; nan if none."""
        finite = np.isfinite(self.displacement)
        size = np.sqrt(np.sum(np.where(finite, self.displacement, 0.0) ** 2, axis=1))
        return np.where(finite.any(axis=1), size, np.nan)

    @cached_property
    def verdicts(self) -> list[str]:
        """Verdict on each point: moved, stable, held, unchecked or undecided.

        If the search has no conclusion, a point that differs from the others significantly is not called stable.
        """
        d = self.deformation
        open_ = np.full(len(d.names), not d.conclusive) & (d.p_adjusted < d.level)
        return [
            "held"
            if fixed
            else "moved"
            if moved
            else "undecided"
            if doubt
            else "stable"
            if np.isfinite(p)
            else UNTESTED
            for fixed, moved, doubt, p in zip(d.held, d.moved, open_, d.p, strict=True)
        ]

    @cached_property
    def verdict(self) -> Verdict:
        """Verdict of the comparison: at most that of its epochs; doubtful if a point or the search is."""
        return _verdict(self)


def compared(
    first: AdjustedNetwork,
    second: AdjustedNetwork,
    *,
    points: Sequence[str] | None = None,
    level: float = 0.05,
    power: float = 0.8,
    scale_by_variance_factor: bool = False,
) -> ComparedEpochs:
    """Two epochs of a network compared.

    first, second   adjustments
    points          names to compare; None: all common ones
    level           of the tests
    power           with which they find a displacement of the detectable size
    scale_by_variance_factor   multiply covariances by the variance factor of both epochs together; F tests

    Raises EstimationError where the two have too little in common.
    """
    options = ComparisonOptions(level=level, power=power, scale_by_variance_factor=scale_by_variance_factor)
    return ComparedEpochs(first, second, compare(first.solution, second.solution, points=points, options=options))


def _verdict(compared: ComparedEpochs) -> Verdict:
    moved = [name for name, word in zip(compared.deformation.names, compared.verdicts, strict=True) if word == "moved"]
    for which, epoch in (("first", compared.first), ("second", compared.second)):
        judged = epoch.verdict
        if judged.word != "good":
            return Verdict(judged.word, f"the {which} epoch: {judged.why}")
    if not np.isfinite(compared.deformation.p).any():
        return Verdict("doubtful", "no test possible: no displacement has an uncertainty")
    text = "no point moved significantly"
    if moved:
        named = ", ".join(moved[:NAMED]) + (f" and {len(moved) - NAMED} more" if len(moved) > NAMED else "")
        text = f"significant movement of {named}"
    doubts = compared.moved.doubts
    if doubts:
        return Verdict("doubtful", "; ".join([*doubts, *([text] if compared.deformation.conclusive else [])]))
    return Verdict("good", f"both epochs are good{';' if moved else ', and'} {text}")
