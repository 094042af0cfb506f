"""Topics by name."""

import re

import pytest

from catseye.errors import InputError
from catseye.records.topics.pages import documentation_directory, read_topic, topic_names, topic_titles


def test_every_page_is_a_topic_with_a_title():
    root = documentation_directory()
    pages = [p for p in root.rglob("*.md") if not any(part.startswith("_") for part in p.relative_to(root).parts)]
    assert len(topic_names()) == len(pages) > 60
    assert all(topic_titles().values())


def test_pages_that_only_the_build_fills_are_not_listed():
    titles = topic_titles()
    assert list(titles) == [name for name in topic_names() if name in titles]
    assert {"conventions", "formats", "reference"} <= set(titles)
    assert "reference/python/formulas/signal-drift" in set(topic_names()) - set(titles)


def test_an_index_has_the_name_of_its_folder_and_leads_to_its_pages():
    formats = read_topic("formats")
    assert formats.name == "formats"
    assert "formats/beam" in formats.related
    assert {"formats", "howto", "conventions"} <= set(read_topic("index").related)


@pytest.mark.parametrize(
    "name", ["formats/network", "network", "docs/formats/network.md", "NETWORK", "formats/network/"]
)
def test_a_topic_has_several_spellings(name):
    assert read_topic(name).name == "formats/network"


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("convntions", "did you mean conventions"),
        ("formats/beams", "did you mean formats/beam"),
        ("beam", "expected formats/beam or studies/beam"),
        ("xyzzy", "not found (catseye help lists all topics)"),
        ("../README", "not found"),
        ("/etc/passwd", "not found"),
        ("", "not found"),
    ],
)
def test_an_unknown_topic_is_one_line_with_near_matches(name, advice):
    with pytest.raises(InputError, match=re.escape(advice)) as refusal:
        read_topic(name)
    assert "\n" not in str(refusal.value)


def test_a_topic_prints_as_its_text_and_is_an_object():
    topic = read_topic("conventions")
    assert str(topic) == topic.text == topic._repr_markdown_()
    assert topic.text.startswith("# Conventions\n")
    assert topic.to_object() == {
        "topic": "conventions",
        "title": "Conventions",
        "text": topic.text,
        "related": list(topic.related),
    }


@pytest.mark.parametrize("name", topic_names())
def test_no_page_shows_the_marks_of_the_site(name):
    """Outside code: no directive, role, label or front matter."""
    text = re.sub(r"(?ms)^ *(`{3,}).*?^ *\1 *$|`[^`]*`", "", read_topic(name).text)
    assert not re.search(r"(?m)^\s*[:`]{3,}|^\([\w-]+\)=$|\{[\w:-]+\}`|^---$", text)
