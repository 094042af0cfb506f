"""Kind of retroreflector: axis, glass, acceptance and curves, asked for by every room.

Rooms never compare a kind's name. They ask its properties, or choose by the form of its glass in a `match` that ends
in `assert_never`, so that the type checker names each place that a new form has to reach.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import assert_never

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.errors import InputError
from catseye.names import RetroreflectorName
from catseye.optics.retroreflector import cats_eye, prism
from catseye.optics.retroreflector.interface import Retroreflector


class GlassForm(Enum):
    """Form of a retroreflector's glass, and the sizes that describe it.

    NONE      air before the mirrors; no size
    SLAB      corner behind a plane face; its height
    SPHERES   two concentric half-balls; radii of the small and of the large one
    """

    NONE = "none"
    SLAB = "slab"
    SPHERES = "spheres"


@dataclass(frozen=True)
class Acceptance:
    """Largest incidence of a kind of retroreflector.

    why            source of the numbers
    cone           rad: explicit; None where it follows from the face
    aperture       m, radius of a cube corner's face; height m; index, phase, of its material
    least_share    of its face that must return light
    """

    why: str
    cone: float | None = None
    aperture: float = 25.4e-3
    height: float = 38.1e-3
    index: float = 1.0
    least_share: float = 0.075

    @property
    def limit(self) -> float:
        """Largest usable incidence, rad."""
        if self.cone is not None:
            return self.cone
        from scipy.optimize import brentq

        def spare(angle: float) -> float:
            face = {"aperture": self.aperture, "height": self.height, "index": self.index}
            return float(prism.clear_share(angle, **face)) - self.least_share

        return float(brentq(spare, 0.0, 0.499 * np.pi))


@dataclass(frozen=True)
class DrawnSizes:
    """Sizes and glass of the retroreflectors in a figure.

    height, aperture     m, of a prism; radius of a corner's clear opening
    r1, r2               m, of a ball's halves
    ball_aperture        m, radius of the ball's used aperture
    group, phase         indices of the glass over those of the air
    reflectance          of each mirror
    """

    height: float
    aperture: float
    r1: float
    r2: float
    ball_aperture: float
    group: float
    phase: float
    reflectance: float


@dataclass(frozen=True)
class Curve:
    """Curve of a kind in figures of returned light by incidence.

    label     in the legend
    build     retroreflector with the figure's sizes
    colour    number in the figures' series of colours; kinds are drawn in its order
    azimuth   rad, of the ranger
    line      matplotlib's style
    """

    label: str
    build: Callable[[DrawnSizes], Retroreflector]
    colour: int
    azimuth: float = 0.0
    line: str = "-"


@dataclass(frozen=True, repr=False)
class RetroreflectorKind:
    """Kind of retroreflector.

    name         word of files and options
    label        in texts and figures
    has_axis     True if records state its outward axis, and its incidence is judged
    glass        form of its glass
    shapes_dish  True if single ones in the reflector frame are the dish's surface; others stand on the feed arm
    acceptance   largest incidence of use
    curves       in figures of returned light
    """

    name: RetroreflectorName
    label: str
    has_axis: bool
    glass: GlassForm
    shapes_dish: bool
    acceptance: Acceptance
    curves: tuple[Curve, ...]

    def __repr__(self) -> str:
        return f"RetroreflectorKind({self.name!r})"

    @property
    def is_oblique(self) -> bool:
        """True if its range depends on the incidence."""
        return self.glass is GlassForm.SLAB

    def axis_of(self, owner: str, axis: ArrayLike | None) -> Array | None:
        """Outward axis (3,) of a retroreflector of this kind; None for a kind without one.

        owner   its name, for the refusal
        axis    (3,) as its record states it, or None

        Raises InputError for a missing axis of a kind that has one, and for an axis of a kind without.
        """
        stated = None if axis is None else np.asarray(axis, dtype=float)
        if stated is not None and not self.has_axis:
            raise InputError(f"{owner}: axis {stated.tolist()} is invalid (expected none for a {self.label})")
        if self.has_axis and (stated is None or stated.shape != (3,) or not np.isfinite(stated).all()):
            raise InputError(f"{owner}: axis is missing (expected the outward axis of a {self.label})")
        return stated

    def range_constant(self, n: float, *sizes: float) -> float:
        """Range constant of its glass at normal incidence, in the unit of its sizes; never positive.

        n       group index of the glass over that of the air
        sizes   of its glass

        Source: [GOLDMAN00] eqs. 3.10 and 3.14.
        """
        match self.glass:
            case GlassForm.NONE:
                return 0.0
            case GlassForm.SLAB:
                (height,) = sizes
                return float(prism.range_constant(height, n))
            case GlassForm.SPHERES:
                small, large = sizes
                return float(cats_eye.range_constant(small, large, n))
            case _:
                assert_never(self.glass)

    def u_range_constant(self, n: float, u_size: float) -> float:
        """Standard uncertainty of its range constant from that of its sizes, in their unit.

        n        group index of the glass over that of the air
        u_size   of each size

        Source: derivatives of [GOLDMAN00] eqs. 3.8 (at a fixed reference point) and 3.14.
        """
        match self.glass:
            case GlassForm.NONE:
                return 0.0
            case GlassForm.SLAB:
                return n * u_size
            case GlassForm.SPHERES:
                return float(np.hypot(n - 1.0, n)) * u_size
            case _:
                assert_never(self.glass)
