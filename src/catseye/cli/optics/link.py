"""The command of the link budget."""

from typing import Annotated

import typer

from catseye.cli.commands import Json, app
from catseye.cli.results import tell
from catseye.reduction.optics.link import Link, LinkReflector


@app.command(epilog="\b\nExample: catseye link --distance 120 --incidence-deg 20 --measured-volt 4.5")
def link(  # noqa: PLR0913 - its options are its command line
    distance: Annotated[float, typer.Option("--distance", help="Ranger to retroreflector, m.")],
    incidence_deg: Annotated[float, typer.Option("--incidence-deg", help="On the reflector's face, degrees.")] = 0.0,
    offset_mm: Annotated[float, typer.Option("--offset-mm", help="Beam's axis off the reflector, mm.")] = 0.0,
    power_mw: Annotated[float, typer.Option("--power-mw", help="Laser, mean, mW.")] = Link.power * 1e3,
    depth: Annotated[float, typer.Option("--depth", help="Modulation depth, 0 to 1.")] = Link.depth,
    waist_mm: Annotated[
        float, typer.Option("--waist-mm", help="Radius of the outgoing beam at 1/e^2, mm.")
    ] = Link.waist * 1e3,
    receiver_mm: Annotated[
        float, typer.Option("--receiver-mm", help="Radius of the receiving lens, mm.")
    ] = Link.receiver * 1e3,
    transmission: Annotated[
        float, typer.Option("--transmission", help="Of the head's optics, out and back.")
    ] = Link.transmission,
    aperture_mm: Annotated[
        float, typer.Option("--aperture-mm", help="Radius of the reflector's clear face, mm.")
    ] = LinkReflector.aperture * 1e3,
    height_mm: Annotated[float, typer.Option("--height-mm", help="Corner behind the face, mm.")] = LinkReflector.height
    * 1e3,
    index: Annotated[
        float, typer.Option("--index", help="Of the reflector: 1 for a hollow cube.")
    ] = LinkReflector.index,
    duration: Annotated[float, typer.Option("--duration", help="Of one range, s.")] = Link.duration,
    blocked_noise_volt: Annotated[
        float, typer.Option("--blocked-noise-volt", help="Rms of the samples with the beam blocked, V.")
    ] = Link.blocked_noise_volt,
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
        duration=duration,
        blocked_noise_volt=blocked_noise_volt,
        background_uw=background_uw,
        measured_volt=measured_volt,
    )
    tell(result, json=json, sentences=False, rows=result.rows())
