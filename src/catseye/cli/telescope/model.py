"""The commands of a structural model."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.networks import Out
from catseye.cli.results import Strict, tell
from catseye.cli.terminal import ProgressLine
from catseye.cli.vocabularies import NODE_UNITS, one_of

MODEL = "examples/structural-model/telescope.toml"
FINITE = "examples/finite-elements"

model = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Structural model of the telescope: how gravity, temperature and track bend it.",
    epilog=f"\b\nExample: catseye model displace {MODEL} --posture 145,45 --site gbt",
)
app.add_typer(model, name="model")

ModelFile = Annotated[Path, typer.Argument(metavar="MODEL.toml", help="Structural model.")]


def _postures(postures: list[str] | None) -> list[str] | None:
    for posture in postures or ():
        try:
            good = len([float(part) for part in posture.split(",")]) == 2
        except ValueError:
            good = False
        if not good:
            raise typer.BadParameter(f"{posture!r} is not azimuth,elevation in degrees.")
    return postures


Postures = Annotated[
    list[str],
    typer.Option(
        "--posture", metavar="AZ,EL", callback=_postures, help="Azimuth and elevation of the telescope, °; repeats."
    ),
]


def pairs(postures: list[str]) -> list[list[float]]:
    """Azimuth and elevation of each posture, degrees."""
    return [[float(part) for part in posture.split(",")] for posture in postures]


@model.command(
    epilog=f"\b\nExample: catseye model displace {MODEL} --posture 145,45 --posture 145,10 --site gbt --out bent\n"
    f"         catseye model displace {MODEL} --posture 0,60 --temperature-c 25 --points 'ZEG*'\n"
    "Layout of MODEL.toml: catseye help formats/structural-model"
)
def displace(  # noqa: PLR0913 - its options are its command line
    model: ModelFile,
    posture_deg: Postures,
    temperature_c: Annotated[
        float | None,
        typer.Option("--temperature-c", help="Temperature of the structure; the model's reference if not given."),
    ] = None,
    site: Annotated[
        Path | None,
        typer.Option("--site", metavar="SITE", help="Site whose targets and rangers move; the model's if not given."),
    ] = None,
    points: Annotated[
        list[str] | None, typer.Option("--points", metavar="NAME", help="Point, or pattern such as 'ZEG*'; repeats.")
    ] = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Displacements of targets and rangers by the model at a posture, in the ground's and the body's axes."""
    from catseye.api.result import require_writable, save
    from catseye.api.telescope.displacement import displace_model

    require_writable(out, model, site)
    result = displace_model(
        model, posture_deg=pairs(posture_deg), temperature_c=temperature_c, site=site, points=points or ()
    )
    if out is not None:
        save(result, out)
    beam = "" if site is None else "beam.csv, "
    written = (
        None if out is None else f"{out}/: report.html, displacements.csv, {beam}model.json, elevation.svg, side.svg"
    )
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.rows(), written=[("Written to", written)])


@model.command(
    epilog=f"\b\nExample: catseye model fit {MODEL} examples/structure/epochs.csv --write refined.toml --out refined\n"
    f"         catseye model fit {MODEL} at-15 at-45 at-75 --free feed_arm:turn_x,shift_y --temperature-c 12\n"
    "at-15: an output of `catseye reduce`. Layout of EPOCHS.csv: catseye help formats/structure"
)
def fit(  # noqa: PLR0913 - its options are its command line
    model: ModelFile,
    epochs: Annotated[
        list[Path],
        typer.Argument(metavar="EPOCHS.csv|REDUCTION ...", help="List of epochs, or directories of `catseye reduce`."),
    ],
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free",
            metavar="FRAME:COMPONENTS",
            help="Components to fit, such as feed_arm:turn_x,shift_y; repeats. All that the model gives if not given.",
        ),
    ] = None,
    temperature_c: Annotated[
        float | None,
        typer.Option("--temperature-c", help="Temperature of the structure in epochs that do not say it."),
    ] = None,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="NEW.toml", help="Model with the fitted coefficients to write.")
    ] = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Coefficients of the model from targets measured in many postures, with covariance."""
    from catseye.api.result import require_writable, save
    from catseye.api.telescope.model_fit import fit_model

    require_writable(out, model, *epochs, record=write)
    result = fit_model(model, epochs, free=free or (), temperature_c=temperature_c)
    if out is not None:
        save(result, out, record=write)
    else:
        result.save_pages(record=write)
    files = "report.html, model-coefficients.csv, model-residuals.csv, model.json, coefficients.svg, residuals.svg"
    written = [
        ("New model", None if write is None else f"{write}: fitted coefficients and their covariance"),
        ("Written to", None if out is None else f"{out}/: {files}"),
    ]
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.rows(), written=written)


def _origin(place: str) -> str:
    try:
        good = len([float(part) for part in place.split(",")]) == 3
    except ValueError:
        good = False
    if not good:
        raise typer.BadParameter(f"{place!r} is not x,y,z in metres.")
    return place


@model.command(
    name="import",
    epilog=f"\b\nExample: catseye model import {MODEL} {FINITE}/reflector.pch --nodes {FINITE}/nodes.csv "
    "--unit mm --case 1=cosE --case 2=sinE --axes=-y,x,z --origin=0,54.839108,-4.99999 --write bent.toml\n"
    "A case is a term, or its elevation in degrees. Layout of tables: catseye help formats/structural-model",
)
def import_(  # noqa: PLR0913 - its options are its command line
    model: ModelFile,
    result: Annotated[
        Path, typer.Argument(metavar="RESULT.pch|RESULT.csv", help="Displacements by node: Nastran punch, or a table.")
    ],
    nodes: Annotated[Path, typer.Option("--nodes", metavar="NODES.csv", help="Places of the nodes, perhaps targets.")],
    case: Annotated[
        list[str] | None,
        typer.Option("--case", metavar="CASE=TERM|DEGREES", help="Term of a load case, or its elevation; repeats."),
    ] = None,
    terms: Annotated[str, typer.Option("--terms", help="Functions that elevations are resolved into.")] = "cosE,sinE",
    unit: Annotated[
        str | None,
        typer.Option("--unit", metavar=NODE_UNITS, callback=one_of(NODE_UNITS), help="Unit of a punch file."),
    ] = None,
    frame: Annotated[str, typer.Option("--frame", help="Frame of the model that the result is of.")] = "reflector",
    axes: Annotated[str, typer.Option("--axes", help="The frame's x,y,z by the result's axes.")] = "x,y,z",
    origin_m: Annotated[
        str,
        typer.Option(
            "--origin", metavar="X,Y,Z", callback=_origin, help="Origin of the result's axes in the frame, m."
        ),
    ] = "0,0,0",
    within_m: Annotated[float, typer.Option("--within-m", help="Largest distance of a target from its node.")] = 0.5,
    u_percent: Annotated[
        float, typer.Option("--u-percent", help="Uncertainty of the displacements: the prior of a later fit.")
    ] = 10.0,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="NEW.toml", help="Model with the result in it to write.")
    ] = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """A finite element result, displacements by node, read into the model."""
    from catseye.api.result import require_writable, save
    from catseye.api.telescope.finite_elements import import_model

    require_writable(out, model, result, nodes, record=write)
    bent = import_model(
        model,
        result,
        nodes=nodes,
        case=case or (),
        terms=terms,
        unit=unit,
        frame=frame,
        axes=axes,
        origin_m=[float(part) for part in origin_m.split(",")],
        within_m=within_m,
        u_percent=u_percent,
    )
    if out is not None:
        save(bent, out, record=write)
    else:
        bent.save_pages(record=write)
    written = [
        ("New model", None if write is None else f"{write}: motions, shifts and their u"),
        ("Written to", None if out is None else f"{out}/: model-nodes.csv, model.json, targets.svg"),
    ]
    tell(bent, json=json, quiet=quiet, strict=strict, rows=bent.rows(), written=written)


@model.command(
    epilog=f"\b\nExample: catseye model choose {MODEL} --site gbt --count 4 --out cardinal\n"
    f"         catseye model choose {MODEL} --site gbt --count 2 --free feed_arm:turn_x --posture 0,20 --posture 0,70"
)
def choose(  # noqa: PLR0913 - its options are its command line
    model: ModelFile,
    site: Annotated[Path, typer.Option("--site", metavar="SITE", help="Site whose rangers measure its targets.")],
    count: Annotated[int, typer.Option("--count", min=1, help="Number of points.")],
    points: Annotated[
        list[str] | None,
        typer.Option("--points", metavar="NAME", help="Target to choose from, or pattern such as 'ZEG*'; repeats."),
    ] = None,
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free", metavar="FRAME:COMPONENTS", help="Components to determine, as for `model fit`; repeats."
        ),
    ] = None,
    posture_deg: Annotated[
        list[str] | None,
        typer.Option(
            "--posture",
            metavar="AZ,EL",
            callback=_postures,
            help="Posture to measure in, °; repeats. Nine if not given.",
        ),
    ] = None,
    temperature_c: Annotated[
        float | None, typer.Option("--temperature-c", help="Temperature in these postures; the model's reference else.")
    ] = None,
    u_range_mm: Annotated[float, typer.Option("--u-range-mm", help="Uncertainty of a range.")] = 0.1,
    u_shift_mm: Annotated[
        float, typer.Option("--u-shift-mm", help="Prior of a shift's coefficient without a covariance in the model.")
    ] = 5.0,
    u_turn_arcsec: Annotated[
        float, typer.Option("--u-turn-arcsec", help="Prior of a turn's coefficient without a covariance in the model.")
    ] = 20.0,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Cardinal points: the targets whose ranges determine the model's coefficients best."""
    from catseye.api.result import require_writable, save
    from catseye.api.telescope.cardinal_points import choose_model

    require_writable(out, model, site)
    progress = ProgressLine(quiet)
    try:
        result = choose_model(
            model,
            site=site,
            count=count,
            points=points or (),
            free=free or (),
            posture_deg=pairs(posture_deg) if posture_deg else None,
            temperature_c=temperature_c,
            u_range_mm=u_range_mm,
            u_shift_mm=u_shift_mm,
            u_turn_arcsec=u_turn_arcsec,
            progress=progress,
        )
        if out is not None:
            save(result, out, progress=progress)
    finally:
        progress.clear()
    written = [("Written to", None if out is None else f"{out}/: model-points.csv, model.json, information.svg")]
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.rows(), written=written)
