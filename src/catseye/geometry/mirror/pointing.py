"""Six transformations: ground point to encoder counts, and back.

    1  R - R_i            off the Kelvin mount's fixed point
    2  gamma              into the mount's axes
    3  - (dx, dy, dz)     off the scan point, where the mirror's axes meet
    4  lambda             into the mirror's axes
    5  range, Theta, Phi  spherical
    6  N_a, N_e           encoder counts

1 to 4 are mirror = lambda gamma (R - S) with the scan point S = R_i + gamma^T (dx, dy, dz): one turn and one shift,
without loss of precision for near points. This is the ideal mirror; `imperfect` adds the errors of real ones.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catseye.errors import ValidityError
from catseye.geometry.frames.rotation import rx, rz
from catseye.geometry.mirror.encoder import (
    COUNTS_PER_RADIAN,
    azimuth_angle,
    azimuth_counts,
    elevation_angle,
    elevation_counts,
)
from catseye.geometry.mirror.mirror_path import direction_angles
from catseye.geometry.mirror.mount import gamma, lambda_, mount_angles, scan_point

PARAMETERS = ("x", "y", "z", "alpha1", "alpha2", "alpha3", "dx", "dy", "dz", "beta1", "beta2", "na0", "ne0")
SIZES = {"fixed_point": 3, "alpha": 3, "offset": 3, "beta": 2, "zeros": 2}
COMPILED_FROM = 1_000_000  # points: for fewer, loading numba takes longer than the plain form


@dataclass(frozen=True, eq=False)
class MirrorStation:
    """Mirrors on their monuments: 13 numbers each, ordered as `PARAMETERS`.

    fixed_point    (..., 3), m, ground: centre of the Kelvin mount's tooling ball
    alpha          (..., 3), rad: alpha1, alpha2, alpha3
    offset         (..., 3), m, mount axes: dx, dy, dz from the fixed point to the scan point
    beta           (..., 2), rad: beta1, beta2
    zeros          (..., 2), counts: na0, ne0

    Its batch shape broadcasts against that of points and counts: `station[:, None]` of 18 and 1000 points make 18 x
    1000.
    Raises ValidityError for a shape with other last axes, or a number that is not finite.

    Source: [PARKER04] section 2.2.

    >>> zy3 = MirrorStation([5.5862, 20.85, -0.0058], [1.008848, -2.4e-5, 1.45e-4], [0.0, 0.25, 0.0], [0, 0], [0, 0])
    >>> zy3.gamma[0].round(5).tolist(), zy3.scan_point.round(3).tolist()
    ([0.53284, 0.84622, -2e-05], [5.586, 20.85, 0.244])
    """

    fixed_point: NDArray[np.float64]
    alpha: NDArray[np.float64]
    offset: NDArray[np.float64]
    beta: NDArray[np.float64]
    zeros: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name, size in SIZES.items():
            array = np.array(getattr(self, name), dtype=float)
            if array.shape[-1:] != (size,):
                raise ValidityError(f"{name} has shape {array.shape}, expected (..., {size})")
            if not np.isfinite(array).all():
                raise ValidityError(f"{name} of a station holds a number that is not finite")
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @classmethod
    def from_matrix(
        cls, point: ArrayLike, gamma_matrix: ArrayLike, *, offset: ArrayLike, beta: ArrayLike, zeros: ArrayLike
    ) -> "MirrorStation":
        """Station from scan point (..., 3), m, and gamma (..., 3, 3), as on the feed arm.

        The mount may have any orientation.
        """
        g = np.asarray(gamma_matrix, dtype=float)
        away = np.einsum("...ji,...j->...i", g, np.asarray(offset, dtype=float))
        return cls(
            np.asarray(point, dtype=float) - away,
            np.stack(mount_angles(g), axis=-1),
            np.asarray(offset, dtype=float),
            np.asarray(beta, dtype=float),
            np.asarray(zeros, dtype=float),
        )

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the batch of mirrors."""
        return np.broadcast_shapes(*(getattr(self, name).shape[:-1] for name in SIZES))

    @property
    def parameters(self) -> NDArray[np.float64]:
        """Parameters (..., 13) in the order of `PARAMETERS`."""
        parts = [np.broadcast_to(getattr(self, name), (*self.shape, size)) for name, size in SIZES.items()]
        return np.concatenate(parts, axis=-1)

    @classmethod
    def of_parameters(cls, parameters: ArrayLike) -> "MirrorStation":
        """Station with given `parameters` (..., 13)."""
        values = np.asarray(parameters, dtype=float)
        if values.shape[-1:] != (len(PARAMETERS),):
            raise ValidityError(f"parameters of a station have shape {values.shape}, expected (..., {len(PARAMETERS)})")
        return cls(*np.split(values, np.cumsum(list(SIZES.values()))[:-1], axis=-1))

    def __getitem__(self, index: object) -> "MirrorStation":
        """Index the batch of stations, as numpy does."""
        table = self.parameters
        return MirrorStation.of_parameters(
            table[(*index, slice(None)) if isinstance(index, tuple) else (index, slice(None))]
        )

    @cached_property
    def gamma(self) -> NDArray[np.float64]:
        """Matrix (..., 3, 3) from ground to mount coordinates."""
        return gamma(*np.moveaxis(self.alpha, -1, 0))

    @cached_property
    def lambda_(self) -> NDArray[np.float64]:
        """Matrix (..., 3, 3) from mount to mirror coordinates."""
        return lambda_(*np.moveaxis(self.beta, -1, 0))

    @cached_property
    def mirror_from_ground(self) -> NDArray[np.float64]:
        """Matrix (..., 3, 3) from ground to mirror coordinates, eq. 2.47."""
        return self.lambda_ @ self.gamma

    @cached_property
    def scan_point(self) -> NDArray[np.float64]:
        """Scan points in the ground frame, (..., 3) m."""
        return scan_point(self.fixed_point, self.gamma, self.offset)


class Aim(NamedTuple):
    """Range (m), beam angles (rad) and counts of a point, each (...)."""

    range: NDArray[np.float64]
    theta: NDArray[np.float64]
    phi: NDArray[np.float64]
    azimuth_counts: NDArray[np.float64]
    elevation_counts: NDArray[np.float64]


class MirrorBeam(NamedTuple):
    """Beam: scan point (..., 3), m, and unit direction (..., 3), ground."""

    origin: NDArray[np.float64]
    direction: NDArray[np.float64]


def in_mirror_axes(station: MirrorStation, points: ArrayLike) -> NDArray[np.float64]:
    """Mirror coordinates of ground points (..., 3), m, from the scan point.

    Source: [PARKER04] eq. 2.12. Exact.
    """
    at = np.asarray(points, dtype=float)
    _refuse_points(at)
    return np.einsum("...ij,...j->...i", station.mirror_from_ground, at - station.scan_point)


def aim(station: MirrorStation, points: ArrayLike) -> Aim:
    """Range, beam angles and encoder counts for points, direct pointing.

    station    of batch shape that broadcasts with the points'
    points     (..., 3), m, ground

    A point in the scan point itself has no direction: NaN. On the azimuth axis Theta is 0.

    Source: [PARKER04] eq. 2.12 to 2.22. Good to 1e-15 rad.

    >>> zy3 = MirrorStation([5.5862, 20.85, -0.0058], [1.008848, -2.4e-5, 1.45e-4], [-7.5e-5, 0.247459, -7.62e-4],
    ...               [-7.27e-4, 1.21e-4], [-4195, -4935])
    >>> [round(float(v), 4) for v in aim(zy3, [0.0, 100.0, 20.0])]
    [81.7696, 0.2998, 2.1814, 576.8106, 12423.7397]
    """
    mirror = in_mirror_axes(station, points)
    distance = np.linalg.norm(mirror, axis=-1)
    theta, phi = direction_angles(mirror)
    nowhere = np.where(distance > 0.0, 0.0, np.nan)
    theta, phi = theta + nowhere, phi + nowhere
    na0, ne0 = np.moveaxis(station.zeros, -1, 0)
    return Aim(distance, theta, phi, azimuth_counts(theta, na0), elevation_counts(phi, ne0))


def counts(
    station: MirrorStation,
    points: ArrayLike,
    *,
    compiled: bool | None = None,
    out: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Encoder counts (..., 2), azimuth and elevation, for points, direct pointing.

    The same as from `aim`.

    station, points    as for `aim`
    compiled           True for the kernel, equal within 1e-9 counts; None: for a million or more, every station to
                       every point
    out                (..., 2), destination, which is returned; new memory if None

    Raises ValidityError where the kernel is requested for stations and points in pairs, and for an `out` of another
    shape or kind.
    """
    at = np.asarray(points, dtype=float)
    shape = (*np.broadcast_shapes(station.shape, at.shape[:-1]), 2)
    crossed = _stations_by_points(station.shape, at.shape[:-1])
    if compiled and not crossed:
        raise ValidityError(
            f"stations {station.shape} and points {at.shape} are in pairs, which the kernel refuses (expected every "
            "station to every point, stations in front)"
        )
    if out is not None and (out.shape != shape or out.dtype != float or not out.flags.c_contiguous):
        raise ValidityError(f"out has shape {out.shape} and type {out.dtype}, expected {shape}, float64, contiguous")
    answer = np.empty(shape) if out is None else out
    if crossed and (compiled or (compiled is None and answer.size // 2 >= COMPILED_FROM)):
        from catseye.geometry.mirror.pointing_kernel import stations_by_points

        _refuse_points(at)
        table = np.ascontiguousarray(at.reshape(-1, 3))
        stations_by_points(
            _table(station.mirror_from_ground, station.shape, (3, 3)),
            _table(station.scan_point, station.shape, (3,)),
            _table(station.zeros, station.shape, (2,)),
            table,
            answer.reshape(-1, len(table), 2),
        )
        return answer
    aimed = aim(station, at)
    answer[..., 0], answer[..., 1] = aimed.azimuth_counts, aimed.elevation_counts
    return answer


def _table(part: NDArray[np.float64], batch: tuple[int, ...], tail: tuple[int, ...]) -> NDArray[np.float64]:
    """One row a station, in contiguous memory."""
    return np.ascontiguousarray(np.broadcast_to(part, (*batch, *tail)).reshape(-1, *tail))


def _refuse_points(at: NDArray[np.float64]) -> None:
    if at.shape[-1:] != (3,):
        raise ValidityError(f"points have shape {at.shape}, expected (..., 3)")


def _stations_by_points(stations: tuple[int, ...], points: tuple[int, ...]) -> bool:
    """True if every station meets every point, stations in the outer axes."""
    depth = max(len(stations), len(points))
    s, p = ((1,) * (depth - len(shape)) + shape for shape in (stations, points))
    outer = [i for i in range(depth) if s[i] != 1]
    inner = [i for i in range(depth) if p[i] != 1]
    return not outer or not inner or outer[-1] < inner[0]


def ray(station: MirrorStation, at_counts: ArrayLike) -> MirrorBeam:
    """Beam at encoder counts, direct or prime pointing.

    station      of batch shape that broadcasts with the counts'
    at_counts    (..., 2), azimuth and elevation; any turn

    Source: [PARKER04] eq. 2.21, 2.22, 2.16 to 2.18 and 2.12 solved for R. Good to 1e-15 rad.

    >>> flat = MirrorStation([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.25, 0.0], [0.0, 0.0], [0.0, 0.0])
    >>> (ray(flat, [25_000.0, 12_500.0]).direction.round(9) + 0.0).tolist()  # y of the mirror is up
    [0.0, 0.0, 1.0]
    """
    u = beam(station, at_counts)
    direction = np.einsum("...ji,...j->...i", station.mirror_from_ground, u)
    return MirrorBeam(np.broadcast_to(station.scan_point, direction.shape), direction)


def beam(station: MirrorStation, at_counts: ArrayLike) -> NDArray[np.float64]:
    """Unit direction (..., 3) of the beam in mirror axes at counts (..., 2); eq. 2.16 to 2.18."""
    n = np.asarray(at_counts, dtype=float)
    if n.shape[-1:] != (2,):
        raise ValidityError(f"counts have shape {n.shape}, expected (..., 2)")
    theta = azimuth_angle(n[..., 0], station.zeros[..., 0])
    phi = elevation_angle(n[..., 1], station.zeros[..., 1])
    sine = np.sin(phi)
    return np.stack([sine * np.cos(theta), sine * np.sin(theta), np.cos(phi) + 0.0 * theta], axis=-1)


def counts_jacobian(station: MirrorStation, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Derivatives of counts by points (..., 2, 3), counts/m, and parameters (..., 2, 13).

    station, points    as for `aim`

    On the azimuth axis (Phi = 0 or pi) the azimuth has no derivative: infinite or NaN.

    Source: [PARKER04] eq. 2.12 to 2.22 differentiated: a turn of axes about e moves coordinates g by -e x g.

    >>> by_point, _ = counts_jacobian(MirrorStation([0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0], [0, 0]), [120.0, 0.0, 0.0])
    >>> by_point.round(2).tolist()  # one count is 7.5 mm in azimuth, 15 mm in elevation
    [[0.0, 0.0, 132.63], [0.0, 66.31, 0.0]]
    """
    mirror = in_mirror_axes(station, points)
    x, y, z = np.moveaxis(mirror, -1, 0)
    across, square = x**2 + y**2, np.sum(mirror**2, axis=-1)
    zero = np.zeros_like(x)
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(across)
        theta = np.stack([-y / across, x / across, zero], axis=-1)
        phi = np.stack([x * z / (root * square), y * z / (root * square), -root / square], axis=-1)
        slope = np.stack([COUNTS_PER_RADIAN * theta, 0.5 * COUNTS_PER_RADIAN * phi], axis=-2)
        by_point = slope @ station.mirror_from_ground
        lambda_slope = slope @ station.lambda_
        mount = np.einsum("...ji,...j->...i", station.lambda_, mirror) + station.offset
        about_mount, about_mirror = _turning_axes(station)
        by_alpha = -lambda_slope @ np.swapaxes(np.cross(about_mount, mount[..., None, :]), -1, -2)
        by_beta = -slope @ np.swapaxes(np.cross(about_mirror, mirror[..., None, :]), -1, -2)
        by_zeros = np.broadcast_to(np.eye(2), (*by_point.shape[:-1], 2))
    return by_point, np.concatenate([-by_point, by_alpha, -lambda_slope, by_beta, by_zeros], axis=-1)


def counts_covariance(
    station: MirrorStation, points: ArrayLike, *, of_station: ArrayLike, of_points: ArrayLike | None = None
) -> NDArray[np.float64]:
    """Covariance (..., 2, 2), counts^2, of the counts for points.

    station, points   as for `aim`
    of_station        (..., 13, 13), of `PARAMETERS`, in their units
    of_points         (..., 3, 3), m^2, independent of it; none if None

    Source: [JCGM102] eq. 3, first order, with `counts_jacobian`.
    """
    by_point, by_station = counts_jacobian(station, points)
    answer = by_station @ np.asarray(of_station, dtype=float) @ np.swapaxes(by_station, -1, -2)
    if of_points is not None:
        answer = answer + by_point @ np.asarray(of_points, dtype=float) @ np.swapaxes(by_point, -1, -2)
    return answer


def _turning_axes(station: MirrorStation) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Axes of turns: alpha1..3 for the mount's (..., 3, 3), beta1, 2 for the mirror's (..., 2, 3).

    One a row.

    gamma = Rx(alpha3) Rz(alpha2) Ry(alpha1) P: a factor's axis, turned by the later factors.
    """
    tip = rx(station.alpha[..., 2])
    first = (tip @ rz(station.alpha[..., 1]))[..., :, 1]
    last = np.broadcast_to([1.0, 0.0, 0.0], first.shape)
    about_mirror = rx(station.beta[..., 0])[..., :, 1]
    return (
        np.stack([first, tip[..., :, 2], last], axis=-2),
        np.stack([np.broadcast_to([1.0, 0.0, 0.0], about_mirror.shape), about_mirror], axis=-2),
    )
