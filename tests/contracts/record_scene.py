"""Tables of keys on the pages of docs/formats, and the records that they describe.

A page holds `<!-- record: records.site.beam.Laser -->`, and beneath it the table: key, value (type, unit, range),
default, meaning. Meanings are the aligned block of the class's docstring. Keys that a class has from another one stand
in the other's table; after `all` of the marker they are listed here too. `columns` heads the first column "column",
for rows of a CSV file.

`PYTHONPATH=src:tests:docs/extensions python tests/contracts/record_scene.py` writes the pages anew.
"""

import datetime
import inspect
import math
import re
import sys
import types
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib import import_module
from itertools import groupby
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
from pydantic import AwareDatetime
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from aligned import paragraphs, rows, split_names
from catseye.records.files.record import NAME, Length, Record, Version, Within
from contracts.table_scene import PAGES

MARKER = re.compile(r"<!-- record: ([\w.]+)(?: \w+)* -->")
UNITS = {  # end of a key -> unit; the longest end counts
    "mjd_utc": "MJD, UTC", "_mm": "mm", "_mm2": "mm²", "_m": "m", "_um": "µm", "_rad": "rad", "_urad": "µrad",
    "_deg": "°", "_arcsec": "″", "_arcsec2": "″²", "_arcmin": "′", "_c": "°C", "_hpa": "hPa", "_mb": "mb",
    "_percent": "%", "_pct": "%", "_volt": "V", "_hz": "Hz", "_s": "s", "_ms": "ms", "_us": "µs", "_counts": "counts",
    "_ppm": "ppm", "_mw": "mW", "_ohm": "Ω", "_pf": "pF", "_n": "N", "_n_per_m": "N/m", "_m_per_s": "m/s",
    "_per_s": "1/s", "_km_s": "km/s", "_mas": "mas", "_ppm_per_c": "ppm/°C", "_um_per_c": "µm/°C", "_deg_s": "°/s",
    "_mrad_per_sqrt_hour": "mrad/√h", "_mrad_per_root_hour": "mrad/√h", "_rad_per_sqrt_hour": "rad/√h",
    "_mm_per_sqrt_hour": "mm/√h", "_per_volt": "1/V", "_volt_per_rad": "V/rad", "_arcsec_per_mm_x": "″/mm",
    "_arcsec_per_mm_y": "″/mm",
    "_count": "counts",
}  # fmt: skip
TYPES = {float: "number", int: "integer", str: "text", bool: "true or false", dict: "table", Any: "any"}
DATES = {datetime.date: "date", datetime.time: "time of day", datetime.datetime: "date and time"}
GREEK = {"Theta": "Θ", "Phi": "Φ", "psi": "ψ"}


@dataclass(frozen=True)
class Key:
    """Key of a file, as its reference has it.

    value    type, unit and range, as Markdown
    default  "needed", "may be missing", or the value
    meaning  empty where nothing describes it
    """

    name: str
    value: str
    default: str
    meaning: str


def record_named(path: str) -> type[Record]:
    """Record of a path in the package, such as `records.site.monument.MonumentGeometry`."""
    module, _, name = path.rpartition(".")
    record = getattr(import_module(f"catseye.{module}"), name, None)
    if not (inspect.isclass(record) and issubclass(record, Record)):
        raise ValueError(f"catseye.{path} is not a record")
    return record


def own_fields(record: type[Record]) -> list[str]:
    """Keys that a record has and no record above it."""
    inherited = {name for base in record.__mro__[1:] for name in getattr(base, "model_fields", {})}
    return [name for name in record.model_fields if name not in inherited]


def above(record: type[Record]) -> list[type[Record]]:
    """Records from which a record has further keys, the nearest first."""
    return [base for base in record.__mro__[1:] if issubclass(base, Record) and own_fields(base)]


def keys_of(record: type[Record], names: Iterable[str]) -> list[Key]:
    """Reference of some keys of a record."""
    described: dict[str, str] = {}
    for base in reversed(record.__mro__):
        if issubclass(base, Record):
            described.update(meanings(base))
    return [_key(record, name, described) for name in names]


def _key(record: type[Record], name: str, described: dict[str, str]) -> Key:
    field = record.model_fields[name]
    meaning = described.get(name, "")
    if not meaning and name == "format":
        meaning = "format of the file and its version"
    if not meaning and name.startswith("u_") and name[2:] in described:
        meaning = f"standard uncertainty of `{name[2:]}`"
    elif meaning and name.startswith("u_"):
        partners = [key for key, text in described.items() if text == meaning and not key.startswith("u_")]
        if partners:
            keys = [name[2:]] if name[2:] in partners else partners
            meaning = f"standard uncertainty of {' and '.join(f'`{key}`' for key in keys)}"
        elif not re.search("uncertaint|scatter|repeatab|resolution|drift", meaning):
            meaning = f"standard uncertainty{'' if meaning.startswith('of ') else ':'} {meaning}"
    return Key(name, _value(name, field), _default(field), meaning)


def meanings(record: type) -> dict[str, str]:
    """Text of each key in the aligned block of a docstring, as Markdown."""
    texts: dict[str, str] = {}
    for paragraph in paragraphs(inspect.cleandoc(record.__doc__ or "").splitlines()[1:]):
        for start in range(len(paragraph)):
            try:
                pairs = rows(paragraph[start:])
            except IndexError:  # prose before the block
                continue
            for key, text in pairs:
                texts |= {name: marked(text, record) for name in split_names(key) if name not in texts}
            break
    return texts


def marked(text: str, record: type) -> str:
    """Text of a docstring as Markdown: keys as code, symbols as they are printed."""
    text = re.sub(r"\s+", " ", text)
    text = re.sub(r" \([\d., \[\]]+\)$", "", text)  # a default, which has its column
    text = re.sub(r'"([\w.-]+)"', r"`\1`", text)
    pieces = re.split(r"(`[^`]+`)", text)
    return "".join(piece if piece.startswith("`") else _plain(piece, record) for piece in pieces)


def _plain(text: str, record: type) -> str:
    fields = getattr(record, "model_fields", {})
    text = re.sub(r"\b([xyz])\^(?!\d)", lambda match: match[1] + "\u0302", text)
    text = text.replace("^2", "²").replace("1/e²", "1/e²")
    text = re.sub(r"\b(Theta|Phi|psi)\b", lambda match: GREEK[match[1]], text)
    text = re.sub(r"\bpi - ", "π − ", text)
    text = re.sub(r"(?<![\w-])-(?=\d)", "−", text)
    words = re.split(r"(\b[a-z]\w*_\w+\b)", text)
    return "".join(
        f"`{word}`" if k % 2 and (word in fields or "_" in word) else re.sub(r"([*<>$|\[\]])", r"\\\1", word)
        for k, word in enumerate(words)
    )


def unit_of(name: str) -> str:
    """Unit of a key by its end; "" for none."""
    ends = [end for end in UNITS if name.endswith(end)]
    return UNITS[max(ends, key=len)] if ends else ""


def _value(name: str, field: FieldInfo) -> str:
    kinds, ranges = [], []
    for kind, limits in _kinds(field.annotation, (*field.metadata, field)):
        kinds.append(kind)
        ranges += limits
    kinds, ranges = list(dict.fromkeys(kinds)), list(dict.fromkeys(ranges))
    if "number" in kinds and "integer" in kinds:
        kinds.remove("integer")
    unit = unit_of(name)
    if unit and kinds in (["number"], ["integer"]):
        kinds = [unit if kinds == ["number"] else f"{unit}, integer"]
    elif unit and "number" in " ".join(kinds):
        kinds = [f"{' or '.join(kinds)}, {unit}"]
    return "; ".join([" or ".join(kinds), *ranges])


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "needed"
    value = field.get_default(call_default_factory=True)
    if value is None or value is PydanticUndefined or value == () or isinstance(value, Record):
        return "may be missing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return ", ".join(_number(each) if isinstance(each, int | float) else f"`{each}`" for each in value)
    return _number(value) if isinstance(value, int | float) else f"`{value}`" if value != "" else "empty"


def _number(value: float) -> str:
    if abs(value) == 2.0 * math.pi:
        return f"{'−' if value < 0 else ''}2π"
    text = str(value) if isinstance(value, int) and abs(value) < 1e10 else f"{value:.7g}"
    return re.sub(r"e([+-])0?(\d+)", lambda match: f"e{match[1].strip('+')}{match[2]}", text).replace("-", "−")


def _kinds(annotation: Any, metadata: tuple[Any, ...]) -> Iterator[tuple[str, list[str]]]:
    """Types of a value as words, each with its limits; None is left out."""
    origin, inner = get_origin(annotation), get_args(annotation)
    version = next((each for each in metadata if isinstance(each, Version)), None)
    if version is not None:
        numbered = int in inner or annotation is int
        yield (f"1 or `catseye-{version.kind}-1`" if numbered else f"`catseye-{version.kind}-1`"), []
    elif annotation is AwareDatetime:
        yield "date and time with offset", []
    elif origin is Annotated:
        yield from _kinds(inner[0], (*inner[1:], *metadata))
    elif origin in (Union, types.UnionType):
        for each in inner:
            if each is not type(None):
                yield from _kinds(each, metadata)
    elif origin is Literal:
        words = [f"`{each}`" for each in inner]
        yield (" or ".join(words) if len(words) < 3 else f"{', '.join(words[:-1])} or {words[-1]}"), []
    elif origin is tuple:
        yield _tuple(inner), _limits(metadata, "length ")
    elif inspect.isclass(annotation) and issubclass(annotation, Record):
        yield f"[table](#{anchor(annotation)})", []
    elif inspect.isclass(annotation) and issubclass(annotation, datetime.datetime):
        yield "date and time with offset", []
    else:
        kind = TYPES.get(origin or annotation) or DATES.get(annotation) or str(annotation)
        if kind == "text" and any(isinstance(each, FieldInfo) and _is_name(each) for each in metadata):
            kind = "name"
        yield kind, _limits(metadata, "")


def _is_name(field: FieldInfo) -> bool:
    extra = field.json_schema_extra
    return isinstance(extra, dict) and NAME.pattern in str(extra.get("pattern", ""))


def _tuple(inner: tuple[Any, ...]) -> str:
    """Words for a list: of how many, and of what."""
    kind, limits = next(iter(_kinds(inner[0], ())))
    between = f", each {'; '.join(limits)}" if limits else ""
    if "table](" in kind:
        return kind.replace("[table]", "[tables]")
    if kind.startswith("list of "):
        return kind.replace("list of", "list of lists of", 1) + between
    several = {"number": "numbers", "integer": "integers", "text": "texts", "name": "names"}.get(kind, kind)
    return (f"list of {several}" if inner[-1] is Ellipsis else f"{len(inner)} {several}") + between


def _limits(metadata: tuple[Any, ...], what: str) -> list[str]:
    """Ranges of a number or of a vector's length as words."""
    said = []
    for each in metadata:
        if isinstance(each, Within):
            said.append(f"{'above ' if each.above else ''}{_number(each.low)} to {_number(each.high)}")
        elif isinstance(each, Length):
            said.append(f"{what}{'0 or ' if each.or_zero else ''}{_number(each.low)} to {_number(each.high)}")
        elif isinstance(each, FieldInfo):
            said += _limits(tuple(each.metadata), what)
        elif isinstance(each, annotated_types.Ge):
            said.append(f"{each.ge} or more")
        elif isinstance(each, annotated_types.Gt):
            said.append(f"above {each.gt}")
        elif hasattr(each, "low") and hasattr(each, "high"):  # a range with other units to suspect
            said.append(f"{_number(each.low)} to {_number(each.high)}")
    return said


def anchor(record: type[Record]) -> str:
    """Name of a record's target on its page."""
    return f"record-{record.__name__.lower()}"


def table(record: type[Record], *, every: bool = False, columns: bool = False) -> str:
    """Reference of a record as Markdown: label, table, and where further keys are."""
    names = list(record.model_fields) if every else own_fields(record)
    labelled = [record, *(base for base in above(record) if every and base.__module__ == record.__module__)]
    lines = [
        *(f"({anchor(each)})=" for each in labelled),
        "",
        f"| {'column' if columns else 'key'} | value | default | meaning |",
    ]
    lines.append("|---|---|---|---|")
    for cells, group in groupby(keys_of(record, names), lambda key: (key.value, key.default, key.meaning)):
        lines.append(f"| {', '.join(f'`{key.name}`' for key in group)} | {' | '.join(cells)} |")
    further = [] if every else [base for base in above(record) if base.__name__ != "Record"]
    if further:
        links = ", ".join(f"[{title(base)}](#{anchor(base)})" for base in further)
        lines += ["", f"Further keys: {links}."]
    return "".join(f"{line}\n" for line in lines)


def title(record: type[Record]) -> str:
    """First line of a record's docstring, as the text of a link."""
    first = re.split(r"[;:.](?: |$)", re.sub(r"^\[+\w+\]+: ", "", (record.__doc__ or "").splitlines()[0]))[0]
    return first[:1].lower() + first[1:] if first[1:2].islower() else first


def described(page: str) -> Iterator[tuple[type[Record], bool, str, tuple[int, int]]]:
    """Records of a page's markers, whether with every key, their tables as they stand, and where."""
    lines = page.splitlines(keepends=True)
    for first, line in enumerate(lines):
        if match := MARKER.match(line):
            end = first + 1
            while end < len(lines) and lines[end].startswith("(record-"):
                end += 1
            if end > first + 1:
                end += 1
                while end < len(lines) and lines[end].startswith("|"):
                    end += 1
                if "".join(lines[end : end + 2]).startswith("\nFurther keys: "):
                    end += 2
            yield record_named(match[1]), "all" in line, "".join(lines[first + 1 : end]), (first + 1, end)


def rewritten(page: str) -> str:
    """Page with the table of each of its records as the record has it."""
    lines = page.splitlines(keepends=True)
    for record, every, _, (first, end) in reversed(list(described(page))):
        columns = "columns" in lines[first - 1]
        lines[first:end] = table(record, every=every, columns=columns).splitlines(keepends=True)
    return "".join(lines)


if __name__ == "__main__":
    for path in sorted(PAGES.glob("*.md")):
        page = path.read_text(encoding="utf-8")
        if (new := rewritten(page)) != page:
            path.write_text(new, encoding="utf-8")
            sys.stdout.write(f"{path}: written\n")
