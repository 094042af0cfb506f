"""Spelling and terms of the pages and of every `--help`."""

import pytest

from command_scene import COMMAND
from docs.words_scene import british, forbidden, misspelled, own_words, pages, terms, text_of, words_of
from repository import ROOT


@pytest.fixture(scope="module")
def checker():
    spelling = pytest.importorskip("spellchecker", reason="extra docs is not installed")
    pytest.importorskip("codespell_lib", reason="extra docs is not installed")
    return spelling.SpellChecker(language="en")


def test_pages_are_spelled_in_british_english(checker):
    own, spellings = own_words(), british()
    wrong = [
        f"{path.relative_to(ROOT)}: {line}"
        for path in pages()
        for line in misspelled(text_of(path.read_text(encoding="utf-8")), checker, own, spellings)
    ]
    assert wrong == []


def test_own_words_are_used_and_sorted(checker):
    used = {word.lower() for path in pages() for _, word in words_of(text_of(path.read_text(encoding="utf-8")))}
    lines = [line for line in (ROOT / "docs" / "words.txt").read_text(encoding="utf-8").splitlines() if line]
    words = [line for line in lines if not line.startswith("#")]
    assert words == sorted(set(words), key=str.lower)
    american = british()
    assert [word for word in words if checker.known([word.lower()]) and word.lower() not in american] == []
    assert len(own_words() - used) < 20, sorted(own_words() - used)


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("The colour of the centre, 3 metres away.", []),
        ("The color of it.", ["line 1: color: American, expected colour"]),
        ("First.\nA recieved range.", ["line 2: recieved: unknown (add it to docs/words.txt if it is right)"]),
        ("`color` of $recieved$ in\n```\nrecieved\n```\n", []),
        ("The retroreflector's prisms and neighbours' walls, re-read.", []),
    ],
)
def test_what_is_wrong_is_named_with_its_line(checker, text, wrong):
    assert misspelled(text_of(text), checker, own_words(), british()) == wrong


def test_pages_use_plain_terms():
    phrases = terms()
    used = [
        f"{path.relative_to(ROOT)}: {line}"
        for path in pages()
        for line in forbidden(text_of(path.read_text(encoding="utf-8")), phrases)
    ]
    assert used == []


def helps():
    """Name and help text of every command."""

    def walk(name, command):
        yield name, command.get_help(command.context_class(command, info_name=name, terminal_width=100))
        for word, each in getattr(command, "commands", {}).items():
            yield from walk(f"{name} {word}", each)

    yield from walk("catseye", COMMAND)


def test_helps_use_plain_terms():
    phrases, texts = terms(), dict(helps())
    assert len(texts) > 30
    assert [f"{name}: {line}" for name, text in texts.items() for line in forbidden(text, phrases)] == []


def test_a_phrase_is_found_over_the_end_of_a_line():
    phrases = {"told to end": "stopped"}
    assert forbidden("It runs until Told\n  to end by us.", phrases) == ["line 1: 'Told to end': say 'stopped'"]
    assert forbidden("the untold to ending", phrases) == []
