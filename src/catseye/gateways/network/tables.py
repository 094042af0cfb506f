"""Tables of a network: coordinates, observations, parameters, displacements, candidates; in the axes of its file."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catseye.constants import DEGREE, MILLIMETRE
from catseye.estimation.network.plan import Candidate
from catseye.gateways.writers.columns import Column, Table, each
from catseye.reduction.network.adjusted import AdjustedNetwork
from catseye.reduction.network.comparison import ComparedEpochs
from catseye.reduction.network.observations import ROLES

PAGE = "network.md"
IN_UNIT = "in `unit`"


def _letters(adjusted: AdjustedNetwork, flags: np.ndarray) -> list[str]:
    """Letters of the file's axes that are flagged at each point."""
    letters = np.array(adjusted.network.axis_names)
    return [" ".join(letters[row]) for row in flags @ np.abs(adjusted.network.axes) > 0.0]


def _mm2(row: int, column: int) -> Column[AdjustedNetwork]:
    pair = "xyz"[row] + "xyz"[column]
    doc = f"variance of {pair[0]}" if row == column else f"covariance of {pair[0]} and {pair[1]}"
    return Column(f"cov_{pair}_mm2", "mm2", doc, lambda f: f.covariance[:, row, column] / MILLIMETRE**2, ".9e")


def _semi_axis(k: int, word: str) -> Column[AdjustedNetwork]:
    doc = f"{word} semi-axis of the standard ellipsoid"
    return Column(f"semi_axis_{k + 1}_mm", "mm", doc, lambda f: f.ellipsoid.semi_axes[:, k] / MILLIMETRE, ".7f")


COORDINATES = Table[AdjustedNetwork](
    "coordinates.csv",
    PAGE,
    (
        Column("point", "", "name", lambda f: f.names),
        Column("x_m", "m", "adjusted x; empty where nothing determines it", lambda f: f.x[:, 0], ".10f"),
        Column("y_m", "m", "adjusted y", lambda f: f.x[:, 1], ".10f"),
        Column("z_m", "m", "adjusted z", lambda f: f.x[:, 2], ".10f"),
        Column("u_x_mm", "mm", "standard uncertainty of x", lambda f: f.u[:, 0] / MILLIMETRE, ".7f"),
        Column("u_y_mm", "mm", "standard uncertainty of y", lambda f: f.u[:, 1] / MILLIMETRE, ".7f"),
        Column("u_z_mm", "mm", "standard uncertainty of z", lambda f: f.u[:, 2] / MILLIMETRE, ".7f"),
        *(_mm2(row, column) for row in range(3) for column in range(row, 3)),
        *(_semi_axis(k, word) for k, word in enumerate(("longest", "middle", "shortest"))),
        Column(
            "u_position_mm",
            "mm",
            "point error: root of the sum of the coordinates' variances",
            lambda f: f.u_position / MILLIMETRE,
            ".7f",
        ),
        Column(
            "ellipse_major_mm",
            "mm",
            "longer semi-axis of the standard ellipse in plan",
            lambda f: f.ellipse.major / MILLIMETRE,
            ".7f",
        ),
        Column("ellipse_minor_mm", "mm", "its shorter semi-axis", lambda f: f.ellipse.minor / MILLIMETRE, ".7f"),
        Column(
            "ellipse_bearing_deg",
            "deg",
            "bearing of its longer axis, clockwise from north (y), 0 to 180",
            lambda f: f.ellipse.bearing / DEGREE,
            ".4f",
        ),
        Column("fixed", "", "axes along which it was held", lambda f: _letters(f, f.network.points.fixed)),
        Column("datum", "", "axes along which it defined the datum", lambda f: _letters(f, f.network.points.datum)),
        Column("observations", "", "number of its observations", lambda f: f.observation_counts),
    ),
    also=("points.csv", "epoch-*-coordinates.csv"),
)


@dataclass(frozen=True, eq=False)
class ObservationRows:
    """Source of observations.csv: observations in some order.

    adjusted   network
    order      (m,) rows of its table
    """

    adjusted: AdjustedNetwork
    order: np.ndarray

    def measure(self, name: str) -> np.ndarray:
        return np.asarray(getattr(self.adjusted.table, name)[self.order])

    def ends(self, role: int) -> list[str]:
        points = [*self.adjusted.names, ""]
        return [points[i] for i in self.adjusted.table.ends[self.order, role]]

    @property
    def kinds(self) -> list[str]:
        table = self.adjusted.table
        return [table.kinds[k] for k in table.kind[self.order]]

    @cached_property
    def where(self) -> list[tuple[int, int]]:
        """Group of each observation and its row there."""
        return list(zip(self.measure("group").tolist(), self.measure("row").tolist(), strict=True))

    @property
    def places(self) -> list[str]:
        places = self.adjusted.network.places
        return [places[g][r] if places and places[g] else "" for g, r in self.where]

    @property
    def suspects(self) -> np.ndarray:
        """Mask (m,) of the suspects."""
        suspect = np.zeros(len(self.adjusted.table), dtype=bool)
        suspect[self.adjusted.suspects] = True
        return suspect[self.order]


def _yes(flags: np.ndarray) -> list[str]:
    return np.where(flags, "yes", "no").tolist()


def _end(role: int, word: str) -> Column[ObservationRows]:
    return Column(ROLES[role], "", f"{word} point", lambda o: o.ends(role))


def _measure(name: str, doc: str, form: str = ".7g") -> Column[ObservationRows]:
    return Column(name, "", doc, lambda o: o.measure(name), form)


def _velocity(rows: ObservationRows) -> np.ndarray | None:
    """First velocity corrections, mm; None where there is none."""
    velocity = rows.measure("velocity")
    return velocity / MILLIMETRE if np.isfinite(velocity).any() else None


OBSERVATIONS = Table[ObservationRows](
    "observations.csv",
    PAGE,
    (
        Column("number", "", "position in the file, from 0, as in `suspects` of the JSON", lambda o: o.order),
        Column("kind", "", "kind of observation", lambda o: o.kinds),
        *(_end(role, word) for role, word in enumerate(("first", "second", "third", "fourth"))),
        Column("component", "", "axis, of one coordinate of a point or vector", lambda o: o.measure("component")),
        Column("unit", "", "`m`, `rad` or `1`", lambda o: o.measure("unit")),
        _measure("observed", f"observed value, {IN_UNIT}", ".13g"),
        _measure("u", f"standard uncertainty, {IN_UNIT}"),
        _measure("residual", f"observed less adjusted, {IN_UNIT}"),
        _measure("standardised", "residual over its own standard deviation, w"),
        _measure("redundancy", "redundancy number, 0 (unchecked) to 1"),
        _measure("mdb", f"minimal detectable bias: smallest error that the test detects, {IN_UNIT}"),
        _measure("estimated_error", f"error, if this observation alone is in error, {IN_UNIT}"),
        _measure(
            "bias_to_noise", "largest effect of an error of size `mdb` on a result, over its standard uncertainty"
        ),
        _measure("effect", "largest movement of one of its points by an error of size `mdb`, m"),
        Column(
            "velocity_mm", "mm", "first velocity correction that was applied, with `[air]` or `index`", _velocity, ".6f"
        ),
        Column("test", "", "test statistic: w, or Pope's tau", lambda o: o.adjusted.statistic[o.order], ".6g"),
        Column("p", "", "p-value, corrected for the number of tests", lambda o: o.adjusted.p[o.order], ".6g"),
        Column("suspect", "", "`yes` where the test rejects it", lambda o: _yes(o.suspects)),
        Column("active", "", "`yes` where the adjustment used it", lambda o: _yes(o.measure("active"))),
        Column("checked", "", "`yes` where other observations check it", lambda o: _yes(o.measure("checked"))),
        Column("group", "", "group of observations", lambda o: [o.adjusted.network.groups[g].name for g, _ in o.where]),
        Column("place", "", "line or table of the file that it was read from", lambda o: o.places),
    ),
    also=("epoch-*-observations.csv",),
)


PARAMETERS = Table[AdjustedNetwork](
    "parameters.csv",
    PAGE,
    (
        Column("parameter", "", "name", lambda f: [p.name for p in f.network.parameters]),
        Column("unit", "", "unit of the values", lambda f: [p.unit for p in f.network.parameters]),
        Column(
            "value",
            "",
            f"estimate, {IN_UNIT}; axes x east, y north, z up",
            lambda f: f.solution.parameters,
            ".13g",
        ),
        Column("u", "", f"standard uncertainty, {IN_UNIT}", lambda f: f.u_parameters, ".7g"),
        Column(
            "prior_u",
            "",
            f"standard uncertainty beforehand, {IN_UNIT}; empty: free, 0: held",
            lambda f: np.array([p.sigma for p in f.network.parameters]),
            ".7g",
        ),
    ),
    also=("epoch-*-parameters.csv",),
)


def _axis(prefix: str, k: int, doc: str, value: Callable[[ComparedEpochs], np.ndarray]) -> Column[ComparedEpochs]:
    """Column in millimetres of one axis of an (n, 3) array in metres."""
    axis = "xyz"[k]
    return Column(f"{prefix}{axis}_mm", "mm", f"{doc} along {axis}", lambda c: value(c)[:, k] / MILLIMETRE, ".6f")


DISPLACEMENTS = Table[ComparedEpochs](
    "displacements.csv",
    PAGE,
    (
        Column("point", "", "name of a point of both epochs", lambda c: c.deformation.names),
        Column("x_m", "m", "x in the first epoch", lambda c: c.first.x[c.rows, 0], ".10f"),
        Column("y_m", "m", "y in the first epoch", lambda c: c.first.x[c.rows, 1], ".10f"),
        Column("z_m", "m", "z in the first epoch", lambda c: c.first.x[c.rows, 2], ".10f"),
        *(_axis("d", k, "displacement, second epoch less first,", lambda c: c.displacement) for k in range(3)),
        Column("length_mm", "mm", "length of the displacement", lambda c: c.length / MILLIMETRE, ".6f"),
        *(_axis("u_d", k, "standard uncertainty of the displacement", lambda c: c.u) for k in range(3)),
        *(_axis("plain_d", k, "plain difference of the coordinates", lambda c: c.difference[0]) for k in range(3)),
        Column("statistic", "", "chi-square of the displacement", lambda c: c.deformation.statistic, ".6g"),
        Column("p", "", "probability of such a statistic without movement", lambda c: c.deformation.p, ".6g"),
        Column("p_adjusted", "", "p times the number of points tested", lambda c: c.deformation.p_adjusted, ".6g"),
        Column(
            "detectable_mm",
            "mm",
            "smallest displacement that the test detects, in its weakest direction",
            lambda c: c.deformation.detectable / MILLIMETRE,
            ".6g",
        ),
        Column("verdict", "", "`moved`, `stable`, `undecided`, `held` or `not checked`", lambda c: c.verdicts),
    ),
)

Listed = tuple[str, Candidate]
CANDIDATES = Table[Sequence[Listed]](
    "candidates.csv",
    PAGE,
    (
        Column(
            "list",
            "",
            "`candidate`: a single further range; `schedule`: ranges in the given time, in order",
            each(lambda r: r[0]),
        ),
        Column("from", "", "station", each(lambda r: r[1].from_)),
        Column("to", "", "target", each(lambda r: r[1].to)),
        Column("u_mm", "mm", "standard uncertainty of the range", each(lambda r: r[1].u / MILLIMETRE), ".6f"),
        Column(
            "mean_u_mm",
            "mm",
            "mean standard uncertainty of the points of interest with it, in a schedule with all before it",
            each(lambda r: r[1].mean_u / MILLIMETRE),
            ".6f",
        ),
        Column("gain_um", "um", "reduction of that mean", each(lambda r: r[1].gain * 1e6), ".6f"),
        Column("at_s", "s", "time of completion, in a schedule", each(lambda r: r[1].at_s), "g"),
    ),
)


def coordinates_csv(adjusted: AdjustedNetwork) -> Iterator[str]:
    """Table of points with standard uncertainties, covariances and semi-axes of the ellipsoid.

    adjusted   network; variances include its variance factor where it is `scaled`
    """
    return COORDINATES.pieces(adjusted)


def observations_csv(adjusted: AdjustedNetwork, *, worst_first: bool = False) -> Iterator[str]:
    """Table of observations; lengths in m and angles in rad, as `unit` says.

    adjusted      network
    worst_first   by falling |standardised|; else in file order. `number` counts from 0 in file order, as the indices
                  of `suspects` in JSON do.
    """
    rows = adjusted.table
    order = rows.worst_first if worst_first else np.arange(len(rows))
    return OBSERVATIONS.pieces(ObservationRows(adjusted, order))


def parameters_csv(adjusted: AdjustedNetwork) -> Iterator[str]:
    """Table of additional parameters, in x east, y north, z up."""
    return PARAMETERS.pieces(adjusted)


def displacements_csv(compared: ComparedEpochs) -> Iterator[str]:
    """Table of common points: coordinates, displacements, uncertainties."""
    return DISPLACEMENTS.pieces(compared)


def candidates_csv(candidates: Sequence[Candidate], schedule: Sequence[Candidate]) -> Iterator[str]:
    """Table of additional ranges, the best first, then the schedule."""
    lists = (("candidate", candidates), ("schedule", schedule))
    return CANDIDATES.pieces([(name, candidate) for name, rows in lists for candidate in rows])
