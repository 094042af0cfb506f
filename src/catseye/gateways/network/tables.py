"""Adjusted network as CSV: units in the names, in the axes of its file; written in pieces."""

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from math import isfinite

import numpy as np

from catseye.constants import MILLIMETRE
from catseye.reduction.network.adjusted import AdjustedNetwork
from catseye.reduction.network.observations import MEASURES, ROLES

Formats = dict[str, str]  # number format of each column; "" for texts, "d" for integers
Column = Sequence[str] | np.ndarray

PIECE = 5_000  # rows of a piece
COORDINATES: Formats = {
    "point": "",
    "x_m": ".10f",
    "y_m": ".10f",
    "z_m": ".10f",
    "u_x_mm": ".7f",
    "u_y_mm": ".7f",
    "u_z_mm": ".7f",
    "cov_xx_mm2": ".9e",
    "cov_xy_mm2": ".9e",
    "cov_xz_mm2": ".9e",
    "cov_yy_mm2": ".9e",
    "cov_yz_mm2": ".9e",
    "cov_zz_mm2": ".9e",
    "semi_axis_1_mm": ".7f",
    "semi_axis_2_mm": ".7f",
    "semi_axis_3_mm": ".7f",
    "fixed": "",
    "datum": "",
    "observations": "d",
}
OBSERVATIONS: Formats = {
    "number": "d",
    "kind": "",
    **dict.fromkeys(ROLES, ""),
    "component": "",
    "unit": "",
    **dict.fromkeys(MEASURES, ".7g"),
    "observed": ".13g",
    "test": ".6g",
    "p": ".6g",
    "suspect": "",
    "active": "",
    "checked": "",
    "group": "",
    "place": "",
}
PARAMETERS: Formats = {"parameter": "", "unit": "", "value": ".13g", "u": ".7g", "prior_u": ".7g"}
TRIANGLE = np.triu_indices(3)


def coordinates_csv(adjusted: AdjustedNetwork) -> Iterator[str]:
    """Table of points with standard uncertainties, covariances and semi-axes of the ellipsoid.

    adjusted   network; variances include its variance factor where it is `scaled`
    """
    axes, names = np.abs(adjusted.network.axes), [cell(n) for n in adjusted.names]
    letters = np.array([cell(n) for n in adjusted.network.axis_names])
    fixed, datum = ((flags @ axes) > 0.0 for flags in (adjusted.network.points.fixed, adjusted.network.points.datum))
    triangle = adjusted.covariance[:, *TRIANGLE] / MILLIMETRE**2
    yield from table(
        COORDINATES,
        len(names),
        lambda part: [
            names[part],
            *adjusted.x[part].T,
            *(adjusted.u[part].T / MILLIMETRE),
            *triangle[part].T,
            *(adjusted.ellipsoid.semi_axes[part].T / MILLIMETRE),
            [" ".join(letters[f]) for f in fixed[part]],
            [" ".join(letters[d]) for d in datum[part]],
            adjusted.observation_counts[part],
        ],
    )


def observations_csv(adjusted: AdjustedNetwork, *, worst_first: bool = False) -> Iterator[str]:
    """Table of observations; lengths in m and angles in rad, as `unit` says.

    adjusted      adjusted on a solution
    worst_first   by falling |standardised|; else in file order. `number` counts from 0 in file order, as the indices
                  of `suspects` in JSON do.
    """
    rows, places = adjusted.table, adjusted.network.places
    order = rows.worst_first if worst_first else np.arange(len(rows))
    kinds, groups = [cell(k) for k in rows.kinds], [cell(g.name) for g in adjusted.network.groups]
    points = [*(cell(n) for n in adjusted.names), ""]
    suspect = np.zeros(len(rows), dtype=bool)
    suspect[adjusted.suspects] = True

    def columns(part: slice) -> list[Column]:
        at = order[part]
        where = list(zip(rows.group[at].tolist(), rows.row[at].tolist(), strict=True))
        return [
            at,
            [kinds[k] for k in rows.kind[at]],
            *([points[i] for i in end[at]] for end in rows.ends.T),
            [cell(c) for c in rows.component[at].tolist()],
            rows.unit[at].tolist(),
            *(getattr(rows, name)[at] for name in MEASURES),
            adjusted.statistic[at],
            adjusted.p[at],
            *(np.where(flag[at], "yes", "no").tolist() for flag in (suspect, rows.active, rows.checked)),
            [groups[g] for g, _ in where],
            [cell(places[g][r]) if places and places[g] else "" for g, r in where],
        ]

    yield from table(OBSERVATIONS, len(rows), columns)


def parameters_csv(adjusted: AdjustedNetwork) -> Iterator[str]:
    """Table of additional parameters, in x east, y north, z up; empty prior_u: free, 0: held."""
    parameters = adjusted.network.parameters
    yield from table(
        PARAMETERS,
        len(parameters),
        lambda part: [
            [cell(p.name) for p in parameters[part]],
            [p.unit for p in parameters[part]],
            adjusted.solution.parameters[part],
            adjusted.u_parameters[part],
            np.array([p.sigma for p in parameters[part]]),
        ],
    )


def table(formats: Formats, count: int, columns: Callable[[slice], Sequence[Column]]) -> Iterator[str]:
    """Header and rows in pieces.

    formats   number format by column name
    count     number of rows
    columns   function that returns the columns of a slice of rows
    """
    yield ",".join(formats) + "\n"
    for low in range(0, count, PIECE):
        part = columns(slice(low, low + PIECE))
        codes, texts = zip(*(_column(c, f) for c, f in zip(part, formats.values(), strict=True)), strict=True)
        template = ",".join(codes) + "\n"
        yield "".join([template % row for row in zip(*texts, strict=True)])


def _column(column: Column, form: str) -> tuple[str, Sequence]:
    """Template of a column's cells and its values; empty where a number is not finite."""
    if not isinstance(column, np.ndarray):
        return "%s", column
    values = column.tolist()
    if form == "d" or np.isfinite(column).all():
        return f"%{form}", values
    return "%s", [format(value, form) if isfinite(value) else "" for value in values]


def cell(text: str) -> str:
    """Cell, quoted where CSV needs it.

    >>> cell('a "b", c'), cell("P 1")
    ('"a ""b"", c"', 'P 1')
    """
    stream = io.StringIO(newline="")
    csv.writer(stream, lineterminator="").writerow([text])
    return stream.getvalue() if text else ""
