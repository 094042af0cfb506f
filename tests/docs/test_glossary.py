"""The glossary: each word once, in order, under its letter, and a target of links."""

import re

import pytest

from repository import ROOT

PAGE = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")


def key(word):
    return re.sub(r"[^a-z0-9]+", " ", word.lower().replace("²", "2").replace("_", " ")).strip()


def entries():
    """Letter, word and meaning of each entry."""
    for part in PAGE.split("\n## ")[1:]:
        for word, meaning in re.findall(r"(?m)^\| (.+?) \| (.+) \|$", part.partition("|---|---|\n")[2]):
            yield part[0], word, meaning


def test_words_are_in_order_under_their_letters_each_once():
    words = [word for _, word, _ in entries()]
    assert len(words) > 330
    assert [key(word) for word in words] == sorted(key(word) for word in words)
    assert len({word.lower() for word in words}) == len(words)
    assert all(key(word)[0].upper() == letter for letter, word, _ in entries())


def test_meanings_are_short():
    assert [word for _, word, meaning in entries() if not 8 < len(meaning) < 260] == []


def test_every_word_is_a_target():
    pytest.importorskip("sphinx.application", reason="extra docs is not installed")
    import glossary

    assert glossary.slugs("internal cube, ZRG") == ["internal-cube", "zrg"]
    assert glossary.slugs("lean (of a shaft)") == ["lean-of-a-shaft", "lean"]
    assert all(slug for _, word, _ in entries() for slug in glossary.slugs(word))
    targets = {slug for _, word, _ in entries() for slug in glossary.slugs(word)}
    for path in (ROOT / "docs").rglob("*.md"):
        if "_build" not in path.parts:
            linked = re.findall(r"glossary\.md#([\w-]+)\)", path.read_text(encoding="utf-8"))
            assert set(linked) <= targets, path
