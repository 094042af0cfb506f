"""Words of the pages: text without code, unknown words, American spellings, and phrases that have a plainer one."""

import re
import tomllib
from importlib.resources import files
from pathlib import Path

from repository import ROOT

DOCS = ROOT / "docs"
UNREAD = ("components.md", "openapi.json")  # names of packages
FENCED = re.compile(r"(?ms)^[ \t]*(`{3,}|~{3,})(?P<info>[^\n]*)\n(?P<body>.*?)^[ \t]*\1[ \t]*$")
TEXTS = ("note", "warning", "tip", "admonition", "grid", "dropdown", "card", "figure", "seealso")  # directives of text
CODE = (
    (re.compile(r"\A---\n.*?\n---\n", re.DOTALL), ""),  # the page's own settings
    (re.compile(r"<!--.*?-->", re.DOTALL), ""),
    (re.compile(r"``.+?``|`[^`]+`", re.DOTALL), "CODE"),
    (re.compile(r"\$\$.*?\$\$|(?<![\\\w])\$[^$\n]+\$", re.DOTALL), "FORMULA"),
    (re.compile(r"\]\([^)]*\)"), "]"),
    (re.compile(r"\b(?:https?|doi):\S+"), ""),
    (re.compile(r"(?m)^ {4,}\$ .*(?:\n {4,}.*)*"), ""),  # lines of a terminal
    (re.compile(r"(?m)^\([\w-]+\)=$|^:[\w-]+:.*$|<[^>\n]+>|\{[^}\n]*\}"), ""),  # anchors, options, markup
)
LETTER = "[A-Za-zÀ-ÖØ-öø-ÿ]"
WORD = re.compile(rf"(?<![\w./@=_-]){LETTER}+(?:['’][a-z]+)?(?![\w@=_/]|\.\w)")


def pages() -> list[Path]:
    """Markdown pages of the documentation, and those of the root that a reader meets first."""
    found = [path for path in DOCS.rglob("*.md") if "_build" not in path.parts and path.name not in UNREAD]
    return sorted([*found, ROOT / "README.md", ROOT / "CONTRIBUTING.md"])


def text_of(markdown: str) -> str:
    """Text of a page; code, formulas and addresses are blanked, and each line stays where it was."""

    def blanked(match: re.Match[str], instead: str = "") -> str:
        return instead + "\n" * match[0].count("\n")

    def without_code(match: re.Match[str]) -> str:
        is_text = any(match["info"].startswith("{" + name) for name in TEXTS)
        return "\n" + match["body"] + "\n" if is_text else blanked(match)

    text = FENCED.sub(without_code, markdown)
    for pattern, instead in CODE:
        text = pattern.sub(lambda match, instead=instead: blanked(match, instead), text)
    return text


def words_of(text: str) -> list[tuple[int, str]]:
    """Line and word of each word of a text that is no abbreviation."""
    found = []
    for number, line in enumerate(text.split("\n"), 1):
        for match in WORD.finditer(line):
            word = re.sub(r"['’]s?$", "", match[0])
            if len(word) > 2 and not word[1:].isupper() and (word[1:].islower() or "'" in word or "’" in word):
                found.append((number, word))
    return found


def own_words() -> set[str]:
    """Words of docs/words.txt, one a line."""
    lines = (DOCS / "words.txt").read_text(encoding="utf-8").splitlines()
    return {line.strip().lower() for line in lines if line.strip() and not line.startswith("#")}


def british() -> dict[str, str]:
    """American spelling -> British one, of the list that codespell brings."""
    text = (files("codespell_lib") / "data" / "dictionary_en-GB_to_en-US.txt").read_text(encoding="utf-8")
    pairs = (line.split("->") for line in text.splitlines() if "->" in line)
    return {american.strip().split(",")[0]: own.strip() for own, american in pairs}


def misspelled(text: str, checker, own: set[str], spellings: dict[str, str]) -> list[str]:
    """Unknown and American words, each with its line."""
    named = words_of(text)
    british_words = {*spellings.values(), *own}
    lower = {word.lower().replace("’", "'") for _, word in named}
    unknown = {
        word
        for word in checker.unknown(lower)
        if word not in british_words and not _is_inflected(word, british_words) and not _is_joined(word, checker)
    }
    american = {word: spellings[word] for word in lower if word in spellings and word not in own}
    lines = []
    for number, word in named:
        low = word.lower().replace("’", "'")
        if low in american:
            lines.append(f"line {number}: {word}: American, expected {american[low]}")
        elif low in unknown:
            lines.append(f"line {number}: {word}: unknown (add it to docs/words.txt if it is right)")
    return lines


def _is_inflected(word: str, words: set[str]) -> bool:
    """True for a plural, a participle or an adverb of a word of a list."""
    endings = ("s", "es", "d", "ed", "r", "ing", "ly")
    return any(word.endswith(end) and {word[: -len(end)], word[: -len(end)] + "e"} & words for end in endings)


def _is_joined(word: str, checker) -> bool:
    """True for a known word with a common prefix."""
    prefixes = ("un", "re", "non", "over", "sub", "mis", "de", "auto", "multi", "inter")
    return any(word.startswith(each) and checker.known([word[len(each) :]]) for each in prefixes)


def terms() -> dict[str, str]:
    """Phrase -> plain one, of docs/terms.toml."""
    return tomllib.loads((DOCS / "terms.toml").read_text(encoding="utf-8"))["terms"]


def forbidden(text: str, phrases: dict[str, str]) -> list[str]:
    """Phrases that a text uses, each with its line and the plain one; a phrase may run over the end of a line."""
    found = []
    for phrase, plain in phrases.items():
        pattern = r"\b" + r"\s+".join(map(re.escape, phrase.split())) + r"\b"
        for match in re.finditer(pattern, text, re.IGNORECASE):
            line = text.count("\n", 0, match.start()) + 1
            found.append(f"line {line}: {' '.join(match[0].split())!r}: say {plain!r}")
    return sorted(found)
