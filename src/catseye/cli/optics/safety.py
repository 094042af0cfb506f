"""The command of laser safety."""

from typing import Annotated

import typer

from catseye.cli.commands import Json, app
from catseye.cli.results import tell
from catseye.cli.terminal import wrapped
from catseye.cli.vocabularies import EDITIONS, one_of


@app.command(
    epilog="\b\nExample: catseye safety --power-mw 10 --wavelength-um 0.780 --diameter-mm 20 --divergence-mrad 0.05 "
    "--scan-rad-per-s 0.5\nA warning for planning, never a certificate: catseye help safety says what is left out."
)
def safety(  # noqa: PLR0913 - its options are its command line
    power_mw: Annotated[float, typer.Option("--power-mw", help="Power of the beam, continuous, mW.")],
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="Wavelength in vacuum, 0.4 to 1.4 µm.")],
    diameter_mm: Annotated[float, typer.Option("--diameter-mm", help="Diameter at 1/e² where the beam leaves, mm.")],
    divergence_mrad: Annotated[float, typer.Option("--divergence-mrad", help="Divergence, full angle at 1/e², mrad.")],
    waist_distance: Annotated[
        float, typer.Option("--waist-distance", help="Distance of the waist from where the beam leaves, m.")
    ] = 0.0,
    duration_s: Annotated[
        float | None,
        typer.Option("--duration-s", help="Duration of the exposure; 0.25 s for visible light, else 100 s."),
    ] = None,
    aided: Annotated[
        bool, typer.Option("--aided", help="Sweep, return and near end of the hazard through 7x50 binoculars.")
    ] = False,
    scan_rad_per_s: Annotated[
        float | None, typer.Option("--scan-rad-per-s", help="Angular rate of the beam (not the mirror), rad/s.")
    ] = None,
    scan_period_s: Annotated[
        float | None,
        typer.Option("--scan-period-s", help="Time from one pass to the next, s; a single pass if not given."),
    ] = None,
    reflector_distance: Annotated[
        float | None,
        typer.Option("--reflector-distance", help="Distance of a retroreflector that sends the beam back, m."),
    ] = None,
    reflector_diameter_mm: Annotated[
        float, typer.Option("--reflector-diameter-mm", help="Diameter of the retroreflector's clear face, mm.")
    ] = 50.8,
    subtense_mrad: Annotated[
        float,
        typer.Option(
            "--subtense-mrad", help="Angular subtense of the apparent source at the eye; up to 1.5 is a point source."
        ),
    ] = 1.5,
    edition: Annotated[
        str, typer.Option("--edition", metavar=EDITIONS, callback=one_of(EDITIONS), help="Edition of the limits.")
    ] = "iec2014",
    json: Json = False,
) -> None:
    """Laser safety of a beam: limits of exposure, class, hazard distances."""
    from catseye.api.optics import safety as safety_of

    result = safety_of(
        power_mw,
        wavelength_um,
        diameter_mm,
        divergence_mrad,
        waist_distance=waist_distance,
        duration_s=duration_s,
        aided=aided,
        scan_rad_per_s=scan_rad_per_s,
        scan_period_s=scan_period_s,
        reflector_distance=reflector_distance,
        reflector_diameter_mm=reflector_diameter_mm,
        subtense_mrad=subtense_mrad,
        edition=edition,
    )
    tell(result, json=json, rows=("", *result.rows(), "", wrapped("Note", result.values["notice"])))
