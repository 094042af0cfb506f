"""Surface of the dish by the prisms of one epoch."""

from collections.abc import Sequence

import numpy as np

from catseye.aliases import Array
from catseye.constants import DEGREE
from catseye.records.site.folder import SiteFolder
from catseye.reduction.surface.dish import DishDesign
from catseye.reduction.surface.findings import SurfaceFindings, reduce_surface
from catseye.reduction.surface.prisms import EpochPlace, prisms_of_points
from catseye.reduction.surface.shape import ShapeSettings


def dish_rows(names: Sequence[str], site: SiteFolder) -> list[int]:
    """Indices of the prisms of the dish among points."""
    return [k for k, name in enumerate(names) if name in site.targets and site.targets[name].shapes_dish]


def epoch_surface(
    names: Sequence[str],
    places: Array,
    covariance: Array,
    *,
    site: SiteFolder,
    posture: tuple[float, float],
    source: str,
) -> SurfaceFindings:
    """Shape of the dish by points in the ground frame.

    names        of n points, of which the prisms of the dish count
    places       (n, 3) m
    covariance   (3n, 3n) m^2
    posture      rad, azimuth and elevation of the telescope
    source       of the points, for messages

    Raises EstimationError: the prisms determine no shape.
    """
    rows = dish_rows(names, site)
    at = (3 * np.array(rows, dtype=int)[:, None] + np.arange(3)).ravel()
    dish = DishDesign.of_site(site)
    prisms = prisms_of_points(
        places[rows],
        covariance[np.ix_(at, at)],
        [names[k] for k in rows],
        dish,
        EpochPlace("ground", posture[0] / DEGREE, posture[1] / DEGREE, None),
        source=source,
    )
    return reduce_surface([prisms], dish, ShapeSettings())
