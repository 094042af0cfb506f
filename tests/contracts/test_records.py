"""Every record that a person can write in a file is on a page of docs/formats, with every key and its meaning."""

import inspect
import re
from collections import Counter

import pytest

from catseye.records.files.record import Record
from contracts.record_scene import PAGES, Key, described, keys_of, own_fields, record_named, rewritten, table
from contracts.table_scene import modules, tables

ANEW = "`PYTHONPATH=src:tests:docs/extensions python tests/contracts/record_scene.py` writes it"
PAGE_TEXTS = {path.name: path.read_text(encoding="utf-8") for path in sorted(PAGES.glob("*.md"))}
SHOWN = [(name, *shown) for name, page in PAGE_TEXTS.items() for shown in described(page)]


def records():
    """Every record of the package that has keys, each once."""
    found = {
        value
        for module in modules("records", "reduction")
        for value in vars(module).values()
        if inspect.isclass(value) and issubclass(value, Record) and value.__module__ == module.__name__
    }
    return sorted((record for record in found if record.model_fields), key=lambda record: record.__qualname__)


def on_a_page(record):
    """True where a page has all keys of a record: in its own table, in a subclass's, or as written columns."""
    own = {shown for _, shown, *_ in SHOWN}
    if record in own:
        return True
    if any(every and issubclass(shown, record) for _, shown, every, *_ in SHOWN):
        return True
    file = re.match(r"Row of ([a-z_]+\.csv)\b", record.__doc__ or "")
    columns = {column.name for each in tables() if file and each.file == file[1] for column in each.columns}
    return set(record.model_fields) <= columns


@pytest.mark.parametrize("record", records(), ids=lambda record: record.__name__)
def test_every_record_is_on_a_page(record):
    assert on_a_page(record), "put `<!-- record: ... -->` on its page of docs/formats; " + ANEW


@pytest.mark.parametrize("record", records(), ids=lambda record: record.__name__)
def test_every_key_has_a_meaning(record):
    """A line of the aligned block in the docstring of its class, or of one above it."""
    assert [key.name for key in keys_of(record, record.model_fields) if len(key.meaning) < 4] == []


@pytest.mark.parametrize(
    ("page", "record"), [shown[:2] for shown in SHOWN], ids=lambda each: getattr(each, "__name__", each)
)
def test_a_table_is_as_its_record(page, record):
    text = PAGE_TEXTS[page]
    assert rewritten(text) == text, f"docs/formats/{page}: {ANEW}"


def test_each_record_has_one_table_and_keys_stand_in_it_once():
    assert len(SHOWN) >= 90
    assert max(Counter(record for _, record, *_ in SHOWN).values()) == 1
    for _, record, every, shown, _ in SHOWN:
        named = re.findall(
            r"`(\w+)`", "".join(line.split(" | ")[0] for line in shown.splitlines() if line[:3] == "| `")
        )
        assert named == (list(record.model_fields) if every else own_fields(record)), record


def test_links_go_to_tables_that_are_there():
    labels = set(re.findall(r"^\((record-\w+)\)=$", "".join(PAGE_TEXTS.values()), re.MULTILINE))
    assert set(re.findall(r"\(#(record-\w+)\)", "".join(PAGE_TEXTS.values()))) <= labels


def test_units_ranges_and_defaults_are_those_of_the_fields():
    keys = {
        key.name: key
        for key in keys_of(
            record_named("records.site.mirror.Mirror"), ["d0_mm", "beam_x_mm", "u_d0_mm", "leakage_phase_rad"]
        )
    }
    assert keys["d0_mm"].value == "mm; 50 to 1000"
    assert (keys["d0_mm"].default, keys["beam_x_mm"].default) == ("needed", "0")
    assert keys["u_d0_mm"] == Key("u_d0_mm", "mm; above 0 to 100", "needed", "standard uncertainty of `d0_mm`")
    assert keys["leakage_phase_rad"].value == "rad; −2π to 2π"
    row = keys_of(record_named("records.site.target.TargetRow"), ["frame", "position_mm", "name"])
    assert [key.value for key in row] == [
        "`ground`, `alidade` or `reflector`", "3 numbers, mm; length 500 to 1e7", "name",
    ]  # fmt: skip


def test_a_key_without_a_line_is_seen():
    class Sheet(Record):
        """Sheet of an example.

        known_mm   length of the example
        """

        known_mm: float
        u_known_mm: float
        unknown_mm: float

    keys = keys_of(Sheet, Sheet.model_fields)
    assert [key.meaning for key in keys] == ["length of the example", "standard uncertainty of `known_mm`", ""]
    assert "| `known_mm` | mm | needed | length of the example |\n" in table(Sheet)
