"""The command of figures that no other command draws."""

from pathlib import Path
from typing import Annotated, Any

import typer

from catseye.cli.commands import Json, Quiet, app
from catseye.cli.point import as_mjd, time_text
from catseye.cli.terminal import say
from catseye.errors import InputError

KINDS = ("sky", "servo")
MARK = "<!-- catseye plot"
USUAL_COUNTS_PER_S, USUAL_COUNTS_PER_S2 = 12_000.0, 40_000.0  # of axes whose record does not say
LONGEST_MOVE = 120.0  # s, of a drawn move: a few seconds of computing


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
    "Example: catseye plot servo --counts 10000 --out servo.svg"
)
def plot(
    kind: Annotated[str, typer.Argument(metavar="KIND", callback=_known, help=f"{' or '.join(KINDS)}.")],
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
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A figure: a ranger's sky with Sun, boxes and a slew; or a move of a mirror's servo."""
    from catseye.gateways.objects import json_line
    from catseye.gateways.output import whole_file

    if kind == "sky":
        if monument is None or mirror is None or at is None:
            raise typer.BadParameter("sky needs --monument, --mirror and --at.", param_hint="'KIND'")
        if (start is None) != (end is None):
            raise typer.BadParameter("go together: --from and --to.", param_hint="'--from'")
        way = None if start is None or end is None else (_counts(start), _counts(end))
        place = {"latitude_deg": latitude_deg, "longitude_deg": longitude_deg}
        drawn, told = _sky(monument, mirror, as_mjd(at), way, keep_out, **place)
    else:
        drawn, told = _servo(mirror, axis, counts)
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


def _sky(
    monument: Path,
    mirror: Path,
    mjd: float,
    way: tuple[tuple[float, float], tuple[float, float]] | None,
    keep_out: Path | None,
    *,
    latitude_deg: float | None,
    longitude_deg: float | None,
) -> tuple[str, dict[str, Any]]:
    """The figure, and what it says in words and numbers."""
    from catseye.gateways.sky_figures import sky_figure
    from catseye.geometry.slew import Pace
    from catseye.ranger.motion_units import pace_of
    from catseye.records.keep_out import KeepOut
    from catseye.records.mirror import MirrorGeometry
    from catseye.records.monument import MonumentGeometry
    from catseye.records.reading import read_record
    from catseye.reduction.guard import guard_of
    from catseye.reduction.pointing import station_of
    from catseye.reduction.reroute import route
    from catseye.reduction.sighting import place_of_monument

    stands, head = read_record(monument, MonumentGeometry), read_record(mirror, MirrorGeometry)
    zones = KeepOut() if keep_out is None else read_record(keep_out, KeepOut)
    said = all(getattr(head, key) for key in ("abv_0", "aba_0", "abv_1", "aba_1"))
    usual = Pace((USUAL_COUNTS_PER_S,) * 2, (USUAL_COUNTS_PER_S2,) * 2)
    guard = guard_of(
        stands.monument,
        station_of(stands, head),
        head,
        keep_out=zones,
        place=place_of_monument(stands, longitude_deg, latitude_deg),
        pace=pace_of(head) if said else usual,
    )
    if way is None:
        return sky_figure(guard, mjd), {"pace": "of the record" if said else "assumed"}
    asked, found = guard.slew(mjd, *way), route(guard, mjd, *way)
    return sky_figure(guard, mjd, slew=way, route=found if found.found else None), {
        "pace": "of the record" if said else f"assumed, {USUAL_COUNTS_PER_S:g} counts/s",
        "slew_allowed": asked.allowed,
        "slew_refused": asked.reason or None,
        "free_at_mjd": asked.free_at_mjd,
        "route": str(found.status),
        "waypoints": found.waypoints.tolist(),
        "duration": found.duration,
        "prime": found.prime if found.found else None,
    }


def _servo(mirror: Path | None, axis: int, counts: int) -> tuple[str, dict[str, Any]]:
    """A move of the assumed axis, with a mirror's settings or with those of the tuning study."""
    from catseye.constants import DEGREE
    from catseye.gateways.servo_figures import move_figure
    from catseye.ranger.motion_units import SAMPLE_TIME, acceleration_integer, velocity_integer
    from catseye.records.mirror import MirrorGeometry
    from catseye.records.reading import read_record
    from catseye.simulator.motor import AxisDesign
    from catseye.simulator.tuning import Filter, design_filter, margins, plant_of, ready_axis, step_metrics

    plant = plant_of(AxisDesign())
    velocity, acceleration = velocity_integer(USUAL_COUNTS_PER_S), acceleration_integer(USUAL_COUNTS_PER_S2)
    if mirror is None:
        chosen = design_filter(plant, crossover_hz=30.0, interval=3)
    else:
        head = read_record(mirror, MirrorGeometry)
        names = [f"{key}_{axis}" for key in ("fkp", "fki", "fkd", "fil", "fsi", "abv", "aba")]
        values = [getattr(head, name) for name in names]
        for name, value in zip(names, values, strict=True):
            if value is None:
                raise InputError(f"{mirror}: {name} is missing (expected with all of {', '.join(names)})")
        chosen, velocity, acceleration = Filter(*values[:5]), values[5], values[6]
        if not velocity or not acceleration:
            raise InputError(f"{mirror}: {names[5]} = {velocity}, {names[6]} = {acceleration} (expected above 0)")
    made = ready_axis(chosen, velocity=velocity, acceleration=acceleration)
    made.abp(counts)
    made.stt()
    rate = velocity / 65_536
    samples = round(counts / rate + 2.0 * rate * 65_536 / acceleration + 0.5 / SAMPLE_TIME)
    if samples * SAMPLE_TIME > LONGEST_MOVE:
        raise InputError(
            f"a move of {counts} counts with abv {velocity}, aba {acceleration} takes up to "
            f"{samples * SAMPLE_TIME:.0f} s (expected up to {LONGEST_MOVE:g} s)"
        )
    trace = made.run(samples)
    found, came = margins(plant, chosen), step_metrics(trace.time, trace.actual, target=counts)
    return move_figure(trace, target=counts, plant=plant), {
        "axis": "assumed: nothing public says inertia, torque and friction of the ZY's",
        "kp": chosen.kp,
        "ki": chosen.ki,
        "kd": chosen.kd,
        "il": chosen.il,
        "interval": chosen.interval,
        "phase_margin_deg": found.phase / DEGREE,
        "following_error_counts": float(abs(trace.error).max()),
        "settled_after_s": came.settling,
        "motor_off": made.chip.motor_off,
    }
