"""`explain`: the range of one shot down to every input."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from catseye.aliases import Progress
from catseye.api.night import campaign_of
from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.errors import ArgumentError
from catseye.names import NOTES_AIR_MODEL

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.records.night.campaign import Campaign
    from catseye.reduction.budget.explanation import Explanation

FEWEST_DRAWS = 1000  # that show a 95 % interval at all
MOST_DRAWS = 10_000_000


@dataclass(frozen=True, eq=False, repr=False)
class ExplanationResult(Result):
    """One shot explained, before any adjustment.

    shot, ranger, target   which
    status        what became of it
    range_        m, as this shot alone gives it; None where it gives none
    u_range       m, standard uncertainty
    explanation   everything else: budget, Monte Carlo, whole cycles, the network's word
    """

    shot: int
    ranger: str
    target: str
    status: str
    range_: float | None
    u_range: float | None
    explanation: "Explanation"
    campaign: "Campaign"
    seed: int | None

    def passages(self) -> "Sequence[Passage]":
        """The shot, its return, its range, cycles, Monte Carlo and the network's word."""
        from catseye.gateways.epoch.explain import explanation_passages

        return explanation_passages(self.explanation)

    def headline(self) -> "Sequence[Passage]":
        """The two passages on the shot and its range."""
        return [p for p in self.passages() if p.title in (f"Shot {self.shot}", "The range")]

    def to_object(self) -> dict[str, Any]:
        """JSON object of `catseye explain --json`."""
        from catseye.gateways.epoch.explain import explanation_object

        return explanation_object(self.explanation, self.seed)

    def tables(self) -> "dict[str, QTable]":
        """`budget`: a row an input; value, u and slope are in each input's own unit, which stands beside it."""
        items, budget = self.explanation.items, self.explanation.budget
        rows = range(len(items) if budget is not None else 0)
        columns = {
            "input": ([items[k].given.name for k in rows], ""),
            "value": ([items[k].given.value for k in rows], ""),
            "u": ([items[k].given.u for k in rows], ""),
            "unit": ([items[k].unit for k in rows], ""),
            "contribution": ([1e6 * budget.contribution[k] for k in rows] if budget is not None else [], "um"),
            "share": ([100.0 * budget.share[k] for k in rows] if budget is not None else [], "%"),
        }
        return {"budget": quantities(columns, shot=self.shot)}

    def figures(self) -> "dict[str, Figure]":
        """Contributions of the inputs and, after a Monte Carlo, its histogram."""
        from catseye.gateways.epoch.explain_figures import figures

        return figures(self.explanation) if self.explanation.budget is not None else {}

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """The page that `--page` writes, as explanation.html, with the table and the JSON."""
        self.write_files(directory, progress, {"explanation.html": self._page})

    def _report(self, when: "datetime") -> "ResultReport":
        """Report of the page that `--page` writes, made at a time, UTC."""
        from catseye.gateways.epoch.explain_page import explanation_report

        return explanation_report(self.explanation, self.campaign, when)

    def _page(self, now: "datetime") -> str:
        from catseye.gateways.writers.report_page import report_page

        return report_page(self._report(now))

    def save_page(self, path: "str | os.PathLike[str]") -> Path:
        """Write the page of the shot, whole or not at all: a new HTML file, or an earlier page of a shot."""
        from datetime import UTC, datetime

        from catseye.gateways.epoch.explain_page import MARK
        from catseye.gateways.writers.output import atomic_file, refuse_suffix

        where = Path(path)
        refuse_suffix(where, "page")
        with atomic_file(where, "page", MARK) as pieces:
            pieces.append(self._page(datetime.now(UTC)))
        return where

    def lines(self) -> list[str]:
        """Table of the budget for a terminal, by share; empty without a range."""
        from catseye.gateways.epoch.explain import budget_lines

        return budget_lines(self.explanation)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of the campaign's files."""
        return self.campaign.hashes

    def sources(self) -> tuple[Path, ...]:
        """Directory of the campaign."""
        return (self.campaign.directory,)


@with_units
def explain(
    campaign: "str | os.PathLike[str] | Campaign",
    shot: Annotated[Any, In("", whole=True)],
    *,
    air_model: str = NOTES_AIR_MODEL,
    monte_carlo: Annotated[Any, In("", whole=True)] = 200_000,
    seed: Annotated[Any, In("", whole=True)] = 1,
    progress: Progress | None = None,
) -> ExplanationResult:
    """The range of one shot and every cause of its uncertainty, before any adjustment.

    campaign      as for `reduce`
    shot          its number in shots.csv
    monte_carlo   draws through the whole chain; 0 for none
    seed          of the draws

    Raises InputError for an unknown shot; ArgumentError for a number of draws that shows no interval.
    """
    from catseye.reduction.budget.explanation import explain_shot
    from catseye.reduction.epoch.settings import ReductionSettings

    night = campaign_of(campaign)
    settings = ReductionSettings(air_model=air_model)
    if monte_carlo != 0 and not FEWEST_DRAWS <= monte_carlo <= MOST_DRAWS:
        raise ArgumentError(
            f"monte_carlo = {monte_carlo} (expected 0, for none, or {FEWEST_DRAWS} to {MOST_DRAWS})", "monte_carlo"
        )
    if seed < 0:
        raise ArgumentError(f"seed = {seed} (expected 0 or more)", "seed")
    explanation = explain_shot(night, shot, settings=settings, draws=monte_carlo, seed=seed, progress=progress)
    return ExplanationResult(
        verdict=explanation.verdict,
        shot=explanation.shot,
        ranger=explanation.ranger,
        target=explanation.target,
        status=str(explanation.status),
        range_=explanation.budget.value if explanation.budget is not None else None,
        u_range=explanation.budget.u if explanation.budget is not None else None,
        explanation=explanation,
        campaign=night,
        seed=seed if monte_carlo else None,
    )


def require_page(page: "Path | None") -> None:
    """Refuse a page that `ExplanationResult.save_page` would refuse, before the long work; None: none."""
    from catseye.gateways.epoch.explain_page import MARK
    from catseye.gateways.writers.output import refuse_file, refuse_suffix

    if page is not None:
        refuse_suffix(page, "page")
        refuse_file(page, "page", MARK)
