"""The Sun: the coordinator's vector, and the ranger's own avoidance."""

import numpy as np
from numpy.typing import ArrayLike

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.geometry.sky.time_tag import PER_SECOND
from catseye.ranger.handlers.axes import Handler
from catseye.ranger.state import RangerState, Values
from catseye.ranger.sun_watch import HALF_ANGLE, nearest_sun, way_out

SUN_NS = PER_SECOND  # the Sun moves 15" in it


def _sun(z: RangerState, _: int, *vector: float) -> Values:
    if vector:
        size = float(np.linalg.norm(vector))
        if not 0.99 <= size <= 1.01:
            raise InputError(f"vector to the Sun is {size:.4g} long (expected 1)")
        z.sun_vector, z.sun_told_ns = vector, z.now_ns()
    if z.sun_vector is None:
        raise InputError("no Sun vector received (expected SUN x, y, z)")
    return tuple(f"{v:.7f}" for v in z.sun_vector)


def watch_sun(z: RangerState) -> list[str]:
    """Check the beam against the Sun once a second: laser off, drive away.

    Returns one line when it begins.
    """
    now_ns = z.now_ns()
    if 0 < z.next_sun_ns - now_ns <= SUN_NS or not (z.initialised and z.homed):
        return []
    z.next_sun_ns = now_ns + SUN_NS
    station, suns, starts = z.cubes.station, z.suns(), not z.in_sun
    least = nearest_sun(station, z.here, z.here, suns=suns, exact=True)
    z.in_sun = least < HALF_ANGLE
    if not z.in_sun:
        return []
    z.switch_laser(False)
    away = _leave_sun(z, suns)
    text = f"the Sun is {least / DEGREE:.1f} deg from the beam (expected {HALF_ANGLE / DEGREE:g}): laser off, {away}"
    return [text] if starts else []


def _leave_sun(z: RangerState, suns: list[ArrayLike]) -> str:
    """Drive out of the cone if a path is free; the action, in words."""
    station, moving = z.cubes.station, any(z.head.moving(axis) for axis in (0, 1))
    if moving and z.heading and nearest_sun(station, z.here, z.heading, suns=suns, exact=True) >= HALF_ANGLE:
        return "the current move leads out"
    z.head.stop()
    if not (z.head.enabled(0) and z.head.enabled(1)):
        return "amplifiers are off: cover the mirror"
    end = way_out(station, z.here, suns, limits=z.limits)
    if end is None:
        return "no safe path out: cover the mirror"
    z.aimed, z.heading = None, end
    started = [
        z.head.start(axis, end[axis], velocity=settings.velocity, acceleration=settings.acceleration)
        for axis, settings in enumerate(z.axes)
    ]
    return f"driving away to {end[0]}, {end[1]}" if all(started) else "the axes do not start: retried each second"


SUN: dict[str, Handler] = {"SUN": _sun}
