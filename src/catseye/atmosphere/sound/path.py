"""Sound along a path: wind, bent rays, means over the path.

Sound runs with speed c in the air, which itself moves with the wind: the front of a wave that is to travel along the
path must head upwind of it, so that its speed along the path is sqrt(c² - w_perp²) + w_par. Two directions at once give
both terms exactly when the air is the same along the path. A wind of 5 m/s along the path changes one direction by 8
°C, the mean of the reciprocal times not at all, and the reciprocal of the mean time by w²/c² (0.12 °C).

In air that is not the same everywhere: times add, so that a path gives the harmonic mean of c + w. With the variances
var(T), var(w) along the path the temperature of the mean speed is low by (3/4) var(T)/T + (2T/c²) var(w): 0.003 °C for
1 K rms, 0.005 °C for 1 m/s rms (vapour pressure the same all along). The group index's mean over the same path exceeds
the index at that temperature by (n - 1) var(T)/4T² only: 8e-10 for 1 K rms, since both means deviate
in the same direction.
"""

from typing import Any, NamedTuple

import numpy as np

from catseye.atmosphere.limit import ValidInterval

WIND = ValidInterval("wind", "m/s", -60.0, 60.0, "the formula for slow winds")


class Pair(NamedTuple):
    """Speed and wind from two travel times in opposite directions.

    speed_along   sqrt(c² - w_perp²), m/s
    wind          along the path, m/s, positive from A to B
    """

    speed_along: Any
    wind: Any


def pair(time_ab, time_ba, length) -> Pair:
    """Speed of sound and wind along a path from both travel times.

    Exact for uniform air.

    time_ab   travel time from A to B, s
    time_ba   travel time from B to A at the same instant, s
    length    of the path, m

    Source: exact geometry, derived at the head of this file. Good while the wind does not change between the two:
    within 1 s it changes by some 0.5 m/s, 0.25 m/s of speed (0.4 °C) when they are taken one after the other.

    >>> [round(float(v), 6) for v in pair(100.0 / 348.0, 100.0 / 338.0, 100.0)]
    [343.0, 5.0]
    """
    length = np.asarray(length, float)
    forth, back = length / np.asarray(time_ab, float), length / np.asarray(time_ba, float)
    return Pair(0.5 * (forth + back), 0.5 * (forth - back))


def travel_time(length, speed, wind_along, wind_across):
    """Travel time of sound along a straight path in uniform air and wind, s.

    length        of the path, m
    speed         of sound in air at rest, m/s
    wind_along    component along the path, m/s, positive from source to receiver
    wind_across   component across it, m/s, either sign

    Source: exact geometry, derived at the head of this file. Raises ValidityError for a wind above 60 m/s.

    >>> round(float(travel_time(100.0, 343.0, 5.0, 0.0)), 9)
    0.287356322
    """
    WIND.check(wind_along)
    WIND.check(wind_across)
    c, w = np.asarray(speed, float), np.asarray(wind_across, float)
    return np.asarray(length, float) / (np.sqrt(c**2 - w**2) + np.asarray(wind_along, float))


def straight_line_speed(speed_along, crosswind, u_crosswind):
    """Speed of sound in air at rest from that along a path, with uncertainty.

    speed_along   sqrt(c² - w_perp²), m/s
    crosswind     expected component across the path, m/s; 0 where unknown
    u_crosswind   its standard uncertainty, m/s; without an anemometer the rms of the site's winds

    A crosswind always slows sound, so that an unknown one is a bias as well: with w_perp normal about w0 with u the
    mean of w_perp² is w0² + u², its variance 4 w0² u² + 2 u⁴. Both are used: 5 m/s of unknown sign is +0.061 ± 0.086
    °C.

    Source: exact geometry; mean and variance of the square of a normal variable.

    >>> [round(float(v), 4) for v in straight_line_speed(343.0, 0.0, 5.0)]
    [343.0364, 0.0515]
    """
    c, w0, u = (np.asarray(v, float) for v in (speed_along, crosswind, u_crosswind))
    full = np.sqrt(c**2 + w0**2 + u**2)
    return full, np.sqrt(4.0 * w0**2 * u**2 + 2.0 * u**4) / (2.0 * full)


def bent_ray_excess(length, speed, gradient):
    """Relative time by which sound on its bent ray precedes the straight line.

    length     between the ends, m
    speed      of sound half-way on the straight line, m/s
    gradient   of the speed along the ray across the path, 1/s: 0.6 m/s per °C times °C/m, and the wind's own shear

    The ray is a circle of radius c/gradient: 5.7 km for 0.1 °C/m, a sag of 0.22 m over 100 m, and the sound arrives
    early by 1.3e-5 (0.007 °C too warm); for 1 °C/m near sunny ground 0.75 °C. Grows with the square of both.

    Source: exact for a constant gradient across the path, 1 - asinh(u)/u with u = g L/2c; [PIERCE19] chapter 8.

    >>> round(float(bent_ray_excess(100.0, 343.0, 0.06)) * 1e6, 2)
    12.75
    """
    u = 0.5 * np.asarray(gradient, float) * np.asarray(length, float) / np.asarray(speed, float)
    square = u**2
    small = square < 1e-4
    safe = np.where(small, 1.0, u)
    series = square / 6.0 * (1.0 - square * (9.0 / 20.0) * (1.0 - square * (25.0 / 42.0)))
    return np.where(small, series, 1.0 - np.arcsinh(safe) / safe)[()]
