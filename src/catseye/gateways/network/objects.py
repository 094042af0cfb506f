"""Adjusted network as JSON: SI units, in the axes of its file; null for missing numbers.

Written in pieces of some thousand rows, so that a million observations need no more memory than their columns.
"""

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.estimation.least_squares.adjustment import NONCENTRALITY
from catseye.gateways.network.findings import MEASURES, ROLES, Findings
from catseye.gateways.network.summary import verdict
from catseye.gateways.writers.objects import plain

if TYPE_CHECKING:
    from catseye.reduction.network import AdjustedNetwork

FORMAT = "catseye-adjustment-1"
PIECE = 5_000  # rows of a piece


def network_object(findings: Findings, treated: "AdjustedNetwork | None" = None) -> dict[str, Any]:
    """Complete object that `catseye adjust --json` prints.

    findings   findings on a solution
    treated    treatment of its observations, if requested

    Angles run clockwise, azimuths from north, whatever the file's own sense. `mdb` is for the single test at 0.1 % with
    power 80 %; `test` is w, or tau where `scaled`, and `p` its p-value corrected for the number of tests. `from`, `to`,
    `third` and `fourth` follow the kind: at, backsight, foresight of an angle. Parameters refer to x east, y north,
    z up.
    """
    points = {name: value for low in _starts(len(findings.names)) for name, value in _points(findings, low)}
    observations = [
        dict(zip(columns, values, strict=True))
        for low in _starts(len(findings.table))
        if (columns := _observations(findings, low, treated))
        for values in zip(*columns.values(), strict=True)
    ]
    return {**_head(findings, treated), "points": points, "observations": observations}


def network_json(findings: Findings, *, lines: bool = False, treated: "AdjustedNetwork | None" = None) -> Iterator[str]:
    """Text of `network_object` in pieces.

    findings   findings on a solution
    treated    treatment of its observations, if requested
    lines      one line per entry, for reading; else all on one line, for programs

    >>> from itertools import chain
    >>> list(chain(_joined(iter([["a", "b"], ["c"]]), ", ")))
    ['a, b', ', c']
    """
    end, deep = ("\n", "    ") if lines else ("", "")
    comma = f",{end}{deep}" if lines else ", "
    head = (",\n  " if lines else ", ").join(
        f"{json.dumps(k)}: {_text(v)}" for k, v in _head(findings, treated).items()
    )
    yield f'{{{end}{"  " if lines else ""}{head},{end or " "}{"  " if lines else ""}"points": {{{end}{deep}'
    points = (
        [f"{json.dumps(k)}: {_text(v)}" for k, v in _points(findings, low)] for low in _starts(len(findings.names))
    )
    yield from _joined(points, comma)
    yield f'{end}{"  " if lines else ""}}},{end or " "}{"  " if lines else ""}"observations": [{end}{deep}'
    yield from _joined(
        (_row_texts(_observations(findings, low, treated)) for low in _starts(len(findings.table))), comma
    )
    yield f"{end}{'  ' if lines else ''}]{end}}}{end}"


_text = json.JSONEncoder(allow_nan=False).encode
_quoted = json.encoder.encode_basestring_ascii


def _joined(pieces: Iterator[list[str]], comma: str) -> Iterator[str]:
    first = True
    for piece in pieces:
        yield ("" if first else comma) + comma.join(piece)
        first = False


def _starts(count: int) -> range:
    return range(0, count, PIECE)


def _head(findings: Findings, treated: "AdjustedNetwork | None") -> dict[str, Any]:
    """All but the points and the observations."""
    solution, overall = findings.solution, findings.global_test
    degrees = solution.degrees_of_freedom
    likely = None if treated is None else findings.in_table(treated.likely)
    return plain(
        {
            "format": FORMAT,
            "verdict": verdict(findings).to_object(),
            "source": findings.network.source,
            "description": findings.network.description,
            "status": solution.status,
            "datum": solution.datum,
            "notes": [*findings.network.notes, *findings.network.doubts],
            "axes": list(findings.network.axis_names),
            "iterations": solution.iterations,
            "approximate": list(solution.approximate),
            "variance_factor": solution.variance_factor,
            "degrees_of_freedom": degrees,
            "scaled": findings.scaled,
            "chi_square": {
                "statistic": overall.factor * degrees,
                "degrees": degrees,
                "lower": overall.lower * degrees,
                "upper": overall.upper * degrees,
                "p": overall.p,
                "passed": overall.lower <= overall.factor <= overall.upper if np.isfinite(overall.p) else None,
                "level": findings.level,
                "verdict": overall.outcome,
            },
            "critical": {
                "test": findings.test,
                "level": findings.level,
                "level_single": findings.level_single,
                "value": findings.critical,
                "noncentrality": NONCENTRALITY,
            },
            "treatment": None if treated is None else _treatment(findings, treated),
            "relative": [
                {
                    "from": r.first,
                    "to": r.second,
                    "distance": r.distance,
                    "u_distance": r.u_distance,
                    "covariance": r.covariance,
                    "ellipsoid": {"semi_axes": r.ellipsoid.semi_axes, "directions": r.ellipsoid.directions.T},
                }
                for r in findings.relative
            ],
            "suspects": findings.suspects,
            "likely": [] if likely is None else np.flatnonzero(likely),
            "unchecked": np.flatnonzero(findings.table.active & ~findings.table.checked),
            "parameters": {
                p.name: {"value": value, "u": u, "unit": p.unit, "prior_u": p.sigma}
                for p, value, u in zip(
                    findings.network.parameters, solution.parameters, findings.u_parameters, strict=True
                )
            },
        }
    )


def _treatment(findings: Findings, treated: "AdjustedNetwork") -> dict[str, Any]:
    """Rows left out or down-weighted, and estimated variance components."""
    sign, components = findings.table.sign, treated.components
    rejections = []
    for rejection in treated.rejections:
        row = findings.row_of(rejection.group, rejection.row)
        rejections.append(
            {
                "observation": row,
                "statistic": sign[row] * rejection.statistic,
                "estimated_error": sign[row] * rejection.estimated_error,
                "margin": rejection.margin,
                "rival": None if rejection.rival is None else findings.row_of(*rejection.rival),
            }
        )
    return {
        "method": treated.treatment,
        "rejected": np.flatnonzero(findings.in_table(treated.rejected)),
        "undecided": np.flatnonzero(findings.in_table(treated.undecided)),
        "rejections": rejections,
        "variance_components": None
        if components is None
        else {
            name: {"value": value, "u": u}
            for name, value, u in zip(components.names, components.values, components.u, strict=True)
        },
        "notes": list(treated.notes),
    }


def _points(findings: Findings, low: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and object of a piece of the points, from row `low` on."""
    part = slice(low, low + PIECE)
    axes, names = np.abs(findings.network.axes), np.array(findings.network.axis_names)
    points = findings.network.points
    fixed, datum, absent = ((flags[part] @ axes) > 0.0 for flags in (points.fixed, points.datum, points.absent))
    columns = (
        findings.names[part],
        _numbers(findings.x[part]),
        _numbers(findings.u[part]),
        _numbers(findings.covariance[part]),
        _numbers(findings.ellipsoid.semi_axes[part]),
        _numbers(np.swapaxes(findings.ellipsoid.directions[part], 1, 2)),
        fixed,
        datum,
        absent,
        findings.observation_counts[part].tolist(),
    )
    for name, (x, y, z), u, covariance, semi_axes, directions, fixed_axes, chosen, absent_axes, observations in zip(
        *columns, strict=True
    ):
        yield (
            name,
            {
                "x": x,
                "y": y,
                "z": z,
                "u": u,
                "covariance": covariance,
                "ellipsoid": {"semi_axes": semi_axes, "directions": directions},
                "fixed": names[fixed_axes].tolist(),
                "datum": names[chosen].tolist(),
                "absent": names[absent_axes].tolist(),
                "observations": observations,
            },
        )


def _observations(findings: Findings, low: int, treated: "AdjustedNetwork | None") -> dict[str, list[Any]]:
    """Columns of the observations from row `low` on, one piece."""
    table, part = findings.table, slice(low, low + PIECE)
    names = [*findings.names, None]  # the last one is for -1, none
    columns: dict[str, list[Any]] = {"kind": [table.kinds[k] for k in table.kind[part].tolist()]}
    for role, end in zip(ROLES, table.ends.T, strict=True):
        if role in ROLES[:2] or np.any(end >= 0):
            columns[role] = [names[i] for i in end[part].tolist()]
    if np.any(table.component != ""):
        columns["component"] = [c or None for c in table.component[part].tolist()]
    columns["unit"] = table.unit[part].tolist()
    columns |= {name: _numbers(getattr(table, name)[part]) for name in MEASURES}
    columns |= {"test": _numbers(findings.statistic[part]), "p": _numbers(findings.p[part])}
    columns |= {"active": table.active[part].tolist(), "checked": table.checked[part].tolist()}
    if treated is not None:
        columns["weight"] = _numbers(findings.in_table(treated.weights)[part])
    groups, places = [g.name for g in findings.network.groups], findings.network.places
    at = list(zip(table.group[part].tolist(), table.row[part].tolist(), strict=True))
    columns["group"] = [groups[g] for g, _ in at]
    columns["place"] = [places[g][r] if places and places[g] else None for g, r in at]
    return columns


def _row_texts(columns: dict[str, list[Any]]) -> list[str]:
    """Rows of columns as JSON text from one template: three times as fast as objects."""
    codes, texts = zip(*(_column_texts(values) for values in columns.values()), strict=True)
    template = "{" + ", ".join(f"{json.dumps(key)}: {code}" for key, code in zip(columns, codes, strict=True)) + "}"
    return [template % row for row in zip(*texts, strict=True)]


def _column_texts(values: list[Any]) -> tuple[str, list[Any]]:
    """JSON format of a column of numbers, booleans or texts with None, and its values."""
    types = set(map(type, values))
    if types == {float}:
        return "%r", values
    if types == {bool}:
        return "%s", ["true" if value else "false" for value in values]
    return "%s", ["null" if v is None else repr(v) if isinstance(v, float) else _quoted(v) for v in values]


def _numbers(values: np.ndarray) -> list[Any]:
    """Nested lists with None for non-finite values."""
    if np.isfinite(values).all():
        return values.tolist()
    return np.where(np.isfinite(values), values.astype(object), np.array(None)).tolist()
