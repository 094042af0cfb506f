"""Alternative interpretations of a table of star offsets.

Each is tried on a copy: exchanged columns, zenith distances, other units. A reading is a change of the four angles of
every row. All have as many unknowns and one unknown scatter, the same for both coordinates on the sky, so that their
likelihoods compare directly: of n rows with the residuals' squares S

    log L = -n log S + sum of log cos E + (numbers changed in scale) log scale,

cos E because azimuth times cos E, not azimuth, scatters alike. A wrong reading of correct rows reaches k times the
right one's likelihood with a chance of 1/k at most.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from catseye.constants import ARCSECOND, DEGREE
from catseye.geometry.antenna.pointing_series import columns, design

DECISIVE = float(np.log(1e4))  # a wrong reading of a correct table passes it once in 10 000
FARTHEST = 5.0 * DEGREE  # between sky and encoders: as `records.laboratory.star_offsets` reads a table
RADIANS, HOURS = 1.0 / DEGREE, 15.0

Angles = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # azimuth, elevation; of the sky, of the encoders
Reading = Callable[[Angles], tuple[Angles, float]]


@dataclass(frozen=True)
class BetterReading:
    """Interpretation that fits better.

    text      its name, with the remaining scatter
    sky_rms   rad
    gain      log likelihood above the table's as it stands
    """

    text: str
    sky_rms: float
    gain: float


def _scaled(azimuth: float, elevation: float) -> Reading:
    """Interpretation of angles typed in other units.

    Read as degrees, they are in units of so many degrees.
    """

    def reading(angles: Angles) -> tuple[Angles, float]:
        a, e, b, f = angles
        size = np.log(azimuth) + np.log(elevation)
        return (a * azimuth, e * elevation, b * azimuth, f * elevation), float(len(a) * size)

    return reading


READINGS: dict[str, Reading] = {
    "elevations are zenith distances": lambda s: ((s[0], np.pi / 2 - s[1], s[2], np.pi / 2 - s[3]), 0.0),
    "azimuths and elevations are exchanged": lambda s: ((s[1], s[0], s[3], s[2]), 0.0),
    "azimuths of sky and encoders are exchanged": lambda s: ((s[2], s[1], s[0], s[3]), 0.0),
    "elevations of sky and encoders are exchanged": lambda s: ((s[0], s[3], s[2], s[1]), 0.0),
    "angles are radians": _scaled(RADIANS, RADIANS),
    "azimuths are radians": _scaled(RADIANS, 1.0),
    "elevations are radians": _scaled(1.0, RADIANS),
    "angles are hours": _scaled(HOURS, HOURS),
    "azimuths are hours": _scaled(HOURS, 1.0),
    "elevations are hours": _scaled(1.0, HOURS),
}


def better_readings(
    azimuth: np.ndarray, elevation: np.ndarray, observed: np.ndarray, *, terms: Sequence[str]
) -> tuple[BetterReading, ...]:
    """Interpretations that fit decisively better.

    The best and those that nearly equal it.

    azimuth, elevation   (n,) rad, of the stars that are used, on the sky
    observed             (n, 2) rad, azimuth times cos E and elevation: encoders less sky
    terms                of the series
    """
    a, e = azimuth, elevation
    across, up = observed.T
    as_read: Angles = (a, e, a + across / np.cos(e), e + up)
    chosen = columns(terms)
    as_typed, _ = _likelihood(as_read, chosen)
    result = []
    for text, reading in READINGS.items():
        angles, jacobian = reading(as_read)
        if _possible(angles):
            likelihood, rms = _likelihood(angles, chosen)
            gain = likelihood + jacobian - as_typed
            if gain > DECISIVE:
                result.append(BetterReading(f"{text} ({rms / ARCSECOND:.2f} arc seconds rms)", rms, gain))
    best = max((interpretation.gain for interpretation in result), default=0.0)
    return tuple(sorted((r for r in result if r.gain > best - DECISIVE), key=lambda r: -r.gain))


def _possible(angles: Angles) -> bool:
    """True for angles that a table may hold.

    Elevations above the horizon, azimuths of one turn or so, pairs close together.
    """
    a, e, b, f = angles
    elevations = np.concatenate([e, f])
    within = (
        np.abs([a, b]).max() <= 540.0 * DEGREE and -5.0 * DEGREE <= elevations.min() <= elevations.max() <= np.pi / 2
    )
    return bool(within and np.hypot(_across(angles), f - e).max() <= FARTHEST)


def _across(angles: Angles) -> np.ndarray:
    a, e, b, _ = angles
    return np.asarray(((b - a + np.pi) % (2.0 * np.pi) - np.pi) * np.cos(e))


def _likelihood(angles: Angles, chosen: list[int]) -> tuple[float, float]:
    """Log likelihood up to a constant, and rms on the sky, rad."""
    a, e, _, f = angles
    rows = design(a, e)[:, :, chosen].reshape(2 * len(a), -1)
    observed = np.column_stack([_across(angles), f - e]).ravel()
    estimate = np.linalg.lstsq(rows, observed, rcond=None)[0]
    squares = max(float(np.sum((observed - rows @ estimate) ** 2)), 1e-300)
    lit = np.log(np.maximum(np.cos(e), 1e-9)).sum()
    return float(lit - len(a) * np.log(squares)), float(np.sqrt(squares / len(a)))
