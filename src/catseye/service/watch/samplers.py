"""Parameters and samplers of a coordinator, as JSON-ready objects."""

from collections.abc import Sequence

from catseye.coordinator.control.registry import ROWS
from catseye.coordinator.samplers.columns import COLUMNS, TEXTS
from catseye.coordinator.samplers.pose_rows import Row
from catseye.ranger.line import Reply, parse_stamp
from catseye.service.watch.entries import Object, mjd_of, number

PARAMETER = ("name", "value", "waiting", "legal", "unit", "changes", "meaning", "stage")


def parameters_object(replies: Sequence[Reply], interlocks: Sequence[Reply]) -> Object:
    """Parameters and interlocks of rows of PARAMETERS and INTERLOCKS."""
    rows: list[Object] = [
        dict(zip(PARAMETER, reply.values, strict=False)) for reply in replies if len(reply.values) >= len(PARAMETER)
    ]
    for row in rows:
        row["unit"] = "" if row["unit"] == "none" else row["unit"]
        row["choices"] = list(ROWS[row["name"]].words) if row["name"] in ROWS else []
    locks = [reply.values for reply in interlocks if len(reply.values) >= 3]
    return {
        "parameters": rows,
        "interlocks": [
            {"parameters": v[0].split(), "rule": v[1], "refusal": None if v[2] == "none" else v[2]} for v in locks
        ],
    }


def samplers_object(replies: Sequence[Reply]) -> Object:
    """Samplers of rows of SAMPLERS."""
    rows = [reply.values for reply in replies if len(reply.values) >= 3]
    return {"samplers": [{"name": v[0], "values": int(v[1]), "columns": v[2].split()[1:]} for v in rows]}


def sampler_object(name: str, replies: Sequence[Reply]) -> Object:
    """Values of rows of SAMPLER as columns."""
    return rows_object(name, [reply.values[1:] for reply in replies if len(reply.values) == len(COLUMNS[name]) + 2])


def rows_object(name: str, rows: Sequence[Row]) -> Object:
    """Values of a sampler's rows, a stamp and its columns each, as columns."""
    columns = COLUMNS[name]
    values = {column: [_value(column, row[k]) for row in rows] for k, column in enumerate(columns, start=1)}
    return {"name": name, "mjd": [mjd_of(parse_stamp(row[0])) for row in rows], "columns": values}


def _value(column: str, text: str) -> str | float | None:
    if column in TEXTS:
        return text
    return None if text == "none" else number(float(text))
