"""Tilt of the alidade by azimuth, as a Fourier series with covariance.

The cause is track and azimuth bearing. The tilt is in the ground frame, as the turn of the alidade about east and
north, from its nominal place:

    tilt(A) = mean + sum over k of c_k cos kA + s_k sin kA,    each of mean, c_k, s_k with two components.

Ranges give poses of the alidade, r = R tilt with R from the ground's axes to the alidade's; an inclinometer on the
alidade reads r + zero. Its zero rotates with the telescope: it is a tilt with one wave a turn, so that inclinometers
alone cannot separate it from the same part of (c_1, s_1); all other waves they determine. Ranges separate both,
coarsely; the inclinometers then give the shape. Both enter one least squares. The mean is the azimuth axis's lean: AN
and AW of the pointing series.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from catseye.constants import ARCSECOND
from catseye.errors import EstimationError, FrameError, InputError
from catseye.estimation.least_squares.singular import best_linear_estimate
from catseye.geometry.antenna.pointing_series import axis_terms
from catseye.geometry.frames.rotation import from_vector, rz
from catseye.records.laboratory.tilts import TiltReadings
from catseye.records.network.written_pose import WrittenPose
from catseye.reduction.pose.pose import GroupPose
from catseye.verdict import Verdict

MOST_HARMONICS = 36
EXCESS = 3.0  # standard deviations of the variance factor beyond which readings scatter more than claimed
WAVE_1 = slice(2, 6)  # of the coefficients: cos 1A and sin 1A, about east and north


@dataclass(frozen=True, eq=False)
class TiltSeries:
    """Tilt by azimuth as a series.

    harmonics    K
    names        (4 K + 2) coefficients: "mean east", "mean north", "cos 1A east", ...
    values       (4 K + 2,) rad, turns about east and north; nan where an inclinometer alone cannot determine it
    covariance   (4 K + 2, 4 K + 2) rad^2, nan likewise
    """

    harmonics: int
    names: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray

    def at(self, azimuth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tilt (..., 2), rad, about east and north, and its covariance.

        At azimuths (...); covariance (..., 2, 2) rad^2.

        Coefficients that are not determined are left out: see `undetermined`.
        """
        determined = np.isfinite(self.values)
        rows = _rows(np.asarray(azimuth, dtype=float), self.harmonics)[..., determined]
        return rows @ self.values[determined], rows @ self.covariance[np.ix_(determined, determined)] @ np.swapaxes(
            rows, -1, -2
        )

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names of coefficients that the observations do not determine."""
        return tuple(name for name, value in zip(self.names, self.values, strict=True) if not np.isfinite(value))

    @property
    def axis(self) -> tuple[np.ndarray, np.ndarray]:
        """AN and AW (2,) rad of the mean tilt, and their covariance (2, 2)."""
        turn = np.array([self.values[0], self.values[1], 0.0])
        return axis_terms(turn), self.covariance[:2, :2]


@dataclass(frozen=True, eq=False)
class TrackProfile:
    """Tilt series fitted to poses and inclinometers.

    series       fitted
    zero         (2,) rad, of the inclinometer about the alidade's x and y, with covariance (2, 2); None without one
                 or where nothing determines it
    azimuth      (n,) rad, of all observations, poses first
    residual     (n, 2) rad, observed minus fitted, alidade's axes
    w            (n, 2) standardised residuals; nan where nothing checks one
    poses        number of poses among the n
    pvv, degrees_of_freedom, p   of the fit
    sources      verdicts of the poses, by their files
    """

    series: TiltSeries
    zero: tuple[np.ndarray, np.ndarray] | None
    azimuth: np.ndarray
    residual: np.ndarray
    w: np.ndarray
    poses: int
    pvv: float
    degrees_of_freedom: int
    p: float
    sources: Mapping[str, Verdict | None] = field(default_factory=dict)

    @property
    def verdict(self) -> Verdict:
        """Verdict from the scatter against the claim, undetermined parts, and the poses' verdicts."""
        return self._own_verdict().resting_on(self.sources)

    def _own_verdict(self) -> Verdict:
        degrees = self.degrees_of_freedom
        if degrees < 1:
            return Verdict("doubtful", "as many readings as coefficients: the profile is unchecked")
        factor, without = self.pvv / degrees, ""
        if self.series.undetermined:
            without = "; without the wave of one turn, which an inclinometer alone cannot separate from its zero"
        if factor > 1.0 + EXCESS * (2.0 / degrees) ** 0.5:
            return Verdict("doubtful", f"readings scatter more than claimed (variance factor {factor:.2f}){without}")
        return Verdict("good", f"readings scatter about the profile as claimed (variance factor {factor:.2f}){without}")


def _rows(azimuth: np.ndarray, harmonics: int) -> np.ndarray:
    """Derivatives (..., 2, 4 K + 2) of the tilt by the coefficients.

    Tilt about east and north.
    """
    waves = [np.ones_like(azimuth)]
    for k in range(1, harmonics + 1):
        waves += [np.cos(k * azimuth), np.sin(k * azimuth)]
    base = np.stack(waves, axis=-1)
    return np.asarray(np.einsum("...w,ij->...iwj", base, np.eye(2)).reshape((*azimuth.shape, 2, -1)))


def coefficient_names(harmonics: int) -> tuple[str, ...]:
    """Names of the coefficients in their order."""
    waves = ["mean", *(f"{f} {k}A" for k in range(1, harmonics + 1) for f in ("cos", "sin"))]
    return tuple(f"{wave} {axis}" for wave in waves for axis in ("east", "north"))


def track_profile(
    azimuth: np.ndarray,
    turn: np.ndarray,
    covariance: np.ndarray,
    *,
    tilts: TiltReadings | None = None,
    harmonics: int = 2,
    names: Sequence[str] | None = None,
    partial: bool = False,
) -> TrackProfile:
    """Fit the alidade's tilt by azimuth.

    Poses and inclinometers in one least squares.

    azimuth      (m,) rad, of the poses; m may be 0 with tilts
    turn         (m, 2) rad, rotation of the alidade about its own x and y axes, from design or a reference
    covariance   (m, 2, 2) rad^2, of each, the poses independent of each other
    tilts        readings of an inclinometer, or None
    harmonics    K, waves a turn, 0 to 36
    names        m, of the poses, for errors
    partial      True: an inclinometer alone gives all waves but the first, which its zero resembles; False: refused

    Raises EstimationError naming the coefficients that nothing determines: too few azimuths, or an inclinometer alone.
    """
    if not 0 <= harmonics <= MOST_HARMONICS:
        raise EstimationError(f"{harmonics} harmonics of a track profile (expected 0 to {MOST_HARMONICS})")
    m, n = len(azimuth), 0 if tilts is None else len(tilts)
    called = [*(names or [f"pose {k + 1}" for k in range(m)]), *(f"reading {k + 1}" for k in range(n))]
    azimuths = np.concatenate([np.asarray(azimuth, dtype=float), np.zeros(0) if tilts is None else tilts.azimuth])
    if not len(azimuths):
        raise EstimationError("a track profile needs poses or inclinometer readings (none present)")
    alone = partial and not m and harmonics > 0
    tilt_rows = np.swapaxes(rz(azimuths)[..., :2, :2], -1, -2) @ _rows(azimuths, harmonics)  # rz: ground from alidade
    # a zero acts like two of the four coefficients of one wave: with all four free it may stay 0
    free_zero = n > 0 and not alone
    zero = np.zeros((m + n, 2, 2 if free_zero else 0))
    if free_zero:
        zero[m:] = np.eye(2)
    design = np.concatenate([tilt_rows, zero], axis=-1).reshape(2 * (m + n), -1)
    read = np.zeros((0, 2)) if tilts is None else tilts.tilt
    values = np.concatenate([np.asarray(turn, dtype=float).reshape(m, 2), read])
    q = np.zeros((2 * (m + n), 2 * (m + n)))
    for k in range(m):
        q[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = covariance[k]
    if tilts is not None:
        q[2 * m :, 2 * m :] = np.diag(np.repeat(tilts.u**2, 2))
    parameters = [*coefficient_names(harmonics), *(("zero x", "zero y") if free_zero else ())]
    solution = best_linear_estimate(
        design, values.ravel(), q, parameters=parameters, rows=[f"{c} {a}" for c in called for a in "xy"]
    )
    size = 4 * harmonics + 2
    values_of_series, spread = solution.estimate[:size].copy(), solution.covariance[:size, :size].copy()
    if alone:
        values_of_series[WAVE_1] = np.nan
        spread[WAVE_1], spread[:, WAVE_1] = np.nan, np.nan
    series = TiltSeries(harmonics, coefficient_names(harmonics), values_of_series, spread)
    from scipy import special

    free = solution.degrees_of_freedom
    weight = solution.weight_diagonal
    good = weight > 1e-9 * float(weight.max(initial=0.0))
    w = np.where(good, solution.weighted_residual / np.sqrt(np.where(good, weight, 1.0)), np.nan)
    return TrackProfile(
        series=series,
        zero=(solution.estimate[size:], solution.covariance[size:, size:]) if free_zero else None,
        azimuth=azimuths,
        residual=(values.ravel() - design @ solution.estimate).reshape(-1, 2),
        w=w.reshape(-1, 2),
        poses=m,
        pvv=solution.pvv,
        degrees_of_freedom=free,
        p=float(special.chdtrc(free, solution.pvv)) if free else float("nan"),
    )


def track_of_poses(
    poses: Sequence[WrittenPose], *, tilts: TiltReadings | None = None, harmonics: int = 2
) -> TrackProfile:
    """Fit the alidade's tilt by azimuth from written poses and an inclinometer.

    poses       of the alidade, in its own frame, at several azimuths; none: the inclinometer alone
    tilts       its readings, or None
    harmonics   waves a turn, 0 to 36

    Raises InputError for a pose in another frame or without posture, EstimationError as `track_profile`.
    """
    m = len(poses)
    azimuth, turn, covariance = np.zeros(m), np.zeros((m, 2)), np.zeros((m, 2, 2))
    for k, pose in enumerate(poses):
        if pose.frame != "alidade" or pose.posture is None:
            raise InputError(f"{pose.file}: is in the frame {pose.frame!r} (expected 'alidade', with its posture)")
        if pose.rotation is None or pose.covariance is None:
            raise InputError(f"{pose.file}: rotation or covariance is missing (expected 3 and 6 x 6 numbers)")
        azimuth[k], turn[k], covariance[k] = pose.posture[0], pose.rotation[:2], pose.covariance[3:5, 3:5]
    names = [pose.file for pose in poses]
    profile = track_profile(azimuth, turn, covariance, tilts=tilts, harmonics=harmonics, names=names, partial=True)
    return replace(profile, sources={pose.file: pose.verdict for pose in poses})


def joined_tilt(
    rotation: np.ndarray, covariance: np.ndarray, tilt: np.ndarray, *, u: float
) -> tuple[np.ndarray, np.ndarray]:
    """Pose of an alidade combined with an inclinometer's reading.

    The pose's six numbers (6,) and their covariance (6, 6).

    rotation     (6,) m and rad: translation and rotation in the alidade's axes, about its pivot, from the ranges
    covariance   (6, 6)
    tilt         (2,) rad, turns about x and y, the instrument's zero taken out
    u            rad, of each, the zero's uncertainty included

    One least squares of both: K = C B'(B C B' + u^2)^-1, B picking the two turns; translation follows by correlation.
    """
    if not u > 0.0:
        raise EstimationError(f"inclinometer with u = {u / ARCSECOND:g} arcsec (expected above 0)")
    pick = np.zeros((2, 6))
    pick[0, 3] = pick[1, 4] = 1.0
    gain = covariance @ pick.T @ np.linalg.inv(pick @ covariance @ pick.T + u**2 * np.eye(2))
    complement = np.eye(6) - gain @ pick
    spread = complement @ covariance @ complement.T + u**2 * gain @ gain.T
    return rotation + gain @ (np.asarray(tilt) - pick @ rotation), spread


def pose_with_tilt(group_pose: GroupPose, tilt: np.ndarray, u: float) -> GroupPose:
    """Alidade pose combined with an inclinometer's reading.

    In its own frame; see `joined_tilt`.

    The residuals of the points, their sum of squares and `gain` stay those of the ranges alone.
    """
    pose = group_pose.pose
    motion = pose.motion
    if pose.frame != "alidade":
        raise FrameError(f"pose in the frame '{pose.frame}', expected 'alidade', the inclinometer's frame")
    six = np.concatenate([motion.translation, motion.rotation])
    six, covariance = joined_tilt(six, motion.covariance, tilt, u=u)
    joined = replace(motion, translation=six[:3], matrix=from_vector(six[3:]), covariance=covariance)
    return replace(group_pose, pose=replace(pose, motion=joined))
