"""Template of a calibration: table with its header, and sheet with every key, to fill in."""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from catseye.records.files.readings import LEFT_OUT, TIME, Sheet
from catseye.records.files.record import Within
from catseye.reduction.calibrations.kind import CalibrationKind

MARK = "# template of catseye calibrate"  # identifies a sheet that may be replaced
OF_EVERY_TABLE = (TIME, LEFT_OUT)
UNITS = (  # ending of a column or key -> its unit in words
    ("_arcsec", "arcsec"), ("_mrad2", "mrad²"), ("_rad", "rad"), ("_deg", "degrees"), ("_counts", "encoder counts"),
    ("_mm", "mm"), ("_um", "µm"), ("_ppm", "ppm"), ("_ppm_per_c", "ppm/°C"), ("_volt", "V"), ("_c", "°C"),
    ("_hpa", "hPa"), ("_percent", "%"), ("_hz", "Hz"), ("_utc", "days, Modified Julian Date, UTC"), ("_s", "s"),
    ("_m", "m"), ("_share", "share of one"), ("_n", "N"), ("_n_per_m", "N/m"),
    ("_volt_per_rad", "V/rad"), ("_per_volt", "1/V"), ("_km_s", "km/s"), ("_mas", "mas"), ("_mm2", "mm²"),
    ("_mm_per_sqrt_hour", "mm/√h"), ("_rad_per_sqrt_hour", "rad/√h"),
)  # fmt: skip
ENTRY = re.compile(r"(?P<keys>[a-z0-9_]+(?:, [a-z0-9_]+)*) {2,}(?P<text>\S.*)")
PROVENANCE = {  # what a laboratory changes in any sheet
    "instrument": '"ZP103"',
    "serial": '"103"',
    "measured_on": "2026-09-01",
    "valid_until": "2028-09-01",
    "by": '"name"',
    "report": '"number of the report"',
}


def template_table(kind: CalibrationKind) -> str:
    """Table without readings: its header, the needed columns first.

    kind   of calibration
    """
    return ",".join(_columns(kind)) + "\n"


def _columns(kind: CalibrationKind) -> dict[str, Within | None]:
    """Bounds of each column of a table, once each, needed ones first: some kinds need what others may have."""
    own = {**kind.layout.required, **kind.layout.optional}
    return {**own, **{column: None for column in OF_EVERY_TABLE if column not in own}}


def template_sheet(name: str, kind: CalibrationKind, example: tuple[str, ...]) -> str:
    """Sheet to fill in: provenance, every key as a comment with unit, bounds and meaning; columns of the table.

    name      of the kind
    kind      of calibration
    example   header and first rows of the kind's example
    """
    layout = kind.layout
    schema = layout.sheet.model_json_schema()
    lines = [
        f"{MARK} {name}",
        f"# {kind.about}",
        "#",
        f"# Columns of the table; delete optional ones that were not read, and {TIME} and {LEFT_OUT} where not needed:",
    ]
    for column, bounds in _columns(kind).items():
        need = "needed" if column in layout.required else "optional"
        lines.append(f"#   {column}: {_described(column, bounds)}{need}")
    lines += ["#", "# Example:", *(f"#   {row}" for row in example), "", f'kind = "{name}"']
    lines += [f"# {key} = {value}" for key, value in PROVENANCE.items()]
    lines += ["", "# Remove the # before each key that is known; those that are needed have no default:"]
    tables: list[str] = []
    meanings = _meanings(layout.sheet)
    for key, entry in schema["properties"].items():
        if key in Sheet.model_fields:
            continue
        inner = _table_of(entry, schema)
        if inner is None:
            lines.append(f"# {key} = {_value(key, entry)}  # {_remark(key, entry, schema, meanings)}")
        else:
            tables += ["", f"# [[{key}]]  # {meanings.get(key, '')}".rstrip(" #")]
            tables += [
                f"# {inside} = {_value(inside, part)}  # {_remark(inside, part, inner, {})}"
                for inside, part in inner["properties"].items()
            ]
    return "\n".join([*lines, *tables]) + "\n"


def _described(name: str, bounds: Within | None) -> str:
    """Unit and bounds of a column, each with a comma behind it."""
    unit = _unit(name)
    span = "" if bounds is None else f"{'above ' if bounds.above else ''}{bounds.low:g} to {bounds.high:g}, "
    return f"{unit}, {span}" if unit else span


def _unit(name: str) -> str:
    endings = [(ending, unit) for ending, unit in UNITS if name.endswith(ending)]
    return max(endings, key=lambda pair: len(pair[0]))[1] if endings else ""


def _meanings(sheet: type) -> dict[str, str]:
    """Meaning of each key of a sheet, from its description."""
    meanings: dict[str, str] = {}
    keys: list[str] = []
    for base in reversed(sheet.__mro__):
        for line in (base.__doc__ or "").splitlines():
            entry = ENTRY.fullmatch(line.strip())
            if entry is not None:
                keys = entry["keys"].split(", ")
                meanings |= dict.fromkeys(keys, entry["text"])
            elif keys and line.startswith(" " * 8) and line.strip():
                meanings |= {key: f"{meanings[key]} {line.strip()}" for key in keys}
            else:
                keys = []
    return meanings


def _variants(entry: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Types that a key may have, without none."""
    yield from (part for part in entry.get("anyOf", [entry]) if part.get("type") != "null")


def _table_of(entry: Mapping[str, Any], schema: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Schema of the tables of a key; None for a key with a value."""
    for part in _variants(entry):
        name = part.get("$ref") or part.get("items", {}).get("$ref")
        if name is not None and "properties" in (inner := schema["$defs"][name.rpartition("/")[2]]):
            return {"$defs": schema["$defs"], **inner}
    return None


def _value(key: str, entry: Mapping[str, Any]) -> str:
    """Value of a key as it may be written: its default, else a word for its type."""
    default = entry.get("default")
    if isinstance(default, bool) or default is None or default == []:
        kinds = {part.get("type") for part in _variants(entry)}
        if "array" in kinds:
            return "[]"
        if kinds == {"boolean"}:
            return "true" if default is True else "false"
        if kinds == {"integer"}:
            return "0"
        if any(part.get("format") == "date" for part in _variants(entry)):
            return "2026-09-01"
        return '""' if kinds <= {"string"} or key == "name" else "0.0"
    return f'"{default}"' if isinstance(default, str) else f"{default}"


def _remark(key: str, entry: Mapping[str, Any], schema: Mapping[str, Any], meanings: Mapping[str, str]) -> str:
    """Need, unit, bounds and meaning of a key."""
    need = "needed" if key in schema.get("required", ()) else "optional"
    words = [need]
    if unit := _unit(key):
        words.append(unit)
    for part in _variants(entry):
        if "enum" in part:
            words.append("one of " + ", ".join(str(word) for word in part["enum"]))
        low, high = (part.get("minimum", part.get("exclusiveMinimum")), part.get("maximum"))
        if low is not None and high is not None:
            words.append(f"{'above ' if 'exclusiveMinimum' in part else ''}{low:g} to {high:g}")
    meaning = meanings.get(key, "")
    if key.startswith("u_") and meaning.startswith("of "):
        meaning = f"standard uncertainty {meaning}"
    elif key.startswith("u_") and meaning and meaning == meanings.get(key[2:]):
        meaning = f"standard uncertainty of {key[2:]}"
    return ", ".join(words) + (f": {meaning}" if meaning else "")
