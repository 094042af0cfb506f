"""Every section of both documents has a command that leads to its formula, and every public definition a door.

The walk is that of `docs/extensions/doors.py`: it errs towards reached, as any use of a method's name counts.
"""

import ast
from collections import Counter
from collections.abc import Iterator

import pytest

import catseye
import sections
from doors import Node, Package
from repository import ROOT

ROWS = list(sections.rows())
COMPUTED = [row for row in ROWS if row.computes]
ROOMS = ("catseye.cli", "catseye.api", "catseye.web", "catseye.__main__")
DOCUMENTED = ("docs", "examples", "benchmarks", "studies")  # Python there may use what no command reaches


def test_both_documents_are_there_whole():
    """Eleven chapters of the notes and four parts of the memo, each place once."""
    assert Counter(row.document for row in {r.chapter: r for r in ROWS}.values()) == {"PARKER04": 11, "GOLDMAN00": 4}
    places = Counter((row.document, row.chapter, row.place) for row in ROWS)
    assert [place for place, times in places.items() if times > 1] == []


@pytest.mark.parametrize("row", COMPUTED, ids=lambda row: f"{row.document[0]} {row.place}")
def test_each_command_of_a_section_reaches_a_definition_that_cites_it(row):
    unknown = [door for door in row.doors if door not in sections.commands()]
    assert unknown == []
    assert [door for door in row.doors if not sections.formulas(row, door)] == []


def test_a_section_without_a_command_says_what_stands_for_it():
    for row in ROWS:
        if not row.computes:
            assert len(row.doors) == 1, row.place
            assert row.doors[0].split(":")[0] in sections.NOTHING, row.place


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("eqs. 1.3-1.5", {"eq. 1.3", "eq. 1.4", "eq. 1.5"}),
        ("eq. 2.12 to 2.14, section 2.4.", {"eq. 2.12", "eq. 2.13", "eq. 2.14", "section 2.4"}),
        ("eqs. 2.14, 2.15 and 2.21", {"eq. 2.14", "eq. 2.15", "eq. 2.21"}),
        ("eqs. 3.17-3.19b", {"eq. 3.17", "eq. 3.18", "eq. 3.19b"}),
        ("chapter 6, item 3, names it", {"chapter 6", "chapter 6 item 3"}),
        ("sections 2.2.1 and 2.5, eq. 2.6", {"section 2.2.1", "section 2.5", "eq. 2.6"}),
        ("appendix C and figure 10", {"appendix C", "figure 10"}),
        ("eq. A.1, its difference", {"eq. A.1"}),
        ("a text of 1.5 m without a reference", set()),
    ],
)
def test_references_are_read_from_a_text(text, expected):
    assert sections.references(text) == expected


def reached() -> set[Node]:
    """Definitions that a command, a call or a documented program reaches."""
    package = sections.package()
    starts = {node for room in ROOMS for node in package.whole(room)} | set(documented(package))
    return package.reached(starts | {("catseye", ""), ("catseye.bibliography", "Source")})


def documented(package: Package) -> Iterator[Node]:
    """Names that Python in documentation, examples, benchmarks and studies imports from the package.

    With the methods of imported classes that the same program calls.
    """
    for folder in DOCUMENTED:
        for path in sorted((ROOT / folder).rglob("*.py")):
            nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
            called = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
            for node in nodes:
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("catseye."):
                    for alias in node.names:
                        yield from ((node.module, alias.name), (f"{node.module}.{alias.name}", ""))
                        methods = {f"{alias.name}.{name}" for name in called}
                        yield from ((node.module, name) for name in methods & defined(package, node.module))


def defined(package: Package, module: str) -> set[str]:
    return set(package.modules[module].definitions) if module in package.modules else set()


def test_every_call_is_where_the_walk_begins():
    package = sections.package()
    for file, names in catseye.FACE.items():
        assert set(names) <= set(package.modules[f"catseye.api.{file}"].definitions)


def unreached() -> list[str]:
    """Public definitions that nobody reaches but tests, a module and its names a line."""
    seen = reached()
    names: dict[str, list[str]] = {}
    for module, name in sections.package().public():
        if (module, name) not in seen:
            names.setdefault(module.removeprefix("catseye."), []).append(name)
    return [f"{module}: {' '.join(sorted(some))}" for module, some in sorted(names.items())]


def test_nothing_public_is_reached_by_tests_alone():
    """A definition without a command is deleted, unless a section of the documents needs it."""
    assert unreached() == []
