"""The commands of uncertainty by input: explain a shot, budget of points."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import AirModel, Json, Quiet, app
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine
from catseye.cli.vocabularies import AIR_MODEL

FEWEST, MOST = 1000, 10_000_000  # draws, as in catseye.api.budget.shot


def _draws(value: int) -> int:
    if value != 0 and not FEWEST <= value <= MOST:
        raise typer.BadParameter(f"{value} is not 0, for none, nor between {FEWEST} and {MOST} draws.")
    return value


@app.command(epilog="\b\nExample: catseye explain examples/night-01 300 --page shot-300.html")
def explain(  # noqa: PLR0913 - its options are its command line
    campaign: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN", help="Directory of a campaign, laid out as examples/night-01.")
    ],
    shot: Annotated[int, typer.Argument(metavar="SHOT", help="Number of the shot in shots.csv.")],
    page: Annotated[
        Path | None,
        typer.Option("--page", metavar="FILE.html", help="HTML page to write: new, or an earlier one of this command."),
    ] = None,
    monte_carlo: Annotated[
        int, typer.Option("--monte-carlo", metavar="N", callback=_draws, help="Draws of the Monte Carlo; 0 for none.")
    ] = 200_000,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the draws.")] = 1,
    air_model: AirModel = AIR_MODEL,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """The range of one shot and every cause of its uncertainty, before any adjustment."""
    from catseye.api.budget.shot import explain as explained
    from catseye.api.budget.shot import require_page

    require_page(page)
    progress = ProgressLine(quiet)
    try:
        result = explained(campaign, shot, air_model=air_model, monte_carlo=monte_carlo, seed=seed, progress=progress)
        if page is not None:
            result.save_page(page)
    finally:
        progress.clear()
    lines = result.lines()
    rows = [*(["", *lines] if lines else []), *([] if page is None else [""])]
    tell(result, json=json, quiet=quiet, strict=strict, rows=rows, written=[("Written to", page)])


@app.command(epilog="\b\nExample: catseye budget examples/night-01 DP012 ZY113 --out budget")
def budget(
    campaign: Annotated[
        Path, typer.Argument(metavar="CAMPAIGN", help="Directory of a campaign, laid out as examples/night-01.")
    ],
    points: Annotated[
        list[str], typer.Argument(metavar="POINT ...", help="Points of the night: targets, or scan points of rangers.")
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
    ] = None,
    air_model: AirModel = AIR_MODEL,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Uncertainty of a night's coordinates by kind of input, after the adjustment."""
    from catseye.api.budget.points import budget as budget_of
    from catseye.api.result import require_writable, save

    require_writable(out, campaign)
    progress = ProgressLine(quiet)
    try:
        result = budget_of(campaign, points, air_model=air_model, progress=progress)
        if out is not None:
            save(result, out)
    finally:
        progress.clear()
    tell(result, json=json, quiet=quiet, strict=strict, rows=["", *result.rows()], written=[("Written to", out)])
