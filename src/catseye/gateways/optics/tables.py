"""Tables of a beam train: the beam along its path, and the returned power by distance."""

from collections.abc import Sequence

from catseye.gateways.writers.columns import Column, Table, each
from catseye.reduction.optics.beam import BeamPlace, Returned

PAGE = "beam.md"
EXACT = ".10g"

PLACES = Table[Sequence[BeamPlace]](
    "beam.csv",
    PAGE,
    (
        Column("leg", "", "`outward`, `reflector`, `inward` or `detector`", each(lambda p: p.leg)),
        Column("name", "", "name of the element, or its kind", each(lambda p: p.name)),
        Column("way_m", "m", "path length from the laser", each(lambda p: p.way), EXACT),
        Column(
            "radius_x_m",
            "m",
            "beam radius at 1/e² in x; empty behind a reflector that clips",
            each(lambda p: p.radius[0]),
            EXACT,
        ),
        Column("radius_y_m", "m", "beam radius in y", each(lambda p: p.radius[1]), EXACT),
        Column(
            "curvature_x_per_m",
            "1 / m",
            "curvature of the wavefront in x, positive where it spreads",
            each(lambda p: p.curvature[0]),
            EXACT,
        ),
        Column("curvature_y_per_m", "1 / m", "curvature of the wavefront in y", each(lambda p: p.curvature[1]), EXACT),
        Column("aperture_m", "m", "radius of the aperture; empty without one", each(lambda p: p.aperture), EXACT),
        Column("clipped", "", "share of the arriving power that it blocks", each(lambda p: p.clipped), EXACT),
        Column("power_w", "W", "power behind the element", each(lambda p: p.power), EXACT),
    ),
)

RETURNED = Table[Sequence[Returned]](
    "returned.csv",
    PAGE,
    (
        Column("distance_m", "m", "distance of the reflector", each(lambda r: r.distance), EXACT),
        Column("radius_x_m", "m", "beam radius at the reflector in x", each(lambda r: r.radius[0]), EXACT),
        Column("radius_y_m", "m", "beam radius at the reflector in y", each(lambda r: r.radius[1]), EXACT),
        Column("hit", "", "share of the beam that falls on the reflector", each(lambda r: r.hit), EXACT),
        Column(
            "collected",
            "",
            "share of the returned light that passes all inward apertures",
            each(lambda r: r.collected),
            EXACT,
        ),
        Column("power_w", "W", "power on the detector", each(lambda r: r.power), EXACT),
        Column("status", "", "`ok`, or the reason for an empty cell", each(lambda r: r.status)),
    ),
)
