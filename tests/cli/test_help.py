"""`catseye help`: topics, pages, commands; in a pager only on a terminal."""

import json
import os
import pty
import subprocess
import sys

import pytest

import catseye as catseye_package
from command_scene import command_line


@pytest.fixture
def catseye(capsys):
    return command_line(capsys)


def test_topics_are_listed_with_their_titles(catseye):
    status, said, complaint = catseye("help")
    assert (status, complaint) == (0, "")
    for name, title in catseye_package.topics().items():
        assert f"  {name} " in said
        assert title.split()[0] in said
    assert max(map(len, said.splitlines())) <= 100


def test_a_page_is_shown_without_marks_of_markdown(catseye):
    status, said, complaint = catseye("help", "formats/beam")
    assert (status, complaint) == (0, "")
    assert "Files of beam trains" in said
    assert "\x1b" not in said
    assert "```" not in said
    assert "**" not in said


def test_related_topics_end_a_page(catseye):
    _, said, _ = catseye("help", "formats")
    assert "catseye help formats/zy: The ZY language" in said.split("Related topics")[1]


def test_json_has_the_text_or_the_titles(catseye):
    page = json.loads(catseye("help", "conventions", "--json")[1])
    assert page["text"] == catseye_package.topic("conventions").text
    assert json.loads(catseye("help", "--json")[1]) == {"topics": catseye_package.topics()}


def test_the_name_of_a_command_shows_its_options(catseye):
    status, said, _ = catseye("help", "acoustic")
    assert status == 0
    assert said.startswith("Usage: catseye acoustic ")
    assert "--sheet" in said
    assert json.loads(catseye("help", "acoustic", "--json")[1])["topic"] == "acoustic"


def test_a_topic_goes_before_a_command_of_its_name(catseye):
    assert "Laser safety" in catseye("help", "safety")[1]


def test_an_unknown_topic_is_one_line(catseye):
    status, said, complaint = catseye("help", "convntions")
    assert (status, said) == (1, "")
    assert (
        complaint == "catseye: topic 'convntions' not found (did you mean conventions? catseye help lists all topics)\n"
    )


def on_a_terminal(pager, name):
    """Exit status and output of `catseye help` with a terminal for its stdout."""
    reading, writing = pty.openpty()
    environment = {**os.environ, "PAGER": pager, "TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24"}
    code = "from catseye.cli.main import run; run()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, "help", name], stdin=writing, stdout=writing, stderr=writing, env=environment
    )
    os.close(writing)
    said = b""
    try:
        while piece := os.read(reading, 65536):
            said += piece
    except OSError:  # a terminal ends so on Linux
        pass
    os.close(reading)
    return process.wait(timeout=60), said.decode()


def test_a_long_page_goes_to_the_pager_of_a_terminal_in_colours():
    status, said = on_a_terminal("sed s/^/PAGED:/", "conventions")
    assert status == 0
    assert said.count("PAGED:") > 24
    assert "\x1b[" in said


def test_without_a_pager_the_page_is_printed():
    status, said = on_a_terminal("no-such-pager", "conventions")
    assert status == 0
    assert "PAGED" not in said
    assert "Conventions" in said
