"""The commands of triplets in use: ranges from prisms to balls, the local net, the aim, bounds."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import AirModel, Json, Quiet, app
from catseye.cli.numbers import row_of
from catseye.cli.results import Strict, tell
from catseye.cli.telescope.pointing import Out
from catseye.cli.vocabularies import AIR_MODEL

triplets = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Triplets on the telescope: prisms to balls, local net, aim, bounds.",
    epilog="\b\nExample: catseye triplets reduce night-01 triplets/prism-ranges.csv",
)
app.add_typer(triplets, name="triplets")

Site = Annotated[Path, typer.Argument(metavar="SITE", help="Directory of a site or a campaign: triplets, feed arm.")]
Unit = Annotated[str | None, typer.Option("--unit", metavar="TRnn", help="Single triplet; all if not given.")]
UNormal = Annotated[
    float, typer.Option("--u-normal-deg", help="Uncertainty of each plate's normal, each direction, deg.")
]
UZero = Annotated[float, typer.Option("--u-zero-mm", help="Uncertainty of each ranger's zero, mm.")]


@triplets.command(
    epilog="\b\nExample: catseye triplets reduce night-01 triplets/prism-ranges.csv --out to-the-balls\n"
    "Example: catseye triplets reduce night-01 --unit TR01\n"
    "Layout of RANGES.csv: catseye help formats/triplet-ranges; it may be ranges.csv of catseye reduce"
)
def reduce(  # noqa: PLR0913 - its options are its command line
    site: Site,
    ranges: Annotated[
        Path | None,
        typer.Argument(metavar="[RANGES.csv]", help="Ranges to prisms; those of the records' places if not given."),
    ] = None,
    unit: Unit = None,
    u_normal_deg: UNormal = 0.3,
    u_zero_mm: UZero = 0.03,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Ranges to prisms become ranges to mid-points and balls; or what is ranged by the records' places."""
    from catseye.api.result import require_writable, save
    from catseye.api.triplet.ranges import reduce_triplets

    require_writable(out, site, ranges)
    result = reduce_triplets(site, ranges, unit=unit, u_normal_deg=u_normal_deg, u_zero_mm=u_zero_mm)
    if out is not None:
        save(result, out)
    written = [] if out is None else [("Written to", f"{out}/: ranges.csv, points.csv, ranges.svg, result.json")]
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.lines(), written=written)


@triplets.command(
    epilog="\b\nExample: catseye triplets adjust night-01 triplets/prism-ranges.csv --out local-net\n"
    "Layout of RANGES.csv: catseye help formats/triplet-ranges; it may be ranges.csv of catseye reduce"
)
def adjust(
    site: Site,
    ranges: Annotated[
        Path, typer.Argument(metavar="RANGES.csv", help="Ranges of the feed arm's rangers to prisms and one another.")
    ],
    u_normal_deg: UNormal = 0.3,
    u_zero_mm: UZero = 0.03,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Local net of feed arm and prisms by itself, and the balls computed from it, with covariance."""
    from catseye.api.result import require_writable, save
    from catseye.api.triplet.ranges import adjust_triplets

    require_writable(out, site, ranges)
    result = adjust_triplets(site, ranges, u_normal_deg=u_normal_deg, u_zero_mm=u_zero_mm)
    if out is not None:
        save(result, out)
    files = "points.csv, distances.csv, ranges.csv, net.svg, result.json"
    written = [] if out is None else [("Written to", f"{out}/: {files}")]
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.lines(), written=written)


@triplets.command(
    epilog="\b\nExample: catseye triplets aim night-01\n"
    "Example: catseye triplets aim night-01 --unit TR03 --scope-mm=0,100 --at-mm=0,-6000,56000"
)
def aim(  # noqa: PLR0913 - its options are its command line
    site: Site,
    unit: Unit = None,
    at_mm: Annotated[
        str | None,
        typer.Option(
            "--at-mm",
            metavar="X,Y,Z",
            callback=row_of(3, "x,y,z in mm"),
            help="Point to aim at, reflector frame; that of feedarm.toml if not given.",
        ),
    ] = None,
    outer: Annotated[
        str | None,
        typer.Option(
            "--outer",
            metavar="X,Y,Z",
            callback=row_of(3, "x,y,z"),
            help="Direction of the mounts' outer axis, reflector frame; each unit's y if not given.",
        ),
    ] = None,
    scope_mm: Annotated[
        str | None,
        typer.Option(
            "--scope-mm",
            metavar="X,Y",
            callback=row_of(2, "x,y in mm"),
            help="Where the scope's sight crosses the unit's x and y, from the pivot; 0,0 if not given.",
        ),
    ] = None,
    pivot_mm: Annotated[
        str | None,
        typer.Option(
            "--pivot-mm",
            metavar="X,Y,Z",
            callback=row_of(3, "x,y,z in mm"),
            help="Where the mount's axes meet, from the ball in unit axes; 0,0,0 if not given.",
        ),
    ] = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """The two rotations of each mount that aim its rifle scope, and the incidences that follow."""
    from catseye.api.result import require_writable, save
    from catseye.api.triplet.mount import aim_triplets

    require_writable(out, site)
    result = aim_triplets(site, unit=unit, at_mm=at_mm, outer=outer, scope_mm=scope_mm, pivot_mm=pivot_mm)
    if out is not None:
        save(result, out)
    written = [] if out is None else [("Written to", f"{out}/: mounts.csv, incidences.csv, result.json")]
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.lines(), written=written)


@triplets.command(
    epilog="\b\nExample: catseye triplets bound --warmer-c 20\n"
    "Example: catseye triplets bound --along-mm 0.3 --distance-m 46 --aside-mm 200 --out bounds"
)
def bound(  # noqa: PLR0913 - its options are its command line
    spacing_mm: Annotated[float, typer.Option("--spacing-mm", help="Prisms further apart than assumed, mm.")] = 0.15,
    along_mm: Annotated[float, typer.Option("--along-mm", help="Ball towards the right prism, mm.")] = 0.15,
    across_mm: Annotated[float, typer.Option("--across-mm", help="Ball up in the plate, mm.")] = 0.15,
    d12_mm: Annotated[float, typer.Option("--d12-mm", help="Distance between the prisms, mm.")] = 635.0,
    distance_m: Annotated[float, typer.Option("--distance-m", help="Scan point to the prisms' line, m.")] = 18.0,
    aside_mm: Annotated[
        float | None,
        typer.Option("--aside-mm", help="Scan point along the line, mm; before the right prism if not given."),
    ] = None,
    height_mm: Annotated[float, typer.Option("--height-mm", help="Scan point over the line, mm.")] = 50.0,
    prism_mm: Annotated[float, typer.Option("--prism-mm", help="Height of a prism, mm.")] = 38.4,
    ball_mm: Annotated[float, typer.Option("--ball-mm", help="Sum of the ball's radii, mm.")] = 146.4972,
    warmer_c: Annotated[float, typer.Option("--warmer-c", help="Change of the air's temperature, °C.")] = 0.0,
    higher_hpa: Annotated[float, typer.Option("--higher-hpa", help="Change of the air's pressure, hPa.")] = 0.0,
    moister_percent: Annotated[float, typer.Option("--moister-percent", help="Change of the air's humidity, %.")] = 0.0,
    temperature_c: Annotated[float, typer.Option("--temperature-c", help="Air before the change, °C.")] = 20.0,
    pressure_hpa: Annotated[float, typer.Option("--pressure-hpa", help="Pressure of the air, hPa.")] = 933.0,
    humidity_percent: Annotated[
        float, typer.Option("--humidity-percent", help="Relative humidity of the air, %.")
    ] = 50.0,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Effects of a unit's dimensions and of another air: the memo's appendices A and D."""
    from catseye.api.result import require_writable, save
    from catseye.api.triplet.mount import bound_triplets

    require_writable(out)
    result = bound_triplets(
        spacing_mm=spacing_mm,
        along_mm=along_mm,
        across_mm=across_mm,
        d12_mm=d12_mm,
        distance_m=distance_m,
        aside_mm=aside_mm,
        height_mm=height_mm,
        prism_mm=prism_mm,
        ball_mm=ball_mm,
        warmer_c=warmer_c,
        higher_hpa=higher_hpa,
        moister_percent=moister_percent,
        temperature_c=temperature_c,
        pressure_hpa=pressure_hpa,
        humidity_percent=humidity_percent,
    )
    if out is not None:
        save(result, out)
    written = [] if out is None else [("Written to", f"{out}/: cases.csv, causes.csv, bounds.svg, result.json")]
    tell(result, json=json, quiet=quiet, strict=strict, rows=result.lines(), written=written)


@triplets.command(
    "range",
    epilog="\b\nExample: catseye triplets range --phase-rad 2.0 --zrg-rad 1.0 --cal-rad 0.5 --coarse-m 18.2\n"
    "Example: catseye triplets range --phase-rad 2.0 --zrg-rad 1.0 --distance-m 18.1748 --u-distance-mm 0.02",
)
def range_(  # noqa: PLR0913 - its options are its command line
    phase_rad: Annotated[float, typer.Option("--phase-rad", help="Phase of the hollow target, rad.")],
    zrg_rad: Annotated[float, typer.Option("--zrg-rad", help="Phase of the ranger's reference, rad.")],
    cal_rad: Annotated[
        float | None, typer.Option("--cal-rad", help="Zero-distance phase of the ranger, rad; with --coarse-m.")
    ] = None,
    coarse_m: Annotated[float | None, typer.Option("--coarse-m", help="Coarse length, m: gives the distance.")] = None,
    distance_m: Annotated[
        float | None, typer.Option("--distance-m", help="Known distance, m: gives the zero-distance phase.")
    ] = None,
    u_phase_rad: Annotated[float, typer.Option("--u-phase-rad", help="Uncertainty of each phase, rad.")] = 0.0,
    u_distance_mm: Annotated[float, typer.Option("--u-distance-mm", help="That of --distance-m, mm.")] = 0.0,
    temperature_c: Annotated[float, typer.Option("--temperature-c", help="Temperature of the air, °C.")] = 20.0,
    pressure_hpa: Annotated[float, typer.Option("--pressure-hpa", help="Pressure of the air, hPa.")] = 933.0,
    humidity_percent: Annotated[float, typer.Option("--humidity-percent", help="Relative humidity, %.")] = 50.0,
    modulation_mhz: Annotated[float, typer.Option("--modulation-mhz", help="Modulation of the light, MHz.")] = 1500.0,
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="Vacuum wavelength, µm.")] = 0.780,
    air_model: AirModel = AIR_MODEL,
    json: Json = False,
    quiet: Quiet = False,
    strict: Strict = False,
) -> None:
    """Range to a hollow target by itself from its phase, or the ranger's zero-distance phase from a known range."""
    from catseye.api.triplet.hollow import range_triplets

    result = range_triplets(
        phase_rad=phase_rad,
        zrg_rad=zrg_rad,
        cal_rad=cal_rad,
        coarse_m=coarse_m,
        distance_m=distance_m,
        u_phase_rad=u_phase_rad,
        u_distance_mm=u_distance_mm,
        temperature_c=temperature_c,
        pressure_hpa=pressure_hpa,
        humidity_percent=humidity_percent,
        modulation_mhz=modulation_mhz,
        wavelength_um=wavelength_um,
        air_model=air_model,
    )
    tell(result, json=json, quiet=quiet, strict=strict)
