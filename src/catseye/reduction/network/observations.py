"""Observations of an adjusted network as columns, in the axes and the order of its own file."""

import re
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter

import numpy as np

from catseye.errors import ArgumentError
from catseye.estimation.least_squares.adjustment import NONCENTRALITY
from catseye.estimation.network.external import effects_at_ends
from catseye.estimation.network.model import NetworkSolution, ObservationNetwork, points_of
from catseye.estimation.quality.reliability import bias_to_noise, checked, noncentrality

ROLES = ("from", "to", "third", "fourth")
MEASURES = (
    "observed",
    "u",
    "residual",
    "standardised",
    "redundancy",
    "mdb",
    "estimated_error",
    "bias_to_noise",
    "effect",
    "velocity",
)
NUMBER = re.compile(r"\d+")
MDB_LEVEL, MDB_POWER = 0.001, 0.8  # of NONCENTRALITY
COMPONENTS = ("x", "y", "z")


@dataclass(frozen=True)
class Detectability:
    """Test that the minimal detectable bias of an observation refers to.

    level   of the two-sided test of one observation
    power   probability with which it finds an error of that size

    Raises ArgumentError for values that are no probabilities, and for a power not above the level.
    """

    level: float = MDB_LEVEL
    power: float = MDB_POWER

    def __post_init__(self) -> None:
        if not 0.0 < self.level < self.power < 1.0:
            raise ArgumentError(
                f"mdb_level = {self.level:g} with power = {self.power:g} (expected probabilities, the power above the "
                "level)",
                "mdb_level",
                "power",
            )

    @cached_property
    def noncentrality(self) -> float:
        """Size of a detectable error, in standard uncertainties of the estimated error."""
        usual = noncentrality(MDB_LEVEL, MDB_POWER)
        return float(NONCENTRALITY * noncentrality(self.level, self.power) / usual)

    @property
    def words(self) -> str:
        """Level and power in words."""
        return f"{100.0 * self.level:g} %, power {100.0 * self.power:g} %"


USUAL = Detectability()


@dataclass(frozen=True, eq=False)
class ObservationTable:
    """All m observations of a network in file order, as columns; lengths in m, angles in rad.

    kinds             names of kinds, indexed by `kind`
    kind              (m,) int
    unit              (m,) "m", "rad" or "1"
    component         (m,) axis of the file, for one coordinate of a point or vector; else ""
    sign              (m,) -1 where the file's axis is opposite to this package's
    ends              (m, 4) rows of the points by role, from, to, third, fourth; -1 for none
    group, row        (m,) int: position in the network's groups
    active            (m,) bool: used in the adjustment
    checked           (m,) bool: an error in it would show by other observations
    bias_to_noise     (m,) largest effect of an error just not detectable on any result, in its standard uncertainties;
                      nan where unknown, as within correlated groups
    effect            (m,) m, largest movement of a named point by an error of the size of mdb, or nan
    velocity          (m,) m, first velocity correction of a distance whose index of air is known; else nan
    observed, residual, u, redundancy, standardised, mdb, estimated_error   (m,) as in `GroupFit`; mdb is its
                      detectable_error; the last three are nan for unchecked observations, and all four without
                      an answer
    """

    kinds: tuple[str, ...]
    kind: np.ndarray
    unit: np.ndarray
    component: np.ndarray
    sign: np.ndarray
    ends: np.ndarray
    group: np.ndarray
    row: np.ndarray
    active: np.ndarray
    checked: np.ndarray
    observed: np.ndarray
    residual: np.ndarray
    u: np.ndarray
    redundancy: np.ndarray
    standardised: np.ndarray
    mdb: np.ndarray
    estimated_error: np.ndarray
    bias_to_noise: np.ndarray
    effect: np.ndarray
    velocity: np.ndarray

    def __len__(self) -> int:
        return len(self.kind)

    @cached_property
    def worst_first(self) -> np.ndarray:
        """Rows by falling |standardised|, (m,), untested ones last; by |residual| / u if none has a test."""
        size = np.abs(self.standardised)
        if not np.isfinite(size).any():
            size = np.abs(self.residual) / self.u
        return np.argsort(-np.nan_to_num(size, nan=-1.0), kind="stable")


def observation_table(solution: NetworkSolution, detectability: Detectability = USUAL) -> ObservationTable:
    """Observations of a solution, in file order where known, else group by group.

    solution        an adjusted network
    detectability   level and power of `mdb`, `bias_to_noise` and `effect`

    The sign of components along an axis opposite in the file is reversed, with all derived values.
    """
    network = solution.network
    kinds: dict[str, int] = {}
    effects = effects_at_ends(solution)
    parts = [_part(solution, g, kinds, effects[g], detectability.noncentrality) for g in range(len(network.groups))]
    order = _file_order(network)
    joined = {
        name: np.concatenate([part[name] for part in parts])[order] if parts else np.zeros(0) for name in _COLUMNS
    }
    if not parts:
        joined |= {"ends": np.zeros((0, len(ROLES)), dtype=int), "component": np.zeros(0, dtype="U1")}
    return ObservationTable(kinds=tuple(kinds), **joined)


_COLUMNS = tuple(ObservationTable.__dataclass_fields__)[1:]


def _part(
    solution: NetworkSolution, g: int, kinds: dict[str, int], effect: np.ndarray, delta: float
) -> dict[str, np.ndarray]:
    """Columns of one group, given the effects of undetected errors and the noncentrality; adds to `kinds`."""
    group, fit = solution.network.groups[g], solution.fits[g]
    m = len(fit.residual)
    group_kind = getattr(group, "kind", "") if "kinds" not in type(group).__dict__ else ""  # else a kind per row
    names, at = (
        (np.array([group_kind]), np.zeros(m, dtype=int))
        if group_kind
        else np.unique(_row_texts(group, "kinds"), return_inverse=True)
    )
    code = np.array([kinds.setdefault(str(name), len(kinds)) for name in names], dtype=int)
    ends = np.full((m, len(ROLES)), -1)
    for role, end in enumerate(points_of(group)[: len(ROLES)]):
        ends[:, role] = end
    component, sign = _components(solution.network, getattr(group, "component", np.full(m, "")))
    computed = fit.detectable_error > 0.0  # zero without statistics
    tested_rows = fit.active & computed & checked(fit)
    independent = group.covariance.ndim == 1
    tested = np.where(tested_rows | (computed & ~fit.active), sign, np.nan)
    return {
        "kind": code[at],
        "unit": np.asarray(getattr(group, "units", np.full(m, getattr(group, "unit", "") or "1"))),
        "component": component,
        "sign": sign,
        "ends": ends,
        "group": np.full(m, g),
        "row": np.arange(m),
        "active": fit.active,
        "checked": tested_rows,
        "observed": sign * group.observed,
        "residual": sign * fit.residual,
        "u": fit.sigma,
        "redundancy": np.where(computed, fit.redundancy, np.nan),
        "standardised": tested * fit.standardised,
        "mdb": np.abs(tested) * fit.detectable_error * (delta / NONCENTRALITY),
        "estimated_error": tested * fit.estimated_error,
        "bias_to_noise": np.where(tested_rows & independent, bias_to_noise(fit.redundancy, delta), np.nan),
        "effect": np.where(tested_rows, effect * (delta / NONCENTRALITY), np.nan),
        "velocity": _velocity(group, m),
    }


def _velocity(group: object, m: int) -> np.ndarray:
    """First velocity corrections (m,) m of distances, nan for others: (d - c) (n_ref / n - 1).

    A display d = D n / n_ref + c, with n / n_ref the group's scale and c its known offset; in it stays an unknown zero,
    some nanometres. Source: [RUEGER90] chapter 6 (first velocity correction); [PARKER04] eq. 5.18 has it in n_g.
    """
    index, offset = (
        np.broadcast_to(getattr(group, name, default), m) for name, default in (("scale", 1.0), ("offset", 0.0))
    )
    if getattr(group, "kind", "") not in ("slope_distance", "horizontal_distance") or np.all(index == 1.0):
        return np.full(m, np.nan)
    length = np.asarray(getattr(group, "observed", np.nan)) - offset
    return np.where(index != 1.0, length * (1.0 / index - 1.0), np.nan)


def _row_texts(group: object, name: str) -> np.ndarray:
    """Texts of a group's rows, (m,); the group's name for foreign kinds."""
    texts = getattr(group, name, None)
    return np.asarray(texts) if texts is not None else np.full(len(group.observed), group.name)  # type: ignore[attr-defined]


def _components(network: ObservationNetwork, component: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Components in the file's names, and their signs."""
    called, sign = component.astype("U8"), np.ones(len(component))
    for k, name in enumerate(COMPONENTS):
        mine = component == name
        if mine.any():
            j = int(np.argmax(np.abs(network.axes[k])))
            called[mine], sign[mine] = network.axis_names[j], network.axes[k, j]
    return called, sign


def in_file_axes(network: ObservationNetwork, x: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates or displacements (n, 3) and covariances (n, 3, 3) in the axes of the network's file.

    By exchange and sign, not by a product: an unknown coordinate does not affect the others.
    """
    at = np.argmax(np.abs(network.axes), axis=0)
    sign = network.axes[at, np.arange(3)]
    return sign * x[:, at], np.outer(sign, sign) * covariance[:, at[:, None], at]


def _file_order(network: ObservationNetwork) -> np.ndarray:
    """Rows of all groups in file order; unchanged if a group has no places in the file."""
    total = sum(len(g.observed) for g in network.groups)
    if len(network.groups) < 2 or len(network.places) != len(network.groups) or not all(network.places):
        return np.arange(total)
    rank: dict[str, int] = {}
    keys = []
    for place in (place for places in network.places for place in places):
        words = NUMBER.sub("", place)
        keys.append((rank.setdefault(words, len(rank)), *map(int, NUMBER.findall(place))))
    return np.array([i for i, _ in sorted(enumerate(keys), key=itemgetter(1))], dtype=int)
