"""Comparison of two adjusted epochs of a network, with the joint stochastic model of both."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from catseye.errors import EstimationError
from catseye.estimation.deformation.beside_frame import beside_frame, frame_points
from catseye.estimation.deformation.common_points import distance_changes, far_points, listed, paired_names
from catseye.estimation.deformation.congruence import (
    DATUMS,
    KNOWN,
    VarianceFactor,
    differences,
    pooled_variance_factor,
)
from catseye.estimation.deformation.deformation import Deformation, moved_points
from catseye.estimation.deformation.epoch_model import DatumConnection, EpochModel
from catseye.estimation.least_squares.status import CONVERGED
from catseye.estimation.network.model import NetworkSolution

DATUM_WORDS = {  # allowed differences of the datums, keys of `DATUMS`
    "absolute": "both epochs are in one datum: coordinates are compared as they stand",
    "translation": "the datums may differ by a shift",
    "levelled": "the datums may differ by a shift and a rotation about the vertical",
    "levelled similarity": "the datums may differ by a shift, a rotation about the vertical and a scale",
    "rigid": "the datums may differ by a shift and a rotation",
    "similarity": "the datums may differ by a shift, a rotation and a scale",
}
LARGEST = 700  # common points of one joint test, whose work grows with their number cubed


@dataclass(frozen=True, eq=False)
class PointMovements:
    """Movements between two epochs.

    Arrays over the n points of `deformation`, x east, y north, z up.

    first, second           as adjusted
    deformation             displacements relative to the stable points, each the best estimate if these did not move,
                            with covariance, statistic, p, moved points, tests, detectable displacements, level, power
    difference              (n, 3) m, plain: second less first in the datum of the fixed, else of the stable points; nan
                            if the stable points do not determine it
    difference_covariance   (n, 3, 3) m^2
    carried                 points that the second epoch fixes at the first's result
    rounding                (largest departure of the fixed coordinates from that result, its standard uncertainty), m
    frame                   the points that all others were compared with one by one; () for one joint test
    apart                   name -> m: moved points, with the median change of their distances to the others: possibly
                            another point of the same name
    alike                   pairs of names that are not common and differ only by case
    variance_factor         factor on the covariances
    homogeneity             p of equal variance factors in both epochs; nan without redundancy in either
    words                   assumptions and results, one line each
    """

    first: NetworkSolution
    second: NetworkSolution
    deformation: Deformation
    difference: np.ndarray
    difference_covariance: np.ndarray
    carried: tuple[str, ...]
    rounding: tuple[float, float]
    frame: tuple[str, ...]
    apart: dict[str, float]
    alike: tuple[tuple[str, str], ...]
    variance_factor: VarianceFactor
    homogeneity: float
    words: tuple[str, ...]

    @property
    def doubts(self) -> list[str]:
        """Reasons to doubt the comparison, one line each.

        The epochs' own verdicts are not included.
        """
        doubts = [] if self.deformation.conclusive else [self.deformation.status]
        if self.apart:
            text = ", ".join(f"{name} ({by:.3g} m)" for name, by in self.apart.items())
            doubts.append(f"moved so far that it may be another point of the same name: {text}")
        if self.alike:
            text = listed([f"{a} and {b}" for a, b in self.alike])
            doubts.append(f"not compared, as the names differ by upper and lower case: {text}")
        return doubts

    @property
    def u(self) -> np.ndarray:
        """Standard uncertainties (n, 3) m of deformation.displacement."""
        return np.sqrt(np.maximum(np.diagonal(self.deformation.covariance, axis1=1, axis2=2), 0.0))

    @property
    def u_difference(self) -> np.ndarray:
        """Standard uncertainties (n, 3) m of the plain difference."""
        return np.sqrt(np.maximum(np.diagonal(self.difference_covariance, axis1=1, axis2=2), 0.0))


@dataclass(frozen=True)
class ComparisonOptions:
    """Settings of `compare`.

    level, power, rule         as `moved_points`; with a frame half the level is used for it and half for the others
    rounding                   m, the last digit of coordinates carried from the first epoch; their departure from its
                               result is an error of u = rounding / sqrt(12) each. 0: carried with all digits
    same_point                 m: a moved point whose distances to others changed by more in the median may be another
                               point of the same name; it is noted, and stays in the result
    scale_by_variance_factor   False: a priori covariances. True: times the pooled variance factor, F tests
    """

    level: float = 0.05
    power: float = 0.8
    rule: str = "global"
    rounding: float = 1e-5
    same_point: float = 0.1
    scale_by_variance_factor: bool = False


USUAL = ComparisonOptions()


def compare(
    first: NetworkSolution,
    second: NetworkSolution,
    *,
    points: Sequence[str] | None = None,
    frame: Sequence[str] | None = None,
    datum: str | None = None,
    options: ComparisonOptions = USUAL,
) -> PointMovements:
    """Movements between two adjusted epochs of a network, with their joint covariance.

    first, second              adjusted by `adjust_network`, in the same axes
    points                     names to compare, taken as the same points however far they moved; None: all common ones.
                               Points that define the datum are always included
    frame                      stable points that single points are compared with, for large networks; None: those that
                               define the datum, if there are more than 700 common points
    datum                      allowed differences of the datums, a key of `DATUMS`; None: found from the observations
    options                    level and rule of the tests, rounding of carried coordinates

    A coordinate that is absent in either epoch is not compared. Raises EstimationError for an epoch without a solution,
    or for incompatible epochs.

    Source: [PELZER71], [CASPARY87] (congruence); [FOERSTNER16] chapter 4 (propagation; see `epoch_model`).
    """
    _check_alike(first, second)
    common, alike = paired_names(first, second)
    connection = DatumConnection.of(first, second, datum, options.rounding)
    names = _names(common, points, connection)
    model = EpochModel.of(first, second, names, connection)
    factor, homogeneity = _factor(first, second)
    factor = factor if options.scale_by_variance_factor else KNOWN
    tested: dict[str, Any] = {
        "datum": connection.datum,
        "level": options.level,
        "power": options.power,
        "rule": options.rule,
        "variance_factor": factor,
    }
    if frame is not None or len(names) > LARGEST:
        inside = frame_points(first, second, model, frame, datum=connection.datum, limit=LARGEST)
        deformation, (difference, covariance) = beside_frame(model, inside, tested)
    else:
        inside = np.zeros(0, dtype=int)
        epochs = model.epochs(np.arange(len(names)))
        far = far_points(epochs, level=options.level, scaled=6 in DATUMS[connection.datum])
        deformation = moved_points(epochs, **tested, far=far)
        plain = differences(epochs, connection.datum, deformation.stable)
        difference, covariance = plain.blocks(*plain.plain(deformation.stable))
    movements = PointMovements(
        first=first,
        second=second,
        deformation=deformation,
        difference=difference,
        difference_covariance=covariance * factor.value,
        carried=tuple(dict.fromkeys(name for name, _ in connection.carried_coordinates)),
        rounding=(connection.departure, connection.u),
        frame=tuple(names[i] for i in inside),
        apart=_apart(model, deformation.moved, options.same_point) if points is None else {},
        alike=tuple(alike) if points is None else (),
        variance_factor=factor,
        homogeneity=homogeneity,
        words=(),
    )
    return replace(movements, words=tuple(_words(movements, options, connection.common_fixed)))


def _check_alike(first: NetworkSolution, second: NetworkSolution) -> None:
    a, b = first.network, second.network
    for which, solution in (("first", first), ("second", second)):
        if not solution.status.usable:
            raise EstimationError(f"the {which} epoch has no solution to compare: {solution.status}")
    if not np.array_equal(a.axes, b.axes) or a.axis_names != b.axis_names:
        raise EstimationError(
            f"the epochs have different axes: {', '.join(a.axis_names)} with {np.asarray(a.axes).tolist()} and "
            f"{', '.join(b.axis_names)} with {np.asarray(b.axes).tolist()}; write both in the same axes"
        )


def _factor(first: NetworkSolution, second: NetworkSolution) -> tuple[VarianceFactor, float]:
    """Variance factor of both epochs, or of the one with redundancy, and p of their equality."""
    redundant = [(s.variance_factor, s.degrees_of_freedom) for s in (first, second)]
    redundant = [(f, v) for f, v in redundant if f > 0.0 and v > 0.0]
    if len(redundant) == 2:
        return pooled_variance_factor(redundant[0], redundant[1])
    return (VarianceFactor(*redundant[0]) if redundant else KNOWN), float("nan")


def _names(common: tuple[str, ...], points: Sequence[str] | None, connection: DatumConnection) -> tuple[str, ...]:
    """Names to compare, including those that define the datum."""
    if points is None:
        return common
    for name in points:
        if name not in common:
            raise EstimationError(f"point {name!r} is not in both epochs; compare common points")
    return tuple(
        dict.fromkeys([*points, *connection.common_fixed, *(name for name, _ in connection.carried_coordinates)])
    )


def _apart(model: EpochModel, moved: np.ndarray, same_point: float) -> dict[str, float]:
    """Points that moved implausibly far, with the median change of their distances to others, m."""
    if not moved.any():
        return {}
    change = distance_changes(model.x, model.y, model.compared.reshape(-1, 3))
    return {model.names[i]: float(change[i]) for i in np.flatnonzero(moved & (change > same_point))}


def _words(movements: PointMovements, options: ComparisonOptions, common_fixed: Sequence[str]) -> list[str]:
    """Assumptions and results, one line each."""
    words = [DATUM_WORDS[movements.deformation.datum]]
    if movements.carried:
        words[0] = (
            f"the second epoch fixes {listed(movements.carried)} at the first's result: its errors are propagated, and "
            "a movement of these points would appear as a movement of all others"
        )
    elif common_fixed:
        words[0] = f"{listed(common_fixed)} are fixed in both epochs: their movement would appear as one of all others"
    if movements.rounding[1]:
        words.append(
            f"fixed coordinates are up to {1e6 * movements.rounding[0]:.2g} um off the first's result: "
            f"treated as rounding to {1e6 * options.rounding:g} um, u = {1e6 * movements.rounding[1]:.2g} um each"
        )
    if movements.apart:
        text = ", ".join(f"{name} ({by:.3g} m)" for name, by in movements.apart.items())
        words.append(
            f"possibly another point: {text}: distances to other points changed by more than {options.same_point:g} m"
        )
    for which, a, b in (("first", movements.first, movements.second), ("second", movements.second, movements.first)):
        alone = [name for name in a.index if name not in b.index]
        if alone:
            words.append(f"in the {which} epoch only: {listed(alone)}")
    if movements.frame:
        words.append(f"single points compared with the stable ones of {listed(movements.frame)}, no joint test")
    words.append(f"{_scatter(movements)}; {_basis(movements)}")
    return [
        *words,
        *(
            f"the {w} epoch: {s.status}"
            for w, s in (("first", movements.first), ("second", movements.second))
            if s.status != CONVERGED
        ),
        movements.deformation.status,
    ]


def _scatter(movements: PointMovements) -> str:
    """Variance factors of both epochs, or the epoch without one."""
    a, b = movements.first.variance_factor, movements.second.variance_factor
    if np.isfinite(movements.homogeneity):
        return f"variance factors {a:.3g} and {b:.3g}, equal with p = {movements.homogeneity:.2g}"
    bare = [which for which, value in (("first", a), ("second", b)) if not np.isfinite(value)]
    if len(bare) == 2:
        return "neither epoch has redundancy: no variance factor can check their uncertainties"
    if bare:
        value, which_epoch = (b, "second") if bare == ["first"] else (a, "first")
        return f"variance factor {value:.3g} of the {which_epoch} epoch, no redundancy in the {bare[0]}"
    return f"variance factors {a:.3g} and {b:.3g}, too small to compare"


def _basis(movements: PointMovements) -> str:
    estimated = np.isfinite(movements.variance_factor.degrees_of_freedom)
    pooled = np.isfinite(movements.homogeneity)
    return ("pooled" if pooled else "applied to both") if estimated else "a-priori covariances"
