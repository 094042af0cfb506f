"""The commands of pointing: the series fitted and predicted, and the track under it."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.results import Strict, tell
from catseye.cli.vocabularies import POINTING_TERMS

TERMS = POINTING_TERMS.replace("|", ",")

pointing = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="The antenna's pointing series, from stars and from metrology.",
    epilog="\b\nExample: catseye pointing predict --azimuth-deg 145.3 --elevation-deg 30",
)
app.add_typer(pointing, name="pointing")

Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
]

Structure = Annotated[
    Path | None,
    typer.Option("--structure", metavar="MODEL.toml", help="Structural model, whose offset of the beam is taken out."),
]
SiteOfStructure = Annotated[
    Path | None, typer.Option("--site", metavar="SITE", help="Site with the paraboloid, for --structure.")
]
StructureTemperature = Annotated[
    float | None,
    typer.Option("--temperature-c", help="Temperature of the structure; the model's reference if not given."),
]


@pointing.command(
    epilog="\b\nExample: catseye pointing fit examples/pointing/stars.dat --against published --out pointing-report\n"
    "Layout of STARS.dat: catseye help formats/star-offsets; POSE.json: catseye pose --pointing prime --out"
)
def fit(  # noqa: PLR0913 - its options are its command line
    files: Annotated[
        list[Path], typer.Argument(metavar="STARS.dat | POSE.json ...", help="A TPOINT file, or poses with pointing.")
    ],
    against: Annotated[
        str | None,
        typer.Option(
            "--against",
            metavar="published|MODEL.toml|STARS.dat",
            help="Series to compare with; stars are fitted likewise.",
        ),
    ] = None,
    terms: Annotated[str, typer.Option("--terms", help="Terms to fit.")] = TERMS,
    u_arcsec: Annotated[
        float | None,
        typer.Option("--u-arcsec", help="Uncertainty of each coordinate of a star; from the scatter if not given."),
    ] = None,
    reject: Annotated[
        bool, typer.Option("--reject", help="Reject observations with |w| above 4, one at a time.")
    ] = False,
    structure: Structure = None,
    site: SiteOfStructure = None,
    temperature_c: StructureTemperature = None,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="MODEL.toml", help="File of the series with its covariance.")
    ] = None,
    write_stars: Annotated[
        Path | None,
        typer.Option("--write-stars", metavar="USED.dat", help="File of the observations used, as TPOINT text; new."),
    ] = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """The eight-term series by least squares, with covariance and what it cannot tell apart."""
    from catseye.api.pointing import fit_pointing
    from catseye.api.result import require_writable, save

    require_writable(out, *files, structure, site)
    chosen = [term.strip().upper() for term in terms.split(",")]
    result = fit_pointing(
        files,
        against=against,
        terms=chosen,
        u_arcsec=u_arcsec,
        reject=reject,
        structure=structure,
        site=site,
        temperature_c=temperature_c,
    )
    if write_stars is not None:
        result.save_stars(write_stars)
    if write is not None:
        result.save_model(write)
    if out is not None:
        save(result, out)
    written = (
        [] if out is None else [("Written to", f"{out}/: report.html, observations.csv, pointing.json, pointing.toml")]
    )
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.lines(), written=written)


@pointing.command(
    epilog="\b\nExample: catseye pointing predict --azimuth-deg 145.3 --elevation-deg 30 --model published\n"
    "         catseye pointing predict --azimuth-deg 145.3 --elevation-deg 30 --model residual.toml "
    "--structure examples/structural-model/telescope.toml --site gbt --temperature-c 5"
)
def predict(
    azimuth_deg: Annotated[float, typer.Option("--azimuth-deg", help="Azimuth on the sky, clockwise from north.")],
    elevation_deg: Annotated[float, typer.Option("--elevation-deg", help="Elevation on the sky.")],
    model: Annotated[str, typer.Option("--model", metavar="published|MODEL.toml", help="The series.")] = "published",
    structure: Structure = None,
    site: SiteOfStructure = None,
    temperature_c: StructureTemperature = None,
    json: Json = False,
) -> None:
    """Predict the encoders' corrections for a direction on the sky."""
    from catseye.api.pointing import predict_pointing

    result = predict_pointing(
        azimuth_deg, elevation_deg, model=model, structure=structure, site=site, temperature_c=temperature_c
    )
    tell(result, json=json, rows=result.lines())


@pointing.command(
    epilog="\b\nExample: catseye pointing track --tilts examples/pointing/tilts.csv --harmonics 3\n"
    "Example: catseye pointing track pose-000/pose.json pose-090/pose.json --tilts tilts.csv --harmonics 2\n"
    "POSE.json: catseye pose --group alidade --frame alidade --out; TILTS.csv: catseye help formats/star-offsets"
)
def track(
    poses: Annotated[
        list[Path] | None, typer.Argument(metavar="[POSE.json ...]", help="Poses of the alidade at several azimuths.")
    ] = None,
    tilts: Annotated[
        Path | None, typer.Option("--tilts", metavar="TILTS.csv", help="Readings of an inclinometer on the alidade.")
    ] = None,
    harmonics: Annotated[int, typer.Option("--harmonics", min=0, max=36, help="Number of harmonics per turn.")] = 2,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Tilt of the alidade against azimuth: poses and inclinometer in one Fourier series."""
    from catseye.api.result import require_writable, save
    from catseye.api.track_profile import track_pointing

    require_writable(out, *(poses or []), *([] if tilts is None else [tilts]))
    result = track_pointing(poses, tilts=tilts, harmonics=harmonics)
    if out is not None:
        save(result, out)
    written = [] if out is None else [("Written to", f"{out}/: report.html, tilt.csv, track.json")]
    tell(result, json=json, quiet=quiet, rows=result.lines(), written=written)
