"""`budget`: the uncertainty of a night's coordinates by kind of input."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.aliases import Progress
from catseye.api.night import campaign_of
from catseye.api.result import Result, quantities
from catseye.errors import ArgumentError
from catseye.names import NOTES_AIR_MODEL

if TYPE_CHECKING:
    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.records.night.campaign import Campaign
    from catseye.reduction.budget.points import PointBudget


@dataclass(frozen=True, eq=False, repr=False)
class BudgetResult(Result):
    """Uncertainty of n points by s kinds of input, in the ground frame (x east, y north, z up; m).

    points         names
    x              (n, 3) m
    u              (n, 3) m, standard uncertainties as `reduce` claims them
    kinds          names of the s kinds: errors of the shots, of the records, and errors in common
    contribution   (s, n, 3) m, what each kind alone would leave; their squares add up to u²
    share          (s, n, 3) of the variance
    parts          everything else: the budget of the coordinates
    campaign       as it was read
    air_model      name of the model of the index
    """

    points: tuple[str, ...]
    x: np.ndarray
    u: np.ndarray
    kinds: tuple[str, ...]
    contribution: np.ndarray
    share: np.ndarray
    parts: "PointBudget"
    campaign: "Campaign"
    air_model: str

    def passages(self) -> "Sequence[Passage]":
        """Sentence a point: its uncertainty, and the largest input of each axis."""
        from catseye.gateways.epoch.budget import budget_passages

        return budget_passages(self.parts)

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye budget --json`."""
        from catseye.gateways.epoch.budget import budget_object

        return budget_object(self.parts)

    def tables(self) -> "dict[str, QTable]":
        """`budget`: a row a point and kind of input."""
        from catseye.gateways.epoch.budget import BUDGET

        return {"budget": quantities(BUDGET.quantities(self.parts, [column.name for column in BUDGET.columns]))}

    def figures(self) -> "dict[str, Figure]":
        """Contributions of the inputs, by axis."""
        from catseye.gateways.epoch.budget import budget_figure

        return {"contributions": budget_figure(self.parts)}

    def rows(self) -> list[str]:
        """Table a point for a terminal."""
        from catseye.gateways.epoch.budget import point_budget_lines

        return point_budget_lines(self.parts)

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write the files of `catseye budget --out`."""
        from catseye.gateways.epoch.budget import write_budget

        write_budget(self.parts, directory, self.campaign.hashes, settings={"air_model": self.air_model})

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the campaign's files."""
        return self.campaign.hashes

    def sources(self) -> tuple[Path, ...]:
        """Directory of the campaign."""
        return (self.campaign.directory,)


def budget(
    campaign: "str | os.PathLike[str] | Campaign",
    points: Sequence[str],
    *,
    air_model: str = NOTES_AIR_MODEL,
    progress: Progress | None = None,
) -> BudgetResult:
    """Uncertainty of a night's coordinates by kind of input, after the adjustment.

    campaign    as for `reduce`
    points      names of points of the night: targets, or scan points of rangers
    air_model   as for `reduce`

    Each part is what one kind of input (noise of the samples, thermometers, monuments, ...) leaves by itself. One shot
    before the adjustment is `explain`. Raises InputError for an unknown point, ArgumentError without any.

    Source: [JCGM102] eq. 3.
    """
    from catseye.reduction.budget.points import budget_of_points
    from catseye.reduction.epoch.settings import ReductionSettings

    names = (points,) if isinstance(points, str) else tuple(points)
    if not names:
        raise ArgumentError("points is empty (expected names of points of the night)", "points")
    night = campaign_of(campaign)
    parts = budget_of_points(night, names, ReductionSettings(air_model=air_model), progress)
    return BudgetResult(
        verdict=parts.verdict,
        points=parts.points,
        x=parts.x,
        u=parts.u,
        kinds=parts.budget.sources,
        contribution=parts.contribution,
        share=parts.share,
        parts=parts,
        campaign=night,
        air_model=air_model,
    )
