"""Reports read back from their pages: the data of a page, with its shapes checked.

The format is that of docs/formats/results.md, "Data of a report".
"""

import base64
import binascii
import json
import re
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from catseye.errors import InputError
from catseye.records.files.refusal import refusal, shown, unreadable
from catseye.verdict import ORDER

FORMAT = "catseye-report-1"
PAGE = "report.html"  # in the directory of a result
DATA = '<script type="application/octet-stream" id="catseye-data">'
SHARED = "shared"  # lists that occur more than once, and the key of a reference to one
MOST = 64 * 1024 * 1024  # bytes of a page, and of its data unpacked
OLDER = re.compile(r"<title>(catseye|Triplet calibration|Structure|Vibration)\b")
STORES = {"table": "tables", "scene": "scenes", "chart": "charts", "drawing": "drawings"}
KINDS = ("number", "text", "long", "hash")
CHARTS = ("scatter", "line", "bars", "histogram", "normal", "map")
GZIP = 16 + zlib.MAX_WBITS


def read_report(path: Path) -> dict[str, Any]:
    """Report of a page, or of the page in a result's directory.

    Raises InputError for a missing or foreign file, one of an older catseye, one that is damaged or too large.
    """
    page = path / PAGE if path.is_dir() else path
    return report_in(_text(page, path), str(page))


def report_in(text: str, page: str) -> dict[str, Any]:
    """Report in the text of a page; InputError as for `read_report`.

    page   name for messages
    """
    start = text.find(DATA)
    if start < 0:
        raise refusal(page, _foreign(text))
    packed = text[start + len(DATA) : max(text.find("</script>", start), start)]
    report = _document(_unpacked(packed, page), page)
    if not isinstance(report, dict) or report.get("format") != FORMAT:
        found = report.get("format") if isinstance(report, dict) else report
        raise refusal(
            page, f"format = {shown(found)} (expected {FORMAT}: use the catseye that wrote it, or run it again)"
        )
    try:
        report = _expanded(report)
        _require_report(report)
    except RecursionError as problem:
        raise refusal(page, "the report's data are nested too deeply (run it again)") from problem
    except _Misshapen as problem:
        raise refusal(page, f"the report's data: {problem} (run it again)") from problem
    return report


def _text(page: Path, path: Path) -> str:
    try:
        if not page.is_file():
            what = f"no {PAGE} in it" if path.is_dir() else "is not a file" if page.exists() else "missing"
            raise refusal(str(path), f"{what} (expected a result's directory with {PAGE}, or such a page)")
        size = page.stat().st_size
        if size > MOST:
            raise refusal(str(page), f"holds {size} bytes (expected at most {MOST})")
        return page.read_text(encoding="utf-8")
    except OSError as problem:
        raise unreadable(str(page), problem) from problem
    except UnicodeDecodeError as problem:
        raise refusal(str(page), "is not UTF-8 text (expected a report of catseye)") from problem


def _foreign(text: str) -> str:
    """Reason why a page without data cannot be read."""
    if OLDER.search(text[:4096]):
        return "has no data: written by catseye before 0.2, or a certificate (run the command again for a report)"
    return "is not a report of catseye (expected one)"


def _unpacked(packed: str, page: str) -> bytes:
    """Data of a page, at most `MOST` bytes."""
    try:
        inflate = zlib.decompressobj(GZIP)
        raw = inflate.decompress(base64.b64decode(packed, validate=True), MOST + 1)
    except (binascii.Error, ValueError, zlib.error) as problem:
        raise refusal(page, "its data are damaged (copy it once more, or run it again)") from problem
    if len(raw) > MOST:
        raise refusal(page, f"its data hold more than {MOST} bytes (expected at most that)")
    if not inflate.eof:
        raise refusal(page, "its data are cut off (copy it once more, or run it again)")
    return raw


def _document(raw: bytes, page: str) -> Any:
    try:
        return json.loads(raw.decode("utf-8"), parse_constant=_no_number)
    except (ValueError, RecursionError) as problem:
        raise refusal(page, "its data are not JSON (run it again)") from problem


def _no_number(text: str) -> Any:
    raise ValueError(f"{text} is no number of JSON")


class _Misshapen(InputError):
    """Part of a report's data that is not as the format says."""


def _require(condition: bool, what: str) -> None:
    if not condition:
        raise _Misshapen(what)


def _expanded(report: Mapping[str, Any]) -> dict[str, Any]:
    """Report with its shared lists in their places."""
    lists = report.get(SHARED, [])
    _require(_is_list(lists, lambda one: isinstance(one, list)), "shared lists are misshapen")
    left = [MOST // 8]  # values of all lists together

    def expanded(part: Any) -> Any:
        if isinstance(part, dict) and part.keys() == {SHARED}:
            place = part[SHARED]
            _require(isinstance(place, int) and 0 <= place < len(lists), f"shared list {shown(place)} is missing")
            left[0] -= len(lists[place])
            _require(left[0] >= 0, f"more than {MOST // 8} values")
            return list(lists[place])
        if isinstance(part, dict):
            return {key: expanded(item) for key, item in part.items()}
        return (
            [expanded(item) for item in part] if isinstance(part, list) and part and isinstance(part[0], dict) else part
        )

    return {key: expanded(item) for key, item in report.items() if key != SHARED}


def _require_report(report: Mapping[str, Any]) -> None:
    """Raise for a report whose parts do not have the format's shapes."""
    _require(all(isinstance(report.get(key), str) for key in ("title", "subtitle")), "title or subtitle is no text")
    verdict = report.get("verdict")
    if verdict is not None:
        _require(_has_texts(verdict, "word", "why") and verdict["word"] in ORDER, "verdict is none")
    for key, names in (("cards", ("name", "value", "remark")), ("passages", ("title", "text"))):
        _require(_is_list(report.get(key), lambda one, names=names: _has_texts(one, *names)), f"{key} are misshapen")
    for store in STORES.values():
        _require(isinstance(report.get(store), dict), f"{store} are missing")
    sections = report.get("sections")
    _require(_is_list(sections, lambda one: _has_texts(one, "id", "title")), "sections are misshapen")
    for section in sections or ():
        _require(_is_list(section.get("blocks"), lambda one: _has_texts(one, "kind")), f"section {section['id']}")
        for block in section["blocks"]:
            _require_block(block, report)
    for name, table in report["tables"].items():
        _require_table(name, table)
    for name, scene in report["scenes"].items():
        _require_scene(name, scene)
    for name, chart in report["charts"].items():
        _require_chart(name, chart)
    _require(all(isinstance(drawing, str) for drawing in report["drawings"].values()), "a drawing is no text")


def _require_block(block: Mapping[str, Any], report: Mapping[str, Any]) -> None:
    kind = block["kind"]
    if kind in ("text", "heading"):
        _require(_has_texts(block, "text"), f"a {kind} is empty")
    elif kind == "list":
        _require(_is_list(block.get("items"), lambda one: isinstance(one, str)), "a list is misshapen")
    else:
        _require(kind in STORES, f"block of kind {shown(kind)}")
        key = block.get(kind)
        _require(isinstance(key, str) and key in report[STORES[kind]], f"{kind} {shown(key)} is missing")


def _require_table(name: str, table: Any) -> None:
    columns = table.get("columns") if isinstance(table, dict) else None
    _require(_is_list(columns, lambda one: _has_texts(one, "key", "label", "unit", "kind")), f"table {name}")
    assert columns is not None
    lengths = set()
    for column in columns:
        where = f"column {column['key']} of table {name}"
        _require(column["kind"] in KINDS, where)
        usual = _is_number if column["kind"] == "number" else lambda one: isinstance(one, str)
        _require(_is_list(column.get("values"), usual), where)
        lengths.add(len(column["values"]))
    _require(len(lengths) <= 1, f"columns of table {name} have different lengths")
    keys = [column["key"] for column in columns]
    _require("name" not in table or table["name"] in keys, f"name of table {name}")


def _require_scene(name: str, scene: Any) -> None:
    where = f"scene {name}"
    _require(isinstance(scene, dict) and isinstance(scene.get("points"), dict), where)
    points, groups = scene["points"], scene.get("groups")
    _require(_has_texts(scene, "frame") and _is_list(groups, lambda one: isinstance(one, str)), where)
    names = points.get("name")
    _require(_is_list(names, lambda one: isinstance(one, str)), where)
    count = len(names)
    covariance = points.get("covariance")
    arrays = [points.get(axis) for axis in "xyz"]
    if covariance is not None:
        _require(isinstance(covariance, dict), where)
        arrays += [covariance.get(pair) for pair in ("xx", "xy", "xz", "yy", "yz", "zz")]
    if scene.get("value") is not None:
        arrays.append(_values(scene["value"], where))
    for array in arrays:
        _require(_is_list(array, _is_number) and len(array or ()) == count, where)
    _require_indices(points.get("group"), len(groups), count, where)
    if scene.get("beams") is not None:
        beams = scene["beams"]
        _require(isinstance(beams, dict) and _is_list(beams.get("value"), _is_number), where)
        for end in ("from", "to"):
            _require_indices(beams.get(end), count, len(beams["value"]), where)


def _require_chart(name: str, chart: Any) -> None:
    where = f"chart {name}"
    _require(isinstance(chart, dict) and chart.get("type") in CHARTS, where)
    axes = [axis for axis in (chart.get("x"), chart.get("y")) if axis is not None]
    _require(bool(axes) and all(_has_texts(axis, "label", "unit") for axis in axes), where)
    arrays = [_values(axis, where) for axis in axes]
    arrays += [chart[key] for key in ("u", "group") if chart.get(key) is not None]
    if chart.get("value") is not None:
        arrays.append(_values(chart["value"], where))
    _require(all(_is_list(array, _is_number) for array in arrays), where)
    _require(len({len(array) for array in arrays}) == 1, f"{where} has arrays of different lengths")
    names = chart.get("name")
    valid = names is None or (_is_list(names, lambda one: isinstance(one, str)) and len(names) == len(arrays[0]))
    _require(valid, f"names of {where}")


def _values(part: Any, where: str) -> Any:
    _require(isinstance(part, dict) and isinstance(part.get("values"), list), where)
    return part["values"]


def _require_indices(rows: Any, limit: int, count: int, where: str) -> None:
    """Raise unless there are `count` whole numbers from 0 below the limit."""
    valid = _is_list(rows, lambda k: isinstance(k, int) and not isinstance(k, bool) and 0 <= k < limit)
    _require(valid and len(rows) == count, where)


def _is_list(values: Any, valid: Any) -> bool:
    return isinstance(values, list) and all(map(valid, values))


def _is_number(value: Any) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))


def _has_texts(one: Any, *keys: str) -> bool:
    return isinstance(one, dict) and all(isinstance(one.get(key), str) for key in keys)
