"""Kind "hollow": three mirrors whose corner may face any way, since no record states its axis."""

import numpy as np

from catseye.optics.retroreflector.hollow_cube import HollowCube
from catseye.optics.retroreflector.kinds.kind import Acceptance, Curve, DrawnSizes, GlassForm, RetroreflectorKind


def inscribed(sizes: DrawnSizes) -> HollowCube:
    """Hollow cube with a round opening inscribed in the corner."""
    return HollowCube(sizes.aperture, np.sqrt(2.0) * sizes.aperture, sizes.reflectance)


KIND = RetroreflectorKind(
    name="hollow",
    label="hollow cube",
    has_axis=False,
    glass=GlassForm.NONE,
    shapes_dish=False,
    acceptance=Acceptance("round face inscribed in the corner: sqrt 2 of its radius high; same share", height=35.9e-3),
    curves=(Curve("hollow cube", inscribed, 0),),
)
