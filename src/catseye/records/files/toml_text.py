"""Records and values as TOML text, exact when read back."""

import json
from datetime import date
from typing import Any

from catseye.records.files.record import Record


def record_toml(record: Record) -> str:
    """Record as TOML, keys in the order of definition; defaults are omitted."""
    return "\n".join(_table(record.model_dump(exclude_defaults=True), "")).strip("\n") + "\n"


def _table(values: dict[str, Any], place: str) -> list[str]:
    """Lines of a table: its own keys first, as TOML requires, then subtables."""
    inner = {key: value for key, value in values.items() if isinstance(value, dict) or _is_tables(value)}
    lines = [f"{key} = {toml_value(value)}" for key, value in values.items() if key not in inner]
    for key, value in inner.items():
        name = f"{place}{key}"
        for table in [value] if isinstance(value, dict) else value:
            lines += ["", f"[{name}]" if isinstance(value, dict) else f"[[{name}]]", *_table(table, f"{name}.")]
    return lines


def _is_tables(value: Any) -> bool:
    return isinstance(value, tuple) and bool(value) and isinstance(value[0], dict)


def toml_value(value: Any) -> str:
    """Value in TOML syntax.

    >>> toml_value((1.5, 2, "x"))
    '[1.5, 2, "x"]'
    """
    if isinstance(value, tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, str):  # JSON and TOML basic strings differ in one character
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return value.isoformat() if isinstance(value, date) else repr(value)
