"""Deformation between two adjusted epochs as JSON and CSV, in the axes of the first epoch's file."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.estimation.deformation.comparison import PointMovements
from catseye.estimation.deformation.congruence import VarianceFactor
from catseye.estimation.deformation.deformation import CongruenceTest, Deformation
from catseye.gateways.network.findings import Findings, in_file_axes
from catseye.gateways.network.summary import verdict
from catseye.gateways.writers.objects import plain
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.verdict import Verdict

FORMAT = "catseye-comparison-1"
NAMED = 8  # points named in sentences
SMALLEST = np.finfo(float).tiny  # smaller probabilities are zero in double precision
UNTESTED = "not checked"


@dataclass(frozen=True, eq=False)
class ComparedEpochs:
    """Two epochs and the deformation between them.

    first, second   adjustments
    moved           deformation of the common points, in x east, y north, z up
    """

    first: Findings
    second: Findings
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


def comparison_verdict(compared: ComparedEpochs) -> Verdict:
    """Verdict of a comparison: at most that of its epochs; doubtful if a point or the search is.

    compared   two epochs
    """
    moved = [name for name, word in zip(compared.deformation.names, compared.verdicts, strict=True) if word == "moved"]
    for which, epoch in (("first", compared.first), ("second", compared.second)):
        judged = verdict(epoch)
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


def comparison_object(compared: ComparedEpochs) -> dict[str, Any]:
    """Object that `catseye adjust A B --json` prints; SI units.

    compared   two epochs
    """
    d, factor = compared.deformation, compared.variance_factor
    columns = zip(
        d.names,
        compared.displacement,
        compared.covariance,
        compared.u,
        compared.length,
        *compared.difference,
        d.statistic,
        d.p,
        d.p_adjusted,
        d.detectable,
        compared.verdicts,
        strict=True,
    )
    keys = (
        "displacement",
        "covariance",
        "u",
        "length",
        "difference",
        "difference_covariance",
        "statistic",
        "p",
        "p_adjusted",
        "detectable",
        "verdict",
    )
    return plain(
        {
            "format": FORMAT,
            "verdict": comparison_verdict(compared).to_object(),
            "status": d.status,
            "axes": list(compared.first.network.axis_names),
            "datum": d.datum,
            "level": d.level,
            "power": d.power,
            "words": list(compared.moved.words),
            "carried": list(compared.moved.carried),
            "frame": list(compared.moved.frame),
            "apart": compared.moved.apart,
            "conclusive": d.conclusive,
            "homogeneity": compared.moved.homogeneity,
            "variance_factor": factor.value,
            "variance_factor_degrees_of_freedom": factor.degrees_of_freedom,  # null: known
            "congruence": {"all": _test(d.before), "stable": _test(d.after)},
            "moved": [name for name, verdict in zip(d.names, compared.verdicts, strict=True) if verdict == "moved"],
            "stable": [name for name, verdict in zip(d.names, compared.verdicts, strict=True) if verdict == "stable"],
            "steps": [vars(step) for step in d.steps],
            "points": {
                name: {**dict(zip(keys, values, strict=True)), "moved": values[-1] == "moved"}
                for name, *values in columns
            },
            "epochs": [_epoch(compared.first), _epoch(compared.second)],
        }
    )


def _test(test: CongruenceTest) -> dict[str, Any]:
    return {"statistic": test.pvv, "degrees_of_freedom": test.degrees_of_freedom, "p": test.p}


def _epoch(epoch: Findings) -> dict[str, Any]:
    solution = epoch.solution
    return {
        "source": epoch.network.source,
        "status": solution.status,
        "datum": solution.datum,
        "variance_factor": solution.variance_factor,
        "degrees_of_freedom": solution.degrees_of_freedom,
        "suspects": epoch.suspects,
    }


def comparison_passages(compared: ComparedEpochs) -> list[Passage]:
    """Summary of movements and assumptions, in sentences.

    compared   two epochs
    """
    d = compared.deformation
    passages = [Passage("Movements", f"{d.status[0].upper()}{d.status[1:]}.")]
    for i, (name, word) in enumerate(zip(d.names, compared.verdicts, strict=True)):
        if word in ("moved", "undecided") and len(passages) <= NAMED:
            parts = ", ".join(
                f"d{axis} {value / MILLIMETRE:+.3f} (u {u / MILLIMETRE:.3f})"
                for axis, value, u in zip(
                    compared.first.network.axis_names, compared.displacement[i], compared.u[i], strict=True
                )
                if np.isfinite(value)
            )
            chance = f"p = {d.p[i]:.2g}" if d.p[i] > 0.0 else f"p < {SMALLEST:.0e}"
            passages.append(Passage(name, f"{parts} mm; probability by chance {chance}."))
    count = sum(word in ("moved", "undecided") for word in compared.verdicts)
    if count > NAMED:
        passages.append(Passage("Others", f"{count - NAMED} more points moved or are undecided."))
    words = [word for word in compared.moved.words if word != d.status]
    return passages + (
        [Passage("Assumed", " ".join(f"{word[0].upper()}{word[1:]}." for word in words))] if words else []
    )
