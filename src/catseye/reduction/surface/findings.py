"""Recipe of surfaces: shapes, change, look-up table, actuators, and the verdict on them.

The verdict is by the prisms' places, the limits of a dish, errors above the noise, and the inputs' verdicts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from catseye.aliases import Progress
from catseye.constants import DEGREE, MILLIMETRE
from catseye.errors import EstimationError
from catseye.estimation.shapes.paraboloid import ParaboloidStatus
from catseye.reduction.site.posture import SURE, largest_correction
from catseye.reduction.surface.actuators import Actuators, Travel, actuators_of, corrections
from catseye.reduction.surface.change import Change, change_between
from catseye.reduction.surface.dish import DishDesign
from catseye.reduction.surface.lookup import Lookup, lookup_of
from catseye.reduction.surface.placement import DishPlacement, placement_of
from catseye.reduction.surface.shape import Prisms, ShapeSettings, SurfaceShape, fitted_frame, shape_of
from catseye.verdict import Verdict

LARGEST_FACTOR = 2.0  # variance factor of a look-up table's model beyond which its epochs disagree


@dataclass(frozen=True, eq=False)
class SurfaceFindings:
    """Results of one call of `catseye surface`.

    An epoch, a change, a look-up table; perhaps actuators.

    dish         design
    placements   of each shape's points on it
    """

    dish: DishDesign
    shapes: tuple[SurfaceShape, ...]
    change: Change | None = None
    lookup: Lookup | None = None
    actuators: Actuators | None = None
    placements: tuple[DishPlacement, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """Verdict on the surface.

        Points on the dish, errors above the noise, epochs that fit the look-up table, and the inputs' verdicts.
        """
        sources = {shape.prisms.source: shape.prisms.verdict for shape in self.shapes}
        return _own_verdict(self).resting_on(sources)


def reduce_surface(
    epochs: Sequence[Prisms],
    dish: DishDesign,
    settings: ShapeSettings,
    *,
    actuators: bool = False,
    positions: Mapping[str, float] | None = None,
    travel: Travel = "normal",
    progress: Progress | None = None,
) -> SurfaceFindings:
    """Surface of a dish from the prisms of its epochs, in the order measured.

    epochs      one: its shape; two: second less first as well; from three on: a look-up table by elevation
    dish        design
    settings    of the shapes
    actuators   corrections of all actuators, from the last epoch
    positions   mm, of the actuators by name; None: their middle
    travel      of an actuator
    progress    called with (what, done, of how many)

    Raises EstimationError for too few prisms and for points off the dish.
    """
    aperture = dish.aperture
    shapes, placements = [], []
    for k, prisms in enumerate(epochs):
        if progress is not None:
            progress("fitting epochs", k, len(epochs))
        placement = placement_of(prisms, dish)
        try:
            if np.all(placement.outside > 0.0):
                raise EstimationError(placement.doubt)
            lit = fitted_frame(prisms, aperture, settings) if dish.site is None else None
            shapes.append(shape_of(prisms, aperture, settings, lit=lit))
        except EstimationError as problem:
            few = problem.reason is ParaboloidStatus.TOO_FEW
            text = str(problem) if few else placement.doubt or str(problem)
            raise EstimationError(f"{prisms.source}: {text}") from problem
        placements.append(placement)
    change = change_between(epochs[0], epochs[1], aperture, settings=settings) if len(epochs) == 2 else None
    lookup = lookup_of(shapes) if len(epochs) >= 3 else None
    corrected = None
    if actuators:
        corrected = corrections(
            shapes[-1], *actuators_of(dish.require_site("actuators")), positions=positions, travel=travel
        )
    return SurfaceFindings(
        dish=dish,
        shapes=tuple(shapes),
        change=change,
        lookup=lookup,
        actuators=corrected,
        placements=tuple(placements),
    )


def _own_verdict(result: SurfaceFindings) -> Verdict:
    for shape, placement in zip(result.shapes, result.placements, strict=False):
        if placement.doubt:
            return Verdict("failed" if placement.cures else "doubtful", f"{shape.prisms.source}: {placement.doubt}")
    for shape in result.shapes:
        if doubt := _implausible(shape, result.dish):
            return Verdict("doubtful", f"{shape.prisms.source}: {doubt}")
    if result.lookup is not None:
        return _of_lookup(result)
    noisy = [shape for shape in result.shapes if not shape.square.stands_out]
    if noisy:
        return Verdict("doubtful", f"{noisy[0].prisms.source}: no error of the surface stands out from the noise")
    prisms = ", ".join(str(len(shape.prisms.names)) for shape in result.shapes)
    fixed = "" if "focal-length" in result.shapes[-1].fit.free else ", focal length held"
    return Verdict(
        "good", f"{prisms} {result.dish.noun} determine the paraboloid{fixed}, and its errors stand out from the noise"
    )


def _of_lookup(result: SurfaceFindings) -> Verdict:
    assert result.lookup is not None
    factors = [m.variance_factor for m in result.lookup.models if np.isfinite(m.variance_factor)]
    if not factors:
        return Verdict("doubtful", "as many terms as epochs: nothing checks the look-up table")
    if max(factors) > LARGEST_FACTOR:
        most = max(factors)
        return Verdict("doubtful", f"epochs scatter about the look-up table with a variance factor up to {most:.1f}")
    return Verdict("good", f"a look-up table of {len(result.shapes)} epochs, which scatter about it as they claim")


def _implausible(shape: SurfaceShape, dish: DishDesign) -> str:
    """Implausible property of a fit, as a text; "" if plausible.

    The surface lies within the largest deviation t, of a site's dish the actuators' travel; so does a change of focal
    length, which moves the rim of radius R by R² / 4f² of it; a site's dish stands where encoders say, to the largest
    correction of the pointing series.
    """
    fit, aperture = shape.fit, shape.aperture
    worst = int(np.argmax(np.abs(fit.deviation)))
    if not abs(fit.deviation[worst]) <= dish.largest:
        off = fit.deviation[worst] / MILLIMETRE
        return (
            f"{shape.prisms.names[worst]} is {off:+.0f} mm off the paraboloid, beyond {dish.largest / MILLIMETRE:g} mm"
        )
    change = fit.focal_length - aperture.focal_length
    most = dish.largest * (2.0 * aperture.focal_length / aperture.radius) ** 2
    design = "the design's" if dish.site is None else "the site's"
    if abs(change) > most + SURE * fit.u_focal_length:
        return (
            f"focal length {fit.focal_length:.3f} m, {design} is {aperture.focal_length:.3f} m (expected within "
            f"{most:.2f} m); this may be another dish"
        )
    if dish.site is None:
        return ""
    u = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    limit = largest_correction()
    if np.any(np.abs(fit.rotation) > limit + SURE * u[3:]):
        turn = np.linalg.norm(fit.rotation) / DEGREE
        return f"the dish is turned by {turn:.3f} degrees against the posture (expected up to {limit / DEGREE:.3f})"
    arm = float(np.linalg.norm(aperture.centre)) + aperture.radius
    if np.any(np.abs(fit.translation) > limit * arm + SURE * u[:3]):
        shift = np.linalg.norm(fit.translation)
        return f"the vertex is {shift:.3f} m off its nominal place (expected up to {limit * arm:.2f} m)"
    return ""
