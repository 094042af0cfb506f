"""Map of a site from its records: rangers, targets, outline of the antenna."""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catseye.constants import DEGREE, MILLIMETRE
from catseye.records.site.folder import REFERENCE, SiteFolder
from catseye.reduction.site.motion import ALIDADE, REFLECTOR, ground_from
from catseye.reduction.site.places import places_of

RIM_POINTS = 73  # of the dish's outline
RIB_POINTS = 9
BODIES = {"": "ground", "arm": "feed"}  # names for people, where they differ
Line = tuple[str, str, str, NDArray[np.float64]]  # name, body, frame, points (n, 3) m


class SiteMap:
    """Places of a site, ground frame, m, at its records' posture.

    The structure is an outline: the rim and two ribs of the design paraboloid, both axes, and lines from the vertex
    and the rim to the feed. The records say no more of the steel.
    """

    def __init__(self, site: SiteFolder):
        self.site = site

    @property
    def name(self) -> str:
        """Name of the site by its records."""
        return self.site.site.campaign.name

    @cached_property
    def posture(self) -> tuple[float, float]:
        """Azimuth and elevation of the records, rad."""
        record = self.site.site.campaign
        return record.azimuth_deg * DEGREE, record.elevation_deg * DEGREE

    @cached_property
    def bodies(self) -> dict[str, str]:
        """Body of each point: "ground", "alidade", "dish" or "feed"."""
        bodies = {name: BODIES.get(place.body, place.body) for name, place in self._places.items()}
        return bodies | {ranger.name: "feed" for ranger in self.site.feedarm.ranger}

    def body(self, name: str) -> str:
        """Body of a point; a monument's fixed point is on the ground."""
        return self.bodies.get(name, "ground")

    @cached_property
    def _places(self) -> dict[str, Any]:
        return places_of(self.site)

    def rangers(self) -> list[dict[str, Any]]:
        """Rangers with their kind and place."""
        on_arm = {ranger.name for ranger in self.site.feedarm.ranger}
        rows = []
        for name in self.site.rangers:
            x, y, z = self._places[name].start.tolist()
            rows.append({"name": name, "x": x, "y": y, "z": z, "kind": "feed" if name in on_arm else "ground"})
        return rows

    def targets(self) -> dict[str, list[Any]]:
        """Columns of all targets: name, place, body."""
        rangers = set(self.site.rangers)
        names = [n for n in self.site.target_names if n in self._places and n not in rangers and n != REFERENCE]
        places = np.array([self._places[name].start for name in names]).reshape(-1, 3)
        columns = {axis: places[:, k].tolist() for k, axis in enumerate("xyz")}
        return {"name": names, **columns, "body": [self.body(name) for name in names]}

    def structure(self, azimuth: float | None, elevation: float | None) -> list[dict[str, Any]]:
        """Outline of the antenna at a posture, rad; the records' if None."""
        if azimuth is None or elevation is None:
            azimuth, elevation = self.posture
        lines = []
        for name, body, frame, points in self._lines:
            placed = ground_from(self.site, frame, azimuth, elevation).single.points(points)
            lines.append({"name": name, "body": body, **{a: placed[:, k].tolist() for k, a in enumerate("xyz")}})
        return lines

    @cached_property
    def _lines(self) -> Sequence[Line]:
        shape, reflector = self.site.site.paraboloid, self.site.site.frames.reflector
        focal, radius = shape.focal_length_mm * MILLIMETRE, shape.aperture_radius_mm * MILLIMETRE
        centre = np.array(shape.aperture_centre_mm) * MILLIMETRE
        turn = np.linspace(0.0, 2.0 * math.pi, RIM_POINTS)
        along = np.linspace(-radius, radius, RIB_POINTS)
        rim = _on_dish(centre + radius * np.column_stack([np.cos(turn), np.sin(turn)]), focal)
        ribs = [_on_dish(centre + along[:, None] * np.array(axis), focal) for axis in ((1.0, 0.0), (0.0, 1.0))]
        feed = self._feed(focal)
        lowest = rim[int(np.argmin(np.linalg.norm(rim - feed, axis=1)))]
        axis = -np.array(reflector.reflector_to_elevation_mm) * MILLIMETRE  # a point of the elevation axis
        half = np.array([0.5 * radius, 0.0, 0.0])
        height = reflector.elevation_axis_height_mm * MILLIMETRE
        return (
            ("rim of the dish", "dish", REFLECTOR, rim),
            ("rib across", "dish", REFLECTOR, ribs[0]),
            ("rib along", "dish", REFLECTOR, ribs[1]),
            ("feed arm", "feed", REFLECTOR, np.array([lowest, feed])),
            ("elevation axis", "dish", REFLECTOR, np.array([axis - half, axis + half])),
            ("dish to elevation axis", "dish", REFLECTOR, np.array([axis, ribs[1][RIB_POINTS // 2]])),
            ("azimuth axis", "alidade", ALIDADE, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, height]])),
        )

    def _feed(self, focal: float) -> NDArray[np.float64]:
        """Middle of the feed arm's rangers, reflector frame; the focus without any."""
        rangers = self.site.feedarm.ranger
        if not rangers:
            return np.array([0.0, 0.0, focal])
        return np.asarray(np.mean([np.array(r.nominal_scan_point_mm) * MILLIMETRE for r in rangers], axis=0))

    def to_object(self) -> dict[str, Any]:
        """JSON object of the whole map."""
        location = self.site.site.site
        azimuth, elevation = self.posture
        return {
            "name": self.name,
            "latitude": location.latitude_deg * DEGREE,
            "longitude": location.longitude_deg * DEGREE,
            "height": location.elevation_of_z0_m,
            "time_zone": None,  # no record names one
            "posture": {"azimuth": azimuth, "elevation": elevation},
            "rangers": self.rangers(),
            "targets": self.targets(),
            "structure": self.structure(azimuth, elevation),
        }


def _on_dish(xy: NDArray[np.float64], focal: float) -> NDArray[np.float64]:
    """Points (n, 3) of the paraboloid over its aperture plane."""
    return np.column_stack([xy, np.sum(xy**2, axis=1) / (4.0 * focal)])
