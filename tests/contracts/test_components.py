"""The page of components is true: each pinned wheel and each npm package, with its version and its stated licence."""

import re

import pytest

from contracts import components_scene as scene

ROW = re.compile(r"^\| ([^|]+) \| ([^|]+) \| ([^|]+) \|$", re.MULTILINE)
FEWEST = 30  # packages that any environment of the tests has
REFUSED = re.compile(r"\bA?GPL(?!-compatible)")  # a wheel of users that would bind them


def rows(text):
    return [row for row in ROW.findall(text) if row[0] != "component"]


def test_the_page_lists_every_pin():
    listed = {(name, number) for name, number, _ in rows(scene.PAGE.read_text(encoding="utf-8"))}
    assert set(scene.pins().values()) - listed == set()


def test_the_page_has_the_licence_that_each_installed_package_states():
    """Packages that are not installed, or in another version, are passed over one by one."""
    stated = {(name, number): text for name, number, text in rows(scene.PAGE.read_text(encoding="utf-8"))}
    compared = {pin: scene.licence(name) for name, pin in scene.pins().items() if scene.installed(name) == pin[1]}
    assert len(compared) > FEWEST
    assert {pin: (stated[pin], text) for pin, text in compared.items() if stated[pin] != text} == {}


def test_the_page_is_as_it_would_be_written():
    """Sections and order, where all that is pinned is installed."""
    if lacking := sorted(name for name, pin in scene.pins().items() if scene.installed(name) != pin[1]):
        pytest.skip(f"{len(lacking)} packages are not installed as pinned, such as {lacking[0]}: sections not compared")
    assert scene.page_text() == scene.PAGE.read_text(encoding="utf-8"), scene.__doc__


def test_nothing_that_users_get_has_a_licence_that_binds_them():
    text = scene.PAGE.read_text(encoding="utf-8")
    users = "\n".join(part for part in text.split("\n## ") if not part.startswith("For developers"))
    assert len(rows(users)) > 20
    assert [row for row in rows(users) if REFUSED.search(row[2]) and "LGPL" not in row[2]] == []


def test_what_is_built_in_is_named():
    text = scene.PAGE.read_text(encoding="utf-8")
    [built] = [part for part in text.split("\n## ") if part.startswith("Built into")]
    assert tuple(sorted(name for name, *_ in rows(built))) == scene.BUILT_IN
