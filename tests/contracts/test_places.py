"""Every place that a page or a docstring names is there: files, modules and what is in them, commands."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from repository import ROOT

PACKAGE = ROOT / "src" / "catseye"
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])
BESIDE = (ROOT, ROOT / "tests", PACKAGE)  # where a path may begin
ROOMS = sorted(path.name for path in PACKAGE.iterdir() if (path / "__init__.py").is_file())
# Mentions that need not be there, with the reason. Decisions speak of history; say here which words are history.
HISTORY: dict[tuple[str, str], str] = {}

FILE = re.compile(r"(?<![\w/.-])(?:[\w-]+/)+[\w-]+\.py\b")
ADDED = re.compile(r"^```\{code-block\} python\n:caption: (\S+)$", re.MULTILINE)  # by a walkthrough
DOTTED = re.compile(rf"`((?:catseye|{'|'.join(ROOMS)})(?!\.csv`)(?:\.[A-Za-z_]\w*)+)(?=[`(\[ ])")
COMMAND = re.compile(r"(?:`|bin/)catseye ([a-z][a-z-]*)")
JOINED = re.compile(r'@app\.command\((?:"([\w-]+)")?.*?\ndef (\w+)|\bapp\.add_typer\(\w+, name="([\w-]+)"', re.DOTALL)


@cache
def texts() -> dict[str, str]:
    """The pages and the package's source, by their path from the root; code is read too: its messages name places."""
    return {
        path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
        for path in (*PAGES, *sorted(PACKAGE.rglob("*.py")))
    }


def strays(mention: re.Pattern[str], is_there) -> list[str]:
    """Where a mention has no place, one line each."""
    return [
        f"{where}:{text.count(chr(10), 0, found.start()) + 1}: {named}"
        for where, text in texts().items()
        for found in mention.finditer(text)
        if not is_there(named := found[found.lastindex or 0]) and (where, named) not in HISTORY
    ]


@cache
def added() -> set[str]:
    """Files that a walkthrough of docs/howto adds."""
    return {name for text in texts().values() for name in ADDED.findall(text)}


def file_is_there(name: str) -> bool:
    return name in added() or any((folder / name).is_file() for folder in BESIDE)


@cache
def names_of(module: Path) -> dict[str, ast.AST]:
    """What a module's file defines or imports at its top level, by name."""
    found: dict[str, ast.AST] = {}
    for node in ast.parse(module.read_text(encoding="utf-8")).body:
        for part in ast.walk(node) if not isinstance(node, ast.FunctionDef | ast.ClassDef) else [node]:
            if isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                found[part.name] = part
            elif isinstance(part, ast.alias):
                found[part.asname or part.name] = part
            elif isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store):
                found[part.id] = part
    return found


def members_of(node: ast.AST) -> set[str]:
    """Methods, fields and attributes of a class as its own text gives them; inherited ones are not seen."""
    own = {n.name for n in ast.walk(node) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)}
    own |= {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    return own | {n.attr for n in ast.walk(node) if isinstance(n, ast.Attribute) and isinstance(n.ctx, ast.Store)}


@cache
def dotted_is_there(name: str) -> bool:
    """Whether a dotted name, from `catseye` or from a room, leads to a module, to its attribute, or to a member."""
    if f"src/catseye/{name.replace('.', '/')}.py" in added():
        return True
    here, parts = PACKAGE, name.removeprefix("catseye.").split(".")
    while parts and (here / parts[0] / "__init__.py").is_file():
        here, parts = here / parts[0], parts[1:]
    module = here / f"{parts[0]}.py" if parts else here
    if parts and module.is_file():
        parts = parts[1:]
    else:
        module = here / "__init__.py"
    if not parts:
        return True
    found = names_of(module).get(parts[0])
    if found is None or len(parts) > 2:
        return False
    return len(parts) == 1 or not isinstance(found, ast.ClassDef) or parts[1] in members_of(found)


@cache
def commands() -> set[str]:
    """The names under which the command line's modules join the app."""
    found = set()
    for path in (PACKAGE / "cli").rglob("*.py"):
        for given, function, group in JOINED.findall(path.read_text(encoding="utf-8")):
            found.add(given or group or function.strip("_").replace("_", "-"))  # as typer names it
    return found


def test_every_file_that_is_named_is_there():
    assert strays(FILE, file_is_there) == []


def test_every_dotted_name_leads_somewhere():
    assert strays(DOTTED, dotted_is_there) == []


def test_every_command_that_is_named_exists():
    assert strays(COMMAND, commands().__contains__) == []


def test_what_is_history_is_still_said():
    for (where, named), reason in HISTORY.items():
        assert named in texts()[where], f"{where} no longer says {named}: strike it from HISTORY"
        assert reason


@pytest.mark.parametrize(
    ("text", "path", "dotted", "command"),
    [
        ("see `atmosphere/index/air.py`.", True, None, None),
        ("see `atmosphere/air.py`.", False, None, None),
        ("see `reduction/epoch/test_epoch.py` and `catseye reduce`", True, None, True),
        ("as `atmosphere.index.air.MODELS` says", None, True, None),
        ("as `catseye.signal.cycles.whole.CycleDecision.margin` says", None, True, None),
        ("as `catseye.signal.cycles.whole.CycleDecision.marvel` says", None, False, None),
        ("as `signal.whole` says, by `.venv/bin/catseye reduse`", None, False, False),
        ("`records.night.campaign.read_campaign(directory)`, `catseye plot servo`", None, True, True),
        ("`estimation.adjustment`", None, False, None),
        ("`catseye` alone, `signalled.word`, a catseye somewhere, `air.MODELS`", None, None, None),
    ],
)
def test_a_place_is_told_from_none(text, path, dotted, command):
    """By hand: what each pattern sees in a line (None: nothing), and whether that is there."""

    def verdict(mention, is_there):
        seen = [found[found.lastindex or 0] for found in mention.finditer(text)]
        return all(map(is_there, seen)) if seen else None

    assert verdict(FILE, file_is_there) is path
    assert verdict(DOTTED, dotted_is_there) is dotted
    assert verdict(COMMAND, commands().__contains__) is command
