"""Gaussian beam to a retroreflector and back: radius and power shares.

Scalar and paraxial. A retroreflector returns the light on its aperture, turned about its centre, with the same
curvature: after it the light spreads by its divergence and by diffraction at the aperture.

Source: [PARKER04] section 6.2.6.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError

NODES_PER_FRINGE = 12.0  # nodes of the quadrature over an aperture, for each Fresnel zone
FEWEST_NODES, MOST_NODES = 200, 20_000
CHORDS_PER_RADIAN = 0.85  # nodes over a full chord, for each radian of phase from its middle to its end
FEWEST_CHORDS, MOST_CHORDS = 16, 320
WIDE = 4.5  # beam radii: exp(-40) of the light is outside
WIDEST = 6.0  # the same for 1e-12
# rad, k a r/B: an edge of radius a, lit evenly, sends 2/(pi spread) = 0.5 % of the light beyond; fewer for more discs
# beyond it the integration is refused
SPREADS = (120.0, 60.0, 30.0, 15.0)


def radius(distance: ArrayLike, *, waist: ArrayLike, wavelength: ArrayLike, quality: ArrayLike = 1.0) -> NDArray:
    """Radius at 1/e^2 of the intensity, m.

    distance     m from the waist, any sign
    waist        m, above 0: the radius there
    wavelength   m, above 0, of the light
    quality      M^2, at least 1: spread over that of an ideal beam

    Source: [SIEGMAN86] eq. 17.5, with M^2. Exact for a paraxial beam.

    >>> round(float(radius(100.0, waist=0.010, wavelength=0.78e-6)), 6)
    0.010304
    """
    _positive(waist=waist, wavelength=wavelength)
    spread = np.asarray(distance, float) * np.asarray(quality, float) * np.asarray(wavelength, float)
    return np.hypot(np.asarray(waist, float), spread / (np.pi * np.asarray(waist, float)))


def share_within(aperture: ArrayLike, beam_radius: ArrayLike, offset: ArrayLike = 0.0) -> NDArray:
    """Share of a Gaussian beam's power on a circular aperture.

    aperture      m, its radius, 0 or more
    beam_radius   m, above 0, at 1/e^2
    offset        m, 0 or more: of the beam's axis from the aperture's centre

    Source: [SIEGMAN86] eq. 17.11 for offset 0, else Rice's distribution: distances from a point, of a round normal
    scatter of standard deviation beam_radius/2. Exact.

    >>> round(float(share_within(0.01, 0.01)), 6), round(float(share_within(0.01, 0.01, 0.01)), 6)
    (0.864665, 0.396499)
    """
    _positive(beam_radius=beam_radius)
    for name, value in (("aperture", aperture), ("offset", offset)):
        if not np.all(np.asarray(value, dtype=float) >= 0.0):
            raise ValidityError(f"{name} = {np.min(np.asarray(value, dtype=float))} m is not 0 or more")
    a, w, d = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (aperture, beam_radius, offset)))
    from scipy.stats import ncx2

    centred = -np.expm1(-2.0 * (a / w) ** 2)
    squeezed = np.maximum(d, 1e-12 * w)
    return np.where(d > 0.0, ncx2.cdf(4.0 * (a / w) ** 2, 2, 4.0 * (squeezed / w) ** 2), centred)


def returned_share(distance: float, *, aperture: float, receiver: float, waist: float, wavelength: float) -> float:
    """Share of power returned by a centred retroreflector to a centred receiver.

    distance     m, above 0: from the waist, which lies at the receiver, to the retroreflector
    aperture     m, above 0: radius of the retroreflector's
    receiver     m, above 0: radius of the receiving lens
    waist        m, above 0: radius of the beam at 1/e^2
    wavelength   m, above 0

    Source: Fresnel's integral in polar form, [GOODMAN05] eq. 4-17 with the Gaussian field of [SIEGMAN86] eq. 17.4 on
    the aperture. Exact in the paraxial approximation, by Gauss-Legendre quadrature to some 1e-6. Raises ValidityError
    where an aperture is so wide or so near that its Fresnel zones are too many for the quadrature.

    >>> round(returned_share(100.0, aperture=0.019, receiver=0.05, waist=0.010, wavelength=0.78e-6), 4)
    0.9988
    """
    _positive(distance=distance, aperture=aperture, receiver=receiver, waist=waist, wavelength=wavelength)
    wave_number = 2.0 * np.pi / wavelength
    rayleigh = 0.5 * wave_number * waist**2
    curvature = distance / (distance**2 + rayleigh**2)  # 1/R of the wave that arrives
    beam_radius = float(radius(distance, waist=waist, wavelength=wavelength))
    inner, inner_weight = _quadrature(aperture, wave_number * aperture * (aperture + 2.0 * receiver) / distance)
    outer, outer_weight = _quadrature(receiver, 2.0 * wave_number * receiver * aperture / distance)
    field = np.sqrt(2.0 / np.pi) / beam_radius * np.exp(-((inner / beam_radius) ** 2))
    field = field * np.exp(0.5j * wave_number * inner**2 * (curvature + 1.0 / distance)) * inner * inner_weight
    from scipy.special import j0

    power = 0.0
    for start in range(0, len(outer), 256):  # rows at a time: the kernel is large where zones are many
        part = slice(start, start + 256)
        kernel = j0((wave_number / distance) * outer[part, None] * inner)
        amplitude = np.abs(kernel @ field) * wave_number / distance
        power += float(np.sum(2.0 * np.pi * outer[part] * outer_weight[part] * amplitude**2))
    return power


def share_within_ellipse(aperture: ArrayLike, radius_x: ArrayLike, radius_y: ArrayLike) -> NDArray:
    """Share of an elliptical Gaussian beam's power on a centred round aperture.

    aperture             m, its radius, 0 or more
    radius_x, radius_y   m, above 0, of the beam at 1/e^2 in its two planes

    Source: the Gaussian integrated along chords of the wide axis, exactly, and across them by Gauss-Legendre in the
    angle of the chord: 1e-12 for any ratio of the axes.

    >>> round(float(share_within_ellipse(0.01, 0.01, 0.01)), 6), round(float(share_within_ellipse(0.01, 0.02, 0.01)), 6)
    (0.864665, 0.590095)
    """
    _positive(radius_x=radius_x, radius_y=radius_y)
    a, x, y = (np.asarray(v, dtype=float)[..., None] for v in np.broadcast_arrays(aperture, radius_x, radius_y))
    if not np.all(a >= 0.0):
        raise ValidityError(f"aperture = {float(a.min())} m is not 0 or more")
    narrow, wide = np.minimum(x, y), np.maximum(x, y)
    a = np.minimum(a, WIDEST * wide)
    top = np.arcsin(np.minimum(1.0, WIDEST * narrow / np.where(a > 0.0, a, np.inf)))
    top = np.where(a > 0.0, top, 0.0)
    node, weight = np.polynomial.legendre.leggauss(96)
    angle = 0.5 * top * (node + 1.0)
    from scipy.special import erf

    across, chord = a * np.sin(angle), a * np.cos(angle)
    light = np.exp(-2.0 * (across / narrow) ** 2) * erf(np.sqrt(2.0) * chord / wide) * chord / narrow
    return np.minimum(np.sum(top * weight * light, axis=-1) * np.sqrt(2.0 / np.pi), 1.0)


def waist_for(distance: ArrayLike, wavelength: ArrayLike, quality: ArrayLike = 1.0) -> NDArray:
    """Waist, m, at the head for the smallest beam at a distance.

    The beam there is wider by the root of 2.

    distance     m, above 0
    wavelength   m, above 0
    quality      M^2, at least 1

    Source: the minimum of `radius` over the waist, a Rayleigh range equal to the distance.

    >>> round(float(waist_for(120.0, 0.78e-6)), 6)
    0.005458
    """
    _positive(distance=distance, wavelength=wavelength)
    return np.sqrt(np.asarray(quality, float) * np.asarray(wavelength, float) * np.asarray(distance, float) / np.pi)


def powers_through(
    q: ArrayLike, *, wavelengths: ArrayLike, discs: Sequence[float], systems: Sequence[ArrayLike]
) -> NDArray[np.float64]:
    """Shares (d,) of a beam's power within successive round apertures.

    Each is lit by the light passed by the one before.

    q             (2,) complex parameters of the beam in the first aperture, m, in its two planes: see `abcd`
    wavelengths   (2,) m: of the light times M^2 of each plane
    discs         (d,) m, above 0: radii of the apertures, centred
    systems       (d - 1, 2, 2, 2) matrices from one aperture to the next, in the two planes; their B not 0

    An aperture wider than the light on it is integrated only so far (`lit_edges`); the rest falls with
    1/radius, as the rings of every edge do ([BORN99] section 8.5.2).

    M^2 above 1 is an ideal beam of that longer wavelength: exact as long as nothing clips it; diffraction by an edge
    is then M^2 times too wide, so that the returned share is rather too small.

    Raises ValidityError where fringes are too many to integrate (wide apertures close together).

    Source: the diffraction integral of an ABCD system, [COLLINS70]; [SIEGMAN86] ch. 20. Each disc is cut into
    chords; Gauss-Legendre to some 1e-6 of the power.

    >>> from catseye.optics.abcd import beam_at_waist, free_space, onward
    >>> q, back = onward(beam_at_waist(0.010, 0.78e-6), free_space(100.0)), free_space(100.0)
    >>> powers_through([q, q], wavelengths=[0.78e-6] * 2, discs=[0.019, 0.05], systems=[[back, back]]).round(4).tolist()
    [0.9989, 0.9988]
    """
    _positive(wavelengths=wavelengths, discs=discs)
    k, z, steps = 2.0 * np.pi / np.asarray(wavelengths, float), np.asarray(q, complex), np.asarray(systems, float)
    w = np.sqrt(-2.0 / (k * np.imag(1.0 / z)))
    edges, counts = _followed(np.array([min(discs[0], WIDE * float(w.max())), *discs[1:]]), z, steps, k)
    outer, inner, area = _chords(edges[0], counts[0])
    chirp = 0.5j * k / z
    field = np.sqrt(2.0 / (np.pi * w[0] * w[1])) * np.exp(-chirp[0] * outer[:, None] ** 2 - chirp[1] * inner**2)
    shares = [float(np.sum(area * np.abs(field) ** 2))]
    axes = np.array([0, 1])  # of the outer and of the inner coordinate
    for edge, disc, count, step in zip(edges[1:], discs[1:], counts[1:], steps, strict=True):
        (a, _, _, d), rates = step[axes].reshape(2, 4).T, k[axes] / step[axes, 0, 1]
        chirped = np.exp(-0.5j * (rates[0] * a[0] * outer[:, None] ** 2 + rates[1] * a[1] * inner**2))
        lit = field * chirped * area * np.sqrt(np.abs(rates[0] * rates[1])) / (2.0 * np.pi)
        far_outer, far_inner, far_area = _chords(edge, count)  # its outer coordinate is the inner one of this disc
        field = np.zeros(far_inner.shape, dtype=complex)
        for row, x, y in zip(lit, outer, inner, strict=True):
            field += (row @ np.cos(rates[1] * np.outer(y, far_outer)))[:, None] * np.cos(rates[0] * x * far_inner)
        bend = rates[1] * d[1] * far_outer[:, None] ** 2 + rates[0] * d[0] * far_inner**2
        field *= np.exp(-0.5j * bend)
        outer, inner, area, axes = far_outer, far_inner, far_area, axes[::-1]
        within = float(np.sum(area * np.abs(field) ** 2))
        shares.append(within + (1.0 - edge / disc) * max(shares[-1] - within, 0.0))
    return np.array(shares)


def lit_edges(
    q: ArrayLike,
    *,
    wavelengths: ArrayLike,
    discs: Sequence[float],
    systems: Sequence[ArrayLike],
    spread: float = SPREADS[0],
) -> NDArray[np.float64]:
    """Radii (d,), m, of apertures as far as they are lit.

    Lit by rays of the first, and by diffraction at all before.

    spread   rad, of diffraction by each edge: see SPREADS
    others   as of `powers_through`

    Source: the rings of an edge fall off as [BORN99] section 8.5.2 says.

    >>> from catseye.optics.abcd import beam_at_waist, free_space
    >>> q, on = beam_at_waist(0.010, 0.78e-6), free_space(10.0)
    >>> lit_edges([q, q], wavelengths=[0.78e-6] * 2, discs=[0.02, 1.0], systems=[[on, on]]).round(4).tolist()
    [0.02, 0.0274]
    """
    k, curvature = 2.0 * np.pi / np.asarray(wavelengths, float), np.real(1.0 / np.asarray(q, complex))
    edges, steps = np.array(discs, dtype=float), np.asarray(systems, float)
    for i in range(1, len(edges)):
        system, diffracted = np.broadcast_to(np.eye(2), (2, 2, 2)), 0.0
        for j in range(i - 1, -1, -1):
            system = system @ steps[j]  # from disc j to disc i
            diffracted += float(np.max(spread * np.abs(system[:, 0, 1]) / (k * edges[j])))
        rays = float(np.max(edges[0] * np.abs(system[:, 0, 0] + system[:, 0, 1] * curvature)))
        edges[i] = min(edges[i], rays + diffracted)
    return edges


def _followed(
    discs: NDArray[np.float64], q: NDArray[np.complex128], steps: NDArray[np.float64], k: NDArray[np.float64]
) -> tuple[NDArray[np.float64], list[int]]:
    """Integration radii (d,), m, of the discs, and nodes on half chords."""
    light = {"wavelengths": 2.0 * np.pi / k, "discs": discs.tolist(), "systems": steps}
    for spread in SPREADS:
        edges = lit_edges(q, **light, spread=spread)
        try:
            return edges, _chord_counts(edges, np.real(1.0 / q), steps, k)
        except ValidityError:
            if spread == SPREADS[-1]:
                raise
    raise AssertionError("SPREADS is empty")


def _chord_counts(
    edges: NDArray[np.float64], curvature: NDArray[np.float64], steps: NDArray[np.float64], k: NDArray[np.float64]
) -> list[int]:
    """Nodes on half a chord of each disc, for incoming and outgoing phase."""
    bends, spread, counts = curvature, 0.0, []
    for i, edge in enumerate(edges):
        run = 0.0
        if i < len(steps):
            a, b = steps[i][:, 0, 0], steps[i][:, 0, 1]
            if np.any(b == 0.0):
                raise ValidityError("apertures are images of each other (expected a distance between them: B not 0)")
            run = float(np.max(k * (0.5 * edge**2 * np.abs(a / b + bends) + edge * edges[i + 1] / np.abs(b))))
            bends = steps[i][:, 1, 1] / b
        run = max(run + edge * spread, 2.0 * edge * spread)  # the power's fringes are twice as fine as the field's
        count = FEWEST_CHORDS + int(0.5 * CHORDS_PER_RADIAN * run)
        if count > MOST_CHORDS:
            raise ValidityError(
                f"the light's phase runs over {run:.0f} rad of an aperture of {edge:.4g} m, too much to integrate "
                "(expected smaller apertures or more distance between them)"
            )
        counts.append(count)
        spread = float(np.max(k * edge / np.abs(b))) if i < len(steps) else 0.0
    return counts


def _chords(edge: float, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Places on a quarter of a disc, outer (c,), inner (c, c), with areas.

    The area is that of all four quarters.
    """
    node, weight = np.polynomial.legendre.leggauss(2 * count)
    node, weight = node[count:], weight[count:]
    along, chord = edge * np.sin(0.5 * np.pi * node), edge * np.cos(0.5 * np.pi * node)[:, None]
    return along, chord * node, 4.0 * 0.5 * np.pi * weight[:, None] * weight * chord**2


def _quadrature(edge: float, phase: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Nodes on 0 to `edge` and their weights, for a phase range."""
    count = int(FEWEST_NODES + NODES_PER_FRINGE * phase / (2.0 * np.pi))
    if count > MOST_NODES:
        raise ValidityError(
            f"an aperture of {edge} m spans {phase / np.pi:.0f} Fresnel zones, too many for the quadrature "
            "(expected a smaller one or a longer distance; there the returned share is the share on the aperture)"
        )
    pieces = max(1, count // 64)  # Gauss-Legendre of 64 points piece by piece
    x, w = np.polynomial.legendre.leggauss(64)
    edges = np.linspace(0.0, edge, pieces + 1)
    half = 0.5 * np.diff(edges)
    return ((edges[:-1] + half)[:, None] + half[:, None] * x).ravel(), (half[:, None] * w).ravel()


def _positive(**values: ArrayLike) -> None:
    for name, value in values.items():
        sizes = np.asarray(value, dtype=float)
        if not np.all((sizes > 0.0) & (sizes < np.inf)):
            wrong = sizes[~((sizes > 0.0) & (sizes < np.inf))].flat[0]
            raise ValidityError(f"{name} = {wrong} m is not above 0 and finite")
