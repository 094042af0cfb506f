"""The command of figures that no other command draws."""

from pathlib import Path
from typing import Annotated, Any

import typer

from catseye.cli.commands import MODELS, Json, Quiet, app, known_model, uncertainty
from catseye.cli.point import time_text
from catseye.cli.terminal import say
from catseye.errors import InputError

KINDS = ("sky", "servo", "air")
MARK = "<!-- catseye plot"


def _known(kind: str) -> str:
    if kind not in KINDS:
        raise typer.BadParameter(f"{kind!r} is not one of {', '.join(KINDS)}.")
    return kind


def _pair(text: str | None) -> str | None:
    if text is not None:
        _counts(text)
    return text


def _counts(text: str) -> tuple[float, float]:
    try:
        azimuth, elevation = (float(part) for part in text.split(","))
    except ValueError as problem:
        raise typer.BadParameter(f"{text!r} is not AZIMUTH,ELEVATION in counts.") from problem
    if not (abs(azimuth) <= 1e6 and abs(elevation) <= 1e6):
        raise typer.BadParameter(f"{text!r} is not within 1e6 counts.")
    return azimuth, elevation


@app.command(
    epilog="\b\nExample: catseye plot sky --monument examples/night-01/monuments/ZY103.toml --mirror "
    "examples/night-01/mirrors/ZP103.toml --at 2003-09-10T18:00:00Z --longitude-deg=-79.84 "
    "--keep-out examples/keep-out.toml --from=18500,10000 --to=21500,12000 --out sky.svg\n"
    "Example: catseye plot servo --counts 10000 --out servo.svg\n"
    "Example: catseye plot air --temperature-c 20 --pressure-hpa 933 --humidity-percent 50 --u-temperature-c 0.2 "
    "--out air.svg"
)
def plot(
    kind: Annotated[str, typer.Argument(metavar="KIND", callback=_known, help=f"{', '.join(KINDS)}.")],
    out: Annotated[Path, typer.Option("--out", metavar="FIGURE.svg", help="Figure to write: new, or an earlier one.")],
    monument: Annotated[Path | None, typer.Option("--monument", metavar="M.toml", help="sky: of the monument.")] = None,
    mirror: Annotated[
        Path | None, typer.Option("--mirror", metavar="Z.toml", help="sky: on it; servo: whose settings to take.")
    ] = None,
    at: Annotated[str | None, typer.Option("--at", metavar="TIME", callback=time_text, help="sky: UTC or MJD.")] = None,
    latitude_deg: Annotated[float | None, typer.Option("--latitude-deg", help="sky: if the record has none.")] = None,
    longitude_deg: Annotated[float | None, typer.Option("--longitude-deg", help="sky: if the record has none.")] = None,
    keep_out: Annotated[
        Path | None, typer.Option("--keep-out", metavar="BOXES.toml", help="sky: boxes that no beam may enter.")
    ] = None,
    start: Annotated[
        str | None, typer.Option("--from", metavar="AZ,EL", callback=_pair, help="sky: a slew from these counts ...")
    ] = None,
    end: Annotated[
        str | None, typer.Option("--to", metavar="AZ,EL", callback=_pair, help="sky: ... to these, and the way round.")
    ] = None,
    counts: Annotated[int, typer.Option("--counts", min=1, max=1_000_000, help="servo: length of the move.")] = 10_000,
    axis: Annotated[int, typer.Option("--axis", min=0, max=1, help="servo: 0 azimuth, 1 elevation.")] = 0,
    temperature_c: Annotated[float, typer.Option("--temperature-c", help="air: °C.")] = 20.0,
    pressure_hpa: Annotated[float, typer.Option("--pressure-hpa", help="air: hPa.")] = 1013.25,
    humidity_percent: Annotated[float, typer.Option("--humidity-percent", help="air: over liquid water, %.")] = 50.0,
    wavelength_um: Annotated[float, typer.Option("--wavelength-um", help="air: of vacuum, µm.")] = 0.780,
    model: Annotated[
        str, typer.Option("--model", metavar=MODELS, callback=known_model, help="air: formula of the index.")
    ] = "ciddor_hill1999",
    co2_ppm: Annotated[float, typer.Option("--co2-ppm", help="air: carbon dioxide, ppm.")] = 450.0,
    u_temperature_c: Annotated[float, typer.Option(callback=uncertainty, help="air: of the temperature, °C.")] = 0.0,
    u_pressure_hpa: Annotated[float, typer.Option(callback=uncertainty, help="air: of the pressure, hPa.")] = 0.0,
    u_humidity_percent: Annotated[float, typer.Option(callback=uncertainty, help="air: of the humidity, %.")] = 0.0,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A figure: a ranger's sky with Sun, boxes and a slew; a move of a mirror's servo; the index of air."""
    from catseye.gateways.air_figures import air_plot
    from catseye.gateways.objects import json_line
    from catseye.gateways.output import whole_file
    from catseye.gateways.plots import servo_plot, sky_plot
    from catseye.geometry.time_tag import mjd_of

    if kind == "sky":
        if monument is None or mirror is None or at is None:
            raise typer.BadParameter("sky needs --monument, --mirror and --at.", param_hint="'KIND'")
        if (start is None) != (end is None):
            raise typer.BadParameter("go together: --from and --to.", param_hint="'--from'")
        way = None if start is None or end is None else (_counts(start), _counts(end))
        place = {"latitude_deg": latitude_deg, "longitude_deg": longitude_deg}
        drawn, told = sky_plot(monument, mirror, mjd_of(at), way, keep_out, **place)
    elif kind == "servo":
        drawn, told = servo_plot(mirror, axis, counts)
    else:
        drawn, told = air_plot(
            temperature_c,
            pressure_hpa,
            humidity_percent,
            wavelength_um=wavelength_um,
            model=model,
            co2_ppm=co2_ppm,
            u_temperature_c=u_temperature_c,
            u_pressure_hpa=u_pressure_hpa,
            u_humidity_percent=u_humidity_percent,
        )
    for given in (monument, mirror, keep_out):
        if given is not None and given.resolve() == out.resolve():
            raise InputError(f"--out {out}: is an input of this figure (expected another name)")
    with whole_file(out, "--out", MARK) as pieces:
        pieces.append(drawn.replace("<svg ", f"{MARK} {kind} -->\n<svg ", 1))
    if json:
        say(json_line({"kind": kind, "written": str(out), **told}))
    elif not quiet:
        for line in (*_lines(told), f"written to {out}"):
            say(line)


def _lines(told: dict[str, Any]) -> list[str]:
    return [f"{key.replace('_', ' ')}: {value}" for key, value in told.items() if value not in (None, "")]
