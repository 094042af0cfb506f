"""Bodies of a site's points, and the points tracked between epochs.

Bodies are dish, feed arm and alidade.
"""

from collections.abc import Mapping

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.records.site.folder import SiteFolder

ABOVE_THE_DISH = 5.0  # m over the paraboloid: higher points are on the arm
ABOVE_THE_GROUND = 10.0  # m over the highest monument: higher points stand on no pillar


def bodies_of(site: SiteFolder, frames: Mapping[str, str]) -> dict[str, str]:
    """Body of each point: "dish", "arm" or "alidade".

    Points on the ground are absent.

    Rangers of the reflector's frame are on the arm, and so are single targets far above the paraboloid or outside
    the aperture.
    """
    bodies = {name: "alidade" for name, frame in frames.items() if frame == "alidade"}
    bodies |= {ranger.name: "arm" for ranger in site.feedarm.ranger}
    shape = site.site.paraboloid
    centre = np.array(shape.aperture_centre_mm)
    for target in site.targets.values():
        if target.frame == "reflector":
            x, y, z = target.position_mm
            high = (z - (x * x + y * y) / (4.0 * shape.focal_length_mm)) * MILLIMETRE > ABOVE_THE_DISH
            outside = float(np.hypot(*(np.array([x, y]) - centre))) > 1.05 * shape.aperture_radius_mm
            bodies[target.name] = "arm" if high or outside else "dish"
    for triplet in site.triplets.values():
        if triplet.frame == "reflector":
            bodies |= dict.fromkeys(triplet.targets, "dish")
        elif triplet.frame == "alidade":
            bodies |= dict.fromkeys(triplet.targets, "alidade")
    return bodies


def high_of_ground(site: SiteFolder) -> dict[str, str]:
    """Points typed in the ground's frame that are on the "alidade".

    Single targets that cannot stand on the ground.

    They are higher than any pillar and nearer the pintle bearing than half of the monuments' ring: cubes at the
    elevation bearings, 47 m up. At one posture they are the alidade's, and its steel moves them.
    """
    if not site.monuments:
        return {}
    stands = np.array([(m.x_mm, m.y_mm, m.z_mm) for m in site.monuments.values()]) * MILLIMETRE
    least = np.max(stands[:, 2]) + ABOVE_THE_GROUND
    most = 0.5 * np.median(np.hypot(stands[:, 0], stands[:, 1]))
    places = {n: np.array(t.position_mm) * MILLIMETRE for n, t in site.targets.items() if t.frame == "ground"}
    return {n: "alidade" for n, (x, y, z) in places.items() if z > least and np.hypot(x, y) < most}


def tracked_names(site: SiteFolder) -> tuple[str, ...]:
    """Rangers, triplets and single targets except dish prisms.

    The dish has too many prisms to track.
    """
    single = [n for n, t in site.targets.items() if not t.shapes_dish]
    triplets = [name for triplet in site.triplets.values() for name in triplet.targets]
    return tuple(sorted([*site.rangers, *single, *triplets]))
