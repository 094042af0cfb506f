"""Reports to explore: sections of texts, tables, scenes, charts and drawings.

`report_object` is the JSON of docs/formats/results.md, "Data of a report"; `writers.report_page` is its page.
Numbers are rounded to their useful digits; the tables beside a report hold all digits.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, NamedTuple

from catseye.gateways.writers.objects import versions
from catseye.gateways.writers.passage import Passage
from catseye.gateways.writers.report_parts import Chart, ReportTable, Scene, pairs
from catseye.records.files.report_file import FORMAT
from catseye.verdict import Verdict


class Card(NamedTuple):
    """A main number of a report, with its name and a remark."""

    name: str
    value: str
    remark: str


class Text(NamedTuple):
    """Paragraph of a section, in words."""

    text: str
    faint: bool = False


class Heading(NamedTuple):
    """Heading within a section."""

    text: str


class Items(NamedTuple):
    """List of sentences, marked."""

    items: Sequence[str]


class TableBlock(NamedTuple):
    """Table under a key of its own in the report; `folded` is the title of what opens."""

    key: str
    table: ReportTable
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
class ReportSection:
    """Part of a report; None among its blocks is left out.

    key   for links within the report
    """

    key: str
    title: str
    blocks: Sequence[Block | None]


@dataclass(frozen=True, eq=False)
class ResultReport:
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
    sections: Sequence[ReportSection | None]
    cards: Sequence[Card] = ()
    passages: Sequence[Passage] = ()
    label: str = ""


def origin_section(
    when: datetime, inputs: Mapping[str, str], facts: Mapping[str, str] | None = None, *blocks: Block
) -> ReportSection:
    """Section on the files read, the programs and the settings.

    when     UTC
    inputs   SHA-256 of each input file, by name
    facts    further rows, by name
    blocks   that go first
    """
    rows = {"made (UTC)": f"{when:%Y-%m-%d %H:%M:%S}", **versions(), **(facts or {})}
    files = TableBlock("inputs", pairs(inputs, "file read", "SHA-256", hashes=True), folded="Inputs and their SHA-256")
    return ReportSection(
        "provenance", "Provenance", [*blocks, TableBlock("versions", pairs(rows, "item", "value")), files]
    )


def report_object(report: ResultReport) -> dict[str, Any]:
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
