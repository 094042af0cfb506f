"""Triplets as observations of a network.

Their sheets' data, and ranges to their prisms with the obliquity.

The memo's steps one by one (`use`) lose the ranges' information on the unit's own shape; here the prisms, the ball,
the plate's tilts and the ball's lateral offsets are parameters, the offsets the same in every posture.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import InputError
from catseye.estimation.observations.fixed_distance import U_FIXED
from catseye.estimation.observations.kinds import Distances, Linear, ObservationGroup, RigidTriplets
from catseye.estimation.observations.unit_direction import across
from catseye.reduction.triplet.use import MountedTriplet, obliquity_by_tilt

Columns = NDArray[np.intp]
BALL = 6  # a unit's parameters: left prism, right prism, ball (9), two tilts, two lateral offsets
TILT = 9
LATERAL = 11
COUNT = 13


@dataclass(frozen=True, eq=False)
class TripletParameters:
    """Positions of the parameters of n units.

    Thirteen each from `first`; the lateral pair is elsewhere if shared.

    first     (n,) column of the x of the left prism; then right prism, ball, tilts, lateral offsets
    lateral   (n,) column of the first of both lateral offsets; default `first` + 11
    """

    first: Columns
    lateral: Columns | None = None

    @property
    def offsets(self) -> Columns:
        return self.first + LATERAL if self.lateral is None else self.lateral


def triplet_start(units: Sequence[MountedTriplet]) -> NDArray[np.float64]:
    """Start values (13n,) of the units' parameters.

    From their approximate places.

    units   in the frame of the network
    """
    return np.concatenate([np.concatenate([u.prisms.ravel(), u.ball, np.zeros(4)]) for u in units])


def triplet_observations(units: Sequence[MountedTriplet], at: TripletParameters) -> tuple[ObservationGroup, ...]:
    """Observations from the sheets.

    Rigid bodies, priors of the plates' tilts and of the balls' lateral offsets.

    units   n, in the frame of the network
    at      their parameters

    A unit seen in several postures has its own points and tilts in each, and one pair of lateral offsets: their prior
    appears once. The spacing and H_corr of such a unit enter each posture independently: use their covariance with
    care.

    Source: [GOLDMAN00] sections 1.2, 1.3, figure 10.
    """
    n = len(units)
    if at.first.shape != (n,) or at.offsets.shape != (n,):
        raise InputError(f"columns of {len(at.first)} and {len(at.offsets)} triplets for {n} units; expected one each")
    no_columns = np.full(n, -1)
    u = [(U_FIXED, U_FIXED, t.u_h_corr, t.u_d_12, t.u_square) for t in units]
    bodies = RigidTriplets(
        name="triplets",
        observed=np.concatenate([[0.0, 0.0, t.h_corr, t.d_12, 0.0] for t in units]),
        covariance=np.stack([np.diag(np.square(row)) for row in u]),
        left=at.first,
        right=at.first + 3,
        ball=at.first + BALL,
        tilt=at.first[:, None] + (TILT, TILT + 1),
        start=np.stack([t.normal for t in units]),
        offset=np.stack([at.offsets, at.offsets + 1, no_columns, no_columns, no_columns], axis=1),
    )
    shared, which = np.unique(at.offsets, return_index=True)
    return (
        bodies,
        _prior("triplet normals", at.first + TILT, np.array([t.u_normal for t in units])),
        _prior("triplet lateral offsets", shared, np.array([units[i].u_lateral for i in which])),
    )


def prism_ranges(
    name: str,
    units: Sequence[MountedTriplet],
    at: TripletParameters,
    *,
    scan_points: ArrayLike,
    scan_columns: Columns,
    ranges: ArrayLike,
    covariance: ArrayLike,
    zeros: Columns | None = None,
) -> Distances:
    """Ranges from k rangers to both prisms of n units as distances.

    dPc added, derivatives by its tilts as nuisance.

    name           of the group
    units          n, in the frame of the network
    at             their parameters
    scan_points    (k, 3) m, approximately
    scan_columns   (k,) column of the x of each
    ranges         (n, k, 2) m, with Pc but without dPc; NaN for missing ones
    covariance     (2nk,) variances or (2nk, 2nk), m^2, in that order
    zeros          (k,) column of each ranger's zero (positive: ranges too long); -1 or None for none

    Observed minus D is -dPc for the tilts' change from the start: D = measured + dPc(tilts).

    Source: [GOLDMAN00] appendices B and C.
    """
    s, d, c = np.asarray(scan_points, dtype=float), np.asarray(ranges, dtype=float), np.asarray(covariance, dtype=float)
    n, k = len(units), len(s)
    m = 2 * n * k
    if d.shape != (n, k, 2) or c.shape not in ((m,), (m, m)):
        raise InputError(
            f"{name}: ranges {d.shape}, covariance {c.shape}; expected ({n}, {k}, 2) and ({m},) or ({m}, {m})"
        )
    corrections, slopes = zip(*(_obliquity(unit, s) for unit in units), strict=True)
    observed = (d + np.stack(corrections)).ravel()
    used = np.flatnonzero(np.isfinite(observed))
    unit, remainder = np.divmod(used, 2 * k)
    ranger, side = np.divmod(remainder, 2)
    zero = np.full(k, -1) if zeros is None else zeros
    tilt = at.first[unit][:, None] + (TILT, TILT + 1)
    return Distances(
        name,
        observed[used],
        c[used] if c.ndim == 1 else c[np.ix_(used, used)],
        scan_columns[ranger],
        at.first[unit] + 3 * side,
        nuisance=np.concatenate([tilt, zero[ranger][:, None]], axis=1),
        coefficient=np.concatenate([-np.stack(slopes).reshape(m, 2)[used], np.ones((len(used), 1))], axis=1),
    )


def _obliquity(unit: MountedTriplet, s: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Range constant change dPc and its derivatives by the two tilts.

    Along the two directions in which `RigidTriplets` tilts the normal.
    """
    return obliquity_by_tilt(unit, s, across(unit.normal[None])[0])


def _prior(name: str, first: Columns, u: NDArray[np.float64]) -> Linear:
    """Pairs of parameters that are zero to u."""
    columns = (first[:, None] + (0, 1)).ravel()
    return Linear(name, np.zeros(len(columns)), np.repeat(u, 2) ** 2, columns, np.eye(len(columns)))
