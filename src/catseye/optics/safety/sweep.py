"""Laser safety of a sweeping beam: pulse trains and hazard distance.

As `hazard`: a warning for planning, never a certificate.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catseye.errors import ValidityError
from catseye.optics import gaussian_beam
from catseye.optics.safety.hazard import NAKED, NEAREST, ROUNDING, TIME_BASE, LaserBeam, Viewer, hazard_zone
from catseye.optics.safety.limits import ALPHA_MIN, SHORTEST, eye_limits, factors

SEARCH = 150  # distances at which a sweeping beam is tested


def sweep_pulse(
    beam: LaserBeam, distance: float, rate: float, *, aperture: float, transmission: float = 1.0
) -> tuple[float, float]:
    """Energy, J, and half-power duration, s, of a sweep across an aperture.

    beam           the laser's
    distance       m, above 0, from the scanning mirror
    rate           rad/s, above 0: of the beam, twice that of a mirror turning about a line in its face
    aperture       m, diameter
    transmission   share that comes through

    Source: the Gaussian beam integrated over chords of the aperture; duration as [IEC14] clause 3 defines it. Exact.

    >>> energy, duration = sweep_pulse(LaserBeam(0.010, 0.780, 0.001, 1e-3), 2.0, 0.5, aperture=7e-3)
    >>> round(energy * 1e6, 2), round(duration * 1e3, 2)  # 10 mW, 7 mm at 1 m/s
    (69.09, 6.91)
    """
    for name, value, unit in (("distance", distance, "m"), ("rate", rate, "rad/s"), ("aperture", aperture, "m")):
        if not 0.0 < value < np.inf:
            raise ValidityError(f"{name} = {value:g} {unit} is not above 0 and finite")
    from scipy.optimize import brentq

    a, w, speed = 0.5 * aperture, 0.5 * beam.diameter_at(distance), rate * distance
    node, weight = np.polynomial.legendre.leggauss(64)
    edge = np.arcsin(min(1.0, 5.0 * w / a))  # beyond 5 w from its axis the beam has exp(-50)
    y = a * np.sin(edge * node)
    chord = 2.0 * np.sqrt(a**2 - y**2) * np.sqrt(2.0 / np.pi) / w * np.exp(-2.0 * (y / w) ** 2)
    energy = beam.power * transmission / speed * float(np.sum(weight * edge * a * np.cos(edge * node) * chord))
    peak = float(gaussian_beam.share_within(a, w))
    half = brentq(lambda x: float(gaussian_beam.share_within(a, w, x)) - 0.5 * peak, 0.0, a + 3.0 * w)
    return energy, 2.0 * half / speed


def repetition_factor(count: float, duration: float, subtense: float, *, wavelength_um: float, total: float) -> float:
    """Repetition factor of a pulse limit: C_5 of IEC, C_P of others.

    From 1 down to 0.2.

    count           pulses within `total` or T_2, whichever is shorter
    duration        s, of one
    subtense        rad
    wavelength_um   um
    total           s, of the whole exposure

    Source: [IEC14] clause 4.3 f 3. For points and pulses longer than T_i it is 1; before 2014 it was count^(-1/4)
    always.

    >>> factors = [repetition_factor(1000, t, 1.5e-3, wavelength_um=0.780, total=10.0) for t in (1e-3, 1e-6)]
    >>> [round(factor, 3) for factor in factors]
    [1.0, 0.889]
    """
    f = factors(wavelength_um, duration, subtense)
    if duration > 0.25 or count <= 1.0:
        return 1.0
    if duration <= f.t_i:
        return 1.0 if total <= 0.25 or count <= 625 else max(0.4, 5.0 * count**-0.25)  # printed from 600 on: above 1
    if subtense <= 5e-3 or subtense > 0.1:
        return 1.0
    return max(0.4 if subtense <= f.alpha_max else 0.2, count**-0.25)


def sweep_ratio(
    beam: LaserBeam,
    distance: float,
    rate: float,
    *,
    duration: float,
    period: float | None = None,
    viewer: Viewer = NAKED,
    subtense: float = ALPHA_MIN,
    edition: str = "iec2014",
) -> float:
    """Exposure of an eye to a sweeping beam over its limit.

    1 is the limit.

    beam, distance, rate   as for `sweep_pulse`
    duration               s, of the exposure
    period                 s, above 0, from one pass to the next; None for a single one
    viewer, subtense, edition   what the eye looks through; the source; a name in EDITIONS

    The largest of three rules: each pass alone; the average of all; each pass alone by a limit reduced by
    `repetition_factor`. A pass as long as the exposure, or as the period, is a standing beam, the worst
    case. An exposure beyond 100 s is no safer than 100 s of it, the time over which a dose of blue light is counted.

    Source: [IEC14] clause 4.3 f, rules 1 to 3.

    >>> round(sweep_ratio(LaserBeam(0.010, 0.780, 0.003, 1e-3), 10.0, 0.5, duration=100.0), 3)
    1.236
    """
    _refuse_sweep(rate, period)
    ratios = []
    if duration > TIME_BASE:
        options: dict[str, Any] = {"period": period, "viewer": viewer, "subtense": subtense, "edition": edition}
        ratios.append(sweep_ratio(beam, distance, rate, duration=TIME_BASE, **options))
    for limit in eye_limits(beam.wavelength_um, duration, subtense, edition=edition):
        aperture = viewer.collecting(limit.aperture)
        steady = viewer.transmission * beam.power_within(aperture, distance) / limit.power
        energy, pulse = sweep_pulse(beam, distance, rate, aperture=aperture, transmission=viewer.transmission)
        if pulse >= min(duration, np.inf if period is None else period):
            ratios.append(steady)
            continue
        longest = min(duration, factors(beam.wavelength_um, duration, subtense).t_2)
        count, train = (1.0 if period is None else float(np.ceil(t / period)) for t in (duration, longest))
        ratios.append(min(steady, count * energy / (duration * limit.power)))
        if limit.name == "chemistry on the retina":  # a dose: only the sum matters
            continue
        short = max(pulse, SHORTEST)
        single_pass = {
            m.name: m.power * short for m in eye_limits(beam.wavelength_um, short, subtense, edition=edition)
        }
        shrunk = repetition_factor(train, short, subtense, wavelength_um=beam.wavelength_um, total=duration)
        ratios.append(min(steady, energy / (single_pass[limit.name] * shrunk)))
    return max(ratios)


def sweep_hazard_distance(
    beam: LaserBeam,
    rate: float,
    *,
    duration: float,
    period: float | None = None,
    viewer: Viewer = NAKED,
    subtense: float = ALPHA_MIN,
    edition: str = "iec2014",
) -> float:
    """Distance, m, beyond which a sweeping beam exceeds no eye limit.

    0 if nowhere from 0.1 m on.

    Arguments as for `sweep_ratio`. Searched within the zone of the standing beam.

    >>> round(sweep_hazard_distance(LaserBeam(0.3, 0.780, 0.003, 1e-3), 0.5, duration=100.0), 1)
    75.8
    """
    _refuse_sweep(rate, period)
    far = hazard_zone(beam, eye_limits(beam.wavelength_um, duration, subtense, edition=edition), viewer)[1]
    if far <= NEAREST:
        return 0.0
    from scipy.optimize import brentq

    def over(log_distance: float) -> float:
        options: dict[str, Any] = {
            "duration": duration,
            "period": period,
            "viewer": viewer,
            "subtense": subtense,
            "edition": edition,
        }
        return sweep_ratio(beam, float(np.exp(log_distance)), rate, **options) - 1.0 - ROUNDING

    tried: NDArray[np.float64] = np.linspace(np.log(NEAREST), np.log(far), SEARCH)
    for k in range(SEARCH - 1, -1, -1):
        if over(float(tried[k])) > 0.0:
            return far if k == SEARCH - 1 else float(np.exp(brentq(over, tried[k], tried[k + 1])))
    return 0.0


def _refuse_sweep(rate: float, period: float | None) -> None:
    """Raise ValidityError unless rate and period are above 0 and finite."""
    for name, value, unit in (("rate", rate, "rad/s"), ("period", 1.0 if period is None else period, "s")):
        if not 0.0 < value < np.inf:
            raise ValidityError(f"{name} = {value:g} {unit} is not above 0 and finite")
