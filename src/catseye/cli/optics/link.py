"""The command of the link budget."""

from typing import Annotated

import typer

from catseye.cli.commands import Json, app
from catseye.cli.results import tell


def _numbers(text: str | None) -> list[float] | None:
    """Numbers of a text, between commas."""
    if text is None:
        return None
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as problem:
        raise typer.BadParameter(f"{text!r} is not a number, or three between commas.") from problem


@app.command(epilog="\b\nExample: catseye link --distance 120 --incidence-deg 20 --measured-volt 4.5")
def link(  # noqa: PLR0913 - its options are its command line
    distance: Annotated[float, typer.Option("--distance", help="Distance from ranger to retroreflector, m.")],
    incidence_deg: Annotated[
        float, typer.Option("--incidence-deg", help="Incidence on the reflector's face, degrees.")
    ] = 0.0,
    offset_mm: Annotated[
        float, typer.Option("--offset-mm", help="Offset of the beam's axis from the reflector, mm.")
    ] = 0.0,
    power_mw: Annotated[float, typer.Option("--power-mw", help="Mean power of the laser, mW.")] = 10.0,
    depth: Annotated[float, typer.Option("--depth", help="Modulation depth, 0 to 1.")] = 0.5,
    waist_mm: Annotated[float, typer.Option("--waist-mm", help="Radius of the outgoing beam at 1/e^2, mm.")] = 10.0,
    receiver_mm: Annotated[float, typer.Option("--receiver-mm", help="Radius of the receiving lens, mm.")] = 50.0,
    transmission: Annotated[
        float, typer.Option("--transmission", help="Transmission of the head's optics, out and back.")
    ] = 0.15,
    aperture_mm: Annotated[
        float, typer.Option("--aperture-mm", help="Radius of the reflector's clear face, mm.")
    ] = 25.4,
    height_mm: Annotated[
        float, typer.Option("--height-mm", help="Height of the reflector, face to corner, mm.")
    ] = 38.1,
    index: Annotated[float, typer.Option("--index", help="Phase index of the reflector; 1 for a hollow cube.")] = 1.511,
    dihedral_arcsec: Annotated[
        str | None,
        typer.Option(
            "--dihedral-arcsec",
            metavar="E|A,B,C",
            callback=_numbers,
            help="Excess of the reflector's angles over right ones, of all or of each.",
        ),
    ] = None,
    duration: Annotated[float, typer.Option("--duration", help="Duration of one range, s.")] = 0.128,
    blocked_noise_volt: Annotated[
        float, typer.Option("--blocked-noise-volt", help="Rms of the samples with the beam blocked, V.")
    ] = 0.2,
    background_uw: Annotated[float, typer.Option("--background-uw", help="Daylight on the detector, µW.")] = 0.0,
    measured_volt: Annotated[
        float | None,
        typer.Option("--measured-volt", help="Return measured straight on at this distance, V: sets the gain."),
    ] = None,
    json: Json = False,
) -> None:
    """Link budget: laser's power to expected return and the range's noise."""
    from catseye.api.optics import link as link_of

    result = link_of(
        distance,
        incidence_deg=incidence_deg,
        offset_mm=offset_mm,
        power_mw=power_mw,
        depth=depth,
        waist_mm=waist_mm,
        receiver_mm=receiver_mm,
        transmission=transmission,
        aperture_mm=aperture_mm,
        height_mm=height_mm,
        index=index,
        dihedral_arcsec=dihedral_arcsec,
        duration=duration,
        blocked_noise_volt=blocked_noise_volt,
        background_uw=background_uw,
        measured_volt=measured_volt,
    )
    tell(result, json=json, sentences=False, rows=result.rows())
