"""The command of one range: explain."""

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from catseye.cli.commands import AirModel, Json, Quiet, app
from catseye.cli.results import Strict, judge
from catseye.cli.terminal import ProgressLine, say, wrapped
from catseye.reduction.epoch.settings import ReductionSettings

if TYPE_CHECKING:
    from catseye.records.night.campaign import Campaign
    from catseye.reduction.budget.explanation import Explanation

FEWEST = 1000  # draws that show a 95 % interval at all
MOST = 10_000_000


def _draws(value: int) -> int:
    if value != 0 and not FEWEST <= value <= MOST:
        raise typer.BadParameter(f"{value} is not 0, for none, nor between {FEWEST} and {MOST} draws.")
    return value


@app.command(epilog="\b\nExample: catseye explain examples/night-01 300 --page shot-300.html")
def explain(  # noqa: PLR0913 - its options are its command line
    campaign: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN", help="Directory of a campaign, laid out as examples/night-01.")
    ],
    shot: Annotated[int, typer.Argument(metavar="SHOT", help="Its number in shots.csv.")],
    page: Annotated[
        Path | None, typer.Option("--page", metavar="FILE.html", help="Page to write: new, or an earlier one of these.")
    ] = None,
    monte_carlo: Annotated[
        int, typer.Option("--monte-carlo", metavar="N", callback=_draws, help="Draws of the Monte Carlo; 0 for none.")
    ] = 200_000,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the draws.")] = 1,
    air_model: AirModel = ReductionSettings.air_model,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """The range of one shot and every cause of its uncertainty, before any adjustment."""
    progress = ProgressLine(quiet)
    try:
        from catseye.records.night.campaign import read_campaign
        from catseye.reduction.budget.explanation import explain_shot

        settings = ReductionSettings(air_model=air_model)
        with _page(page) as pieces:  # refused before the work, not after it
            night = read_campaign(campaign)
            explanation = explain_shot(night, shot, settings=settings, draws=monte_carlo, seed=seed, progress=progress)
            if page is not None:
                pieces.append(_page_of(explanation, night))
    finally:
        progress.clear()
    if json:
        from catseye.gateways.epoch.explain import explanation_object
        from catseye.gateways.writers.objects import json_line

        say(json_line(explanation_object(explanation, seed if monte_carlo else None)))
    elif not quiet:
        _tell(explanation, page)
    if strict:
        judge(explanation.verdict, strict=strict)


def _page(page: Path | None) -> AbstractContextManager[list[str]]:
    if page is None:
        return nullcontext([])
    from catseye.gateways.epoch.explain_page import MARK
    from catseye.gateways.writers.output import atomic_file, refuse_suffix

    refuse_suffix(page, "--page")
    return atomic_file(page, "--page", MARK)


def _page_of(explanation: "Explanation", night: "Campaign") -> str:
    from datetime import UTC, datetime

    from catseye.gateways.epoch.explain_page import explanation_page

    return explanation_page(explanation, night, datetime.now(UTC))


def _tell(explanation: "Explanation", page: Path | None) -> None:
    from catseye.gateways.epoch.explain import budget_lines, explanation_passages

    say(wrapped("Verdict", explanation.verdict.text))
    for passage in explanation_passages(explanation):
        say(wrapped(passage.title, passage.text))
    lines = budget_lines(explanation)
    if lines:
        say("\n" + "\n".join(lines))
    if page is not None:
        say("\n" + wrapped("Written to", str(page)))
