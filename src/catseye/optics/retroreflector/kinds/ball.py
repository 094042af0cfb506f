"""Kind "ball": cat's-eye of two half-balls, under a triplet's plate."""

from catseye.constants import DEGREE
from catseye.optics.retroreflector.cats_eye import BallCatsEye
from catseye.optics.retroreflector.kinds.kind import Acceptance, Curve, DrawnSizes, GlassForm, RetroreflectorKind


def silvered(sizes: DrawnSizes) -> BallCatsEye:
    """Ball of bare glass, silvered behind, with a figure's sizes."""
    return BallCatsEye(
        sizes.r1,
        sizes.r2,
        sizes.ball_aperture,
        group=sizes.group,
        phase=sizes.phase,
        mirror_reflectance=sizes.reflectance,
    )


KIND = RetroreflectorKind(
    name="ball",
    label="ball",
    has_axis=True,
    glass=GlassForm.SPHERES,
    shapes_dish=False,
    acceptance=Acceptance(
        "beyond, the half-balls' common plane is in the way; chosen, not measured",
        cone=80.0 * DEGREE,
    ),
    curves=(Curve("ball", silvered, 2),),
)
