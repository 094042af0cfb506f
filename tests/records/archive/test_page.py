"""The page of the format has each table and column as the layout has them."""

import re

import pytest

from catseye.records.archive.layout import TABLES
from repository import ROOT

PAGE = (ROOT / "docs" / "formats" / "archive.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", TABLES)
def test_the_page_has_the_columns_of_a_table_in_order(kind):
    section = re.search(rf"^### {kind}\n(.*?)(?=^### |\Z)", PAGE, re.MULTILINE | re.DOTALL)
    rows = re.findall(r"^\| `(\w+)` \| (\w+) \| (\S*) \| (.+) \|$", section[1], re.MULTILINE)
    assert rows == [(field.name, field.kind, field.unit, field.doc) for field in TABLES[kind].fields]


def test_the_page_has_no_other_table():
    assert re.findall(r"^### (\w+)$", PAGE, re.MULTILINE) == list(TABLES)
