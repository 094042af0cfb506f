"""Receiving optics of a beam train: focal length, place of the image, and the image by exact rays.

The beam of `reduction.optics.beam` is paraxial: its image is as small as diffraction leaves it. A single lens has
spherical aberration as well, which only rays show: they miss the image's middle, and their path is longer.
"""

from dataclasses import dataclass

import numpy as np

from catseye.aliases import Array
from catseye.optics import abcd
from catseye.optics.receiver import traced_lens

RAYS = 400  # each of the same power


@dataclass(frozen=True)
class TracedImage:
    """Image of parallel light behind one lens, by exact rays.

    radius        m, rms distance of the light from the middle
    share         of the light on the detector
    range_error   m, of the lens's spherical aberration, positive where too long
    """

    radius: float
    share: float
    range_error: float


@dataclass(frozen=True, eq=False)
class ReceivingOptics:
    """Optics from the first inward element to the detector.

    focal_length   (2,) m, in x and y; infinite without power
    defocus        (2,) m, of the detector behind the waist of the image; NaN where the light is not Gaussian
    traced         image by exact rays; None where another element than one thick lens bends the light
    """

    focal_length: Array
    defocus: Array
    traced: TracedImage | None


def receiving_optics(matrices: list[Array], *, image: tuple[Array, Array], light: Array) -> tuple[Array, Array]:
    """Focal lengths (2,) and defocus (2,), m, of the inward elements.

    matrices   (2, 2, 2) of each element in the planes of x and y
    image      radius (2,) m and curvature (2,) 1/m of the beam on the detector
    light      (2,) m, wavelength times M^2

    Source: [PARKER04] chapter 6, item 2: an image stands f tan(angle) off the axis; [SIEGMAN86] ch. 15 and 17.
    """
    bend = np.broadcast_to(abcd.through(*matrices), (2, 2, 2))[:, 1, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        focal_length = np.where(bend == 0.0, np.inf, -1.0 / bend)
        radius, curvature = image
        q = 1.0 / (curvature - 1j * light / (np.pi * radius**2))
    return focal_length, -abcd.waist_ahead(q)


def traced_image(
    beam_radius: float,
    *,
    aperture: float,
    surfaces: tuple[float, float],
    thickness: float,
    indices: tuple[float, float],
    back: float,
    detector: float,
) -> TracedImage:
    """Image of a round Gaussian beam of parallel rays, by exact rays through a lens.

    beam_radius   m, on the lens at 1/e^2
    aperture      m, radius of the lens; infinite without
    surfaces      radii of the lens, m, as for `abcd.thick_lens`
    thickness     m
    indices       phase and group index of its glass over air
    back          m, from the lens's rear vertex to the detector
    detector      m, radius of the disc

    Source: [PARKER04] chapter 6, item 1; exact rays, the light between them as between equal shares of a Gaussian.
    """
    inside = -np.expm1(-2.0 * (aperture / beam_radius) ** 2)
    heights = beam_radius * np.sqrt(-0.5 * np.log1p(-inside * (np.arange(RAYS) + 0.5) / RAYS))
    phase, group = indices
    traced = traced_lens(
        heights, r1=surfaces[0], r2=surfaces[1], thickness=thickness, phase=phase, group=group, back=back
    )
    arrived = np.isfinite(traced.landing)
    landing = traced.landing[arrived]
    return TracedImage(
        radius=float(np.sqrt(np.mean(landing**2))),
        share=float(np.mean(np.where(arrived, np.abs(traced.landing) <= detector, False))),
        range_error=0.5 * float(np.mean(traced.wave[arrived])),
    )
