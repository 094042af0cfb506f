"""Tables of poses, of a pointing fit and of a track profile."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.estimation.shapes.pose import Pose
from catseye.gateways.writers.columns import Column, Table
from catseye.reduction.pose.findings import PoseFindings
from catseye.reduction.pose.series_comparison import PointingFindings
from catseye.reduction.pose.track_profile import TrackProfile

PAGE = "star-offsets.md"


@dataclass(frozen=True, eq=False)
class PosePoints:
    """Source of points.csv: points of a pose.

    places   (n, 3) m, first positions
    """

    pose: Pose
    places: np.ndarray

    @cached_property
    def displacement(self) -> np.ndarray:
        """Motion by the pose, (n, 3) m."""
        return self.pose.displacement(self.places)[0]


def _axis(name: str, unit: str, k: int, doc: str, value: Callable[[PosePoints], np.ndarray]) -> Column[PosePoints]:
    """Column of one axis of an (n, 3) array in metres."""
    scale, form = (MILLIMETRE, ".4f") if unit == "mm" else (1.0, ".6f")
    return Column(f"{name.format('xyz'[k])}_{unit}", unit, doc.format("xyz"[k]), lambda p: value(p)[:, k] / scale, form)


POINTS = Table[PosePoints](
    "points.csv",
    PAGE,
    (
        Column("point", "", "name", lambda p: p.pose.names),
        *(_axis("{}", "m", k, "first position, {}", lambda p: p.places) for k in range(3)),
        *(_axis("d{}", "mm", k, "motion by the pose along {}", lambda p: p.displacement) for k in range(3)),
        *(
            _axis(
                "residual_{}",
                "mm",
                k,
                "second position less first and motion, along {}",
                lambda p: p.pose.motion.residual,
            )
            for k in range(3)
        ),
        Column("w", "", "largest standardised residual of the three", lambda p: p.pose.w, ".2f"),
    ),
)


OBSERVATIONS = Table[PointingFindings](
    "observations.csv",
    PAGE,
    (
        Column("place", "", "file and line", lambda o: o.observations.where),
        Column("azimuth_deg", "deg", "azimuth on the sky", lambda o: o.fit.azimuth / DEGREE, ".7f"),
        Column("elevation_deg", "deg", "elevation on the sky", lambda o: o.fit.elevation / DEGREE, ".7f"),
        Column(
            "correction_azimuth_cos_e_arcsec",
            "arcsec",
            "encoders less sky: azimuth, times the cosine of the elevation",
            lambda o: o.fit.observed[:, 0] / ARCSECOND,
            ".4f",
        ),
        Column(
            "correction_elevation_arcsec",
            "arcsec",
            "encoders less sky: elevation",
            lambda o: o.fit.observed[:, 1] / ARCSECOND,
            ".4f",
        ),
        Column(
            "residual_azimuth_cos_e_arcsec",
            "arcsec",
            "observed less fitted: azimuth, times the cosine of the elevation",
            lambda o: o.fit.residual[:, 0] / ARCSECOND,
            ".4f",
        ),
        Column(
            "residual_elevation_arcsec",
            "arcsec",
            "observed less fitted: elevation",
            lambda o: o.fit.residual[:, 1] / ARCSECOND,
            ".4f",
        ),
        Column(
            "w_azimuth", "", "standardised residual in azimuth; empty where rejected", lambda o: o.fit.w[:, 0], ".2f"
        ),
        Column("w_elevation", "", "standardised residual in elevation", lambda o: o.fit.w[:, 1], ".2f"),
        Column("used", "", "`yes` or `no`", lambda o: np.where(o.fit.used, "yes", "no")),
    ),
)


@dataclass(frozen=True, eq=False)
class TiltRows:
    """Source of tilt.csv: a row every five degrees of azimuth."""

    profile: TrackProfile

    @property
    def azimuth_deg(self) -> np.ndarray:
        return np.arange(0.0, 360.0, 5.0)

    @cached_property
    def tilt(self) -> np.ndarray:
        """Tilt about east and north and its standard uncertainties, (n, 4) arc seconds."""
        tilt, spread = self.profile.series.at(self.azimuth_deg * DEGREE)
        u = np.stack([spread[:, 0, 0] ** 0.5, spread[:, 1, 1] ** 0.5], axis=-1)
        return np.concatenate([tilt, u], axis=-1) / ARCSECOND

    @property
    def partial(self) -> bool:
        """True where coefficients are undetermined and left out."""
        return bool(self.profile.series.undetermined)


def _tilt(name: str, k: int, doc: str, part: str = "") -> Column[TiltRows]:
    """Column of a tilt; with a part in its name where that is left out."""
    return Column(
        f"{name}{part}_arcsec", "arcsec", doc, lambda t: t.tilt[:, k] if t.partial == bool(part) else None, ".4f"
    )


TILTS = ("tilt_east", "tilt_north", "u_east", "u_north")
WITHOUT = "_without_wave_1"
TILT = Table[TiltRows](
    "tilt.csv",
    PAGE,
    (
        Column("azimuth_deg", "deg", "azimuth, every 5°", lambda t: t.azimuth_deg, ".1f"),
        _tilt(TILTS[0], 0, "rotation of the alidade about east"),
        _tilt(TILTS[1], 1, "rotation about north"),
        _tilt(TILTS[2], 2, "standard uncertainty about east"),
        _tilt(TILTS[3], 3, "standard uncertainty about north"),
        *(
            _tilt(name, k, f"in place of `{name}_arcsec` where the wave of one turn is not determined", WITHOUT)
            for k, name in enumerate(TILTS)
        ),
    ),
)


def points_csv(result: PoseFindings) -> str:
    """Table of points: first position, motion by the pose, residual, largest |w|."""
    return POINTS.csv(PosePoints(result.pose.pose, result.pose.places))


def observations_csv(result: PointingFindings) -> str:
    """Table of observations with residuals."""
    return OBSERVATIONS.csv(result)


def tilt_csv(profile: TrackProfile) -> str:
    """Table of the tilt every five degrees; columns name undetermined parts, which are excluded."""
    return TILT.csv(TiltRows(profile))
