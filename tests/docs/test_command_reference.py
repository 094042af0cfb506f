"""The reference of the command line has every command once, by subject, with every option."""

import re

import pytest
import typer

from catseye.cli.commands import SUBJECTS, app
from contracts.test_commands import OF_SEVERAL, WITHOUT_CALL, python_name
from repository import ROOT

pytest.importorskip("sphinx.application", reason="extra docs is not installed")
import commands as reference

PAGES = ROOT / "docs" / "reference" / "commands"
DIRECTIVE = re.compile(r"^```\{command-reference\} (.+)$", re.MULTILINE)
COMMANDS = reference.commands()


def listed():
    """Subject of each command of the pages, in the index's order."""
    index = (PAGES / "index.md").read_text(encoding="utf-8")
    names = index.partition(":maxdepth: 2\n\n")[2].partition("```")[0].split()
    for name in names:
        page = (PAGES / f"{name}.md").read_text(encoding="utf-8")
        title = page.splitlines()[0].removeprefix("# ")
        for words in DIRECTIVE.findall(page):
            assert f"## catseye {words}\n" in page, f"{name}.md: {words} is not under its heading"
            yield title, words


def test_pages_have_every_command_once_under_its_subject_in_the_order_of_help():
    found = list(listed())
    assert sorted(words for _, words in found) == sorted(COMMANDS)
    subjects = list(dict.fromkeys(title for title, _ in found))
    assert subjects == list(SUBJECTS)
    for title, names in SUBJECTS.items():
        assert list(dict.fromkeys(words.split()[0] for each, words in found if each == title)) == list(names)


@pytest.mark.parametrize("words", COMMANDS)
def test_a_command_s_reference_has_its_options_example_and_function(words):
    text = reference.markdown(words, COMMANDS[words])
    shown = [each for kind in ("argument", "option") for each in reference.parameters_of(COMMANDS[words], kind)]
    assert shown
    for parameter in shown:
        assert f"```{{option}} {reference.spelling(parameter)}\n" in text
        assert parameter.help, f"{words}: {parameter.name} has no help"
    assert f"$ catseye {words}" in text
    for name in (
        [] if words in WITHOUT_CALL else [python_name(words), *([OF_SEVERAL[words]] if words in OF_SEVERAL else [])]
    ):
        assert f"{{py:func}}`catseye.{name}`" in text
    assert len([line for line in reference.synopsis(words, COMMANDS[words]).splitlines() if len(line) > 100]) == 0


def test_phrases_of_an_option():
    parameters = {each.name: each for each in COMMANDS["refractometer"].params}
    assert reference.facts(parameters["path_length_m"]) == ["number", "1 to 100000 m"]
    assert reference.facts(parameters["readings"]) == ["path", "required"]
    parameters = {each.name: each for each in COMMANDS["surface"].params}
    assert reference.facts(parameters["elevation_deg"]) == ["number", "may repeat", "-10 to 100°"]
    assert reference.facts(parameters["zernike"]) == ["integer", "1 to 500", "default 15"]
    assert reference.facts(parameters["travel"]) == ["one of normal, axis", "default normal"]


def test_every_check_of_a_number_says_its_range():
    """A range that the program refuses stands in the reference."""
    silent = {
        f"{words} {parameter.name}"
        for words, command in COMMANDS.items()
        for parameter in command.params
        if reference.kind_of(parameter) in (int, float)
        and parameter.type_descriptor.parameter_info.callback is not None
        and not reference.range_of(parameter)
    }
    assert silent == set()


def test_lines_of_an_epilog():
    layout = "Layout: docs/formats/site.md"
    lines, notes = reference.examples(
        f"\b\nExample: catseye a b\n         catseye a --c\nWith a fault: catseye a\n         --d\n{layout}"
    )
    assert lines == ["$ catseye a b", "$ catseye a --c", "# With a fault", "$ catseye a \\\n    --d"]
    assert notes == [layout]
    assert reference.marked(notes[0]) == "Layout: [docs/formats/site.md](/formats/site.md)"


def test_the_app_is_the_one_of_the_program():
    assert set(typer.main.get_command(app).commands) == {words.split()[0] for words in COMMANDS}
