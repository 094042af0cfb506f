"""Sections and equations of both documents: which definitions cite each, and the doors that reach those.

The rows are those of docs/sections.toml, citations are read from the source, and `doors` walks it.
"""

import ast
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from doors import DEFINITIONS, Node, Package

ROOT = Path(__file__).parents[2]
NOTHING = ("text", "drawing", "hardware")
CITED = re.compile(r"\[(PARKER04|GOLDMAN00)\]")
NEXT = re.compile(r"\[[A-Z]{3,}\d{2,3}\]|>>>|\n\n")
NUMBER = r"(?:[A-D]|\d{1,2})\.\d{1,2}[ab]?"
EQUATIONS = re.compile(rf"\b[Ee]qs?\. ?({NUMBER}(?:(?:-| to |, (?:and )?| and |, eqs?\. | or )(?:{NUMBER}))*)")
SECTION = re.compile(r"\b(?:[Ss]ections?|sec\.)\s+((?:\d+(?:\.\d+)+)(?:(?:,| and)\s+(?:section )?\d+(?:\.\d+)+)*)")
CHAPTER = re.compile(r"\b[Cc]hapters?\s+(\d+)(?:(?: and |, )(\d+)\b(?!\.))?(?:, item (\d))?")
OTHER = re.compile(r"\b([Ff]igures?|[Aa]ppendi(?:x|ces))\s+([A-D]\b|\d+(?:\.\d+)?)(?: and ([A-D]\b|\d+(?:\.\d+)?))?")


@dataclass(frozen=True)
class Row:
    """One row of the table.

    document   key of the bibliography
    chapter    heading that it stands under
    place      section, equation or figure
    citations  references, as `references` reads them
    content    text
    doors      commands, or a reason why there is nothing to compute
    """

    document: str
    chapter: str
    place: str
    citations: frozenset[str]
    content: str
    doors: tuple[str, ...]

    @property
    def computes(self) -> bool:
        """True where a command is to lead to a formula."""
        return not self.doors[0].startswith(NOTHING)


def rows() -> Iterator[Row]:
    """Rows of docs/sections.toml."""
    table = tomllib.loads((ROOT / "docs" / "sections.toml").read_text(encoding="utf-8"))
    for document, chapters in table.items():
        for chapter, lines in chapters.items():
            for place, cited, content, doors in lines:
                ways = (doors,) if doors.startswith(NOTHING) else tuple(doors.split(", "))
                yield Row(document, chapter, place, references(cited), content, ways)


def references(text: str) -> frozenset[str]:
    """References in a text: eq. 1.3, section 2.6.1, chapter 6 item 3, figure 10, appendix A; ranges are filled."""
    text = re.sub(r"\s+", " ", text)
    found = set[str]()
    rest = text
    for match in SECTION.finditer(text):
        found |= {f"section {number}" for number in re.findall(r"\d+(?:\.\d+)+", match[1])}
        rest = rest.replace(match[0], " ")
    for match in CHAPTER.finditer(text):
        found |= {f"chapter {number}" for number in match.groups()[:2] if number}
        found |= {f"chapter {match[1]} item {match[3]}"} if match[3] else set()
    for match in OTHER.finditer(text):
        kind = "figure" if match[1].lower().startswith("f") else "appendix"
        found |= {f"{kind} {number}" for number in match.groups()[1:] if number}
        rest = rest.replace(match[0], " ")
    for match in EQUATIONS.finditer(rest):
        for first, last in re.findall(rf"({NUMBER})(?:(?:-| to )({NUMBER}))?", match[1]):
            found |= {f"eq. {number}" for number in _filled(first, last)}
    return frozenset(found)


def _filled(first: str, last: str) -> Iterator[str]:
    yield first
    if last:
        chapter, number = first.split(".")
        start, end = (int(re.sub(r"[ab]", "", text)) for text in (number, last.split(".")[1]))
        yield from (f"{chapter}.{k}" for k in range(start + 1, end))
        yield last


def cited(text: str) -> dict[str, set[str]]:
    """References to each of the documents in a text."""
    found: dict[str, set[str]] = {}
    for match in CITED.finditer(text):
        after = text[match.end() : match.end() + 400]
        end = NEXT.search(after)
        found.setdefault(match[1], set()).update(references(after[: end.start()] if end else after))
    return found


@cache
def package() -> Package:
    """Source of catseye, parsed."""
    return Package(ROOT / "src")


@cache
def citing() -> Mapping[tuple[str, str], frozenset[Node]]:
    """Definitions that cite a reference of a document, by document and reference."""
    found: dict[tuple[str, str], set[Node]] = {}
    for module in package().modules.values():
        if module.name == "catseye.bibliography":
            continue
        lines = package().paths[module.name].read_text(encoding="utf-8").splitlines()
        parts = {name: node for name, node in module.definitions.items() if "." not in name}
        own = list(lines)
        for name, node in parts.items():
            first, last = _extent(node, lines)
            own[first:last] = [""] * (last - first)
            _enter(found, (module.name, name), "\n".join(lines[first:last]))
        _enter(found, (module.name, ""), "\n".join(own))
    return {key: frozenset(nodes) for key, nodes in found.items()}


def _extent(node: ast.AST, lines: list[str]) -> tuple[int, int]:
    """First and last line of a definition, from 0 and excluded, with its decorators."""
    assert isinstance(node, DEFINITIONS)
    first = min([node.lineno, *(d.lineno for d in node.decorator_list)]) - 1
    return first, node.end_lineno or len(lines)


def _enter(found: dict[tuple[str, str], set[Node]], node: Node, text: str) -> None:
    for document, some in cited(re.sub(r"\n *# ?", " ", text)).items():
        for reference in some:
            found.setdefault((document, reference), set()).add(node)


@cache
def commands() -> Mapping[str, tuple[Node, ...]]:
    """Functions of the command line by command; of a group, those of all its commands, and each as `group command`."""
    import typer

    from catseye.cli.commands import app, join_commands

    join_commands()
    found: dict[str, tuple[Node, ...]] = {}
    group: Any = typer.main.get_command(app)
    for name, command in group.commands.items():
        inner = getattr(command, "commands", {})
        for below, one in inner.items():
            found[f"{name} {below}"] = (_node(one.callback),)
        own = () if command.callback is None else (_node(command.callback),)
        found[name] = own + tuple(node for below in inner for node in found[f"{name} {below}"])
    return found


def _node(callback: Any) -> Node:
    return callback.__module__, callback.__name__


@cache
def reached(door: str) -> frozenset[Node]:
    """Definitions that a command reaches."""
    return frozenset(package().reached(commands()[door]))


def formulas(row: Row, door: str | None = None) -> frozenset[Node]:
    """Definitions that cite what a row cites; of one door only if given."""
    nodes = {node for reference in row.citations for node in citing().get((row.document, reference), ())}
    return frozenset(nodes if door is None else nodes & reached(door))
