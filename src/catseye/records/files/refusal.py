"""Error messages: one line with file, place, value and expectation, and a guess at the unit."""

import difflib
import math
import re
from datetime import date
from typing import TYPE_CHECKING, Any

from catseye.constants import DEGREE, ZERO_CELSIUS_K
from catseye.errors import InputError

if TYPE_CHECKING:  # pydantic takes 0.1 s, and readers of an archive refuse without it
    from pydantic import ValidationError

    from catseye.records.files.record import Record

MANY = 20  # other invalid keys above which rows of a table are merged
LONGEST_VALUE = 60  # characters of an invalid value in a message
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?")

# A value that factor and shift bring into its range was probably given in another unit.
OTHER_UNITS = (
    ("_mm", 1e3, 0.0, "metres"),
    ("_m", 1e-3, 0.0, "millimetres"),
    ("_mm", 25.4, 0.0, "inches"),
    ("_mm", 304.8, 0.0, "feet"),
    ("_rad", DEGREE, 0.0, "degrees"),
    ("_c", 1.0, -ZERO_CELSIUS_K, "kelvin"),
    ("_c", 5.0 / 9.0, -160.0 / 9.0, "degrees Fahrenheit"),
    ("_mb", 1e-2, 0.0, "pascals"),
    ("_mb", 10.0, 0.0, "kilopascals"),
    ("_mb", 1.333224, 0.0, "mmHg"),
    ("_mb", 33.86389, 0.0, "inches of mercury"),
    ("_um", 1e-3, 0.0, "nanometres"),
    ("_volt", 1e-3, 0.0, "millivolts"),
    ("_hz", 1e6, 0.0, "megahertz"),
    ("_hz", 1e9, 0.0, "gigahertz"),
)
EXPECTED = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "string_type": "text",
    "string_too_short": "some text",
    "tuple_type": "a list",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "date_type": "a date",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
}


def refusal(file: str, problem: str) -> InputError:
    """Error with a one-line text, whatever names it contains."""
    text = f"{file}: {problem}"
    return InputError("".join(c if c.isprintable() else ascii(c)[1:-1] for c in text))


def unreadable(file: str, problem: OSError) -> InputError:
    return refusal(file, f"cannot be read: {problem.strerror or problem}")


def shown(value: object) -> str:
    """Value as repeated in a message: on one line, shortened.

    >>> shown("two\\nlines")
    "'two\\\\nlines'"
    """
    if isinstance(value, date):
        return value.isoformat()
    try:
        text = repr(value)
    except ValueError:  # an integer of thousands of digits, which Python does not print
        return "a number of thousands of digits"
    except RecursionError:
        return "a deeply nested value"
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}... ({len(text)} characters)"


def explained(problem: "ValidationError", document: dict[str, Any], kind: "type[Record]") -> str:
    """First validation error in words, and the names of all other invalid keys.

    An unknown version comes first; an unknown key comes before a missing one, which it may explain.
    """
    errors = problem.errors(include_url=False)
    version = [error for error in errors if error["type"] == "version"]
    if version:
        errors = version
    errors = sorted(errors, key=lambda error: error["type"] != "extra_forbidden")
    first = errors[0]
    place, key, parent = placed(first["loc"], document)
    text = f"{place}{worded(first, key, parent, kind)}"
    further = dict.fromkeys(placed(error["loc"], document)[0] or error["type"] for error in errors[1:])
    further.pop(place, None)
    if len(further) > MANY:  # one key of many rows is named once
        further = dict.fromkeys(re.sub(r"\[[^]]*\]", "[...]", name) for name in further)
    return f"{text}; also invalid or missing: {', '.join(further)}" if further else text


def placed(loc: tuple[int | str, ...], document: Any) -> tuple[str, str, Any]:
    """Path of a place in a document, its last key, and the table or cell that contains it."""
    path, key = "", ""
    for step in loc:
        if isinstance(document, list) and isinstance(step, int):
            document = document[step] if step < len(document) else None
            name = document.get("name") if isinstance(document, dict) else None
            path += f"[{shown(name)}]" if isinstance(name, str) else f"[{step}]"
        elif isinstance(document, dict):
            document, key = document.get(str(step)), str(step)
            word = key if re.fullmatch(r"[A-Za-z0-9_-]{1,60}", key) else shown(key)
            path += f".{word}" if path else word
        else:
            break
    return path, key, document


def worded(error: Any, key: str, parent: Any, kind: "type[Record]") -> str:
    """Description of an invalid value and of the expected one."""
    name, context, value = error["type"], error.get("ctx", {}), error["input"]
    if name == "missing":
        return " is missing (expected a value)"
    if name == "rule":
        return f": {context['text']}" if error["loc"] else context["text"]
    cell = isinstance(parent, str) and isinstance(value, int | float)
    written = f" = {parent if cell and NUMBER.fullmatch(parent) else shown(value)}"
    if name == "extra_forbidden":
        keys = all_keys(kind)
        close = difflib.get_close_matches(key[:LONGEST_VALUE], keys, n=1)
        hint = f"perhaps {close[0]}" if close else "no such key"
        return f"{written} is not a known key (expected {'in another table' if key in keys else hint})"
    if name in ("range", "length"):
        size = f" has the length {context['size']:.6g}" if name == "length" else ""
        return f"{written}{size}{other_unit(key, context)} ({error['msg']})"
    if name in EXPECTED:
        return f"{written} (expected {EXPECTED[name]})"
    if name == "literal_error":
        return f"{written} (expected {context['expected']})"
    if name in ("too_long", "too_short"):
        limit = context.get("max_length", context.get("min_length"))
        return f"{written} has {context['actual_length']} values (expected {limit})"
    message = error["msg"]
    return f"{written} ({message if message.startswith('expected') else f'expected: {message}'})"


def other_unit(key: str, context: dict[str, Any]) -> str:
    """Guess at a value out of range, such as ' looks like metres', or ""."""
    if context["high"] < 0 <= -context["high"] <= context["size"] <= -context["low"]:
        return " has the wrong sign"
    if context["size"] == 0.0:
        return ""
    for suffix, factor, shift, unit in OTHER_UNITS:
        size = context["size"] * factor + shift
        if key.endswith(suffix) and math.isfinite(size) and context["low"] <= size <= context["high"]:
            return f" looks like {unit}"
    return ""


def all_keys(kind: Any) -> list[str]:
    """Keys allowed in a kind of file, at any depth."""
    schema = kind.model_json_schema()
    tables = [schema, *schema.get("$defs", {}).values()]
    return sorted({key for table in tables for key in table.get("properties", {})})


def in_row(file: str, row: int, problem: str) -> InputError:
    return refusal(file, f"row {row}, {problem}")
