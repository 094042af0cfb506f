"""Design that a surface is compared with: that of a site's records, or a focal length, an aperture and a place."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.errors import InputError
from catseye.geometry.frames.frame import Transform
from catseye.records.panels.actuators import LIMIT_MM
from catseye.records.site.folder import SiteFolder
from catseye.reduction.surface.shape import LitAperture

TABLE, DISH = "table", "dish"  # frames of points without a site, and of their paraboloid
PLAUSIBLE = 0.01  # of the radius: deviations beyond show another dish, another unit or exchanged axes
STEEP = 0.999  # component along the axis beyond which the table's x gives no direction across it
Size = Literal["radius_m", "diameter_m"]


@dataclass(frozen=True, eq=False)
class DishDesign:
    """Design of a dish.

    aperture   illuminated part, with the focal length
    places     design place (3,) m of each prism by name, in the dish's frame; empty where unknown
    largest    m, largest plausible deviation of a point from the paraboloid
    nominal    frame of the points from the dish's; None where site and posture say it
    site       records; None for a dish without
    size       the argument that said its size, for messages
    """

    aperture: LitAperture
    places: Mapping[str, np.ndarray]
    largest: float
    nominal: Transform | None = None
    site: SiteFolder | None = None
    size: Size = "radius_m"

    @classmethod
    def of_site(cls, site: SiteFolder) -> "DishDesign":
        """Dish of a site's records; its surface stands on actuators."""
        places = {
            name: np.array(target.position_mm) * MILLIMETRE
            for name, target in site.targets.items()
            if target.shapes_dish
        }
        return cls(LitAperture.of(site.site.paraboloid), places, LIMIT_MM * MILLIMETRE, site=site)

    @classmethod
    def of_paraboloid(
        cls,
        focal_length: float,
        radius: float,
        *,
        centre: np.ndarray,
        vertex: np.ndarray,
        axis: np.ndarray,
        size: Size = "radius_m",
    ) -> "DishDesign":
        """Dish without a site.

        focal_length   m
        radius         m, of the aperture, in projection along the axis
        centre         (2,) m, of the aperture from the axis, along the dish's x and y; zero but for an offset dish
        vertex         (3,) m, roughly, in the frame of the points
        axis           (3,) from the vertex to the focus, roughly, of any length
        size           the argument that said the radius

        The dish's x is the points' x made perpendicular to the axis, or their y where the axis runs along x.
        """
        length = float(np.linalg.norm(axis))
        if not length > 0.0:
            raise InputError("axis = 0,0,0 (expected a direction, from the vertex to the focus)")
        z = axis / length
        x = np.array([0.0, 1.0, 0.0] if abs(z[0]) > STEEP else [1.0, 0.0, 0.0])
        x = x - (x @ z) * z
        x = x / np.linalg.norm(x)
        rotation = np.column_stack([x, np.cross(z, x), z])
        aperture = LitAperture(centre, radius, focal_length)
        return cls(aperture, {}, PLAUSIBLE * radius, Transform(TABLE, DISH, rotation, vertex), size=size)

    @property
    def noun(self) -> str:
        """Name of its points in messages."""
        return "points" if self.site is None else "prisms"

    @property
    def limit(self) -> str:
        """Largest plausible deviation in words."""
        size = f"{self.largest / MILLIMETRE:g} mm"
        return f"{100.0 * PLAUSIBLE:g} % of the radius, {size}" if self.site is None else f"the actuators' {size}"

    def require_site(self, purpose: str) -> SiteFolder:
        """Records of the site; InputError for a dish without."""
        if self.site is None:
            raise InputError(f"{purpose}: needs the records of a site (expected site without focal_length_m)")
        return self.site
