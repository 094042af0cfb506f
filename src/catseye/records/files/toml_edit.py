"""Values of a TOML text changed in place: other keys, comments and their order stay."""

import re
import tomllib
from collections.abc import Mapping
from typing import Any

from catseye.records.files.refusal import refusal
from catseye.records.files.toml_text import toml_value

HEADER = re.compile(r"\s*\[(?P<name>[A-Za-z0-9_-]+)\]\s*(#.*)?$")
ANY_HEADER = re.compile(r"\s*\[")
Place = tuple[str, str]  # table, "" for the top; key


def edited_toml(text: str, values: Mapping[Place, Any], file: str) -> str:
    """Text with other values; a missing key comes last in its table, a missing table last in the text.

    text     valid TOML
    values   (table, key) -> value; None removes the key
    file     name, for the refusal

    Raises InputError where a key is written so that it cannot be changed in place, such as in an inline table.

    >>> print(edited_toml('a = 1  # one\\n[b]\\nc = 2\\n', {("", "a"): 1.5, ("b", "d"): "x"}, "f"), end="")
    a = 1.5  # one
    [b]
    c = 2
    d = "x"
    """
    lines = text.replace("\r\n", "\n").removesuffix("\n").split("\n")
    for (table, key), value in values.items():
        lines = _with_value(lines, table, key, value)
    changed = "\n".join(lines) + "\n"
    _require_read_back(changed, values, file)
    return changed


def _with_value(lines: list[str], table: str, key: str, value: Any) -> list[str]:
    """Lines with one key's value changed, added or removed."""
    bounds = _lines_of(lines, table)
    if bounds is None:
        return lines if value is None else [*lines, "", f"[{table}]", f"{key} = {toml_value(value)}"]
    first, last = bounds
    for at in range(first, last):
        written = re.match(rf"\s*(?:{re.escape(key)}|\"{re.escape(key)}\")\s*=", lines[at])
        if written is None:
            continue
        end = _end_of_value(lines, at, last)
        if value is None:
            return [*lines[:at], *lines[end + 1 :]]
        return [*lines[:at], f"{key} = {toml_value(value)}{_comment(lines[at : end + 1])}", *lines[end + 1 :]]
    if value is None:
        return lines
    while last > first and not lines[last - 1].strip():
        last -= 1
    return [*lines[:last], f"{key} = {toml_value(value)}", *lines[last:]]


def _lines_of(lines: list[str], table: str) -> tuple[int, int] | None:
    """First line of a table after its header, and the next one's; None without such a table."""
    headers = [number for number, line in enumerate(lines) if ANY_HEADER.match(line)]
    if not table:
        return 0, headers[0] if headers else len(lines)
    for number in headers:
        named = HEADER.match(lines[number])
        if named is not None and named["name"] == table:
            return number + 1, next((later for later in headers if later > number), len(lines))
    return None


def _end_of_value(lines: list[str], at: int, last: int) -> int:
    """Last line of a value that begins in a line: that with which the text is TOML."""
    for end in range(at, last):
        if _is_toml("\n".join(lines[at : end + 1])):
            return end
    return at


def _comment(lines: list[str]) -> str:
    """Comment behind a value, with the blanks before it; empty without one."""
    text = "\n".join(lines)
    for mark in (match.start() for match in re.finditer("#", text)):
        if _is_toml(text[:mark]):
            return text[len(text[:mark].rstrip()) :]
    return ""


def _is_toml(text: str) -> bool:
    try:
        tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return False
    return True


def _require_read_back(text: str, values: Mapping[Place, Any], file: str) -> None:
    """Raise InputError unless the text has each of the values."""
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise refusal(file, f"cannot be changed in place: {problem} (expected a key a line)") from problem
    for (table, key), value in values.items():
        written = (document.get(table) or {}).get(key) if table else document.get(key)
        if written != (list(value) if isinstance(value, tuple) else value):
            where = f"{table}.{key}" if table else key
            raise refusal(file, f"{where} cannot be changed in place (expected it in a line of its own)")
