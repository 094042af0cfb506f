"""Protocol of a group of observations for the solver, and the base class of all kinds."""

from typing import ClassVar, Protocol

import numpy as np

from catseye.errors import EstimationError


class ObservationGroup(Protocol):
    """Group of m observations, possibly correlated, but not with other groups.

    name         of the group, for reports
    observed     (m,) values
    covariance   of the observed values: (m,) variances of independent ones; (m, m); or (b, r, r), b blocks of r rows
                 that follow each other, b r = m
    columns      indices of the parameters that the group depends on: (k,) shared by all rows, without repeats; or
                 (m, w) per row, where repeats add up and -1 stands for none
    """

    @property
    def name(self) -> str: ...
    @property
    def observed(self) -> np.ndarray: ...
    @property
    def covariance(self) -> np.ndarray: ...
    @property
    def columns(self) -> np.ndarray: ...

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian, (m, k) or (m, w) as `columns`, at the parameters x."""
        ...


class Reported(ObservationGroup, Protocol):
    """Group whose rows can be named in a report; see `ObservationKind`."""

    kind: ClassVar[str]
    unit: ClassVar[str]

    @property
    def units(self) -> np.ndarray: ...
    @property
    def kinds(self) -> np.ndarray: ...
    @property
    def component(self) -> np.ndarray: ...
    @property
    def ends(self) -> tuple[np.ndarray, ...]: ...


class ObservationKind:
    """Base of the kinds: checks shapes, names rows for reports.

    kind   what one observation is
    unit   "m" or "rad"; "" where rows differ, see `units`
    """

    kind: ClassVar[str] = ""
    unit: ClassVar[str] = ""

    def __post_init__(self: ObservationGroup) -> None:
        m, covariance, columns = len(self.observed), self.covariance, self.columns
        blocks = covariance.ndim == 3 and covariance.shape[1:] == (covariance.shape[-1],) * 2
        if covariance.shape not in ((m,), (m, m)) and not (blocks and covariance.shape[0] * covariance.shape[1] == m):
            raise EstimationError(
                f"{self.name}: the covariance has shape {covariance.shape}, but there are {m} observations; "
                f"expected ({m},), ({m}, {m}) or square blocks that fill {m} rows"
            )
        if columns.ndim == 2 and len(columns) != m:
            raise EstimationError(
                f"{self.name}: {len(columns)} rows of columns for {m} observations; expected one per row"
            )

    @property
    def units(self: Reported) -> np.ndarray:
        """Units (m,) of the observed values."""
        return np.full(len(self.observed), self.unit)

    @property
    def kinds(self: Reported) -> np.ndarray:
        """Observation kinds (m,) of the rows."""
        return np.full(len(self.observed), self.kind)

    @property
    def component(self: ObservationGroup) -> np.ndarray:
        """Components (m,) "x", "y" or "z" ("1" or "2" across a line) of vector rows, else ""."""
        return np.full(len(self.observed), "")

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        """Columns (m,) of the points by role: from, to, third.

        -1 for none.
        """
        return ()


def joined_columns(name: str, m: int, *parts: np.ndarray) -> np.ndarray:
    """Columns (m, w) joined from parts (m, w_i) or (1, w_i).

    Raises EstimationError for other shapes.

    >>> joined_columns("a", 2, np.array([[0, 1]]), np.array([[5], [6]])).tolist()
    [[0, 1, 5], [0, 1, 6]]
    """
    for part in parts:
        if part.ndim != 2 or len(part) not in (1, m):
            raise EstimationError(f"{name}: indices of shape {part.shape} for {m} rows; expected {m} rows or 1")
    return np.concatenate([np.broadcast_to(part, (m, part.shape[1])) for part in parts], axis=1)


def optional(columns: np.ndarray | None, m: int, width: int = 1) -> np.ndarray:
    """Columns (m, width), -1 where there are none.

    columns   (m,) or (m, width), or None
    """
    if columns is None:
        return np.full((m, width), -1)
    return columns.reshape(-1, width)


def value(x: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Parameters at columns of any shape.

    0 where a column is -1.
    """
    return np.where(columns < 0, 0.0, x[columns])
