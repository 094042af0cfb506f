"""Parts of reports that hold numbers: tables, scenes, charts.

Numbers are rounded to their useful digits; the tables beside a report hold all digits.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

Values = np.ndarray | Sequence[Any]
ColumnKind = Literal["number", "text", "long", "hash"]
ChartKind = Literal["scatter", "line", "bars", "histogram", "normal", "map"]

SPARE = 2  # decimals kept beyond those shown
SIGNIFICANT = 4  # digits of a standard uncertainty
USUAL = 6  # significant digits of a number without stated decimals


@dataclass(frozen=True, eq=False)
class ReportColumn:
    """Column of a report's table.

    key          name within the table
    label        heading, without unit
    values       one per row; None and nan: unknown
    unit         printed beside the label
    kind         "hash": digits of a digest; "long": text of several lines
    digits       decimals shown
    significant  significant digits kept; None: decimals shown and two more
    u            key of the column with the standard uncertainty
    """

    key: str
    label: str
    values: Values = ()
    unit: str = ""
    kind: ColumnKind = "text"
    digits: int | None = None
    significant: int | None = None
    u: str = ""

    def to_object(self) -> dict[str, Any]:
        """Column as an object of JSON."""
        number = self.kind == "number"
        digits = None if self.digits is None or self.significant else self.digits + SPARE
        values = rounded(self.values, digits, self.significant or USUAL) if number else _texts(self.values)
        return {
            "key": self.key,
            "label": self.label,
            "unit": self.unit,
            "kind": self.kind,
            **({"digits": self.digits} if self.digits is not None else {}),
            **({"u": self.u} if self.u else {}),
            "values": values,
        }


def number(
    key: str, label: str, values: Values = (), unit: str = "", digits: int | None = None, *, u: str = ""
) -> ReportColumn:
    """Column of numbers; arguments as for `ReportColumn`."""
    return ReportColumn(key=key, label=label, values=values, unit=unit, kind="number", digits=digits, u=u)


def uncertainty(key: str, label: str, values: Values = (), unit: str = "", digits: int | None = None) -> ReportColumn:
    """Column of standard uncertainties, kept to four significant digits; arguments as for `ReportColumn`."""
    return ReportColumn(
        key=key, label=label, values=values, unit=unit, kind="number", digits=digits, significant=SIGNIFICANT
    )


def text(key: str, label: str, values: Values = (), kind: ColumnKind = "text") -> ReportColumn:
    """Column of texts; arguments as for `ReportColumn`."""
    return ReportColumn(key=key, label=label, values=values, kind=kind)


@dataclass(frozen=True, eq=False)
class ReportTable:
    """Table of a report.

    columns   of equal lengths
    name      key of the column that names a thing of scenes and charts; "" for none
    """

    columns: tuple[ReportColumn, ...]
    name: str = ""

    @classmethod
    def of_rows(cls, rows: Iterable[Sequence[Any]], *heads: ReportColumn, name: str = "") -> "ReportTable":
        """Table whose columns, given without values, take theirs from rows.

        >>> ReportTable.of_rows([("A", 1.0), ("B", None)], text("point", "point"), number("x", "x")).columns[1].values
        (1.0, None)
        """
        columns = tuple(zip(*rows, strict=True)) or tuple(() for _ in heads)
        return cls(tuple(replace(h, values=v) for h, v in zip(heads, columns, strict=True)), name)

    def to_object(self) -> dict[str, Any]:
        """Table as an object of JSON; ValueError for columns of different lengths."""
        lengths = {column.key: len(column.values) for column in self.columns}
        if len(set(lengths.values())) > 1 or len(lengths) < len(self.columns):
            raise ValueError(f"columns of different lengths or of one key: {lengths}")
        return {
            "columns": [column.to_object() for column in self.columns],
            **({"name": self.name} if self.name else {}),
        }


def pairs(
    rows: Mapping[str, str] | Iterable[tuple[str, str]], first: str, second: str, *, hashes: bool = False
) -> ReportTable:
    """Table of names with a text or a digest each."""
    listed = list(rows.items()) if isinstance(rows, Mapping) else list(rows)
    return ReportTable.of_rows(listed, text("name", first), text("value", second, kind="hash" if hashes else "text"))


def sentences(passages: Iterable[tuple[str, str]], first: str = "on") -> ReportTable:
    """Table of passages, for those of a part of the report."""
    return ReportTable.of_rows(passages, text("title", first), text("text", "result", kind="long"))


@dataclass(frozen=True, eq=False)
class Coloured:
    """Value that colours points or marks, diverging about zero.

    values   one per point, in the unit; nan: unknown
    """

    label: str
    unit: str
    values: Values
    digits: int | None = None

    def to_object(self) -> dict[str, Any]:
        """Value as an object of JSON."""
        return {"label": self.label, "unit": self.unit, "values": rounded(self.values, self.digits)}


@dataclass(frozen=True, eq=False)
class Beams:
    """Lines between points of a scene.

    start, end   (b,) rows of points
    value        (b,) standardised residuals; nan: unknown
    names        of the beams, such as shots; empty for none
    """

    start: Values
    end: Values
    value: Values
    names: Sequence[Any] = ()

    def to_object(self) -> dict[str, Any]:
        """Beams as an object of JSON."""
        return {
            "from": [int(row) for row in self.start],
            "to": [int(row) for row in self.end],
            "value": rounded(self.value, 3),
            **({"name": _texts(self.names)} if len(self.names) else {}),
        }


@dataclass(frozen=True, eq=False)
class Scene:
    """Points in three dimensions with ellipsoids, beams and lines.

    frame        name of the frame and of its axes
    names        of the points
    x            (n, 3) m
    groups       of the points, in order
    group        (n,) index into groups
    covariance   (n, 3, 3) m²; None for none
    info         a line of each point; empty for none
    beams        between points
    lines        name -> (k, 3) m
    value        colour of the points
    """

    frame: str
    names: Sequence[str]
    x: np.ndarray
    groups: Sequence[str]
    group: Values
    covariance: np.ndarray | None = None
    info: Sequence[str] = ()
    beams: Beams | None = None
    lines: Mapping[str, np.ndarray] = field(default_factory=dict)
    value: Coloured | None = None

    def to_object(self) -> dict[str, Any]:
        """Scene as an object of JSON."""
        points: dict[str, Any] = {
            "name": _texts(self.names),
            **{axis: rounded(self.x[:, k], 7) for k, axis in enumerate("xyz")},
            "group": [int(k) for k in self.group],
        }
        if self.covariance is not None:
            points["covariance"] = {
                "xyz"[i] + "xyz"[j]: rounded(self.covariance[:, i, j], None, SIGNIFICANT)
                for i in range(3)
                for j in range(i, 3)
            }
        if len(self.info):
            points["info"] = _texts(self.info)
        lines = [
            {"name": name, **{axis: rounded(way[:, k], 4) for k, axis in enumerate("xyz")}}
            for name, way in self.lines.items()
        ]
        return {
            "frame": self.frame,
            "points": points,
            "groups": list(self.groups),
            **({} if self.beams is None else {"beams": self.beams.to_object()}),
            **({"lines": lines} if lines else {}),
            **({} if self.value is None else {"value": self.value.to_object()}),
        }


@dataclass(frozen=True, eq=False)
class Axis:
    """Axis of a chart.

    values       of the marks, in the unit; with categories their indices
    categories   names along the axis; empty for a number
    digits       decimals kept; None: six significant digits
    """

    label: str
    unit: str
    values: Values
    categories: Sequence[str] = ()
    digits: int | None = None

    def to_object(self) -> dict[str, Any]:
        """Axis as an object of JSON."""
        return {
            "label": self.label,
            "unit": self.unit,
            "values": rounded(self.values, self.digits),
            **({"categories": _texts(self.categories)} if len(self.categories) else {}),
        }


def categories(label: str, names: Sequence[str]) -> Axis:
    """Axis whose marks have the places of these names: sorted, each once."""
    order = {name: k for k, name in enumerate(sorted(set(names)))}
    return Axis(label, "", [order[name] for name in names], tuple(order), digits=0)


@dataclass(frozen=True, eq=False)
class Chart:
    """Chart of marks.

    kind      "map": x and y to scale, coloured by value; "histogram" and "normal" have x alone
    u         standard uncertainty of y; None for none
    value     colour
    names     of the marks, such as points or shots; empty for none
    group     (m,) index into groups; empty for one group
    limits    dashed lines, on y; on x for a histogram
    outline   closed or open lines (k, 2), on a map
    """

    kind: ChartKind
    x: Axis
    y: Axis | None = None
    u: Values | None = None
    value: Coloured | None = None
    names: Sequence[Any] = ()
    group: Values = ()
    groups: Sequence[str] = ()
    limits: Sequence[float] = ()
    outline: Sequence[np.ndarray] = ()

    def to_object(self) -> dict[str, Any]:
        """Chart as an object of JSON."""
        ways = [{"x": rounded(way[:, 0], 4), "y": rounded(way[:, 1], 4)} for way in self.outline]
        return {
            "type": self.kind,
            "x": self.x.to_object(),
            **({} if self.y is None else {"y": self.y.to_object()}),
            **({} if self.u is None else {"u": rounded(self.u, None, SIGNIFICANT)}),
            **({} if self.value is None else {"value": self.value.to_object()}),
            **({"name": _texts(self.names)} if len(self.names) else {}),
            **({"group": [int(k) for k in self.group], "groups": list(self.groups)} if len(self.groups) else {}),
            **({"limits": rounded(self.limits)} if len(self.limits) else {}),
            **({"outline": ways} if ways else {}),
        }


def rounded(values: Values, digits: int | None = None, significant: int = USUAL) -> list[Any]:
    """Numbers as JSON: rounded to decimals, or to significant digits; None for None, nan and infinity.

    >>> rounded([0.123456, None, float("nan"), 12], 3), rounded([0.123456, -12345.6], significant=3)
    ([0.123, None, None, 12], [0.123, -12300])
    """
    array = np.array([np.nan if v is None else v for v in values], dtype=float) if len(values) else np.zeros(0)
    if digits is None:
        with np.errstate(divide="ignore", invalid="ignore"):
            size = np.floor(np.log10(np.abs(array)))
        decimals = significant - 1 - np.where(np.isfinite(size), size, 0.0).astype(int)
        numbers = [round(v, d) for v, d in zip(array.tolist(), decimals.tolist(), strict=True)]
    else:
        numbers = [round(v, digits) for v in array.tolist()]
    return [_json(v) for v in numbers]


def _json(value: float) -> float | int | None:
    """Number in its shortest spelling; None unless finite."""
    if not math.isfinite(value):
        return None
    return int(value) if value.is_integer() and abs(value) < 2**53 else value


def _texts(values: Values) -> list[str]:
    return ["" if value is None else str(value) for value in values]
