"""One word, one meaning: class names stand once, docstrings say something, and no text is read back into a value."""

import ast
import re
from collections import defaultdict

import pytest

from repository import ROOT

SOURCE = ROOT / "src" / "catseye"
TREES = {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(SOURCE.rglob("*.py"))}
SHORTEST = 24  # characters of a docstring
READERS = {"partition", "rpartition", "split", "rsplit", "startswith", "endswith", "removeprefix", "removesuffix"}
VALUES = re.compile(r"\b(reasons?|parameters?|rejected|unresolved|layout\.names|state\.names)\b")


def test_public_class_names_stand_once():
    places = defaultdict(list)
    for path, tree in TREES.items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(str(path.relative_to(SOURCE)))
    assert {name: files for name, files in places.items() if len(files) > 1} == {}


def test_docstrings_say_what_is_returned():
    short = [
        f"{path.relative_to(SOURCE)}: {node.name}: {said}"
        for path, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        and (said := ast.get_docstring(node)) is not None
        and len(said) < SHORTEST
    ]
    assert short == []


def read_back(tree):
    """Places where the text of a reason or of a parameter's name is taken apart."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in READERS:
            value = node.func.value
        elif isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Slice) and isinstance(node.value, ast.Name):
            value = node.value
        else:
            continue
        text = ast.unparse(value)
        whole = isinstance(node, ast.Subscript)  # slices of arrays of parameters are none
        if text in ("reason", "parameter") or (not whole and VALUES.search(text)):
            yield f"line {node.lineno}: {ast.unparse(node)}"


ROOMS = sorted(path.name for path in SOURCE.iterdir() if path.is_dir() and path.name not in ("ranger", "__pycache__"))


@pytest.mark.parametrize("room", ROOMS)  # but for the rangers': parameters are words of their language there
def test_no_reason_and_no_parameter_is_read_from_its_text(room):
    found = {
        str(path.relative_to(SOURCE)): places
        for path, tree in TREES.items()
        if path.is_relative_to(SOURCE / room) and (places := list(read_back(tree)))
    }
    assert found == {}


def test_such_reading_is_seen():
    for text in ("reason.partition(':')", "row.reason.startswith('blocked')", "parameter[:-2]", "reasons[k].split()"):
        assert list(read_back(ast.parse(text))), text
    assert not list(read_back(ast.parse("name.partition(' ')")))


def annotations(tree):
    """Of arguments, returns and fields, with the names they belong to."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            given = node.args
            for one in [*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg]:
                if one is not None and one.annotation is not None:
                    yield node.lineno, f"{node.name}({one.arg})", one.annotation
            if node.returns is not None:
                yield node.lineno, node.name, node.returns
        elif isinstance(node, ast.ClassDef):
            for field in node.body:
                if isinstance(field, ast.AnnAssign):
                    yield field.lineno, f"{node.name}.{ast.unparse(field.target)}", field.annotation


@pytest.mark.parametrize("room", ["reduction", "coordinator"])
def test_signatures_say_what_they_take(room):
    """mypy would refuse bare arrays, too, if it were asked in the reduction."""
    anything = [
        f"{path.relative_to(SOURCE)}:{line}: {name}: {ast.unparse(annotation)}"
        for path, tree in TREES.items()
        if path.is_relative_to(SOURCE / room)
        for line, name, annotation in annotations(tree)
        if re.search(r"\bAny\b", ast.unparse(annotation))
    ]
    assert anything == []


def known_names():
    """Everything that some module defines, uses or imports."""
    for tree in TREES.values():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef | ast.FunctionDef):
                yield node.name
            elif isinstance(node, ast.Name):
                yield node.id
            elif isinstance(node, ast.Import | ast.ImportFrom):
                yield from ((each.asname or each.name).rpartition(".")[2] for each in node.names)


def strangers(text, names):
    """Classes in backticks that nobody knows."""
    return [name for name in re.findall(r"`([A-Z][a-z]+[A-Za-z]*)(?:\.\w+)?`", text) if name not in names]


def test_classes_that_docstrings_name_are_there():
    names = {*known_names(), "None"}
    assert strangers("as `Slews.position`", names) == ["Slews"]
    texts = {path.relative_to(ROOT): path.read_text(encoding="utf-8") for path in (*TREES, ROOT / "CONTRIBUTING.md")}
    assert {path: gone for path, text in texts.items() if (gone := strangers(text, names))} == {}
