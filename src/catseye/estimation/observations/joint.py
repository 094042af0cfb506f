"""Several groups as one group with a common covariance, for shared errors."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, cast

import numpy as np

from catseye.estimation.observations.kind import ObservationKind, Reported


@dataclass(frozen=True, eq=False)
class Joint(ObservationKind):
    """Rows of all parts in order.

    The parts' own covariances are ignored.

    name         of the group, for reports
    observed     (m,) of all parts in order
    covariance   of the observed values, (m, m) or another form of `ObservationGroup`
    parts        groups of any kind, m rows together
    """

    kind: ClassVar[str] = "joint"

    name: str
    observed: np.ndarray
    covariance: np.ndarray
    parts: tuple[Reported, ...]

    @classmethod
    def of(cls, name: str, parts: tuple[Reported, ...], covariance: np.ndarray) -> "Joint":
        """Join parts with their own observed values and a new covariance."""
        return cls(name, np.concatenate([p.observed for p in parts]), covariance, parts)

    @cached_property
    def _parts(self) -> tuple[Reported, ...]:
        """Parts with the group's observed values, which select the turn of angles."""
        cuts = np.cumsum([len(p.observed) for p in self.parts])[:-1]
        shares = np.split(self.observed, cuts)
        return tuple(replace(cast(Any, p), observed=o) for p, o in zip(self.parts, shares, strict=True))

    @cached_property
    def columns(self) -> np.ndarray:
        """Columns (m, w) with w of the widest part, padded with -1."""
        return _stacked([_rows(p.columns, len(p.observed)) for p in self.parts], -1)

    @property
    def units(self) -> np.ndarray:
        return np.concatenate([p.units for p in self.parts])

    @property
    def kinds(self) -> np.ndarray:
        return np.concatenate([p.kinds for p in self.parts])

    @property
    def component(self) -> np.ndarray:
        return np.concatenate([p.component for p in self.parts])

    @property
    def ends(self) -> tuple[np.ndarray, ...]:
        roles = [
            np.stack(p.ends, axis=1) if p.ends else np.full((len(p.observed), 0), -1, dtype=int) for p in self.parts
        ]
        return tuple(_stacked(roles, -1).T)

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (m,) and Jacobian (m, w) at the parameters x."""
        predictions = [p.predict(x) for p in self._parts]
        return np.concatenate([a[0] for a in predictions]), _stacked([a[1] for a in predictions], 0)


def _rows(columns: np.ndarray, m: int) -> np.ndarray:
    """Columns (m, w) from either form."""
    return columns if columns.ndim == 2 else np.broadcast_to(columns, (m, len(columns)))


def _stacked(parts: list[np.ndarray], filling: int) -> np.ndarray:
    """Stack matrices, padding the narrow ones on the right."""
    width = max(p.shape[1] for p in parts)
    wide = [np.pad(p, ((0, 0), (0, width - p.shape[1])), constant_values=filling) for p in parts]
    return np.concatenate(wide)
