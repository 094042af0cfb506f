"""The commands of scans: spots, returns by angle, searches."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.results import Strict, tell
from catseye.cli.vocabularies import one_of

PATTERNS = "spiral|raster"

scan = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Scans over a retroreflector, by counts and by angle, and the search for it.",
    epilog="\b\nExample: catseye scan fit examples/scans/azimuth.csv examples/scans/elevation.csv "
    "--mirror examples/night-01/mirrors/ZP103.toml",
)
app.add_typer(scan, name="scan")

Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Directory to write: new, empty, or an earlier output of catseye."),
]


@scan.command(
    epilog="\b\nExample: catseye scan fit examples/scans/azimuth.csv examples/scans/elevation.csv "
    "--mirror examples/night-01/mirrors/ZP103.toml --out scans\n"
    "Columns of SCAN.csv: catseye help formats/scans"
)
def fit(  # noqa: PLR0913 - its options are its command line
    scans: Annotated[list[Path], typer.Argument(metavar="SCAN.csv ...", help="Scans over one retroreflector.")],
    mirror: Annotated[Path, typer.Option("--mirror", metavar="Z.toml", help="The ranger's mirror.")],
    noise_volt: Annotated[float, typer.Option("--noise-volt", help="Uncertainty of one amplitude, dark, V.")] = 0.02,
    scintillation_percent: Annotated[
        float, typer.Option("--scintillation-percent", help="Relative uncertainty of one amplitude.")
    ] = 2.0,
    full_scale_volt: Annotated[
        float, typer.Option("--full-scale-volt", help="Amplitude at which the converter clips, V.")
    ] = 10.0,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Measured azimuth and elevation scans to the spot: centre, width, peak, background."""
    from catseye.api.result import require_writable, save
    from catseye.api.scans.fit import fit_scan

    require_writable(out, *scans, mirror)
    result = fit_scan(
        scans,
        mirror=mirror,
        noise_volt=noise_volt,
        scintillation_percent=scintillation_percent,
        full_scale_volt=full_scale_volt,
    )
    if out is not None:
        save(result, out)
    written = (
        [] if out is None else [("Written to", f"{out}/: scans.csv, readings.csv, samplers.fits, figures, result.json")]
    )
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.rows(), written=written)


@scan.command(
    epilog="\b\nExample: catseye scan compare examples/scans/incidence.csv examples/scans/rotation.csv --out angles\n"
    "Example: catseye scan compare examples/scans/analyser.csv --polarization-deg 30\n"
    "Columns of ANGLES.csv: catseye help formats/scans"
)
def compare(  # noqa: PLR0913 - its options are its command line
    angles: Annotated[list[Path], typer.Argument(metavar="ANGLES.csv ...", help="Returns of one retroreflector.")],
    kind: Annotated[
        str | None,
        typer.Option(
            "--kind",
            metavar="KIND",
            help="Kind to judge: bare-prism, prism-with-silvered-faces, hollow-cube, ball; the likeliest if not given.",
        ),
    ] = None,
    noise: Annotated[float, typer.Option("--noise", help="Uncertainty of a reading without light, V or mW.")] = 0.02,
    relative_percent: Annotated[
        float, typer.Option("--relative-percent", help="Relative uncertainty of a reading.")
    ] = 2.0,
    aperture_mm: Annotated[float, typer.Option("--aperture-mm", help="Radius of the face.")] = 25.4,
    height_mm: Annotated[float, typer.Option("--height-mm", help="Height of a prism, face to corner.")] = 38.1,
    reflectance: Annotated[float, typer.Option("--reflectance", help="Reflectance of each mirror.")] = 0.97,
    polarization_deg: Annotated[
        float | None,
        typer.Option("--polarization-deg", help="Angle of the light's field from the plane of incidence, °."),
    ] = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Measured amplitude or power by incidence and rotation, beside each kind's theory."""
    from catseye.api.result import require_writable, save
    from catseye.api.scans.compare import compare_scan

    require_writable(out, *angles)
    result = compare_scan(
        angles,
        kind=kind,
        noise=noise,
        relative_percent=relative_percent,
        aperture_mm=aperture_mm,
        height_mm=height_mm,
        reflectance=reflectance,
        polarization_deg=polarization_deg,
    )
    if out is not None:
        save(result, out)
    written = [] if out is None else [("Written to", f"{out}/: kinds.csv, returns.csv, angles.svg, result.json")]
    tell(result, json=json, quiet=quiet, strict=strict, written=written)


@scan.command(
    epilog="\b\nExample: catseye scan search examples/scans/targets.csv --monument "
    "examples/night-01/monuments/ZY103.toml --mirror examples/night-01/mirrors/ZP103.toml --write found.csv\n"
    "Then: catseye calibrate search-results found.csv --sheet examples/calibrations/search-results.toml\n"
    "Columns of TARGETS.csv: catseye help formats/scans"
)
def search(  # noqa: PLR0913 - its options are its command line
    targets: Annotated[Path, typer.Argument(metavar="TARGETS.csv", help="Retroreflectors to find.")],
    monument: Annotated[Path, typer.Option("--monument", metavar="M.toml", help="The ranger's monument.")],
    mirror: Annotated[Path, typer.Option("--mirror", metavar="Z.toml", help="The mirror on it.")],
    u_mrad: Annotated[float, typer.Option("--u-mrad", help="Uncertainty of the predicted angles, mrad.")] = 0.5,
    radius_mrad: Annotated[
        float | None, typer.Option("--radius-mrad", help="Radius to search; three times the uncertainty if not given.")
    ] = None,
    pattern: Annotated[
        str, typer.Option("--pattern", metavar=PATTERNS, callback=one_of(PATTERNS), help="Pattern of the search.")
    ] = "spiral",
    spot_mm: Annotated[float, typer.Option("--spot-mm", help="Radius of the spot at 1/e², mm at the target.")] = 40.0,
    look_s: Annotated[float, typer.Option("--look-s", help="Time of one look, with the move to it, s.")] = 0.5,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the simulated ranger.")] = 1,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="FOUND.csv", help="Readings for `calibrate search-results`.")
    ] = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Search pattern, probability of finding and time; a simulated search for each target."""
    from catseye.api.result import require_writable, save
    from catseye.api.scans.search import search_scan

    require_writable(out, targets, monument, mirror, readings=write)
    result = search_scan(
        targets,
        monument=monument,
        mirror=mirror,
        u_mrad=u_mrad,
        radius_mrad=radius_mrad,
        pattern=pattern,
        spot_mm=spot_mm,
        look_s=look_s,
        seed=seed,
    )
    result.save_pages(readings=write)
    if out is not None:
        save(result, out)
    files = None if out is None else f"{out}/: searches.csv, looks.csv, figures, result.json"
    tell(
        result,
        json=json,
        quiet=quiet,
        strict=strict,
        rows=result.rows(),
        written=[("Readings", write), ("Written to", files)],
    )
