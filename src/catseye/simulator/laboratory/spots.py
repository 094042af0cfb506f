"""Simulated light of one retroreflector: by the ranger's counts, and by the angle to it.

By rays, with nothing of the reduction. A ray of the beam at q from its axis falls at d + q from the retroreflector's
corner, which turns it about itself: it returns at -(2 d + q) from the beam's axis. It counts if it falls on the
retroreflector's opening, comes out of it, and meets the lens. So a spot is flat where the retroreflector is wider than
the beam, and no Gaussian; it is as wide in metres at all distances, since diffraction is left out.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from catseye.aliases import Array
from catseye.constants import TWO_PI
from catseye.geometry.mirror.encoder import COUNTS_PER_TURN

RINGS, SPOKES = 60, 96  # rays of a beam
OFFSETS = 241  # of the tabulated share
FACE = 501  # rays across a face


@lru_cache(64)
def _shares(waist: float, aperture: float, receiver: float) -> tuple[Array, Array]:
    """Offsets, m, and shares of a centred beam's light there."""
    table = np.linspace(0.0, aperture + 3.0 * waist, OFFSETS)
    node, weight = np.polynomial.legendre.leggauss(RINGS)
    r = 1.5 * waist * (node + 1.0)
    light = weight * r * np.exp(-2.0 * (r / waist) ** 2)
    turn = TWO_PI * (np.arange(SPOKES) + 0.5) / SPOKES
    x, y = r[:, None] * np.cos(turn), r[:, None] * np.sin(turn)
    shares = []
    for d in table:
        meets = (np.hypot(d + x, y) < aperture) & (np.hypot(2.0 * d + x, y) < receiver)
        shares.append(float(light @ meets.mean(axis=1)))
    return table, np.array(shares) / shares[0]


@dataclass(frozen=True)
class SpotLight:
    """Light of a ranger on a retroreflector.

    waist, aperture, receiver   m: beam's radius at 1/e^2; radii of the retroreflector's opening and of the lens
    peak_volt                   amplitude of the centred beam
    noise_volt                  of each quadrature of the phasor
    scintillation               relative, of one amplitude
    full_scale_volt             at which the converter clips
    """

    waist: float = 0.010
    aperture: float = 0.0254
    receiver: float = 0.050
    peak_volt: float = 4.0
    noise_volt: float = 0.02
    scintillation: float = 0.02
    full_scale_volt: float = 10.0

    def share(self, offset: Array) -> Array:
        """Returned share (...) of a centred beam's light at offsets (...), m, of the beam from the corner."""
        table, shares = _shares(self.waist, self.aperture, self.receiver)
        return np.interp(np.abs(offset), table, shares, right=0.0)

    def amplitudes(self, off: Array, rng: np.random.Generator) -> Array:
        """Amplitudes (n,), V, of phasors at offsets (n,), m."""
        bright = self.peak_volt * self.share(off) * np.exp(rng.normal(0.0, self.scintillation, np.shape(off)))
        noise = rng.normal(0.0, self.noise_volt, (*np.shape(off), 2)) @ np.array([1.0, 1j])
        return np.minimum(np.abs(bright + noise), self.full_scale_volt)


def beam_direction(counts: Array, zeros: Array) -> Array:
    """Unit vectors (n, 3), mirror axes, of beams at real counts (n, 2).

    zeros   (2,) counts
    """
    theta = (counts[..., 0] - zeros[0]) * TWO_PI / COUNTS_PER_TURN
    phi = (counts[..., 1] - zeros[1]) * 2.0 * TWO_PI / COUNTS_PER_TURN
    return np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)], axis=-1)


def scan_amplitudes(
    counts: Array,
    true: Array,
    zeros: Array,
    *,
    distance: float,
    light: SpotLight,
    rng: np.random.Generator,
    loose: float = 0.5,
) -> Array:
    """Amplitudes (n,), V, of a scan at whole counts.

    counts     (n, 2), as the encoders read
    true       (2,) real counts of the retroreflector
    zeros      (2,) counts
    distance   m
    light      of ranger and retroreflector
    rng        draws the shafts' places and the noise
    loose      counts: a shaft stands anywhere within so much of its count
    """
    stands = counts + rng.uniform(-loose, loose, np.shape(counts))
    off = beam_direction(stands, zeros) - beam_direction(np.asarray(true, dtype=float), zeros)
    return light.amplitudes(distance * np.sqrt(np.sum(off**2, axis=-1)), rng)


@dataclass(frozen=True, eq=False)
class SimulatedRanger:
    """Ranger whose encoders' zeros are not those of its record.

    zeros   (2,) counts of the record
    off     (2,) counts by which its true zeros are larger: it finds everything so much higher
    light   of ranger and retroreflectors
    rng     draws the shafts' places and the noise
    """

    zeros: Array
    off: Array
    light: SpotLight
    rng: np.random.Generator

    @classmethod
    def drawn(
        cls, zeros: Array, u: float, rng: np.random.Generator, light: SpotLight | None = None
    ) -> "SimulatedRanger":
        """Ranger whose pointing is off by draws of u, rad, in Theta and Phi."""
        per_count = np.array([1.0, 2.0]) * TWO_PI / COUNTS_PER_TURN
        return cls(zeros, rng.normal(0.0, u, 2) / per_count, light or SpotLight(), rng)

    def measure(self, counts: Array, predicted: Array, distance: float) -> float:
        """Amplitude, V, at counts (2,) of a target predicted at (2,) by the record, m away."""
        read = np.asarray(counts, dtype=float)[None]
        true = np.asarray(predicted, dtype=float) + self.off
        true_zeros = self.zeros + self.off
        observed = scan_amplitudes(read, true, true_zeros, distance=distance, light=self.light, rng=self.rng)
        return float(observed[0])


@dataclass(frozen=True)
class TrueCorner:
    """Cube corner whose light is traced: glass behind a round face, or three mirrors.

    height, aperture   m, face to corner; radius of the face
    index              phase index of what fills it; 1 for mirrors in air
    mirror             reflectance of each face; None for bare glass
    """

    height: float = 0.0381
    aperture: float = 0.0254
    index: float = 1.5112
    mirror: float | None = None

    def share(self, incidence: float, azimuth: float) -> float:
        """Returned share of the light on the face at normal incidence: rays in, three faces, out.

        incidence, azimuth   rad, of the direction to the ranger; azimuth from an edge
        """
        side = np.linspace(-1.0, 1.0, FACE) * self.aperture
        x, y = (item.ravel() for item in np.meshgrid(side, side))
        on = np.hypot(x, y) <= self.aperture
        within = np.arcsin(np.sin(incidence) / self.index)
        shift = 2.0 * self.height * np.tan(within)
        out_x, out_y = -x - shift * np.cos(azimuth), -y - shift * np.sin(azimuth)
        area = float(np.mean((np.hypot(out_x, out_y) <= self.aperture)[on])) * np.cos(incidence)
        passes = 1.0 if self.index == 1.0 else (1.0 - _unpolarized(incidence, self.index)) ** 2
        return area * passes * self._faces(within, azimuth)

    def polarized(self, incidence: float, azimuth: float, *, field: float, analyser: float | None = None) -> float:
        """Returned share of polarized light: the field of each ray followed over the faces that it meets in turn.

        incidence, azimuth   rad, as for `share`
        field                rad, from the plane of incidence, counterclockwise as the ranger sees it
        analyser             rad, from the field; None: all of the light
        """
        toward = np.array([np.sin(incidence) * np.cos(azimuth), np.sin(incidence) * np.sin(azimuth), np.cos(incidence)])
        along = np.array([np.cos(incidence) * np.cos(azimuth), np.cos(incidence) * np.sin(azimuth), -np.sin(incidence)])
        across = np.cross(toward, along)
        within = np.arcsin(np.sin(incidence) / self.index)
        down = -np.array([np.sin(within) * np.cos(azimuth), np.sin(within) * np.sin(azimuth), np.cos(within)])
        gain_s, gain_p = np.sqrt(1.0 - np.abs(_amplitudes(incidence, self.index)) ** 2) if self.index > 1.0 else (1, 1)
        entering = gain_p * np.cos(field) * np.cross(down, across) * np.sign(np.cross(-toward, across) @ along)
        entering = entering + gain_s * np.sin(field) * across
        side = np.linspace(-1.0, 1.0, FACE) * self.aperture
        x, y = (item.ravel() for item in np.meshgrid(side, side))
        on = np.hypot(x, y) <= self.aperture
        shift = 2.0 * self.height * np.tan(within)
        exits = np.hypot(shift * np.cos(azimuth) - x, shift * np.sin(azimuth) - y) <= self.aperture
        turn = TWO_PI / 3.0 * np.arange(3)
        faces = np.stack([np.cos(turn) * np.sqrt(2.0), np.sin(turn) * np.sqrt(2.0), np.ones(3)], axis=1) / np.sqrt(3.0)
        reach = (np.stack([x, y, np.full(len(x), self.height)], axis=1) @ faces.T) / -(faces @ down)
        orders = np.argsort(reach[on & exits], axis=1)
        power = 0.0
        for order in {tuple(row) for row in orders.tolist()}:
            k, e = down, entering.astype(complex)
            for face in order:
                k, e = self._reflected(k, e, faces[face])
            emitted = gain_s * (e @ across) * across
            emitted = emitted + gain_p * (e @ np.cross(k, across)) * np.cross(toward, across)
            if analyser is not None:
                axis = np.cos(field + analyser) * along + np.sin(field + analyser) * across
                emitted = np.atleast_1d(emitted @ axis)
            power += float(np.sum(np.abs(emitted) ** 2)) * float(np.sum(np.all(orders == order, axis=1)))
        return power / float(on.sum()) * float(np.cos(incidence))

    def _reflected(self, k: np.ndarray, e: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Direction and field after one face."""
        s = np.cross(k, normal)
        s = s / np.linalg.norm(s)
        to = k - 2.0 * (k @ normal) * normal
        if self.mirror is not None:
            r_s, r_p = -np.sqrt(self.mirror), np.sqrt(self.mirror)
        else:
            r_s, r_p = _amplitudes(float(np.arccos(abs(k @ normal))), 1.0 / self.index)
        return to, r_s * (e @ s) * s + r_p * (e @ np.cross(k, s)) * np.cross(to, s)

    def _faces(self, within: float, azimuth: float) -> float:
        if self.mirror is not None:
            return self.mirror**3
        ray = np.array([np.sin(within) * np.cos(azimuth), np.sin(within) * np.sin(azimuth), np.cos(within)])
        share = 1.0
        for k in range(3):  # edges lean from the axis by the cube's 54.7 degrees; faces are across them
            turn = TWO_PI * k / 3.0
            edge = np.array([np.cos(turn) * np.sqrt(2.0), np.sin(turn) * np.sqrt(2.0), 1.0]) / np.sqrt(3.0)
            share *= _unpolarized(float(np.arccos(abs(ray @ edge))), 1.0 / self.index)
        return share


def _amplitudes(angle: float, ratio: float) -> np.ndarray:
    """Amplitudes (2,) reflected in s and p; in total reflection of size 1, by the tangents of half phases."""
    sine = np.sin(angle) / ratio
    if sine >= 1.0:
        root = np.sqrt(np.sin(angle) ** 2 - ratio**2)
        half = np.arctan2(np.array([root, root]), np.array([np.cos(angle), ratio**2 * np.cos(angle)]))
        return np.exp(-2j * half)
    if angle < 1e-9:
        return np.array([1.0, -1.0]) * (1.0 - ratio) / (1.0 + ratio) + 0j
    bent = np.arcsin(sine)
    return np.array(
        [-np.sin(angle - bent) / np.sin(angle + bent), np.tan(angle - bent) / np.tan(angle + bent)], dtype=complex
    )


def _unpolarized(angle: float, ratio: float) -> float:
    """Reflectance of a surface for unpolarized light; ratio of the index behind over that before."""
    sine = np.sin(angle) / ratio
    if sine >= 1.0:
        return 1.0
    if angle < 1e-9:
        return float(((ratio - 1.0) / (ratio + 1.0)) ** 2)
    bent = np.arcsin(sine)
    s, p = np.sin(angle - bent) / np.sin(angle + bent), np.tan(angle - bent) / np.tan(angle + bent)
    return float(0.5 * (s**2 + p**2))
