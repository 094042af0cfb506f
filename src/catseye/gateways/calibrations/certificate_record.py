"""Calibration as a TOML record and as JSON."""

import json
import math
import re
from collections.abc import Iterable
from datetime import date
from typing import Any, cast

import numpy as np

from catseye.gateways.writers.objects import plain
from catseye.reduction.calibrations.calibration import Calibration
from catseye.reduction.calibrations.kind import PROVENANCE
from catseye.version import __version__

FORMAT = "catseye-calibration-1"
MARK = f'format = "{FORMAT}"'  # identifies a file of catseye
QUANTITY = ("key", "value", "u", "unit", "meaning", "coverage")
BARE = re.compile(r"[A-Za-z0-9_-]+")


def calibration_object(calibration: Calibration) -> dict[str, Any]:
    """Object that `catseye calibrate --json` prints; units in the keys, null for undefined."""
    return plain(
        {
            "format": FORMAT,
            "verdict": calibration.verdict.to_object(),
            "kind": calibration.kind,
            "title": calibration.title,
            **calibration.provenance,
            "quantities": {
                q.key: {
                    "value": q.value,
                    "u": q.u,
                    "low": q.value - q.coverage * q.u,
                    "high": q.value + q.coverage * q.u,
                    "coverage_factor": q.coverage,
                    "unit": q.unit,
                    "meaning": q.meaning,
                }
                for q in calibration.quantities
            },
            "covariance_order": [q.key for q in calibration.quantities],
            "covariance": calibration.covariance,
            "record": calibration.record,
            "variance_factor": calibration.variance_factor,
            "degrees_of_freedom": calibration.degrees_of_freedom,
            "decisions": [vars(decision) for decision in calibration.decisions],
            "plausible": [vars(outcome) for outcome in calibration.plausible],
            "notes": calibration.notes,
            "readings": [dict(zip(calibration.columns, row, strict=True)) for row in calibration.rows],
            "not_used": [number for number, state in enumerate(calibration.states) if state not in ("used", "suspect")],
        }
    )


def calibration_toml(calibration: Calibration) -> str:
    """RECORD.toml, as read by `records.laboratory.calibration.CalibrationRecord`."""
    provenance = calibration.provenance
    head = {
        "kind": calibration.kind,
        "title": calibration.title,
        **{key: provenance[key] for key in PROVENANCE},
        "made_by": f"catseye {__version__}",
        "verdict": calibration.verdict.text,
        "variance_factor": calibration.variance_factor,
        "degrees_of_freedom": calibration.degrees_of_freedom,
        "method": calibration.method,
        "notes": list(calibration.notes),
    }
    lines = [MARK, *_pairs(head)]
    lines += ["", "# to copy into the instrument's record", *_table("record", calibration.record)]
    for q in calibration.quantities:
        lines += ["", "[[quantity]]", *_pairs({name: getattr(q, name) for name in QUANTITY})]
    matrix = ",\n".join(f"  {_value([float(v) for v in row])}" for row in np.atleast_2d(calibration.covariance))
    lines += [
        "",
        "[covariance]",
        f"order = {_value([q.key for q in calibration.quantities])}",
        f"matrix = [\n{matrix},\n]",
    ]
    for name, outcomes in (("decision", calibration.decisions), ("plausible", calibration.plausible)):
        for outcome in outcomes:
            lines += ["", f"[[{name}]]", *_pairs(vars(outcome))]
    rows = ",\n".join(f"  {_value([_cell(cell) for cell in row])}" for row in calibration.rows)
    lines += ["", "[readings]", f"columns = {_value(list(calibration.columns))}", f"rows = [\n{rows},\n]"]
    for name in ("inputs_sha256", "sheet"):
        lines += ["", *_table(name, cast(dict[str, Any], provenance[name]))]
    return "\n".join(lines) + "\n"


def record_lines(record: dict[str, Any]) -> list[str]:
    """TOML lines to copy into the instrument's record; one table per record."""
    lines = list(_pairs({key: value for key, value in record.items() if not isinstance(value, dict)}))
    for name, values in record.items():
        if isinstance(values, dict):
            lines += [f"# {name}", *_pairs(values)]
    return lines


def _table(name: str, values: dict[str, Any]) -> list[str]:
    """A table and its subtables."""
    inner = {key: value for key, value in values.items() if isinstance(value, dict)}
    lines = [f"[{name}]", *_pairs({key: value for key, value in values.items() if key not in inner})]
    for key, value in inner.items():
        lines += ["", *_table(f"{name}.{_key(key)}", value)]
    return lines


def _pairs(values: dict[str, Any]) -> Iterable[str]:
    """Lines of key = value; undefined values are omitted, as TOML has no null."""
    return [
        f"{_key(key)} = {_value(value)}"
        for key, value in values.items()
        if value is not None and not (isinstance(value, float) and not math.isfinite(value))
    ]


def _cell(value: Any) -> Any:
    """Cell of the readings; undefined numbers become an empty text."""
    return "" if value is None or (isinstance(value, float) and not math.isfinite(value)) else value


def _key(name: str) -> str:
    return name if BARE.fullmatch(name) else _value(name)


def _value(value: Any) -> str:
    """Value in TOML syntax.

    >>> _value(["a", 1.5, True, 3])
    '["a", 1.5, true, 3]'
    """
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):  # JSON and TOML basic strings differ in one character
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, date):
        return value.isoformat()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return str(int(value))
