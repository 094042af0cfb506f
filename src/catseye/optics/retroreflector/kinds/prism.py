"""Kind "prism": cube corner of glass, with an entry face."""

from dataclasses import replace

import numpy as np

from catseye.optics.retroreflector.kinds.kind import Acceptance, Curve, DrawnSizes, GlassForm, RetroreflectorKind
from catseye.optics.retroreflector.solid_prism import SolidPrism


def bare(sizes: DrawnSizes) -> SolidPrism:
    """Prism of bare glass with a figure's sizes."""
    return SolidPrism(sizes.height, sizes.aperture, group=sizes.group, phase=sizes.phase)


def silvered(sizes: DrawnSizes) -> SolidPrism:
    """Prism with metal on its three faces, with a figure's sizes."""
    return replace(bare(sizes), corner_reflectance=sizes.reflectance)


KIND = RetroreflectorKind(
    name="prism",
    label="prism",
    has_axis=True,
    glass=GlassForm.SLAB,
    shapes_dish=True,
    acceptance=Acceptance(
        "face of 2 inches, 1.5 inches high, BK 7, as GBT's; least share chosen: 45 deg",
        index=1.511,
    ),
    curves=(
        Curve("bare prism, ranger on the side of an edge", bare, 1),
        Curve("bare prism, between two edges", bare, 1, azimuth=np.pi / 3.0, line="--"),
        Curve("prism with silvered faces", silvered, 3),
    ),
)
