"""Receiver: signal, delay and noise from light on lens and photodiode."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

ELECTRON = 1.602176634e-19  # C, exact (SI)
BOLTZMANN = 1.380649e-23  # J/K, exact (SI)


def signal_current(power: ArrayLike, *, depth: ArrayLike, responsivity: ArrayLike) -> NDArray[np.float64]:
    """Amplitude of the photocurrent at the modulation frequency, A.

    power          W, mean, on the detector
    depth          modulation depth of the arriving light, 0 to 1
    responsivity   A/W of the diode at that frequency

    Source: definition of the depth: P(t) = P (1 + depth cos wt). Exact.

    >>> float(signal_current(1e-3, depth=0.5, responsivity=0.5))
    0.00025
    """
    return np.asarray(power, float) * np.asarray(depth, float) * np.asarray(responsivity, float)


def noise_density(
    power: ArrayLike,
    *,
    responsivity: ArrayLike,
    background: ArrayLike = 0.0,
    dark_current: ArrayLike = 0.0,
    amplifier: ArrayLike = 0.0,
    load: ArrayLike = np.inf,
    temperature_k: ArrayLike = 293.15,
    intensity_noise_db_hz: ArrayLike = -np.inf,
) -> NDArray[np.float64]:
    """One-sided noise current density at the modulation frequency, A^2/Hz.

    power, background       W on the detector: the laser's, and daylight's
    responsivity            A/W
    dark_current            A
    amplifier               A/sqrt(Hz), input noise of the amplifier, referred to the diode
    load                    ohm, resistance whose thermal noise counts (infinite: in the amplifier's figure)
    temperature_k           K, of the load
    intensity_noise_db_hz   dB/Hz, the laser's relative intensity noise near the modulation

    Source: [YARIV97] ch. 10: shot noise 2 e I, thermal noise 4 k T / R, intensity noise RIN I^2. Independent parts.

    >>> float(noise_density(1e-3, responsivity=0.5)).__round__(25)
    1.602e-22
    """
    current = np.asarray(responsivity, float) * np.asarray(power, float)
    mean = current + np.asarray(responsivity, float) * np.asarray(background, float) + np.asarray(dark_current, float)
    intensity = 10.0 ** (np.asarray(intensity_noise_db_hz, float) / 10.0)
    thermal = 4.0 * BOLTZMANN * np.asarray(temperature_k, float) / np.asarray(load, float)
    return 2.0 * ELECTRON * mean + thermal + np.asarray(amplifier, float) ** 2 + intensity * current**2


def u_phase(amplitude: ArrayLike, density: ArrayLike, duration: ArrayLike) -> NDArray[np.float64]:
    """Standard uncertainty of a tone's phase in white noise, rad.

    amplitude   of the tone, any unit
    density     one-sided density of the noise, that unit squared per Hz
    duration    s, averaging time

    Source: the Cramér-Rao bound sqrt(2/N) sigma/A of [RIFE74] with sigma^2 = density * rate/2 and N = rate * duration.
    Exact for small u.

    >>> float(u_phase(1.0, 1e-6, 0.01))
    0.01
    """
    return np.sqrt(np.asarray(density, float) / np.asarray(duration, float)) / np.asarray(amplitude, float)


def lens_group_lag(height: ArrayLike, powers: ArrayLike, phase: ArrayLike, *, group: ArrayLike) -> NDArray[np.float64]:
    """Modulation path through a lens at a height less the axis, m.

    Below zero: later on the axis.

    height   (...) m, from the axis
    powers   1/m, (e,) or one number: of each thin element, their sum 1/focal length
    phase    (e,) phase indices of their glasses
    group    (e,) group indices

    All rays of a sharp image take the same time for the wave (Fermat). The modulation is slower by n_g - n_p in glass,
    and a collecting lens is thickest in its middle: by the group index the middle is late [BOR88], not
    the outer rays as [PARKER04] chapter 6, item 1, has it. Outer rays can be late by the lens's own spherical
    aberration, which is the same for wave and modulation: see `traced_lens`. A lens of two glasses whose focal length
    does not change with the wavelength has no lag: the sum below is h^2/2 of wavelength times change of power. A
    mirror has none.

    Source: derived here, -h^2/2 sum power (n_g - n_p)/(n_p - 1): each element is thinner at h by h^2 power/2(n_p - 1).
    [BOR88] has it for a single lens. Paraxial; `traced_lens` is exact.

    >>> round(float(lens_group_lag(0.025, 1 / 0.2, 1.511187, group=1.527464)) * 1e6, 2)
    -49.75
    """
    power, n_p, n_g = (np.atleast_1d(np.asarray(v, dtype=float)) for v in (powers, phase, group))
    return -0.5 * np.asarray(height, float) ** 2 * np.sum(power * (n_g - n_p) / (n_p - 1.0), axis=-1)


def lens_group_range(
    aperture: ArrayLike, beam_radius: ArrayLike, *, powers: ArrayLike, phase: ArrayLike, group: ArrayLike
) -> NDArray[np.float64]:
    """Range error by `lens_group_lag`, m, below zero where short.

    Against light on the axis of the lens.

    aperture              (...) m, above 0: radius of the receiving lens
    beam_radius           (...) m, above 0: of the light on it at 1/e^2; infinite for even light
    powers, phase, group  of the lens's elements, as for `lens_group_lag`

    The light passes the lens once, on its way back: half of the mean lag. A constant of the instrument only as long as
    the light on the lens stays the same: it grows with the distance, and the internal reference has another.

    Source: the detected modulation is the sum over the lens of power times exp(-i w lag/c), [GOODMAN05] (Parseval); to
    first order its phase is the mean lag; mean h^2 of a Gaussian cut at the aperture. To 1e-4 of itself.

    >>> lens = {"powers": 1 / 0.2, "phase": 1.511187, "group": 1.527464}
    >>> round(float(lens_group_range(0.025, np.inf, **lens)) * 1e6, 2)
    -12.44
    """
    a, w = np.asarray(aperture, float), np.asarray(beam_radius, float)
    x = 2.0 * (a / w) ** 2
    tiny = x < 1e-4  # even light: the Gaussian's expression loses its digits
    safe = np.where(tiny, 1.0, x)
    mean = a**2 * np.where(tiny, 0.5 - x / 12.0, 1.0 / safe - np.exp(-safe) / -np.expm1(-safe))
    return 0.5 * lens_group_lag(np.sqrt(mean), powers, phase, group=group)


class TracedLens(NamedTuple):
    """Exact rays parallel to the axis through a lens, NaN for a ray that misses.

    wave         (r,) m, path of the wave less that of the axis
    modulation   (r,) m, path of the modulation less that of the axis
    landing      (r,) m, height where the ray meets the image's plane
    """

    wave: NDArray[np.float64]
    modulation: NDArray[np.float64]
    landing: NDArray[np.float64]


def traced_lens(
    heights: ArrayLike,
    *,
    r1: float,
    r2: float,
    thickness: float,
    phase: float,
    group: float,
    back: float | None = None,
) -> TracedLens:
    """Paths of wave and modulation through a lens to an image's plane, and where they meet it.

    heights        (r,) m, of rays parallel to the axis
    r1, r2         m, radii, above zero where the centre lies behind the surface; infinite for a plane
    thickness      m, on the axis
    phase, group   indices of the glass over those of the air
    back           m, from the rear vertex to the image's plane; None: to the paraxial focus

    The wave's path is the lens's spherical aberration on a flat detector there, the modulation's has the group lag too.
    At f/4 a plano-convex lens with its flat side to the target has +181 um at the edge and -51 um of lag; the right
    way round it is +43 and -50.

    Source: exact rays, see `ray_trace`.
    """
    from catseye.optics.abcd import thick_lens
    from catseye.optics.ray_trace import Plane, Rays, SphericalSurface

    def surface(vertex: float, radius: float) -> Plane | SphericalSurface:
        if np.isinf(radius):
            return Plane((0.0, 0.0, vertex), (0.0, 0.0, 1.0))
        return SphericalSurface((0.0, 0.0, vertex + radius), abs(radius), far=radius < 0.0)

    if back is None:
        matrix = thick_lens(r1, r2, thickness=thickness, index=phase)
        back = -float(matrix[0, 0] / matrix[1, 0])
    image = Plane((0.0, 0.0, thickness + back), (0.0, 0.0, 1.0))
    h = np.concatenate([[0.0], np.ravel(np.asarray(heights, float))])
    front, rear, start = surface(0.0, r1), surface(thickness, r2), -1.0
    position = np.stack([h, np.zeros_like(h), np.full_like(h, start)], axis=-1)
    direction = np.broadcast_to([0.0, 0.0, 1.0], position.shape)

    def traced(n: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        rays = Rays(position, direction, np.zeros_like(h)).to(front, 1.0).refracted(front, 1.0 / phase)
        rays = rays.to(rear, n).refracted(rear, phase).to(image, 1.0)
        return rays.path[1:] - rays.path[0], rays.position[1:, 0]

    (wave, landing), (modulation, _) = traced(phase), traced(group)
    return TracedLens(wave, modulation, landing)
