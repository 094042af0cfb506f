"""A TOML text edited in place: values change, all else stays, and what cannot be changed is refused."""

import tomllib
from datetime import date

import pytest

from catseye.errors import InputError
from catseye.records.files.toml_edit import edited_toml

TEXT = """# a sheet
name = "TR01"   # the "#1" unit
list = [
  1.0,  # first
  2.0,
]  # of all
old = 1

[part]  # glass
size = 1.0

[other]
size = 3.0
"""


def test_a_value_changes_in_its_own_table_and_comments_stay():
    changed = edited_toml(TEXT, {("part", "size"): 2.5, ("", "name"): "TR#2", ("", "list"): (3, 4)}, "t.toml")
    assert tomllib.loads(changed) == {
        "name": "TR#2", "list": [3, 4], "old": 1, "part": {"size": 2.5}, "other": {"size": 3.0}
    }  # fmt: skip
    assert changed.splitlines()[:3] == ["# a sheet", 'name = "TR#2"   # the "#1" unit', "list = [3, 4]  # of all"]
    assert "[part]  # glass" in changed


def test_missing_keys_and_tables_are_added_and_none_removes_one():
    values = {
        ("", "on"): date(2003, 5, 14),
        ("part", "new"): 1,
        ("fresh", "x"): 2.0,
        ("", "old"): None,
        ("", "no"): None,
    }
    found = tomllib.loads(edited_toml(TEXT, values, "t.toml"))
    assert found["on"] == date(2003, 5, 14)
    assert (found["part"], found["fresh"]) == ({"size": 1.0, "new": 1}, {"x": 2.0})
    assert "old" not in found
    assert list(found).index("on") < list(found).index("part")


@pytest.mark.parametrize("text", ["part = { size = 1.0 }\n", "part.size = 1.0\n"])
def test_a_key_in_no_line_of_its_own_is_refused(text):
    with pytest.raises(InputError, match=r"t\.toml: .*changed in place"):
        edited_toml(text, {("part", "size"): 2.0}, "t.toml")
