"""Answers from an archive as objects for JSON."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from catseye.gateways.writers.columns import Table

if TYPE_CHECKING:
    from catseye.records.query.sql import SqlRows
    from catseye.reduction.query.again import ReReduction
    from catseye.reduction.query.point import PointSeries


def rows_of(table: Table[Any], source: Any) -> list[dict[str, Any]]:
    """Rows of a table, an object each, under the names of its columns."""
    columns = {}
    for column in table.columns:
        values = column.value(source)
        if values is not None:
            columns[column.name] = values.tolist() if isinstance(values, np.ndarray) else list(values)
    return _rows(columns)


def sql_object(rows: "SqlRows") -> dict[str, Any]:
    """Statement, units of columns, and rows."""
    columns = {name: values.tolist() for name, values in rows.columns.items()}
    return {"sql": rows.statement, "units": dict(rows.units), "rows": _rows(columns)}


def point_object(series: "PointSeries") -> dict[str, Any]:
    """Point, frame and mean."""
    place, covariance, factor = series.mean
    u = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return {
        "name": series.point,
        "frame": series.frame,
        "mean_m": place,
        "u_mean_m": u,
        "factor": factor,
        "nights_without_pose": series.unplaced,
    }


def again_object(found: "ReReduction") -> dict[str, Any]:
    """Circumstances of a re-reduction."""
    return {
        "night": found.archived.night,
        "archived_version": found.archived.version,
        "calibrations": found.records or None,
        "changed": list(found.changed),
        "largest_mm": found.largest * 1e3,
        "shots_used_once": found.selection,
        "points_lost": list(found.lost),
        "points_new": list(found.new),
        "covariance_m2": found.covariance,
    }


def _rows(columns: dict[str, Sequence[Any]]) -> list[dict[str, Any]]:
    names = list(columns)
    return [dict(zip(names, values, strict=True)) for values in zip(*columns.values(), strict=True)]
