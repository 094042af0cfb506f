"""Two adjusted epochs of a network compared: what moved, under the stochastic model that their connection calls for."""

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
from catseye.estimation.least_squares.adjustment import CONVERGED
from catseye.estimation.network.model import NetworkSolution

LARGEST = 700  # common points of one joint test, whose work grows with their number cubed


@dataclass(frozen=True, eq=False)
class PointMovements:
    """What moved between two epochs; arrays over the n points of `deformation`, in x east, y north, z up.

    first, second           as adjusted
    deformation             displacements relative to the stable points, each the best estimate if these did not move,
                            with covariance, statistic, p, who moved, tests, detectable displacements, level and power
    difference              (n, 3) m, plain: second less first in the datum of the held, else of the stable points; nan
                            where the stable points do not hold it
    difference_covariance   (n, 3, 3) m^2
    carried                 points that the second epoch holds at the first's result
    rounding                (largest departure of the held coordinates from that result, its standard uncertainty), m
    frame                   the points that all others were compared with one by one; () where one joint test was made
    apart                   name -> m: moved, and the median of its distances to the others changed by so much: is it
                            the same point?
    alike                   names that are not common, in pairs that differ only by upper and lower case
    variance_factor         that the covariances are multiplied by
    homogeneity             p of equal variance factors in both epochs; nan without redundancy in either
    words                   what was assumed and found, a line each
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
        """Why the comparison is not beyond doubt, a line each; the epochs' own verdicts are not among them."""
        doubts = [] if self.deformation.conclusive else [self.deformation.status]
        if self.apart:
            text = ", ".join(f"{name} ({by:.3g} m)" for name, by in self.apart.items())
            doubts.append(f"moved so far that it may be another point under the same name: {text}")
        if self.alike:
            text = listed([f"{a} and {b}" for a, b in self.alike])
            doubts.append(f"not compared, since the names differ by upper and lower case: {text}")
        return doubts

    @property
    def u(self) -> np.ndarray:
        """(n, 3) m, standard uncertainties of deformation.displacement."""
        return np.sqrt(np.maximum(np.diagonal(self.deformation.covariance, axis1=1, axis2=2), 0.0))

    @property
    def u_difference(self) -> np.ndarray:
        """(n, 3) m, standard uncertainties of the plain difference."""
        return np.sqrt(np.maximum(np.diagonal(self.difference_covariance, axis1=1, axis2=2), 0.0))


@dataclass(frozen=True)
class ComparisonOptions:
    """How `compare` tests two epochs.

    level, power, rule         as `moved_points`; with a frame half the level is spent on it and half on the others
    rounding                   m, the last digit of coordinates carried from the first epoch; their departure from its
                               result is an error of u = rounding / sqrt(12) each. 0: carried with all digits
    same_point                 m: a point that moved and whose distances to others changed by more in the median is
                               doubted: another point under the same name? It stays in the answer
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
    """What moved between two adjusted epochs of a network, with the covariance that their connection calls for.

    first, second              adjusted by `adjust_network`, in the same axes
    points                     names to compare, taken as the same points however far they moved; None: all common ones.
                               Points that carry the datum always take part
    frame                      stable points that each other point is compared with by itself, for large networks; None:
                               those that define the datum, where there are more than 700 common points
    datum                      what the datums may differ by, a key of `DATUMS`; None: found from the observations
    options                    level and rule of the tests, rounding of carried coordinates

    A coordinate that is absent in either epoch is not compared. Raises EstimationError where there is no answer to
    compare, or where the epochs do not fit together.

    Source: [PELZER71], [CASPARY87] (congruence); [FOERSTNER16] chapter 4 (propagation; see `epoch_model`).
    """
    _check_alike(first, second)
    common, alike = paired_names(first, second)
    held = DatumConnection.of(first, second, datum, options.rounding)
    names = _names(common, points, held)
    model = EpochModel.of(first, second, names, held)
    factor, homogeneity = _factor(first, second)
    factor = factor if options.scale_by_variance_factor else KNOWN
    tested: dict[str, Any] = {
        "datum": held.datum,
        "level": options.level,
        "power": options.power,
        "rule": options.rule,
        "variance_factor": factor,
    }
    if frame is not None or len(names) > LARGEST:
        inside = frame_points(first, second, model, frame, datum=held.datum, limit=LARGEST)
        deformation, (difference, covariance) = beside_frame(model, inside, tested)
    else:
        inside = np.zeros(0, dtype=int)
        epochs = model.epochs(np.arange(len(names)))
        far = far_points(epochs, level=options.level, scaled=6 in DATUMS[held.datum])
        deformation = moved_points(epochs, **tested, far=far)
        plain = differences(epochs, held.datum, deformation.stable)
        difference, covariance = plain.blocks(*plain.plain(deformation.stable))
    done = PointMovements(
        first=first,
        second=second,
        deformation=deformation,
        difference=difference,
        difference_covariance=covariance * factor.value,
        carried=tuple(dict.fromkeys(name for name, _ in held.carried)),
        rounding=(held.departure, held.u),
        frame=tuple(names[i] for i in inside),
        apart=_apart(model, deformation.moved, options.same_point) if points is None else {},
        alike=tuple(alike) if points is None else (),
        variance_factor=factor,
        homogeneity=homogeneity,
        words=(),
    )
    return replace(done, words=tuple(_words(done, options, held.same)))


def _check_alike(first: NetworkSolution, second: NetworkSolution) -> None:
    a, b = first.network, second.network
    for which, solution in (("first", first), ("second", second)):
        if not solution.status.startswith(CONVERGED):
            raise EstimationError(f"the {which} epoch has no answer to compare: {solution.status}")
    if not np.array_equal(a.axes, b.axes) or a.axis_names != b.axis_names:
        raise EstimationError(
            f"the epochs have different axes: {', '.join(a.axis_names)} with {np.asarray(a.axes).tolist()} and "
            f"{', '.join(b.axis_names)} with {np.asarray(b.axes).tolist()}; write both in the same axes"
        )


def _factor(first: NetworkSolution, second: NetworkSolution) -> tuple[VarianceFactor, float]:
    """Variance factor of both epochs, or of the one that has redundancy, and the p of their being equal."""
    known = [(s.variance_factor, s.degrees_of_freedom) for s in (first, second)]
    known = [(f, v) for f, v in known if f > 0.0 and v > 0.0]
    if len(known) == 2:
        return pooled_variance_factor(known[0], known[1])
    return (VarianceFactor(*known[0]) if known else KNOWN), float("nan")


def _names(common: tuple[str, ...], points: Sequence[str] | None, held: DatumConnection) -> tuple[str, ...]:
    """Names to compare, those that carry the datum among them."""
    if points is None:
        return common
    for name in points:
        if name not in common:
            raise EstimationError(f"point {name!r} is not in both epochs; compare common points")
    return tuple(dict.fromkeys([*points, *held.same, *(name for name, _ in held.carried)]))


def _apart(model: EpochModel, moved: np.ndarray, same_point: float) -> dict[str, float]:
    """Points that moved by more than a point is expected to, and how much their distances to others changed, m."""
    if not moved.any():
        return {}
    change = distance_changes(model.x, model.y, model.compared.reshape(-1, 3))
    return {model.names[i]: float(change[i]) for i in np.flatnonzero(moved & (change > same_point))}


def _words(done: PointMovements, options: ComparisonOptions, same: Sequence[str]) -> list[str]:
    """What was assumed and found, a line each."""
    words = [f"datums may differ as {done.deformation.datum!r}"]
    if done.carried:
        words[0] = (
            f"the second epoch holds {listed(done.carried)} at the first's result: its errors are carried over, and "
            "a movement of these points would look like one of all others"
        )
    elif same:
        words[0] = f"{listed(same)} are held in both epochs: a movement of theirs would look like one of all others"
    if done.rounding[1]:
        words.append(
            f"held coordinates are up to {1e6 * done.rounding[0]:.2g} um off the first's result: taken as rounding to "
            f"{1e6 * options.rounding:g} um, u = {1e6 * done.rounding[1]:.2g} um each"
        )
    if done.apart:
        text = ", ".join(f"{name} ({by:.3g} m)" for name, by in done.apart.items())
        words.append(
            f"not the same point? {text}: distances to other points changed by more than {options.same_point:g} m"
        )
    for which, a, b in (("first", done.first, done.second), ("second", done.second, done.first)):
        alone = [name for name in a.index if name not in b.index]
        if alone:
            words.append(f"in the {which} epoch only: {listed(alone)}")
    if done.frame:
        words.append(f"each point by itself against the stable ones of {listed(done.frame)}, not in one joint test")
    words.append(f"{_scatter(done)}; {_basis(done)}")
    return [
        *words,
        *(
            f"the {w} epoch: {s.status}"
            for w, s in (("first", done.first), ("second", done.second))
            if s.status != CONVERGED
        ),
        done.deformation.status,
    ]


def _scatter(done: PointMovements) -> str:
    """The variance factors, or which epoch has none."""
    a, b = done.first.variance_factor, done.second.variance_factor
    if np.isfinite(done.homogeneity):
        return f"variance factors {a:.3g} and {b:.3g}, equal with p = {done.homogeneity:.2g}"
    bare = [which for which, value in (("first", a), ("second", b)) if not np.isfinite(value)]
    if len(bare) == 2:
        return "nothing is redundant in either epoch: no variance factor shows if their uncertainties are right"
    if bare:
        value, other = (b, "second") if bare == ["first"] else (a, "first")
        return f"variance factor {value:.3g} of the {other} epoch, nothing is redundant in the {bare[0]}"
    return f"variance factors {a:.3g} and {b:.3g}, too small to be compared"


def _basis(done: PointMovements) -> str:
    estimated = np.isfinite(done.variance_factor.degrees_of_freedom)
    both = np.isfinite(done.homogeneity)
    return ("pooled" if both else "applied to both") if estimated else "covariances a priori"
