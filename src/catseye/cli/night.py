"""The command of a simulated night."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, app
from catseye.cli.terminal import say


@app.command(
    epilog="\b\nExample: catseye night whole-dish\n"
    "Then: catseye reduce whole-dish --out whole-dish-report\n"
    "A small one: catseye night small --dish-prisms 60 --interval-s 14 --again 0\n"
    "At three modulation frequencies: catseye night three --dish-prisms 60 --again 0 --frequency-hz 1500.5e6 "
    "--frequency-hz 1510e6\n"
    'With a wrong record: catseye night wrong --dish-prisms 60 --lie "monument ZY103 1"'
    "\nWith a telescope that bends: catseye night bent --structure structural-model/telescope.toml"
)
def night(  # noqa: PLR0913 - its options are its command line
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="Directory of the campaign: new or empty.")],
    seed: Annotated[int, typer.Option(help="Seed of every draw: the same night each time.")] = 2209,
    dish_prisms: Annotated[int, typer.Option(help="Prisms on the dish; the telescope has 2209.")] = 2209,
    azimuth_deg: Annotated[float, typer.Option(help="Azimuth of the telescope.")] = 145.3,
    elevation_deg: Annotated[float, typer.Option(help="Elevation of the telescope, 5 to 90.")] = 30.0,
    interval_s: Annotated[float, typer.Option(help="Time between two shots of a ranger, s.")] = 8.0,
    again: Annotated[
        float,
        typer.Option(help="Repeat shots of each feed-arm ranger at each prism; a fraction repeats that share."),
    ] = 0.43,
    nature: Annotated[
        float,
        typer.Option(
            help="Strength of air waves, fronts, thermometer lags and thermal expansion: 1 up to natural strength, "
            "0 a steady drift and a rigid telescope."
        ),
    ] = 1.0,
    frequencies_hz: Annotated[
        list[float] | None,
        typer.Option(
            "--frequency-hz",
            metavar="HZ",
            help="Further modulation frequency, 1e9 to 2e9, that every line is also measured at; may repeat. "
            "They resolve whole cycles.",
        ),
    ] = None,
    lies: Annotated[
        list[str] | None,
        typer.Option(
            "--lie",
            metavar='"KIND [NAME] [SIZE]"',
            help="Wrong record or unexpected nature, the truth unchanged; may repeat. "
            "catseye help lying-nights has the kinds.",
        ),
    ] = None,
    structure: Annotated[
        Path | None,
        typer.Option("--structure", metavar="MODEL.toml", help="Structural model that bends the telescope."),
    ] = None,
    json: Json = False,
) -> None:
    """A simulated night of the whole telescope as a campaign: 18 rangers, 2209 prisms, 20 000 shots."""
    from catseye.api.night import night as make
    from catseye.api.result import json_text

    where = make(
        directory,
        seed=seed,
        dish_prisms=dish_prisms,
        azimuth_deg=azimuth_deg,
        elevation_deg=elevation_deg,
        interval_s=interval_s,
        again=again,
        nature=nature,
        frequencies_hz=frequencies_hz or (),
        lies=lies or (),
        structure=structure,
    )
    if json:
        say(json_text({"written": str(where), "seed": seed, "nature": nature, "truth": str(where / "truth.json")}))
    else:
        say(f"Written: {where}/, a campaign; its truth is in truth.json, which no reduction reads")
        say(f"Next:    catseye reduce {where} --out {where}-report")
