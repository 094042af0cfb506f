"""The command of the link budget."""

from typing import TYPE_CHECKING, Annotated

import typer

from catseye.cli.commands import Json, app
from catseye.cli.results import say_verdict
from catseye.cli.terminal import say
from catseye.constants import DEGREE
from catseye.reduction.optics.link import Link, LinkReflector

if TYPE_CHECKING:
    from catseye.reduction.optics.link_budget import LinkBudget


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
    from catseye.gateways.writers.objects import json_line
    from catseye.reduction.optics.link_budget import link_budget

    head = Link(
        power=power_mw * 1e-3,
        depth=depth,
        waist=waist_mm * 1e-3,
        receiver=receiver_mm * 1e-3,
        transmission=transmission,
        duration=duration,
        blocked_noise_volt=blocked_noise_volt,
    )
    reflector = LinkReflector(aperture=aperture_mm * 1e-3, height=height_mm * 1e-3, index=index)
    if measured_volt is not None:
        head = head.scaled(link_budget(head, reflector, distance).amplitude_volt, measured_volt)
    light = {"incidence": incidence_deg * DEGREE, "background": background_uw * 1e-6}
    budget = link_budget(head, reflector, distance, offset=offset_mm * 1e-3, **light)
    answer = _object(budget, head, distance)
    if json:
        say(json_line(answer))
        return
    say_verdict(answer)
    _tell(budget, head)


def _object(budget: "LinkBudget", head: Link, distance: float) -> dict[str, object]:
    word = {"word": "doubtful", "why": "the return is more than the converter takes: it clips"}
    if not budget.clipped:
        word = {
            "word": "good",
            "why": f"a return of {budget.amplitude_volt:.3g} V, noise of a range below 1 mm",
        }
        if budget.u_range > 1e-3:
            word = {"word": "doubtful", "why": f"the range's noise is {1e3 * budget.u_range:.2g} mm"}
    return {
        "verdict": word,
        "distance": distance,
        "factors": budget.factors,
        "received_power": budget.received,
        "amplitude_volt": budget.amplitude_volt,
        "u_volt": budget.u_volt,
        "u_phase": budget.u_phase,
        "u_range": budget.u_range,
        "crosstalk_range": budget.crosstalk_range,
        "noise_shares": budget.noise_shares,
        "volts_per_ampere": head.volts_per_ampere,
        "clipped": budget.clipped,
    }


def _tell(budget: "LinkBudget", head: Link) -> None:
    import math

    say(f"{'laser':<32}{head.power * 1e3:10.4g} mW")
    for name, share in budget.factors.items():
        say(f"{name:<32}{10 * math.log10(share):10.2f} dB")
    say(f"{'on the detector':<32}{budget.received * 1e3:10.4g} mW")
    clipped = "  more than the converter takes: it clips" if budget.clipped else ""
    say(f"{'amplitude of the return':<32}{budget.amplitude_volt:10.4g} V{clipped}")
    say(f"{'noise of the range':<32}{budget.u_range * 1e6:10.4g} µm  (u of phase {budget.u_phase * 1e3:.3g} mrad)")
    for name, share in sorted(budget.noise_shares.items(), key=lambda item: -item[1]):
        say(f"{'':<4}{name:<28}{100 * share:10.3g} %")
    say(f"{'crosstalk left, at worst':<32}{budget.crosstalk_range * 1e6:10.4g} µm")
