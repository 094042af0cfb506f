"""Adjusted network as JSON: SI units, in the axes of its file; null for missing numbers.

Written in pieces of some thousand rows, so that a million observations need no more memory than their columns.
"""

import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from catseye.gateways.writers.objects import plain
from catseye.reduction.network.adjusted import CONFIDENCE, AdjustedNetwork
from catseye.reduction.network.observations import MEASURES, ROLES
from catseye.reduction.network.treatment import Treatment

FORMAT = "catseye-adjustment-1"
PIECE = 5_000  # rows of a piece


def network_object(adjusted: AdjustedNetwork) -> dict[str, Any]:
    """Complete object that `catseye adjust --json` prints.

    adjusted   network

    Angles run clockwise, azimuths from north, whatever the file's own sense. `mdb` is for the single test of the level
    and power under `critical`; `test` is w, or tau where `scaled`, and `p` its p-value corrected for the number of
    tests. `from`, `to`, `third` and `fourth` follow the kind: at, backsight, foresight of an angle. Parameters refer to
    x east, y north, z up, and so does the bearing of an `ellipse`, clockwise from north.
    """
    points = {name: value for low in _starts(len(adjusted.names)) for name, value in _points(adjusted, low)}
    observations = [
        dict(zip(columns, values, strict=True))
        for low in _starts(len(adjusted.table))
        if (columns := _observations(adjusted, low))
        for values in zip(*columns.values(), strict=True)
    ]
    return {**_head(adjusted), "points": points, "observations": observations}


def network_json(adjusted: AdjustedNetwork, *, lines: bool = False) -> Iterator[str]:
    """Text of `network_object` in pieces.

    adjusted   network
    lines      one line per entry, for reading; else all on one line, for programs

    >>> from itertools import chain
    >>> list(chain(_joined(iter([["a", "b"], ["c"]]), ", ")))
    ['a, b', ', c']
    """
    end, deep = ("\n", "    ") if lines else ("", "")
    comma = f",{end}{deep}" if lines else ", "
    head = (",\n  " if lines else ", ").join(f"{json.dumps(k)}: {_text(v)}" for k, v in _head(adjusted).items())
    yield f'{{{end}{"  " if lines else ""}{head},{end or " "}{"  " if lines else ""}"points": {{{end}{deep}'
    points = (
        [f"{json.dumps(k)}: {_text(v)}" for k, v in _points(adjusted, low)] for low in _starts(len(adjusted.names))
    )
    yield from _joined(points, comma)
    yield f'{end}{"  " if lines else ""}}},{end or " "}{"  " if lines else ""}"observations": [{end}{deep}'
    yield from _joined((_row_texts(_observations(adjusted, low)) for low in _starts(len(adjusted.table))), comma)
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


def _head(adjusted: AdjustedNetwork) -> dict[str, Any]:
    """All but the points and the observations."""
    solution, overall = adjusted.solution, adjusted.global_test
    degrees = solution.degrees_of_freedom
    return plain(
        {
            "format": FORMAT,
            "verdict": adjusted.verdict.to_object(),
            "source": adjusted.network.source,
            "description": adjusted.network.description,
            "status": solution.status,
            "datum": solution.datum,
            "notes": [*adjusted.network.notes, *adjusted.network.doubts],
            "axes": list(adjusted.network.axis_names),
            "iterations": solution.iterations,
            "approximate": list(solution.approximate),
            "variance_factor": solution.variance_factor,
            "degrees_of_freedom": degrees,
            "scaled": adjusted.scaled,
            "chi_square": {
                "statistic": overall.factor * degrees,
                "degrees": degrees,
                "lower": overall.lower * degrees,
                "upper": overall.upper * degrees,
                "p": overall.p,
                "passed": overall.lower <= overall.factor <= overall.upper if np.isfinite(overall.p) else None,
                "level": adjusted.level,
                "verdict": overall.outcome,
            },
            "critical": {
                "test": adjusted.test,
                "level": adjusted.level,
                "level_single": adjusted.level_single,
                "value": adjusted.critical,
                "noncentrality": adjusted.detectability.noncentrality,
                "mdb_level": adjusted.detectability.level,
                "power": adjusted.detectability.power,
            },
            "confidence": {
                "probability": CONFIDENCE,
                "ellipsoid": _coverage(adjusted, 3),
                "ellipse": _coverage(adjusted, 2),
            },
            "treatment": None if adjusted.treatment is None else _treatment(adjusted, adjusted.treatment),
            "relative": [
                {
                    "from": r.first,
                    "to": r.second,
                    "distance": r.distance,
                    "u_distance": r.u_distance,
                    "covariance": r.covariance,
                    "ellipsoid": {"semi_axes": r.ellipsoid.semi_axes, "directions": r.ellipsoid.directions.T},
                }
                for r in adjusted.relative
            ],
            "suspects": adjusted.suspects,
            "likely": adjusted.likely,
            "unchecked": np.flatnonzero(adjusted.table.active & ~adjusted.table.checked),
            "parameters": {
                p.name: {"value": value, "u": u, "unit": p.unit, "prior_u": p.sigma}
                for p, value, u in zip(
                    adjusted.network.parameters, solution.parameters, adjusted.u_parameters, strict=True
                )
            },
        }
    )


def _coverage(adjusted: AdjustedNetwork, dimensions: int) -> dict[str, float]:
    """Probability of a standard region, and the factor that makes it one of CONFIDENCE."""
    return dict(zip(("standard", "factor"), adjusted.coverage(dimensions), strict=True))


def _treatment(adjusted: AdjustedNetwork, treatment: Treatment) -> dict[str, Any]:
    """Rows left out or down-weighted, and estimated variance components."""
    sign, components = adjusted.table.sign, treatment.components
    rejections = []
    for rejection in treatment.rejections:
        row = adjusted.row_of(rejection.group, rejection.row)
        rejections.append(
            {
                "observation": row,
                "statistic": sign[row] * rejection.statistic,
                "estimated_error": sign[row] * rejection.estimated_error,
                "margin": rejection.margin,
                "rival": None if rejection.rival is None else adjusted.row_of(*rejection.rival),
            }
        )
    return {
        "method": treatment.method,
        "rejected": np.flatnonzero(adjusted.in_table(treatment.rejected)),
        "undecided": np.flatnonzero(adjusted.in_table(treatment.undecided)),
        "rejections": rejections,
        "variance_components": None
        if components is None
        else {
            name: {"value": value, "u": u}
            for name, value, u in zip(components.names, components.values, components.u, strict=True)
        },
        "notes": list(treatment.notes),
    }


def _points(adjusted: AdjustedNetwork, low: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and object of a piece of the points, from row `low` on."""
    part = slice(low, low + PIECE)
    axes, names = np.abs(adjusted.network.axes), np.array(adjusted.network.axis_names)
    points = adjusted.network.points
    fixed, datum, absent = ((flags[part] @ axes) > 0.0 for flags in (points.fixed, points.datum, points.absent))
    columns = (
        adjusted.names[part],
        _numbers(adjusted.x[part]),
        _numbers(adjusted.u[part]),
        _numbers(adjusted.covariance[part]),
        _numbers(adjusted.ellipsoid.semi_axes[part]),
        _numbers(np.swapaxes(adjusted.ellipsoid.directions[part], 1, 2)),
        _numbers(np.stack([adjusted.ellipse.major, adjusted.ellipse.minor, adjusted.ellipse.bearing], axis=1)[part]),
        _numbers(adjusted.u_position[part]),
        fixed,
        datum,
        absent,
        adjusted.observation_counts[part].tolist(),
    )
    for (
        name,
        (x, y, z),
        u,
        covariance,
        semi_axes,
        directions,
        ellipse,
        u_position,
        fixed_axes,
        chosen,
        absent_axes,
        observations,
    ) in zip(*columns, strict=True):
        yield (
            name,
            {
                "x": x,
                "y": y,
                "z": z,
                "u": u,
                "u_position": u_position,
                "covariance": covariance,
                "ellipsoid": {"semi_axes": semi_axes, "directions": directions},
                "ellipse": dict(zip(("major", "minor", "bearing"), ellipse, strict=True)),
                "fixed": names[fixed_axes].tolist(),
                "datum": names[chosen].tolist(),
                "absent": names[absent_axes].tolist(),
                "observations": observations,
            },
        )


def _observations(adjusted: AdjustedNetwork, low: int) -> dict[str, list[Any]]:
    """Columns of the observations from row `low` on, one piece."""
    table, part = adjusted.table, slice(low, low + PIECE)
    names = [*adjusted.names, None]  # the last one is for -1, none
    columns: dict[str, list[Any]] = {"kind": [table.kinds[k] for k in table.kind[part].tolist()]}
    for role, end in zip(ROLES, table.ends.T, strict=True):
        if role in ROLES[:2] or np.any(end >= 0):
            columns[role] = [names[i] for i in end[part].tolist()]
    if np.any(table.component != ""):
        columns["component"] = [c or None for c in table.component[part].tolist()]
    columns["unit"] = table.unit[part].tolist()
    columns |= {name: _numbers(getattr(table, name)[part]) for name in MEASURES}
    columns |= {"test": _numbers(adjusted.statistic[part]), "p": _numbers(adjusted.p[part])}
    columns |= {"active": table.active[part].tolist(), "checked": table.checked[part].tolist()}
    if adjusted.treatment is not None:
        columns["weight"] = _numbers(adjusted.in_table(adjusted.treatment.weights)[part])
    groups, places = [g.name for g in adjusted.network.groups], adjusted.network.places
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
