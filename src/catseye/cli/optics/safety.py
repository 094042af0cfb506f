"""The command of laser safety."""

from typing import Annotated

import typer

from catseye.cli.commands import Json, app
from catseye.cli.results import say_verdict
from catseye.cli.terminal import say, wrapped
from catseye.cli.vocabularies import EDITIONS, one_of


@app.command(
    epilog="\b\nExample: catseye safety --power-mw 10 --wavelength-um 0.780 --diameter-mm 20 --divergence-mrad 0.05 "
    "--scan-rad-per-s 0.5\nA warning for planning, never a certificate: docs/safety.md says what is left out."
)
def safety(  # noqa: PLR0913 - its options are its command line
    power_mw: Annotated[float, typer.Option("--power-mw", help="Of the beam, mW, continuous.")],
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="0.4 to 1.4 µm.")],
    diameter_mm: Annotated[float, typer.Option("--diameter-mm", help="At 1/e² where the beam leaves, mm.")],
    divergence_mrad: Annotated[float, typer.Option("--divergence-mrad", help="Full angle at 1/e², mrad.")],
    waist_distance: Annotated[
        float, typer.Option("--waist-distance", help="Narrowest place, m from where it leaves.")
    ] = 0.0,
    duration_s: Annotated[
        float | None, typer.Option("--duration-s", help="Of the exposure; 0.25 s for visible light, else 100 s.")
    ] = None,
    aided: Annotated[
        bool, typer.Option("--aided", help="Sweep, return and near end of the hazard through 7x50 binoculars.")
    ] = False,
    scan_rad_per_s: Annotated[
        float | None, typer.Option("--scan-rad-per-s", help="The beam (not the mirror) turns so fast.")
    ] = None,
    scan_period_s: Annotated[
        float | None, typer.Option("--scan-period-s", help="From one pass to the next; a single pass if not given.")
    ] = None,
    reflector_distance: Annotated[
        float | None, typer.Option("--reflector-distance", help="Of a retroreflector that sends it back, m.")
    ] = None,
    reflector_diameter_mm: Annotated[
        float, typer.Option("--reflector-diameter-mm", help="Of its clear face, mm.")
    ] = 50.8,
    subtense_mrad: Annotated[
        float, typer.Option("--subtense-mrad", help="Angle of the apparent source where the eye is; up to 1.5 a point.")
    ] = 1.5,
    edition: Annotated[
        str, typer.Option("--edition", metavar=EDITIONS, callback=one_of(EDITIONS), help="Of the limits.")
    ] = "iec2014",
    json: Json = False,
) -> None:
    """Laser safety of a beam: limits of exposure, class with reasons, hazard distances."""
    from catseye.gateways.optics.safety_objects import Question, safety_object, safety_passages, safety_table
    from catseye.gateways.writers.objects import json_line
    from catseye.optics.safety.hazard import LaserBeam

    if scan_period_s is not None and scan_rad_per_s is None:
        raise typer.BadParameter("needs --scan-rad-per-s.", param_hint="'--scan-period-s'")
    answer = safety_object(
        Question(
            LaserBeam(power_mw * 1e-3, wavelength_um, diameter_mm * 1e-3, divergence_mrad * 1e-3, waist_distance),
            edition=edition,
            duration=duration_s,
            aided=aided,
            subtense=subtense_mrad * 1e-3,
            scan=scan_rad_per_s,
            period=scan_period_s,
            reflector_distance=reflector_distance,
            reflector_diameter=reflector_diameter_mm * 1e-3,
        )
    )
    if json:
        say(json_line(answer))
        return
    say_verdict(answer)
    for title, text in safety_passages(answer):
        say(wrapped(title, text))
    say("\n" + safety_table(answer) + "\n")
    say(wrapped("Note", answer["notice"]))
