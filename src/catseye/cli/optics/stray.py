"""The command of stray light."""

from pathlib import Path
from typing import Annotated

import typer

from catseye.cli.commands import Json, app
from catseye.cli.option_groups import grouped
from catseye.cli.results import Strict, tell


def _pairs(values: list[str]) -> list[tuple[float, float]]:
    """Pairs of numbers, share and millimetres."""
    result = []
    for text in values:
        try:
            share, length = map(float, text.split(","))
        except ValueError as problem:
            raise typer.BadParameter(f"{text!r} is not a share and millimetres, as 0.001,25.") from problem
        result.append((share, length))
    return result


@app.command(
    epilog="\b\nExample: catseye stray --distance 100 --second-pass 0.0004 --leakage 0.0005 --reflector=0.002,-25 "
    "--out stray.svg\n"
    "Example: catseye stray --distance 100 --feedback 1e-13 --regulation-rad 0.5 --shots 10 --movement-um 0.3"
)
@grouped
def stray(  # noqa: PLR0913 - its options are its command line
    distance: Annotated[float, typer.Option("--distance", metavar="M", help="Ranger to target, m.")],
    path: Annotated[
        list[str] | None,
        typer.Option("--path", metavar="SHARE,MM", help="Path that moves with the target: share, detour; may repeat."),
    ] = None,
    reflector: Annotated[
        list[str] | None,
        typer.Option(
            "--reflector", metavar="SHARE,MM", help="Further retroreflector: share, mm beyond the target; may repeat."
        ),
    ] = None,
    second_pass: Annotated[
        float, typer.Option("--second-pass", help="Share that the detector sends out and the target returns.")
    ] = 0.0,
    leakage: Annotated[
        float, typer.Option("--leakage", help="Amplitude of the leakage in the head, over the light's.")
    ] = 0.0,
    gain: Annotated[
        float, typer.Option("--gain", help="Gain of the sine channel over the cosine channel, less 1.")
    ] = 0.0,
    skew_mrad: Annotated[float, typer.Option("--skew-mrad", help="Departure of the channels from quadrature.")] = 0.0,
    feedback: Annotated[
        float | None, typer.Option("--feedback", help="Power returned into the laser's mode, over the emitted power.")
    ] = None,
    coherence: Annotated[float, typer.Option("--coherence", help="Contrast that linewidth and speckle leave.")] = 1.0,
    regulation_rad: Annotated[
        float, typer.Option("--regulation-rad", help="Phase for each unit of relative power, by the regulation.")
    ] = 0.0,
    facet: Annotated[float, typer.Option("--facet", help="Reflectance of the laser's facet.")] = 0.32,
    enhancement: Annotated[float, typer.Option("--enhancement", help="Linewidth enhancement factor.")] = 5.0,
    laser_path_mm: Annotated[float, typer.Option("--laser-path-mm", help="Optical path of the laser's cavity.")] = 1.0,
    shots: Annotated[int, typer.Option("--shots", min=1, help="Number of shots that are averaged.")] = 1,
    movement_um: Annotated[
        float, typer.Option("--movement-um", help="Change of the path from shot to shot, standard deviation.")
    ] = 0.0,
    wavelength_um: Annotated[
        float, typer.Option("--wavelength-um", help="Wavelength of the light in air, µm.")
    ] = 0.780,
    modulation_hz: Annotated[float, typer.Option("--modulation-hz", help="Frequency of the modulation.")] = 1.5e9,
    group_index: Annotated[float, typer.Option("--group-index", help="Group index of the air.")] = 1.00026,
    limit_um: Annotated[float, typer.Option("--limit-um", help="Range error allowed, µm.")] = 10.0,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FIGURE", help="Figure over half a wavelength: .svg, .pdf or .png."),
    ] = None,
    json: Json = False,
    strict: Strict = False,
) -> None:
    """Range errors by light that goes another way, or back into the laser."""
    from catseye.api.light.stray import stray as stray_of

    result = stray_of(
        distance,
        path=_pairs(path or []),
        reflector=_pairs(reflector or []),
        second_pass=second_pass,
        leakage=leakage,
        gain=gain,
        skew_mrad=skew_mrad,
        feedback=feedback,
        coherence=coherence,
        regulation_rad=regulation_rad,
        facet=facet,
        enhancement=enhancement,
        laser_path_mm=laser_path_mm,
        shots=shots,
        movement_um=movement_um,
        wavelength_um=wavelength_um,
        modulation_hz=modulation_hz,
        group_index=group_index,
        limit_um=limit_um,
    )
    result.save_pages(figure=out)
    tell(result, json=json, strict=strict, rows=tuple(result.rows()), written=[("Figure", out)])
