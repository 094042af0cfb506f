"""Triplets on the telescope: ball distance from ranges to both prisms.

Two ranges of a feed-arm ranger, corrected for the glass at normal incidence, become by the memo's steps

    D_1, D_2 = measured + dPc(incidence)        oblique incidence, from approximate coordinates
    D_MP = sqrt((D_1^2 + D_2^2)/2 - D_12^2/4)   the median, exact; figure 10 has a series
    D_BC = D_MP - (e . n) H_corr                e from the ball to the ranger, n the plate's normal towards the prisms

The exact last step is D_BC = sqrt(D_MP^2 - |v|^2 + (e . v)^2) - e . v, with v = H_corr n the ball from the mid-point:
the memo leaves out H_corr^2 sin^2 / (2 D), 0.02 nm for 0.2 mm at 12 deg and 46 m, 0.2 um for the 20 mm that a record
may hold. Figure 10's series, that of 3.19b, leaves out D_12^2 (delta_1 + delta_2) / (16 Delta^2): 2.4 um at 46 m where
delta_1 + delta_2 is a wavelength (`memo.median_series`).

The memo uses the angles A-T-S as incidences. The prisms' normals are parallel to the plate's, not meeting in A:
T_1 A and T_2 A lean by D_12 / (2 D), 3 to 7 mrad, either way. At 46 m that is up to 0.3 um in each range at 10 deg,
7 um at 30 deg, with opposite signs: the mid-point keeps a fiftieth of it or less. Here the normal itself is used.

Displacements from the mid-point matter here, unlike at the calibration: the ball 0.15 mm aside in the plate is
0.15 mm times the sine of the incidence, 31 um at 12 deg (`tolerances`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from catseye.aliases import Array
from catseye.constants import MILLIMETRE
from catseye.errors import InputError, ValidityError
from catseye.geometry.frames.frame import Transform
from catseye.optics.retroreflector.prism import obliquity_correction, obliquity_slope
from catseye.records.site.triplet import TripletRecord

SQUARE = 1e-9  # of unit vectors: their dot product and their lengths


@dataclass(frozen=True, eq=False)
class MountedTriplet:
    """Triplet on the telescope by its records, in one frame.

    Metres, radians.

    name                 of the unit
    ball                 (3,) its centre, approximately
    normal, axis         (3,) unit vectors: plate's normal on the prism side; left to right prism, square to it
    d_12, h_corr         between the prisms; ball above their mid-point along the normal
    heights              (2,) of the left and right prism's glass
    ratio                group index of the glass over that of the air
    u_d_12, u_h_corr     standard uncertainties
    u_lateral            of the ball against the mid-point, each direction in the plate
    u_normal             of the plate's normal, each direction
    u_square             of the right angle between normal and axis: the prisms' depths, 0.15 mm over D_12
    """

    name: str
    ball: Array
    normal: Array
    axis: Array
    d_12: float
    h_corr: float
    heights: Array
    ratio: float
    u_d_12: float
    u_h_corr: float
    u_lateral: float
    u_normal: float
    u_square: float = 0.25e-3

    def __post_init__(self) -> None:
        frame = np.stack([self.axis, self.normal])
        if not np.allclose(frame @ frame.T, np.eye(2), rtol=0.0, atol=SQUARE):
            raise ValidityError(f"triplet {self.name}: normal and axis are not square unit vectors within {SQUARE:g}")

    @classmethod
    def of(cls, record: TripletRecord, frame: Transform, *, ratio: float, u_normal: float) -> "MountedTriplet":
        """Mounted triplet of a data sheet.

        record     the sheet
        frame      from the sheet's frame to the target frame
        ratio      group index of the glass over that of the air
        u_normal   rad, of the plate's normal, each direction

        Source: [GOLDMAN00] figure 10: ball = mid-point + h_corr normal.
        """
        normal, axis = frame.directions(record.normal), frame.directions(record.axis)
        normal = normal / np.linalg.norm(normal)
        axis = axis - (axis @ normal) * normal
        return cls(
            name=record.triplet,
            ball=frame.points(np.array(record.nominal_position_mm) * MILLIMETRE),
            normal=normal,
            axis=axis / np.linalg.norm(axis),
            d_12=record.d12_mm * MILLIMETRE,
            h_corr=record.h_corr_mm * MILLIMETRE,
            heights=np.array([record.left_prism.height_mm, record.right_prism.height_mm]) * MILLIMETRE,
            ratio=ratio,
            u_d_12=record.u_d12_mm * MILLIMETRE,
            u_h_corr=record.u_h_corr_mm * MILLIMETRE,
            u_lateral=record.u_lateral_mm * MILLIMETRE,
            u_normal=u_normal,
        )

    @property
    def across(self) -> Array:
        """Unit's y axis (3,): normal x axis."""
        return np.cross(self.normal, self.axis)

    @property
    def prisms(self) -> Array:
        """Reference points (2, 3), m, of the left and right prism."""
        return self.ball - self.h_corr * self.normal + np.outer([-0.5, 0.5], self.d_12 * self.axis)


@dataclass(frozen=True, eq=False)
class BallRanges:
    """Distances from k rangers to the balls of n triplets.

    NaN for a prism without a range or without a closed triangle.

    incidence    (n, k, 2) rad, on the left and right prism
    obliquity    (n, k, 2) m, dPc, added to the measured ranges, never positive
    d_mp, d_bc   (n, k) m, to the mid-point and the ball
    d_bc_memo    (n, k) m, to the ball by the memo's first-order step
    covariance   (n k, n k) m^2 of d_bc, triplet by triplet; NaN in rows and columns without answer
    """

    incidence: Array
    obliquity: Array
    d_mp: Array
    d_bc: Array
    d_bc_memo: Array
    covariance: Array


def median(d_1: ArrayLike, d_2: ArrayLike, d_12: ArrayLike) -> Array:
    """Distance to the mid-point of the prisms, m.

    NaN where three lengths make no triangle.

    d_1, d_2   m, to the prisms
    d_12       m, between them

    Source: [GOLDMAN00] eq. 3.17. Exact.

    >>> float(median(13.0, 13.0, 10.0))
    12.0
    """
    one, two, base = (np.asarray(d, dtype=float) for d in (d_1, d_2, d_12))
    closes = (np.abs(one - two) <= base) & (base <= one + two)
    square = (0.5 * (one + two)) ** 2 - 0.25 * (base - (one - two)) * (base + (one - two))
    return np.where(closes, np.sqrt(np.where(closes, square, 0.0)), np.nan)


def ball_distance(d_mp: ArrayLike, sight: ArrayLike, offset: ArrayLike) -> Array:
    """Distance from a ranger to the ball, m, from that to the mid-point.

    d_mp     (...) m
    sight    (..., 3) unit vector from the ball to the ranger
    offset   (..., 3) m, ball's centre from the mid-point, same frame: H_corr times the plate's normal

    Source: [GOLDMAN00] appendix C and figure 10, here without their neglect of the offset's square. Exact.

    >>> float(ball_distance(13.0, [1.0, 0.0, 0.0], [0.0, 5.0, 0.0]))
    12.0
    """
    along, square = _parts(sight, offset)
    distance = np.asarray(d_mp, dtype=float)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(distance**2 - square + along**2) - along)


def ball_distance_memo(d_mp: ArrayLike, sight: ArrayLike, offset: ArrayLike) -> Array:
    """Distance to the ball by the memo's subtraction, m.

    Too long by the offset's square across the sight over twice the distance.

    Arguments as of `ball_distance`.

    Source: [GOLDMAN00] figure 10: D_BC = D_MP - (e_BC_S . e_TR) H_corr.

    >>> float(ball_distance_memo(13.0, [1.0, 0.0, 0.0], [0.0, 5.0, 0.0]))
    13.0
    """
    return np.asarray(d_mp, dtype=float) - _parts(sight, offset)[0]


def ball_ranges(
    units: Sequence[MountedTriplet], scan_points: ArrayLike, ranges: ArrayLike, *, covariance: ArrayLike
) -> BallRanges:
    """Distances to the balls with their full covariance.

    units         n, in the frame of the scan points
    scan_points   (k, 3) m, approximately
    ranges        (n, k, 2) m, to the left and right prism, with Pc but without dPc; NaN for missing ones
    covariance    (2nk, 2nk) m^2 of the ranges in that order: zeros and glass constants are common to many

    Besides the ranges' own, each unit adds the common errors of its distances: u of D_12, H_corr, both lateral offsets
    and both tilts of the normal. Approximate coordinates good to 20 mm turn a sight by 0.4 mrad at 50 m: 0.1 um at
    most.

    Source: [GOLDMAN00] appendix C; covariance to first order, [JCGM100] section 5.2.
    """
    s, d = np.asarray(scan_points, dtype=float), np.asarray(ranges, dtype=float)
    n, k = len(units), len(s)
    full = np.asarray(covariance, dtype=float)
    if d.shape != (n, k, 2) or full.shape != (2 * n * k, 2 * n * k):
        raise InputError(
            f"ranges have shape {d.shape} and covariance {full.shape}; expected ({n}, {k}, 2) and "
            f"({2 * n * k}, {2 * n * k}) for {n} triplets and {k} scan points"
        )
    by_triplet = [_one(unit, s, rows) for unit, rows in zip(units, d, strict=True)]
    incidence, obliquity, d_mp, d_bc, memo, by_range, by_unit = (
        np.stack(part) for part in zip(*by_triplet, strict=True)
    )
    slope = by_range.reshape(n * k, 2)
    solved = np.isfinite(d_bc).ravel()
    blocks = np.where(np.isfinite(full), full, 0.0).reshape(n * k, 2, n * k, 2)
    total = np.einsum(
        "ia,iajb,jb->ij", np.where(solved[:, None], slope, 0.0), blocks, np.where(solved[:, None], slope, 0.0)
    )
    for i, part in enumerate(np.nan_to_num(by_unit)):
        rows = slice(i * k, (i + 1) * k)
        total[rows, rows] += part @ part.T
    total[~solved], total[:, ~solved] = np.nan, np.nan
    return BallRanges(incidence=incidence, obliquity=obliquity, d_mp=d_mp, d_bc=d_bc, d_bc_memo=memo, covariance=total)


def incidence_on_prisms(unit: MountedTriplet, scan_points: ArrayLike) -> tuple[Array, Array]:
    """Cosine of incidence (k, 2) on both prisms, and unit vectors.

    Vectors (k, 2, 3) towards the rangers; left and right prism.

    scan_points   (k, 3) m, approximately, in the unit's frame

    Source: [GOLDMAN00] appendix C with the plate's normal in place of T-A, see the module.
    """
    towards = np.asarray(scan_points, dtype=float)[:, None] - unit.prisms
    towards = towards / np.linalg.norm(towards, axis=-1, keepdims=True)
    return np.clip(towards @ unit.normal, -1.0, 1.0), towards


def obliquity_by_tilt(unit: MountedTriplet, scan_points: ArrayLike, tilts: ArrayLike) -> tuple[Array, Array]:
    """Range constant change dPc (k, 2), m, and derivatives by tilts.

    (k, 2, t) in m/rad as the normal moves along t directions.

    scan_points   (k, 3) m, approximately
    tilts         (t, 3) unit vectors in the plate

    Source: [GOLDMAN00] eq. B.1, differentiated: d cos I = tilt . e.
    """
    cosine, towards = incidence_on_prisms(unit, scan_points)
    sine = np.sqrt((1.0 - cosine) * (1.0 + cosine))
    by_angle = obliquity_slope(unit.heights, unit.ratio, cosine)
    by_cosine = np.where(sine > 0.0, -by_angle / np.where(sine > 0.0, sine, 1.0), 0.0)
    slopes = by_cosine[..., None] * (towards @ np.asarray(tilts, dtype=float).T)
    return obliquity_correction(unit.heights, unit.ratio, cosine), slopes


def _one(unit: MountedTriplet, s: Array, d: Array) -> tuple[Array, ...]:
    """Results of one unit.

    Incidence, dPc, D_MP, D_BC, the memo's D_BC, slopes by both ranges, contributions of its errors.
    """
    tilts = np.stack([unit.axis, unit.across])
    obliquity, by_tilt = obliquity_by_tilt(unit, s, tilts)
    right = d + obliquity
    d_mp = median(right[:, 0], right[:, 1], unit.d_12)
    sight = s - unit.ball
    sight = sight / np.linalg.norm(sight, axis=1, keepdims=True)
    offset = unit.h_corr * unit.normal
    d_bc = ball_distance(d_mp, sight, offset)
    by_range = 0.5 * right / d_mp[:, None]
    moved = np.sum(by_range[:, :, None] * by_tilt, axis=1)
    shares = [
        -unit.u_h_corr * (sight @ unit.normal)[:, None],
        -unit.u_lateral * (sight @ tilts.T),
        -unit.u_d_12 * (0.25 * unit.d_12 / d_mp)[:, None],
        unit.u_normal * (moved - unit.h_corr * (sight @ tilts.T)),
    ]
    angle = np.arccos(incidence_on_prisms(unit, s)[0])
    return (
        angle,
        obliquity,
        d_mp,
        d_bc,
        ball_distance_memo(d_mp, sight, offset),
        by_range,
        np.concatenate(shares, axis=1),
    )


def _parts(sight: ArrayLike, offset: ArrayLike) -> tuple[Array, Array]:
    """Offset along the sight, and its square length."""
    e, v = np.asarray(sight, dtype=float), np.asarray(offset, dtype=float)
    return np.sum(e * v, axis=-1), np.sum(v * v, axis=-1)
