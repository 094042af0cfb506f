"""Series of one point: its coordinates night by night, and their scatter beside the claim."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from catseye.errors import InputError
from catseye.names import counted
from catseye.records.archive.layout import AXES, PRODUCTS
from catseye.reduction.query.span import ArchiveSpan
from catseye.verdict import Verdict

PointFrame = Literal["ground", "reflector"]
DISH = "dish"  # body whose pose says where the reflector frame is


class MeanPlace(NamedTuple):
    """Weighted mean of a point's places.

    place        (3,) m
    covariance   (3, 3) m^2, from those of the nights
    factor       scatter about it over the claim, squared: [pvv] over degrees of freedom; nan for a single night
    """

    place: np.ndarray
    covariance: np.ndarray
    factor: float


@dataclass(frozen=True, eq=False)
class PointSeries:
    """Series of a point over n nights.

    frame           of coordinates and covariances: "ground", or "reflector" at its nominal place of the night
    night           (n,) identifiers
    mjd             (n,) UTC
    body            (n,) kind of the point
    x               (n, 3) m
    covariance      (n, 3, 3) m^2
    shots           (n,) used shots to or from it
    azimuth, elevation   (n,) rad, of the telescope
    temperature_c   (n,) of the air
    unplaced        nights left out, as they have no pose of the dish
    """

    point: str
    frame: PointFrame
    verdict: Verdict
    night: np.ndarray
    mjd: np.ndarray
    body: np.ndarray
    x: np.ndarray
    covariance: np.ndarray
    shots: np.ndarray
    azimuth: np.ndarray
    elevation: np.ndarray
    temperature_c: np.ndarray
    unplaced: int = 0

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainties (n, 3) m."""
        return np.sqrt(np.maximum(np.diagonal(self.covariance, axis1=1, axis2=2), 0.0))

    @cached_property
    def mean(self) -> MeanPlace:
        """Mean weighted by the nights' covariances; plain where one is singular, as of a point that is held fixed."""
        n = len(self.x)
        if np.all(np.linalg.eigvalsh(self.covariance)[:, 0] > 0.0):
            weights = np.linalg.inv(self.covariance)
            covariance = np.linalg.inv(weights.sum(axis=0))
            place = covariance @ np.einsum("nij,nj->i", weights, self.x)
            residual = self.x - place
            pvv = float(np.einsum("ni,nij,nj->", residual, weights, residual))
            return MeanPlace(place, covariance, pvv / (3 * (n - 1)) if n > 1 else float("nan"))
        return MeanPlace(self.x.mean(axis=0), self.covariance.sum(axis=0) / n**2, float("nan"))

    @property
    def deviation(self) -> np.ndarray:
        """Places less their mean, (n, 3) m."""
        return self.x - self.mean.place

    @property
    def scatter(self) -> np.ndarray:
        """Standard deviation (3,) m of the places; nan for a single night."""
        return np.std(self.x, axis=0, ddof=1) if len(self.x) > 1 else np.full(3, np.nan)


def point_series(span: ArchiveSpan, point: str, frame: PointFrame = "ground") -> PointSeries:
    """Series of a point in the ground frame, or against the nominal reflector of each night.

    Raises InputError: an unknown point, a span without a night, a dish without poses.
    """
    columns = ("night", "mjd", "body", *AXES, *PRODUCTS, "shots", "azimuth", "elevation", "temperature_c")
    rows = span.table("points", *columns, point=point)
    if not len(rows["night"]):
        span.refuse_empty("points", "point", point)
    x = np.column_stack([rows[axis] for axis in AXES])
    q = covariances(rows)
    kept = np.arange(len(x))
    if frame == "reflector":
        x, q, kept = _in_reflector(span, rows, x, q)
    unplaced = len(rows["night"]) - len(kept)
    nights = rows["night"][kept]
    return PointSeries(
        point=point,
        frame=frame,
        verdict=span.verdict(nights.tolist(), f"{counted(len(nights), 'night')}, all of them good"),
        night=nights,
        mjd=rows["mjd"][kept],
        body=rows["body"][kept],
        x=x,
        covariance=q,
        shots=rows["shots"][kept],
        azimuth=rows["azimuth"][kept],
        elevation=rows["elevation"][kept],
        temperature_c=rows["temperature_c"][kept],
        unplaced=unplaced,
    )


def covariances(rows: dict[str, np.ndarray]) -> np.ndarray:
    """Covariances (n, 3, 3) m^2 from the columns xx to zz of the archive."""
    xx, xy, xz, yy, yz, zz = (rows[name] for name in PRODUCTS)
    return np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(-1, 3, 3)


def _in_reflector(
    span: ArchiveSpan, rows: dict[str, np.ndarray], x: np.ndarray, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places and covariances in the nominal reflector frame, and the rows that have one.

    Its origin is the pivot of the night's pose, its axes those of a rigid telescope at the night's posture; a place
    there includes the pose of the dish, as the ground sees it.
    """
    pivots = pivots_of(span)
    kept = np.array([k for k, night in enumerate(rows["night"].tolist()) if night in pivots], dtype=int)
    if not len(kept):
        raise InputError(f"{span.archive.directory}: no night has a pose of the dish (expected frame ground)")
    axes = reflector_axes(rows["azimuth"][kept], rows["elevation"][kept])
    origin = np.array([pivots[night] for night in rows["night"][kept].tolist()])
    local = np.einsum("nji,nj->ni", axes, x[kept] - origin)
    return local, np.einsum("nji,njk,nkl->nil", axes, q[kept], axes), kept


def pivots_of(span: ArchiveSpan) -> dict[str, np.ndarray]:
    """Nominal vertex (3,) m, ground frame, of each night with a pose of the dish."""
    poses = span.table("poses", "night", *(f"pivot_{axis}" for axis in AXES), body=DISH)
    places = np.column_stack([poses[f"pivot_{axis}"] for axis in AXES])
    return dict(zip(poses["night"].tolist(), places, strict=True))


def reflector_axes(azimuth: np.ndarray, elevation: np.ndarray) -> np.ndarray:
    """Axes (n, 3, 3) of the nominal reflector as columns, in the ground frame."""
    from catseye.geometry.antenna.frames import ground_from_reflector_at

    return ground_from_reflector_at(azimuth, elevation).rotation
