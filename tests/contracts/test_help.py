"""Help texts and messages name topics of the documentation that come with a wheel, no file of the repository."""

import ast
import re

import pytest
import typer

from catseye.cli.commands import app, join_commands
from catseye.errors import InputError
from catseye.records.topics.pages import read_topic
from repository import ROOT

PACKAGE = ROOT / "src" / "catseye"
TOPIC = re.compile(r"\bcatseye help ([a-z0-9][\w/-]*)")
FILE = re.compile(r"\bdocs/[\w/-]+\.\w+|\b(?:README|CONTRIBUTING|CHANGELOG)\.md\b")
LISTS = ("lists",)  # words after `catseye help`, where the list itself is meant
WRITTEN = {  # files that catseye writes into a folder of the user's, or reads there
    "simulator/night/sheets.py": "README.md",
    "cli/networks.py": "README.md",
}


def literals():
    """Strings of the package that are no docstring, with the file."""
    for path in sorted(PACKAGE.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        docstrings = {
            id(node.body[0].value)
            for node in ast.walk(tree)
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
            and node.body
            and isinstance(node.body[0], ast.Expr)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
                yield path.relative_to(PACKAGE).as_posix(), node.value


def helps():
    """Help of each command by its words."""
    join_commands()

    def below(command, words):
        yield words, command.get_help(typer.Context(command, info_name=words, max_content_width=1000))
        for name, inner in getattr(command, "commands", {}).items():
            yield from below(inner, f"{words} {name}")

    return dict(below(typer.main.get_command(app), "catseye"))


HELPS = helps()


def examples():
    """Text of the files that come as examples."""
    for path in sorted((ROOT / "examples").rglob("*")):
        if path.suffix in (".md", ".toml", ".py", ".ipynb", ".service", ".csv"):
            yield path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")


def topics_named(text):
    return [name for name in TOPIC.findall(text) if name not in LISTS]


def is_there(name):
    try:
        return bool(read_topic(name))
    except InputError:
        return False


@pytest.mark.parametrize("words", HELPS)
def test_no_help_text_names_a_file_of_the_repository(words):
    assert FILE.findall(HELPS[words]) == []


def test_help_texts_name_topics_that_are_there():
    named = {name for text in HELPS.values() for name in topics_named(text)}
    assert len(named) > 10
    assert [name for name in named if not is_there(name)] == []


def test_messages_name_topics_and_no_file_of_the_repository():
    wrong = [(file, name) for file, text in literals() for name in topics_named(text) if not is_there(name)]
    wrong += [(file, name) for file, text in literals() for name in FILE.findall(text) if WRITTEN.get(file) != name]
    assert wrong == []


def test_examples_name_topics_and_no_page_of_the_repository():
    wrong = [(file, name) for file, text in examples() for name in topics_named(text) if not is_there(name)]
    wrong += [(file, name) for file, text in examples() for name in re.findall(r"\bdocs/[\w/-]+", text)]
    assert wrong == []


def test_a_missing_topic_and_a_file_are_noticed():
    assert topics_named("see `catseye help formats/beam`; catseye help lists all topics") == ["formats/beam"]
    assert FILE.findall("layout: docs/formats/beam.md, README.md") == ["docs/formats/beam.md", "README.md"]
