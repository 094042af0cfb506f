"""`locate`: positions of many targets from ranges to known stations."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from catseye.api.result import Result, quantities
from catseye.api.units import In, with_units
from catseye.constants import MILLIMETRE

if TYPE_CHECKING:
    from astropy.table import QTable

    from catseye.gateways.writers.passage import Passage
    from catseye.reduction.network.positions import LocatedTargets


@dataclass(frozen=True, eq=False, repr=False)
class PositionsResult(Result):
    """Positions of m targets, each from its own ranges to known stations.

    located   the recipe's answer
    """

    located: "LocatedTargets"

    @property
    def x(self) -> np.ndarray:
        """Coordinates (m, 3) m; nan where there are none."""
        return self.located.positions.x

    @property
    def covariance(self) -> np.ndarray:
        """Covariances (m, 3, 3) m² for stations without uncertainty."""
        return self.located.positions.covariance

    @property
    def status(self) -> np.ndarray:
        """Texts (m,): "found", or the problem and its remedy."""
        return self.located.words

    @property
    def found(self) -> np.ndarray:
        """Mask (m,) of targets with a position."""
        return self.located.found

    @property
    def pvv(self) -> np.ndarray:
        """Sums (m,) of squared residuals in sigmas.

        nan where no solution was tried.
        """
        return self.located.positions.pvv

    @property
    def ranges(self) -> np.ndarray:
        """Number (m,) of ranges of each target."""
        return self.located.positions.ranges

    def passages(self) -> "Sequence[Passage]":
        """Number and quality of the positions, and the status of the first that failed."""
        from catseye.gateways.writers.passage import Passage
        from catseye.reduction.network.words import quantity

        count, total = int(self.found.sum()), len(self.found)
        text = f"{count} of {total} targets found"
        if count:
            u = np.sqrt(np.einsum("nii->n", self.covariance[self.found]) / 3.0)
            usual, worst = quantity(float(np.median(u)), "m"), quantity(float(u.max()), "m")
            text += f"; a coordinate is usually known to {usual}, of the worst to {worst} (1σ, stations taken as exact)"
        first = np.flatnonzero(~self.found)
        rest = [Passage("The others", f"first target {first[0]}: {self.status[first[0]]}.")] if len(first) else []
        return [Passage("Positions", text + "."), *rest]

    def to_object(self) -> dict[str, Any]:
        """Arrays in the order of the targets."""
        names = ("x", "covariance", "status", "found", "pvv", "ranges")
        return {"verdict": self.verdict.to_object(), **{name: getattr(self, name) for name in names}}

    def tables(self) -> "dict[str, QTable]":
        """`positions`: a row a target."""
        u = np.sqrt(np.einsum("nii->ni", self.covariance))
        columns = {
            **{axis: (self.x[:, k], "m") for k, axis in enumerate("xyz")},
            **{f"u_{axis}": (u[:, k] / MILLIMETRE, "mm") for k, axis in enumerate("xyz")},
            "covariance": (self.covariance / MILLIMETRE**2, "mm2"),
            "ranges": (self.ranges, ""),
            "status": (self.status, ""),
        }
        return {"positions": quantities(columns)}


@with_units
def locate(
    stations: Annotated[Any, In("m")],
    ranges: Annotated[Any, In("m")],
    sigma: Annotated[Any, In("m")],
    *,
    near: Annotated[Any, In("m")] = None,
) -> PositionsResult:
    """Positions of many targets, each by least squares from its ranges to known stations.

    stations   (n, 3) m, known: for stations with an uncertainty, and for what they have in common, `adjust` a network
    ranges     (m, n) m, nan where missing; (n,) is one target
    sigma      m, standard uncertainties of the ranges, independent: a number, (n,) or (m, n)
    near       (3,) or (m, 3) m: a point on the target's side of the stations' plane, where two mirror images fit alike

    Raises InputError for shapes that do not join and for stations that are not finite.
    Source: `catseye.estimation.network.positions.dispatch`.

    >>> stations = [[0.0, 0, 0], [50, 0, 1], [0, 50, 2], [50, 50, 9]]
    >>> there = locate(stations, np.linalg.norm(np.array([20.0, 10, 30]) - stations, axis=1), 1e-4)
    >>> np.round(there.x, 6).tolist(), there.verdict.word
    ([[20.0, 10.0, 30.0]], 'good')
    """
    from catseye.reduction.network.positions import located

    found = located(
        np.asarray(stations, dtype=float),
        np.atleast_2d(np.asarray(ranges, dtype=float)),
        np.asarray(sigma, dtype=float),
        near=near,
    )
    return PositionsResult(verdict=found.verdict, located=found)
