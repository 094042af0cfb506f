"""Phase of a photodiode signal against the place of the image.

The notes' second subtlety, with a stated model.

The model: carriers arrive at a thin resistive layer (sheet resistance) above a distributed capacitance, and run
through it to a ring contact at the rim. The middle lies behind more resistance: its signal comes later. With kappa^2 =
i w R C/area, the share of a current put in at r that reaches the ring is I0(kappa r)/I0(kappa a), the solution of the
diffusion equation that is 1 at the rim, by reciprocity. The carriers' transit is the same at all places and drops out.
Real diodes have other contacts and a bias that is not even: scan yours with a small spot and fit the resistance.

Ranges are differences to the internal reference: only differences between the two images matter.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.errors import ValidityError

Complex = NDArray[np.complex128]
RINGS = 64  # nodes of the quadrature over a spot
REACH = 3.5  # radii of a spot: exp(-24) of the light is outside
STEEPEST = 24.0  # w R C/pi: up to it the middle's phase is within half a turn of the rim's


@dataclass(frozen=True)
class Photodiode:
    """Round photodiode with a ring contact.

    radius             m, of the active disc
    sheet_resistance   ohm per square of the layer that carries the current to the ring
    capacitance        F, of the whole disc
    """

    radius: float
    sheet_resistance: float
    capacitance: float

    def __post_init__(self) -> None:
        for name in ("radius", "sheet_resistance", "capacitance"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValidityError(f"{name} {getattr(self, name)} of a photodiode is not above 0 and finite")

    def lag(self, modulation_hz: float = 1500e6) -> float:
        """Lag, rad, of the signal of the centre behind that of the rim."""
        return -float(np.angle(place_response(0.0, self, modulation_hz)))

    @property
    def delay_per_area(self) -> float:
        """Decrease of delay per square of the distance from the centre, s/m^2."""
        return self.sheet_resistance * self.capacitance / (4.0 * np.pi * self.radius**2)


def place_response(place: ArrayLike, diode: Photodiode, modulation_hz: float = 1500e6) -> Complex:
    """Complex share (...) of a local current that reaches the ring contact.

    Its phase below zero is a delay.

    place           (...) m, from the centre, 0 to the radius
    diode           the photodiode
    modulation_hz   Hz, above 0

    Raises ValidityError for a place outside the disc.

    Source: derived here, see the module. Exact in the model.

    >>> diode = Photodiode(radius=0.25e-3, sheet_resistance=100.0, capacitance=1e-12)
    >>> complex(place_response(0.25e-3, diode)).real
    1.0
    """
    r = np.asarray(place, dtype=float)
    if not np.all((r >= 0.0) & (r <= diode.radius * (1.0 + 1e-12))):
        raise ValidityError(f"place {float(np.max(np.abs(r))):g} m is not on a disc of {diode.radius:g} m")
    from scipy.special import iv

    kappa = np.sqrt(1j * TWO_PI * modulation_hz * 4.0 * diode.delay_per_area)
    return iv(0, kappa * r) / iv(0, kappa * diode.radius)


def spot_response(offset: ArrayLike, spot: float, diode: Photodiode, *, modulation_hz: float = 1500e6) -> Complex:
    """Complex share (...) of a Gaussian spot's signal at the output.

    Light beside the disc is ignored.

    offset          (...) m, 0 or more: of the spot's centre from the disc's
    spot            m, above 0: radius at 1/e^2
    diode           the photodiode
    modulation_hz   Hz, above 0

    Source: `place_response` averaged over the light, whose part on a circle about the middle is 4 r/w^2
    exp(-2 (r - d)^2/w^2) times the scaled I0 of 4 r d/w^2; Gauss-Legendre from middle to rim, to 1e-9.
    """
    if not 0.0 < spot < np.inf:
        raise ValidityError(f"spot {spot} m is not above 0 and finite")
    from scipy.special import i0e

    d = np.asarray(offset, dtype=float)[..., None]
    low, high = np.maximum(d - REACH * spot, 0.0), np.minimum(d + REACH * spot, diode.radius)
    half = 0.5 * np.maximum(high - low, 0.0)  # nothing where the light passes beside the disc
    node, weight = np.polynomial.legendre.leggauss(RINGS)
    place = np.minimum(low + half * (node + 1.0), diode.radius)
    light = 4.0 * place / spot**2 * np.exp(-2.0 * ((place - d) / spot) ** 2) * i0e(4.0 * place * d / spot**2)
    return np.sum(half * weight * light * place_response(place, diode, modulation_hz), axis=-1)


def spot_range(offset: ArrayLike, spot: float, diode: Photodiode, *, modulation_hz: float = 1500e6) -> Array:
    """Range error from the diode's delay for a spot, m.

    Positive where too long.

    offset, spot, diode, modulation_hz   as for `spot_response`

    Longest in the middle; only the difference to the reference's spot matters. For small delays c/2 R C/(4 pi a^2) (a^2
    - d^2 - w^2/2). NaN where no light falls on the disc. Raises ValidityError for a diode so slow that its phase
    wraps, w R C/pi above 24.

    Source: the phase of `spot_response` by c/(4 pi f).

    >>> diode = Photodiode(radius=0.25e-3, sheet_resistance=100.0, capacitance=1e-12)
    >>> [round(float(v) * 1e6) for v in spot_range([0.0, 50e-6, 100e-6], 20e-6, diode)]
    [1188, 1141, 997]
    """
    steep = 4.0 * TWO_PI * modulation_hz * diode.delay_per_area * diode.radius**2
    if not steep <= STEEPEST:
        raise ValidityError(
            f"a photodiode of {diode.sheet_resistance:g} ohm per square and {diode.capacitance:g} F turns the phase by "
            f"more than half a turn at {modulation_hz:g} Hz (expected less resistance or capacitance)"
        )
    response = spot_response(offset, spot, diode, modulation_hz=modulation_hz)
    turn = np.where(response == 0.0, np.nan, np.angle(response))
    return -turn * SPEED_OF_LIGHT / (2.0 * TWO_PI * modulation_hz)


def spot_range_uncertainty(offset: ArrayLike, u_place: ArrayLike, diode: Photodiode) -> Array:
    """Standard uncertainty (...), m, of a range from the spot's place.

    offset    (...) m, of the spot's mean place from the centre
    u_place   (...) m, of each of its two coordinates, independent
    diode     the photodiode

    Grows with the offset: with an image servo on the middle only the second order remains.

    Source: range = -K (x^2 + y^2) with K = c/2 of `delay_per_area`; variance 4 K^2 d^2 u^2 + 4 K^2 u^4, exact for
    normal scatter and small delays; [JCGM100] 5.1.2 with its second-order note.

    >>> diode = Photodiode(radius=0.25e-3, sheet_resistance=100.0, capacitance=1e-12)
    >>> round(float(spot_range_uncertainty(50e-6, 5e-6, diode)) * 1e6, 2)
    9.59
    """
    delay = diode.delay_per_area * diode.radius**2
    return 0.5 * SPEED_OF_LIGHT * image_lead(offset, u_place, lag=delay, radius=diode.radius).u


class ImageLead(NamedTuple):
    """Lead of signals whose image moves about a mean place, in the unit of the detector's lag.

    mean   against an image at rest in the mean place; above zero: early, a range too short
    u      standard deviation, of one image by itself
    """

    mean: Array
    u: Array


def image_lead(offset: ArrayLike, u_place: ArrayLike, *, lag: ArrayLike, radius: ArrayLike) -> ImageLead:
    """Mean and standard deviation (...) of the lead by an image's place on a detector.

    offset    (...) m, of the mean place from the centre
    u_place   (...) m, of each of the two coordinates of one image about it, independent
    lag       of the centre behind the rim, rad (or s)
    radius    m, above 0, of the disc

    The signal of a place r is early by lag r^2/radius^2 against the centre's. With x and y about a mean place d away,
    r^2 - d^2 = 2 d x + x^2 + y^2: its mean is 2 u^2, its variance 4 u^2 (d^2 + u^2).

    Source: [PARKER04] chapter 6, item 2, names the effect; derived here from the closed form for small lags in
    `spot_range`. Exact for normal scatter, with lags up to 0.1 rad good to 1 %.

    >>> lead = image_lead(10e-6, 5e-6, lag=0.02, radius=0.1e-3)
    >>> round(float(lead.mean) * 1e6, 3), round(float(lead.u) * 1e6, 3)  # 100 and 224 urad
    (100.0, 223.607)
    """
    d, u = np.asarray(offset, dtype=float), np.asarray(u_place, dtype=float)
    steep = np.asarray(lag, dtype=float) / np.asarray(radius, dtype=float) ** 2
    return ImageLead(2.0 * steep * u**2, 2.0 * np.abs(steep) * u * np.hypot(d, u))


def quadrant_signals(x: ArrayLike, y: ArrayLike, spot: float, gap: float = 0.0) -> Array:
    """Shares (..., 4) of a Gaussian spot on the quadrants, counter-clockwise.

    From that of positive x and y.

    x, y   (...) m, of the spot's centre
    spot   m, above 0: radius at 1/e^2
    gap    m, 0 or more: dead width between the quadrants

    Signals of an image servo behind a beam splitter; `quadrant_position` converts them to a place.

    Source: integrals of a Gaussian. Exact.

    >>> quadrant_signals(0.0, 0.0, 1e-4).tolist()
    [0.25, 0.25, 0.25, 0.25]
    """
    if not (0.0 < spot < np.inf and 0.0 <= gap < np.inf):
        raise ValidityError(f"spot {spot} m is not above 0, or gap {gap} m below 0")
    from scipy.special import ndtr

    def sides(place: ArrayLike) -> tuple[Array, Array]:
        at = np.asarray(place, dtype=float)
        return ndtr((at - 0.5 * gap) * 2.0 / spot), ndtr((-at - 0.5 * gap) * 2.0 / spot)

    (right_half, left_half), (up, down) = sides(x), sides(y)
    return np.stack(np.broadcast_arrays(right_half * up, left_half * up, left_half * down, right_half * down), axis=-1)


def quadrant_position(signals: ArrayLike, *, slope: float, u_signal: float = 0.0) -> tuple[Array, Array]:
    """Place of the spot (..., 2), m, with covariance (..., 2, 2) m^2.

    signals    (..., 4), any unit: quadrants counter-clockwise from that of positive x and y
    slope      m: the spot's place over the difference of halves over the sum, small against the spot; for a Gaussian
               spot of radius w (1/e^2) it is w sqrt(pi/8)
    u_signal   noise of each quadrant, same unit as the signals, independent

    A sum not above zero, no light, gives NaN.

    Source: halves of a Gaussian, erf(sqrt(2) x/w) to first order; [JCGM100] eq. 10.

    >>> quadrant_position([1.1, 0.9, 0.9, 1.1], slope=1e-3)[0].round(9).tolist()
    [0.0001, 0.0]
    """
    q = np.asarray(signals, dtype=float)
    total = np.sum(q, axis=-1)
    safe = np.where(total > 0.0, total, np.nan)[..., None]
    signs = np.array([[1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0]])
    ratio = q @ signs.T / safe
    by_signal = slope * (signs - ratio[..., None]) / safe[..., None]
    return slope * ratio, u_signal**2 * by_signal @ np.swapaxes(by_signal, -1, -2)
