"""Return of a living ranger: optical path, amplitude, electronics phase."""

from typing import assert_never

import numpy as np

from catseye.aliases import Array
from catseye.constants import DEGREE, TWO_PI
from catseye.records.site.retroreflector import GlassForm
from catseye.simulator.night.faults import Planted, Streams
from catseye.simulator.night.head import DRIFT_RAD_PER_ROOT_HOUR
from catseye.simulator.twin.targets import BodyRetroreflector
from catseye.simulator.twin.waves import Waves, correlated, joined, walk

SPOT = 0.014  # m: amplitude exp(-d^2 / 2 SPOT^2) for a beam at d from the middle: 10 mm of beam and the receiver
CUBE_RADIUS = 0.005  # m, acceptance of the internal cube: some hundred counts
CORNER_END = 45.0 * DEGREE  # incidence at which a cube corner's aperture vanishes
BALL_FULL, BALL_END = 60.0 * DEGREE, 79.0 * DEGREE  # off a ball's axis
SCINTILLATION, FLICKER = 0.022, 0.3  # of amplitude, one sigma; s of correlation
GUST, SPELL = 4.0, 1800.0  # s of correlation of a path's index: turbulence, and effects local to the path
GUST_SHARE = 0.7  # of its standard deviation that is turbulence; the squares of both shares make one


def prism_way(height: float, cosine: Array, *, group: float, phase: float) -> Array:
    """Path that a prism adds to its reference point, air metres (k,).

    One way, at cosines of incidence (k,).

    height         apex below the entry face, m; the reference point lies height / group below the face
    group, phase   indices of the glass over air's: for delay, and for refraction

    By a ray through the prism unfolded about its apex, a slab of twice the height, between the plane wavefronts through
    the reference point and through its image.

    >>> bool(np.isclose(prism_way(0.038205, np.array([1.0]), group=1.527077, phase=1.511)[0], 0.0333236, atol=1e-7))
    True
    """
    sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0)) / phase  # inside the glass
    inside = np.sqrt(1.0 - sine**2)
    return height * (group / inside - cosine / group - phase * sine * sine / inside)


def glass_way(retro: BodyRetroreflector, cosine: Array, *, group: float, phase: float, obliquity: float) -> Array:
    """Path (k,), air metres, of a retroreflector's glass, one way.

    At cosines of incidence (k,).

    obliquity   factor on the effect of the angle
    """
    match retro.kind.glass:
        case GlassForm.NONE:
            return np.zeros_like(cosine)
        case GlassForm.SPHERES:
            r1, r2 = retro.sizes
            return np.full_like(cosine, group * (r1 + r2) - r1)
        case GlassForm.SLAB:
            (height,) = retro.sizes
            straight = (group - 1.0 / group) * height
            return straight + obliquity * (prism_way(height, cosine, group=group, phase=phase) - straight)
        case _:
            assert_never(retro.kind.glass)


def acceptance(retro: BodyRetroreflector, cosine: Array) -> Array:
    """Returned amplitude share (k,) at cosines (k,) of the angle off axis."""
    if retro.facing is None:
        return np.ones_like(cosine)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    if retro.kind.glass is GlassForm.SPHERES:
        past = np.clip((angle - BALL_FULL) / (BALL_END - BALL_FULL), 0.0, 1.0)
        return 1.0 - past**2 * (3.0 - 2.0 * past)
    return np.where(angle < CORNER_END, np.cos(2.0 * np.minimum(angle, CORNER_END)), 0.0)


def path_waves(ranger: str, target: str, *, index_ppm: float, streams: Streams, planted: Planted) -> Waves:
    """Noise of one path: index, ppm, relative amplitude; 2 channels."""
    rng = streams(f"path noise/{ranger}/{target}")
    ppm = planted.gain("index_fluctuation") * index_ppm
    gust = correlated(rng, GUST_SHARE * ppm, GUST)
    spell = correlated(rng, np.sqrt(1.0 - GUST_SHARE**2) * ppm, SPELL)
    flicker = correlated(rng, planted.gain("scintillation") * SCINTILLATION, FLICKER)
    combined = joined(gust, spell, flicker)
    mixing = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    return Waves(combined.omega, combined.cosine @ mixing, combined.sine @ mixing, np.zeros(2))


class ElectronicsWalk:
    """Phase of a head's electronics: 10 mrad random walk in root hour.

    Every third warms up.

    It is a sum of waves with a 1/f^2 spectrum (`waves.walk`): smooth below 5 s, a walk up to some days.
    """

    def __init__(self, ranger: str, streams: Streams, planted: Planted):
        rng = streams(f"electronics/{ranger}")
        self._start, warms, rise = rng.uniform(0.0, TWO_PI), rng.uniform() < 1.0 / 3.0, rng.uniform(0.010, 0.030)
        self._rise = planted.gain("warm_up") * warms * rise * rng.choice((-1.0, 1.0))
        step = planted.gain("drift") * DRIFT_RAD_PER_ROOT_HOUR / 60.0
        self._walk = walk(rng, step, shortest=5.0)

    def __call__(self, seconds: Array) -> Array:
        """Phase, rad (k,), at times (k,) since the start."""
        return self._start + self._walk(seconds)[:, 0] + self._rise * np.exp(-np.maximum(seconds, 0.0) / 300.0)
