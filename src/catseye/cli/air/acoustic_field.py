"""The command of an array of loudspeakers and microphones."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import AirModel, Json, Quiet, app
from catseye.cli.results import Strict, tell
from catseye.cli.vocabularies import THERMOMETRY_MODELS, one_of
from catseye.names import AIR_MODEL


@app.command(
    epilog="\b\nExample: catseye acoustic-field examples/acoustic/array-stations.csv examples/acoustic/array-times.csv "
    "--out array\n"
    "Layouts of STATIONS, TIMES and SHEET: catseye help formats/acoustic"
)
def acoustic_field(  # noqa: PLR0913 - its options are its command line
    stations: Annotated[
        Path, typer.Argument(metavar="STATIONS.csv", help="Places of loudspeakers and microphones, m.")
    ],
    times: Annotated[
        Path, typer.Argument(metavar="TIMES.csv", help="Travel times between them, in one direction or both.")
    ],
    sheet: Annotated[
        Path | None,
        typer.Option(
            "--sheet", metavar="SHEET.toml", help="Weather, equipment, expected variation; TIMES.toml if not given."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Directory to write: tables, map, JSON.")
    ] = None,
    model: Annotated[
        str,
        typer.Option(
            "--model",
            metavar=THERMOMETRY_MODELS,
            callback=one_of(THERMOMETRY_MODELS),
            help="Formula for the speed of sound.",
        ),
    ] = "real_gas",
    air_model: AirModel = AIR_MODEL,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Map of temperature and wind from travel times of sound along many paths."""
    from catseye.api.atmosphere.sound_field import acoustic_field as measured
    from catseye.api.result import require_writable, save

    require_writable(out, stations, times, sheet)
    result = measured(stations, times, sheet, model=model, air_model=air_model)
    if out is not None:
        save(result, out)
    tell(result, json=json, quiet=quiet, strict=strict, written=[("Written to", out)])
