"""Tables of a reduction: ranges.csv, coordinates.csv, surface.csv."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE, PPM, TWO_PI
from catseye.gateways.writers.columns import Column, Table
from catseye.reduction.epoch.epoch import Reduction
from catseye.reduction.epoch.range_shots import RangeShots
from catseye.reduction.epoch.surface import DishFit
from catseye.reduction.site.point_kinds import point_kinds
from catseye.signal.cycles.whole import unwrapped_length

PAGE = "results.md"


@dataclass(frozen=True, eq=False)
class ShotRows:
    """Source of ranges.csv: a row per shot, in the campaign's order."""

    reduction: Reduction

    @property
    def ranges(self) -> RangeShots:
        return self.reduction.coordinates.ranges

    @cached_property
    def vacuum(self) -> np.ndarray:
        """Lengths that the adjusted phases represent in vacuum, m."""
        half = self.reduction.campaign.half_wavelengths(self.ranges.shot)
        return unwrapped_length(self.ranges.cycles, self.ranges.phase, half)

    @property
    def d0_mm(self) -> list[float]:
        campaign = self.reduction.campaign
        d0 = {name: campaign.mirror_of(name).d0_mm for name in dict.fromkeys(campaign.shots.ranger)}
        return [d0[name] for name in campaign.shots.ranger]

    def adjusted(self, values: np.ndarray) -> np.ndarray:
        """Values of the adjusted shots among all shots; NaN for the others."""
        every = np.full(len(self.reduction.campaign.shots.shot), np.nan)
        every[self.ranges.shot] = values
        return every

    @property
    def thin(self) -> list[str]:
        cells = [""] * len(self.reduction.campaign.shots.shot)
        for k in self.ranges.shot[self.ranges.thin].tolist():
            cells[k] = "thin"
        return cells


FORMS = {"m": ".7f", "mm": ".4f", "rad": ".7f", "deg": ".4f", "ppm": ".5f", "": ".4f"}  # by unit


def _ranged(
    name: str, unit: str, doc: str, value: Callable[[RangeShots], np.ndarray], form: str = ""
) -> Column[ShotRows]:
    """Column that is empty for shots without a phase or on the internal cube."""
    return Column(name, unit, doc, lambda r: r.adjusted(value(r.ranges)), form or FORMS[unit])


RANGES = Table[ShotRows](
    "ranges.csv",
    PAGE,
    (
        Column("shot", "", "number of the shot in shots.csv", lambda r: r.reduction.campaign.shots.shot),
        Column("mjd_utc", "d", "time, Modified Julian Date", lambda r: r.reduction.campaign.shots.mjd_utc, ".9f"),
        Column("ranger", "", "ranger", lambda r: r.reduction.campaign.shots.ranger),
        Column(
            "target",
            "",
            "retroreflector; `ZRG` is the ranger's internal cube",
            lambda r: r.reduction.campaign.shots.target,
        ),
        Column(
            "status",
            "",
            "`used`, `reference`, or why it is not used: `blocked`, `clipped`, `reflected`, ...",
            lambda r: r.reduction.status,
        ),
        Column(
            "reason",
            "",
            "reason of the rejection, with numbers; empty for a shot that was used",
            lambda r: [r.reduction.rejected.get(int(shot), "") for shot in r.reduction.campaign.shots.shot],
        ),
        Column("amplitude_v", "V", "amplitude of the return", lambda r: r.reduction.phases.amplitude, ".5f"),
        Column("phase_rad", "rad", "phase of the samples", lambda r: r.reduction.phases.phase, ".7f"),
        Column(
            "u_phase_rad",
            "rad",
            "standard uncertainty from the samples' noise",
            lambda r: r.reduction.phases.u_phase,
            ".7f",
        ),
        Column(
            "harmonic_2",
            "",
            "second harmonic of the samples over the return",
            lambda r: r.reduction.phases.relative_harmonics[:, 0],
            ".5f",
        ),
        Column(
            "harmonic_3",
            "",
            "third harmonic of the samples over the return",
            lambda r: r.reduction.phases.relative_harmonics[:, 1],
            ".5f",
        ),
        Column(
            "distorted",
            "",
            "`distorted` where one of them exceeds 2 % by four standard uncertainties; it rejects no shot",
            lambda r: np.where(r.reduction.phases.distorted, "distorted", "").tolist(),
        ),
        _ranged(
            "electronics_rad",
            "rad",
            "phase of the ranger's electronics at the shot, by its reference shots",
            lambda s: s.electronics % TWO_PI,
        ),
        _ranged("difference_rad", "rad", "phase of the path: `phase_rad` less `electronics_rad`", lambda s: s.phase),
        _ranged(
            "cycles", "", "whole cycles of the modulation in the path, there and back", lambda s: s.cycles + 0.0, ".0f"
        ),
        _ranged(
            "margin_mm",
            "mm",
            "error of the approximate range, beyond its present one, that would change `cycles`",
            lambda s: s.margin / MILLIMETRE,
        ),
        Column(
            "thin",
            "",
            "`thin` where misfit and five standard uncertainties of the predicted range could use up the margin",
            lambda r: r.thin,
        ),
        Column(
            "vacuum_length_m",
            "m",
            "length that cycles and phase represent in vacuum",
            lambda r: r.adjusted(r.vacuum),
            ".7f",
        ),
        _ranged("refractivity_ppm", "ppm", "mean group refractivity along the path", lambda s: s.refractivity / PPM),
        Column(
            "air_mm",
            "mm",
            "correction for the air",
            lambda r: r.adjusted(r.vacuum * (1.0 / (1.0 + r.ranges.refractivity) - 1.0) / MILLIMETRE),
            ".4f",
        ),
        Column("d0_mm", "mm", "correction for the distance of the internal cube, D0", lambda r: r.d0_mm, ".4f"),
        _ranged("zero_mm", "mm", "correction for the ranger's zero, as estimated", lambda s: s.zero / MILLIMETRE),
        _ranged("glass_mm", "mm", "correction for the retroreflector's glass", lambda s: s.glass / MILLIMETRE),
        _ranged("incidence_deg", "deg", "angle of incidence on the retroreflector", lambda s: s.incidence / DEGREE),
        _ranged("obliquity_mm", "mm", "correction for that angle", lambda s: s.obliquity / MILLIMETRE),
        _ranged(
            "leakage_mm",
            "mm",
            "correction for signal that never left the ranger, as estimated",
            lambda s: s.leakage / MILLIMETRE,
        ),
        _ranged(
            "head_mm", "mm", "corrections for the head: axes, amplitude, cyclic terms", lambda s: s.head / MILLIMETRE
        ),
        _ranged(
            "moved_mm",
            "mm",
            "correction to the middle of the campaign: expansion and drift of the telescope",
            lambda s: s.moved / MILLIMETRE,
        ),
        _ranged("range_m", "m", "range from scan point to retroreflector", lambda s: s.range_),
        _ranged("u_range_mm", "mm", "standard uncertainty of the range", lambda s: s.u_range / MILLIMETRE),
        _ranged("residual_mm", "mm", "observed less adjusted", lambda s: s.residual / MILLIMETRE),
        _ranged(
            "standardised",
            "",
            "residual over its own standard deviation, w of the outlier test",
            lambda s: s.standardised,
        ),
        _ranged("redundancy", "", "redundancy number, 0 (unchecked) to 1", lambda s: s.redundancy),
        _ranged(
            "detectable_mm",
            "mm",
            "smallest error that the test detects (80 % power)",
            lambda s: s.detectable / MILLIMETRE,
        ),
    ),
)


@dataclass(frozen=True, eq=False)
class PointRows:
    """Source of coordinates.csv: a row per point."""

    reduction: Reduction

    @cached_property
    def covariance(self) -> np.ndarray:
        """Covariance of each point, (n, 3, 3) mm²."""
        return self.reduction.coordinates.joint.blocks / MILLIMETRE**2

    @cached_property
    def u(self) -> np.ndarray:
        """Standard uncertainties, (n, 3) mm."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def status(self) -> list[str]:
        unchecked = set(self.reduction.coordinates.unchecked)
        return ["unchecked" if name in unchecked else "checked" for name in self.reduction.coordinates.points]

    @property
    def moved(self) -> np.ndarray:
        """Distances from the approximate places, m."""
        return np.linalg.norm(self.reduction.coordinates.x - self.reduction.coordinates.start, axis=1)


COORDINATES = Table[PointRows](
    "coordinates.csv",
    PAGE,
    (
        Column("point", "", "name", lambda r: r.reduction.coordinates.points),
        Column(
            "kind",
            "",
            "what it is: `dish prism`, `structure`, `feed-arm ranger`, `ground ranger`, `triplet ball`, ...",
            lambda r: list(kinds_of(r.reduction).values()),
        ),
        Column("x_m", "m", "place in the ground frame, east", lambda r: r.reduction.coordinates.x[:, 0], ".7f"),
        Column("y_m", "m", "place in the ground frame, north", lambda r: r.reduction.coordinates.x[:, 1], ".7f"),
        Column("z_m", "m", "place in the ground frame, up", lambda r: r.reduction.coordinates.x[:, 2], ".7f"),
        Column("u_x_mm", "mm", "standard uncertainty of x", lambda r: r.u[:, 0], ".4f"),
        Column("u_y_mm", "mm", "standard uncertainty of y", lambda r: r.u[:, 1], ".4f"),
        Column("u_z_mm", "mm", "standard uncertainty of z", lambda r: r.u[:, 2], ".4f"),
        Column("cov_xy_mm2", "mm2", "covariance of x and y", lambda r: r.covariance[:, 0, 1], ".8f"),
        Column("cov_xz_mm2", "mm2", "covariance of x and z", lambda r: r.covariance[:, 0, 2], ".8f"),
        Column("cov_yz_mm2", "mm2", "covariance of y and z", lambda r: r.covariance[:, 1, 2], ".8f"),
        Column("shots", "", "number of used shots to or from it", lambda r: r.reduction.coordinates.shots.astype(int)),
        Column(
            "from_approximate_mm",
            "mm",
            "distance from the approximate place in the campaign's files",
            lambda r: r.moved / MILLIMETRE,
            ".4f",
        ),
        Column("lines", "", "number of independent lines to or from it", lambda r: r.reduction.coordinates.lines),
        Column(
            "status",
            "",
            "`checked`, or `unchecked` where an error of one line or survey could move it unseen",
            lambda r: r.status,
        ),
    ),
)


@dataclass(frozen=True, eq=False)
class PrismRows:
    """Source of surface.csv: a row per prism of the dish."""

    reduction: Reduction
    surface: DishFit

    @property
    def shots(self) -> np.ndarray:
        coordinates = self.reduction.coordinates
        return coordinates.shots[coordinates.rows(self.surface.names)].astype(int)


SURFACE = Table[PrismRows](
    "surface.csv",
    PAGE,
    (
        Column("point", "", "name", lambda r: r.surface.names),
        Column(
            "x_dish_m", "m", "place in the fitted paraboloid's frame, x", lambda r: r.surface.fit.local[:, 0], ".7f"
        ),
        Column("y_dish_m", "m", "place in that frame, y", lambda r: r.surface.fit.local[:, 1], ".7f"),
        Column(
            "z_dish_m",
            "m",
            "place in that frame, along the paraboloid's axis",
            lambda r: r.surface.fit.local[:, 2],
            ".7f",
        ),
        Column(
            "deviation_mm",
            "mm",
            "distance from the fitted paraboloid along its normal, positive towards the focus",
            lambda r: r.surface.fit.deviation / MILLIMETRE,
            ".4f",
        ),
        Column(
            "u_deviation_mm",
            "mm",
            "standard uncertainty of the deviation",
            lambda r: r.surface.u_deviation / MILLIMETRE,
            ".4f",
        ),
        Column("shots", "", "number of used shots to or from it", lambda r: r.shots),
    ),
)


def ranges_csv(reduction: Reduction) -> str:
    """Table of every shot in the campaign's order, with every correction to its range."""
    return RANGES.csv(ShotRows(reduction))


def coordinates_csv(reduction: Reduction) -> str:
    """Table of every point in the ground frame, with standard uncertainties and covariances."""
    return COORDINATES.csv(PointRows(reduction))


def surface_csv(reduction: Reduction) -> str:
    """Table of the dish's prisms; no rows without a fitted surface."""
    surface = reduction.surface
    return SURFACE.csv(None if surface is None else PrismRows(reduction, surface))


def kinds_of(reduction: Reduction) -> dict[str, str]:
    """Kind of each point, in a word or two, in the points' order."""
    coordinates = reduction.coordinates
    return point_kinds(reduction.campaign, coordinates.points, coordinates.places)
