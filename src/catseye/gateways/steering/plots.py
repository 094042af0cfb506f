"""Figures of `catseye plot` made from records; the drawing is in separate files."""

from pathlib import Path
from typing import Any

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.gateways.steering.servo_figures import move_figure
from catseye.gateways.steering.sky_figures import sky_figure
from catseye.gateways.writers.drawing import Svg
from catseye.geometry.mirror.slew import Pace
from catseye.ranger.motion_units import SAMPLE_TIME, acceleration_integer, pace_of, velocity_integer
from catseye.records.files.reading import read_record
from catseye.records.site.keep_out import KeepOut
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.monument import MonumentGeometry
from catseye.reduction.site.stations import station_of
from catseye.reduction.steering.guard import guard_of
from catseye.reduction.steering.reroute import route
from catseye.reduction.steering.sighting import place_of_monument
from catseye.simulator.servo.motor import AxisDesign
from catseye.simulator.servo.tuning import Filter, design_filter, margins, plant_of, ready_axis, step_metrics

USUAL_COUNTS_PER_S, USUAL_COUNTS_PER_S2 = 12_000.0, 40_000.0  # of axes without these in their record
LONGEST_MOVE = 120.0  # s, of a drawn move: takes a few seconds to compute


def sky_plot(
    monument: Path,
    mirror: Path,
    mjd: float,
    *,
    way: tuple[tuple[float, float], tuple[float, float]] | None,
    keep_out: Path | None,
    latitude_deg: float | None,
    longitude_deg: float | None,
) -> tuple[Svg, dict[str, Any]]:
    """Sky of a ranger as SVG text, and its summary.

    monument, mirror   records
    mjd                UTC
    way                counts from and to of the requested slew; None for none
    keep_out           boxes; none if None
    latitude_deg, longitude_deg   of the site, if not in the monument's record
    """
    stands, head = read_record(monument, MonumentGeometry), read_record(mirror, MirrorGeometry)
    zones = KeepOut() if keep_out is None else read_record(keep_out, KeepOut)
    recorded = all(getattr(head, key) for key in ("abv_0", "aba_0", "abv_1", "aba_1"))
    usual = Pace((USUAL_COUNTS_PER_S,) * 2, (USUAL_COUNTS_PER_S2,) * 2)
    guard = guard_of(
        stands.monument,
        station_of(stands, head),
        head,
        keep_out=zones,
        place=place_of_monument(stands, longitude_deg, latitude_deg),
        pace=pace_of(head) if recorded else usual,
    )
    if way is None:
        return sky_figure(guard, mjd), {"pace": "of the record" if recorded else "assumed"}
    requested, way_round = guard.slew(mjd, *way), route(guard, mjd, *way)
    return sky_figure(guard, mjd, slew=way, route=way_round if way_round.found else None), {
        "pace": "of the record" if recorded else f"assumed, {USUAL_COUNTS_PER_S:g} counts/s",
        "slew_allowed": requested.allowed,
        "slew_refused": requested.reason or None,
        "free_at_mjd": requested.free_at_mjd,
        "route": str(way_round.status),
        "waypoints": way_round.waypoints.tolist(),
        "duration": way_round.duration,
        "prime": way_round.prime if way_round.found else None,
    }


def servo_plot(mirror: Path | None, axis: int, counts: int) -> tuple[Svg, dict[str, Any]]:
    """Move of the assumed axis as SVG text, with summary.

    mirror   record with the settings; those of the tuning study if None
    axis     0 azimuth, 1 elevation
    counts   length of the move
    """
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
    servo = ready_axis(chosen, velocity=velocity, acceleration=acceleration)
    servo.abp(counts)
    servo.stt()
    rate = velocity / 65_536
    samples = round(counts / rate + 2.0 * rate * 65_536 / acceleration + 0.5 / SAMPLE_TIME)
    if samples * SAMPLE_TIME > LONGEST_MOVE:
        raise InputError(
            f"a move of {counts} counts with abv {velocity}, aba {acceleration} takes up to "
            f"{samples * SAMPLE_TIME:.0f} s (expected up to {LONGEST_MOVE:g} s)"
        )
    trace = servo.run(samples)
    stability, came = margins(plant, chosen), step_metrics(trace.time, trace.actual, target=counts)
    return move_figure(trace, target=counts, plant=plant), {
        "axis": "assumed: inertia, torque and friction of the ZY's axis are not published",
        "kp": chosen.kp,
        "ki": chosen.ki,
        "kd": chosen.kd,
        "il": chosen.il,
        "interval": chosen.interval,
        "phase_margin_deg": stability.phase / DEGREE,
        "following_error_counts": float(abs(trace.error).max()),
        "settled_after_s": came.settling,
        "motor_off": servo.chip.motor_off,
    }
