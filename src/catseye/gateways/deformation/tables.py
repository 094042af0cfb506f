"""Tables of movements from changes of ranges."""

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.gateways.writers.columns import Column, Table
from catseye.reduction.deformation.movements import MeasuredMovements

PAGE = "movements.md"


def _place(k: int) -> Column[MeasuredMovements]:
    axis = "xyz"[k]
    return Column(f"{axis}_m", "m", f"approximate {axis}", lambda f: f.changes.x[:, k], ".4f")


def _moved(k: int) -> Column[MeasuredMovements]:
    axis = "xyz"[k]
    return Column(
        f"d{axis}_mm",
        "mm",
        f"movement along {axis}, after less before",
        lambda f: f.displacement[:, k] / MILLIMETRE,
        ".6f",
    )


def _u(k: int) -> Column[MeasuredMovements]:
    axis = "xyz"[k]
    return Column(f"u_d{axis}_mm", "mm", f"its standard uncertainty, {axis}", lambda f: f.u[:, k] / MILLIMETRE, ".6f")


def _covariance(i: int, j: int) -> Column[MeasuredMovements]:
    pair = "xyz"[i] + "xyz"[j]
    doc = (
        f"variance of the movement along {pair[0]}" if i == j else f"covariance of those along {pair[0]} and {pair[1]}"
    )
    return Column(f"cov_{pair}_mm2", "mm2", doc, lambda f: f.covariances[:, i, j] / MILLIMETRE**2, ".9e")


MOVEMENTS = Table[MeasuredMovements](
    "movements.csv",
    PAGE,
    (
        Column("point", "", "name", lambda f: f.changes.points),
        *(_place(k) for k in range(3)),
        *(_moved(k) for k in range(3)),
        *(_u(k) for k in range(3)),
        *(_covariance(i, j) for i in range(3) for j in range(i, 3)),
        Column("ranges", "", "number of its lines", lambda f: np.isfinite(f.changes.change).sum(axis=1)),
        Column("constraint", "", "kind and name of its constraint; empty: free", lambda f: f.constraint_names),
        Column("p", "", "probability of such a movement of a point at rest", lambda f: f.p, ".6g"),
        Column("verdict", "", "`moved`, `at rest`, `held` or `undetermined`", lambda f: f.words),
    ),
)


def _pairs(measured: MeasuredMovements) -> tuple[np.ndarray, np.ndarray]:
    point, station = np.nonzero(np.isfinite(measured.changes.change))
    return point, station


CHANGES = Table[MeasuredMovements](
    "changes.csv",
    PAGE,
    (
        Column("station", "", "name", lambda f: np.array(f.changes.stations)[_pairs(f)[1]]),
        Column("point", "", "name", lambda f: np.array(f.changes.points)[_pairs(f)[0]]),
        Column(
            "change_mm", "mm", "range, after less before", lambda f: f.changes.change[_pairs(f)] / MILLIMETRE, ".6f"
        ),
        Column("u_mm", "mm", "its standard uncertainty", lambda f: f.changes.u_change[_pairs(f)] / MILLIMETRE, ".6f"),
        Column("residual_mm", "mm", "measured less computed", lambda f: f.residual[_pairs(f)] / MILLIMETRE, ".6f"),
        Column(
            "standardised",
            "",
            "residual over its own standard deviation, w",
            lambda f: f.standardised[_pairs(f)],
            ".4f",
        ),
    ),
)

CONSTRAINTS = Table[MeasuredMovements](
    "constraints.csv",
    PAGE,
    (
        Column("constraint", "", "name", lambda f: [t.name for t in f.tests]),
        Column("kind", "", "`body`, `plane`, `line` or `still`", lambda f: [t.kind for t in f.tests]),
        Column("points", "", "names of its points", lambda f: [" ".join(t.points) for t in f.tests]),
        Column(
            "statistic",
            "",
            "chi-square; empty where nothing checks it",
            lambda f: [t.statistic for t in f.tests],
            ".6g",
        ),
        Column(
            "degrees_of_freedom",
            "",
            "movements that it excludes and the ranges determine",
            lambda f: [t.degrees_of_freedom for t in f.tests],
        ),
        Column("p", "", "probability of such a statistic where it holds", lambda f: [t.p for t in f.tests], ".6g"),
        Column(
            "verdict",
            "",
            "`holds`, `rejected` or `not checked`",
            lambda f: [constraint_word(t.rejected, t.degrees_of_freedom) for t in f.tests],
        ),
    ),
)


def constraint_word(rejected: bool, freedom: int) -> str:
    """Verdict on a constraint.

    >>> constraint_word(False, 2), constraint_word(False, 0)
    ('holds', 'not checked')
    """
    return "rejected" if rejected else "holds" if freedom else "not checked"
