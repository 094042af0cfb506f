"""The command of the glasses."""

from typing import Annotated

import typer

from catseye.cli.commands import Json, app
from catseye.cli.results import tell


@app.command(
    epilog="\b\nExample: catseye glass BK7-old --height-mm 38.4\n"
    "Example: catseye glass BK7-old --height-mm 12.7 --plate-mm 20\n"
    "Example: catseye glass fused-silica --wavelength-um 0.85 --temperature-c=-10"
)
def glass(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Name of the glass; all without it.")] = None,
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="Vacuum wavelength, µm.")] = 0.780,
    temperature_c: Annotated[float, typer.Option("--temperature-c", help="Temperature of the glass, °C.")] = 20.0,
    height_mm: Annotated[
        float,
        typer.Option("--height-mm", help="Height of a prism of it at 20 °C, face to corner, mm."),
    ] = 38.1,
    plate_mm: Annotated[
        float | None,
        typer.Option("--plate-mm", help="From the face of a mirror to the face of the prism in its back, mm."),
    ] = None,
    json: Json = False,
) -> None:
    """Indices of a glass, a prism of it, and errors of another glass."""
    from catseye.api.optics import glass as glass_of

    result = glass_of(
        name, wavelength_um=wavelength_um, temperature_c=temperature_c, height_mm=height_mm, plate_mm=plate_mm
    )
    tell(result, json=json)
