"""Reports to explore: sections of texts, tables, scenes, charts and drawings.

`report_object` is the JSON of docs/formats/results.md, "Data of a report"; `writers.report_page` is its page.
Numbers are rounded to their useful digits; the tables beside a report hold all digits.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any, Literal, NamedTuple

import numpy as np

from catseye.gateways.writers.objects import versions
from catseye.gateways.writers.passage import Passage
from catseye.records.files.report_file import FORMAT
from catseye.verdict import Verdict

Values = np.ndarray | Sequence[Any]
ColumnKind = Literal["number", "text", "long", "hash"]
ChartKind = Literal["scatter", "line", "bars", "histogram", "normal", "map"]

SPARE = 2  # decimals kept beyond those shown
SIGNIFICANT = 4  # digits of a standard uncertainty
USUAL = 6  # significant digits of a number without stated decimals


class Card(NamedTuple):
    """A main number of a report, with its name and a remark."""

    name: str
    value: str
    remark: str


@dataclass(frozen=True, eq=False)
class Column:
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
        """Column as JSON."""
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
) -> Column:
    """Column of numbers; arguments as for `Column`."""
    return Column(key=key, label=label, values=values, unit=unit, kind="number", digits=digits, u=u)


def uncertainty(key: str, label: str, values: Values = (), unit: str = "", digits: int | None = None) -> Column:
    """Column of standard uncertainties, kept to four significant digits; arguments as for `Column`."""
    return Column(key=key, label=label, values=values, unit=unit, kind="number", digits=digits, significant=SIGNIFICANT)


def text(key: str, label: str, values: Values = (), kind: ColumnKind = "text") -> Column:
    """Column of texts; arguments as for `Column`."""
    return Column(key=key, label=label, values=values, kind=kind)


@dataclass(frozen=True, eq=False)
class Table:
    """Table of a report.

    columns   of equal lengths
    name      key of the column that names a thing of scenes and charts; "" for none
    """

    columns: tuple[Column, ...]
    name: str = ""

    @classmethod
    def of_rows(cls, rows: Iterable[Sequence[Any]], *heads: Column, name: str = "") -> "Table":
        """Table whose columns, given without values, take theirs from rows.

        >>> Table.of_rows([("A", 1.0), ("B", None)], text("point", "point"), number("x", "x")).columns[1].values
        (1.0, None)
        """
        columns = tuple(zip(*rows, strict=True)) or tuple(() for _ in heads)
        return cls(tuple(replace(h, values=v) for h, v in zip(heads, columns, strict=True)), name)

    def to_object(self) -> dict[str, Any]:
        """Table as JSON; ValueError for columns of different lengths."""
        lengths = {column.key: len(column.values) for column in self.columns}
        if len(set(lengths.values())) > 1 or len(lengths) < len(self.columns):
            raise ValueError(f"columns of different lengths or of one key: {lengths}")
        return {
            "columns": [column.to_object() for column in self.columns],
            **({"name": self.name} if self.name else {}),
        }


def pairs(
    rows: Mapping[str, str] | Iterable[tuple[str, str]], first: str, second: str, *, hashes: bool = False
) -> Table:
    """Table of names with a text or a digest each."""
    listed = list(rows.items()) if isinstance(rows, Mapping) else list(rows)
    return Table.of_rows(listed, text("name", first), text("value", second, kind="hash" if hashes else "text"))


def sentences(passages: Iterable[tuple[str, str]], first: str = "on") -> Table:
    """Table of passages, for those of a part of the report."""
    return Table.of_rows(passages, text("title", first), text("text", "result", kind="long"))


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
        """Value as JSON."""
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
        """Beams as JSON."""
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
        """Scene as JSON."""
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
        """Axis as JSON."""
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
        """Chart as JSON."""
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


class Text(NamedTuple):
    """Paragraph."""

    text: str
    faint: bool = False


class Heading(NamedTuple):
    """Heading within a section."""

    text: str


class Items(NamedTuple):
    """List of sentences."""

    items: Sequence[str]


class TableBlock(NamedTuple):
    """Table under a key of its own in the report; `folded` is the title of what opens."""

    key: str
    table: Table
    caption: str = ""
    folded: str = ""


class SceneBlock(NamedTuple):
    """Scene under a key of its own."""

    key: str
    scene: Scene
    caption: str


class ChartBlock(NamedTuple):
    """Chart under a key of its own."""

    key: str
    chart: Chart
    caption: str


class DrawingBlock(NamedTuple):
    """SVG text under a key of its own."""

    key: str
    svg: str
    caption: str


Block = Text | Heading | Items | TableBlock | SceneBlock | ChartBlock | DrawingBlock


@dataclass(frozen=True, eq=False)
class Section:
    """Part of a report; None among its blocks is left out.

    key   for links within the report
    """

    key: str
    title: str
    blocks: Sequence[Block | None]


@dataclass(frozen=True, eq=False)
class Report:
    """Report of a result.

    title      heading
    subtitle   origin, time and conventions
    verdict    None for a result without one
    sections   in order
    cards      main numbers
    passages   sentences under titles
    label      title of the page; the heading if empty
    """

    title: str
    subtitle: str
    verdict: Verdict | None
    sections: Sequence[Section | None]
    cards: Sequence[Card] = ()
    passages: Sequence[Passage] = ()
    label: str = ""


def origin_section(
    when: datetime, inputs: Mapping[str, str], facts: Mapping[str, str] | None = None, *blocks: Block
) -> Section:
    """Section on the files read, the programs and the settings.

    when     UTC
    inputs   SHA-256 of each input file, by name
    facts    further rows, by name
    blocks   that go first
    """
    rows = {"made (UTC)": f"{when:%Y-%m-%d %H:%M:%S}", **versions(), **(facts or {})}
    files = TableBlock("inputs", pairs(inputs, "file read", "SHA-256", hashes=True), folded="Inputs and their SHA-256")
    return Section("provenance", "Provenance", [*blocks, TableBlock("versions", pairs(rows, "item", "value")), files])


def report_object(report: Report) -> dict[str, Any]:
    """Report as JSON, docs/formats/results.md; ValueError for a key that occurs twice."""
    stores: dict[str, dict[str, Any]] = {"tables": {}, "scenes": {}, "charts": {}, "drawings": {}}
    sections = [
        {
            "id": section.key,
            "title": section.title,
            "blocks": [_block(block, stores) for block in section.blocks if block is not None],
        }
        for section in report.sections
        if section is not None
    ]
    return {
        "format": FORMAT,
        "title": report.title,
        "subtitle": report.subtitle,
        "verdict": None if report.verdict is None else report.verdict.to_object(),
        "cards": [card._asdict() for card in report.cards],
        "passages": [passage._asdict() for passage in report.passages],
        "sections": sections,
        **stores,
    }


def _block(block: Block, stores: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Block as JSON; its table, scene, chart or drawing goes into a store."""
    match block:
        case Text(words, faint):
            return {"kind": "text", "text": words, **({"faint": True} if faint else {})}
        case Heading(words):
            return {"kind": "heading", "text": words}
        case Items(items):
            return {"kind": "list", "items": list(items)}
        case TableBlock(key, table, caption, folded):
            _store(stores["tables"], key, table.to_object())
            named = {"caption": caption} if caption else {}
            return {"kind": "table", "table": key, **named, **({"folded": folded} if folded else {})}
        case SceneBlock(key, scene, caption):
            _store(stores["scenes"], key, scene.to_object())
            return {"kind": "scene", "scene": key, "caption": caption}
        case ChartBlock(key, chart, caption):
            _store(stores["charts"], key, chart.to_object())
            return {"kind": "chart", "chart": key, "caption": caption}
        case DrawingBlock(key, svg, caption):
            _store(stores["drawings"], key, str(svg))
            return {"kind": "drawing", "drawing": key, "caption": caption}


def _store(store: dict[str, Any], key: str, value: Any) -> None:
    if key in store:
        raise ValueError(f"two parts of a report have the key {key!r}")
    store[key] = value


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
