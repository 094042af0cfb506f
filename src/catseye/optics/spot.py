"""Spot of a scan: return from a retroreflector against beam offset.

A beam off by d from the centre comes back turned about that centre: its axis is 2 d off the lens's axis. Light is
lost first beside the retroreflector, then beside the lens. The phase of what returns, averaged over the
lens, changes by micrometres at most, since a corner cube gives all rays of a plane wave equal paths.

The electric signal grows with the power. Amplitudes in volt therefore have the shape of shares of power.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.aliases import Array
from catseye.constants import SPEED_OF_LIGHT, TWO_PI
from catseye.errors import ValidityError
from catseye.optics.gaussian_beam import radius as beam_radius

FEWEST_NODES, MOST_NODES = 32, 400
NODES_PER_RADIAN = 0.85  # of phase from middle to edge; the angle of a chord runs pi/2 faster, which needs 0.8
NEGLIGIBLE = 6.0  # beam radii from its axis: exp(-72) of the light
FALLS = 1.5  # factor to the next trial distance


def offset_share(
    offset: ArrayLike, distance: float, *, aperture: float, receiver: float, waist: float, wavelength: float
) -> Array:
    """Share (...) of power returned to the receiver at a beam offset.

    offset       (...) m, any sign: beam axis from the retroreflector's centre
    distance     m, above 0: from the waist, which lies at the receiver, to the retroreflector
    aperture     m, above 0: radius of the retroreflector
    receiver     m, above 0: radius of the receiving lens, coaxial with the beam
    waist        m, above 0: radius of the beam at 1/e^2
    wavelength   m, above 0

    Source: Fresnel's integral, [GOODMAN05] eq. 4-17, of the Gaussian field of [SIEGMAN86] eq. 17.4 turned about the
    retroreflector's centre. Exact in the paraxial approximation, to some 1e-5. At offset 0 it is
    `gaussian_beam.returned_share`. Raises ValidityError where the fringes are too many to integrate.

    >>> offset_share([0.0, 0.0084], 120.0, aperture=0.0254, receiver=0.05, waist=0.010, wavelength=0.78e-6).round(4)
    array([1.    , 0.9989])
    """
    named = {"distance": distance, "aperture": aperture, "receiver": receiver, "waist": waist}
    _refuse(offset, **named, wavelength=wavelength)
    k = TWO_PI / wavelength
    off = np.abs(np.asarray(offset, dtype=float))
    w = float(beam_radius(distance, waist=waist, wavelength=wavelength))
    power = []
    for d in off.flat:
        if d - aperture > NEGLIGIBLE * w:
            power.append(0.0)
            continue
        field, area = _in_lens(float(d), k, nodes_for=k, **named)
        power.append(float(np.sum(area * np.abs(field) ** 2)))
    return np.reshape(power, off.shape)


def offset_range(
    offset: ArrayLike,
    distance: float,
    *,
    aperture: float,
    receiver: float,
    waist: float,
    wavelength: float,
    modulation_hz: float = 1500e6,
) -> Array:
    """Range change (...), m, by diffraction at a beam offset.

    Against a centred beam, positive where longer.

    offset, distance, ...   as for `offset_share`
    modulation_hz           Hz, above 0

    The photocurrent at the modulation is the beat of carrier and sideband over the lens; half its phase in metres. The
    steering also changes the range, see `steering_range`.

    Source: as `offset_share`, for two wavelengths a modulation apart. To some 1e-9 m.

    >>> lens = {"aperture": 0.0254, "receiver": 0.05, "waist": 0.010, "wavelength": 0.78e-6}
    >>> bool(abs(offset_range(0.0084, 120.0, **lens)) < 1e-6)
    True
    """
    named = {"distance": distance, "aperture": aperture, "receiver": receiver, "waist": waist}
    _refuse(offset, **named, wavelength=wavelength, modulation_hz=modulation_hz)
    step = TWO_PI * modulation_hz / SPEED_OF_LIGHT
    waves = (TWO_PI / wavelength, TWO_PI / wavelength + step)

    def path(d: float) -> float:
        (carrier, area), (sideband, _) = (_in_lens(d, k, nodes_for=waves[1], **named) for k in waves)
        return float(np.angle(np.sum(area * sideband * np.conj(carrier)))) / step

    centred = path(0.0)
    off = np.abs(np.asarray(offset, dtype=float))
    return np.reshape([0.5 * (path(float(d)) - centred) for d in off.flat], off.shape)


def steering_range(offset: ArrayLike, distance: ArrayLike) -> Array:
    """Range change (...), m, from steering the beam off the target.

    Never above zero.

    offset     (...) m
    distance   (...) m, above 0

    A plane wave along u is at the target after u.R = R cos(offset/R): the range reads short by offset^2 / 2R.

    Source: as for the beam aside in `geometry.mirror.mirror_path`. Exact for a plane wave.

    >>> round(float(steering_range(0.00843, 120.0)) * 1e6, 2)
    -0.3
    """
    r, d = np.asarray(distance, dtype=float), np.asarray(offset, dtype=float)
    return np.asarray(-2.0 * r * np.sin(0.5 * d / r) ** 2)


def gaussian_spot(
    x: ArrayLike,
    y: ArrayLike,
    *,
    peak: ArrayLike,
    radius: ArrayLike,
    background: ArrayLike,
    flatness: ArrayLike = 1.0,
) -> Array:
    """Amplitude (...) of a round spot at (x, y).

    background + peak exp(-2 (r/radius)^(2 f)).

    x, y          any unit, one for both, from the centre
    peak          V, above the background
    radius        that unit, above 0: at 1/e^2 of the peak
    background    V
    flatness      f, 1 or more: 1 a Gaussian, more a flat top with steep sides, as of a retroreflector wider than the
                  beam

    Source: definition; a Gaussian is the result of two Gaussian apertures in series.

    >>> float(gaussian_spot(0.0, 0.0, peak=4.0, radius=1.0, background=0.5))
    4.5
    """
    s = np.asarray(radius, dtype=float)
    squares = np.square(np.asarray(x, dtype=float) / s) + np.square(np.asarray(y, dtype=float) / s)
    with np.errstate(divide="ignore"):  # exp(-2 e^6) is nothing; beyond it powers overflow
        powers = np.exp(np.minimum(np.asarray(flatness, dtype=float) * np.log(squares), 6.0))
    shape = np.exp(-2.0 * powers)
    return np.asarray(np.asarray(background, dtype=float) + np.asarray(peak, dtype=float) * shape)


def reach(radius: ArrayLike, share: ArrayLike) -> Array:
    """Radius (...) at a share of a Gaussian spot's peak.

    In the unit of `radius`.

    radius   above 0, at 1/e^2
    share    above 0 to 1

    Source: `gaussian_spot`, solved.

    >>> round(float(reach(1.0, np.exp(-2.0))), 12)
    1.0
    """
    s = np.asarray(share, dtype=float)
    if not np.all((s > 0.0) & (s <= 1.0)):
        raise ValidityError(f"share {s[~((s > 0.0) & (s <= 1.0))].flat[0]} of a peak is not above 0 and up to 1")
    return np.asarray(np.asarray(radius, dtype=float) * np.sqrt(-0.5 * np.log(s)))


def _refuse(offset: ArrayLike, **named: float) -> None:
    for name, value in named.items():
        if not 0.0 < value < np.inf:
            raise ValidityError(f"{name} = {value} is not above 0 and finite")
    off = np.asarray(offset, dtype=float)
    if not np.all(np.isfinite(off)):
        raise ValidityError(f"offset {off[~np.isfinite(off)].flat[0]} m is not finite")


def _in_lens(
    d: float, k: float, *, nodes_for: float, distance: float, aperture: float, receiver: float, waist: float
) -> tuple[NDArray[np.complex128], Array]:
    """Field across the lens and the areas, for a beam offset d along x.

    Both discs are cut into chords: x = a sin(alpha) along one, y = a cos(alpha) eta across, so that the integrands are
    smooth and Gauss-Legendre converges. All is even in y, so half of either is used. The common phase is
    omitted.
    """
    rayleigh = 0.5 * k * waist**2
    bend = distance / (distance**2 + rayleigh**2)  # 1/R of the wave that arrives
    w = waist * np.hypot(1.0, distance / rayleigh)
    run = aperture * ((d + receiver) / distance + bend * d + 0.5 * aperture * (bend + 1.0 / distance))
    alpha, w_alpha, eta, w_eta = _nodes(nodes_for * run)
    x, chord = aperture * np.sin(alpha), aperture * np.cos(alpha)[:, None]
    y = chord * eta[eta > 0.0]
    squared = (x[:, None] + d) ** 2 + y**2  # the field turned about the retroreflector's centre: its axis is at -d
    path = 0.5 * (bend * squared + (x[:, None] ** 2 + y**2) / distance)
    field = np.sqrt(2.0 / np.pi) / w * np.exp(-squared / w**2 + 1j * k * path)
    field = field * (2.0 * w_alpha[:, None] * w_eta[eta > 0.0] * chord**2)
    beta, w_beta, zeta, w_zeta = _nodes(nodes_for * receiver * (aperture + d) * (1.0 / distance + bend))
    half = beta > 0.0
    qy, chord = receiver * np.sin(beta[half]), receiver * np.cos(beta[half])[:, None]
    qx = d + chord * zeta
    rows = np.einsum("ij,ijm->im", field, np.cos(k / distance * y[:, :, None] * qy))
    u = np.einsum("im,imn->mn", rows, np.exp(-1j * k / distance * x[:, None, None] * qx))
    u = u * np.exp(0.5j * k / distance * (qx**2 + qy[:, None] ** 2)) * k / (TWO_PI * distance)
    return u, 2.0 * w_beta[half][:, None] * w_zeta * chord**2


def _nodes(run: float) -> tuple[Array, Array, Array, Array]:
    """Gauss-Legendre nodes and weights on -pi/2..pi/2 and -1..1.

    Their number follows from the phase range from middle to edge.
    """
    count = FEWEST_NODES + 2 * int(0.5 * NODES_PER_RADIAN * run)  # even: none in the middle
    if count > MOST_NODES:
        raise ValidityError(
            f"the light's phase runs over {run:.0f} rad of an aperture, too much to integrate (expected a smaller "
            "one or a longer distance)"
        )
    node, weight = np.polynomial.legendre.leggauss(count)
    return 0.5 * np.pi * node, 0.5 * np.pi * weight, node, weight
