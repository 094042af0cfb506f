"""Pages of the documentation by name: find, list and read them."""

import posixpath
import re
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path

from catseye.errors import InputError
from catseye.records.files.refusal import shown
from catseye.records.topics.markup import has_prose, linked_pages, page_title, plain_markdown

NEAR = 3  # names that a refusal proposes
INCLUDE = re.compile(r"(?ms)^```\{include\} +(\S+)\n.*?^```$")
LIKENESS = 0.6  # of a proposed name, as difflib measures it
ALIKE = 0.9  # above it a name is mistyped, and no other is meant


@dataclass(frozen=True)
class Topic:
    """A page of the documentation.

    name     path in the documentation without .md: "conventions", "formats/beam"; a folder's index has its name
    source   the page as it is written, in MyST
    """

    name: str
    source: str

    @property
    def title(self) -> str:
        """First heading of the page."""
        return page_title(self.source) or self.name

    @cached_property
    def text(self) -> str:
        """Page as plain Markdown, for a terminal."""
        return plain_markdown(self.source)

    @property
    def related(self) -> tuple[str, ...]:
        """Names of the topics that the page links to, and of the pages under it."""
        names = topic_names()
        inside = "" if self.name == "index" else self.name
        folder = inside if f"{self.name}/index" in _files() else posixpath.dirname(self.name)
        linked = [topic_name(posixpath.normpath(posixpath.join(folder, page))) for page in linked_pages(self.source)]
        children = [name for name in names if posixpath.dirname(name) == inside]
        return tuple(name for name in dict.fromkeys([*linked, *children]) if name in names and name != self.name)

    def to_object(self) -> dict[str, object]:
        """Topic as an object for JSON."""
        return {"topic": self.name, "title": self.title, "text": self.text, "related": list(self.related)}

    def __str__(self) -> str:
        return self.text

    def _repr_markdown_(self) -> str:
        return self.text


def documentation_directory() -> Path:
    """Directory of the pages, in the package or beside the sources; InputError if missing."""
    package = Path(__file__).parents[2]
    for root in (package, package.parents[1]):
        if (root / "docs" / "index.md").is_file() and (root / "docs" / "formats").is_dir():
            return root / "docs"
    raise InputError(f"the documentation is missing: neither {package / 'docs'} nor {package.parents[1] / 'docs'}")


def _files() -> dict[str, Path]:
    """Pages by their path without .md; folders that begin with _ or . hold no pages."""
    root = documentation_directory()
    paths = {path.relative_to(root): path for path in root.rglob("*.md")}
    return {
        place.with_suffix("").as_posix(): path
        for place, path in paths.items()
        if not any(part.startswith(("_", ".")) for part in place.parts)
    }


def topic_name(page: str) -> str:
    """Name of the topic of a page.

    page   path in the documentation, with or without .md

    >>> topic_name("formats/index.md"), topic_name("formats/beam"), topic_name("index")
    ('formats', 'formats/beam', 'index')
    """
    return page.removesuffix(".md").removesuffix("/index")


def topic_names() -> tuple[str, ...]:
    """Names of all topics, sorted; pages of the front before folders."""
    return tuple(sorted(map(topic_name, _files()), key=lambda name: ("/" in name, name)))


def _source(page: Path) -> str:
    """Text of a page with that of the files it includes; those are beside the pages in a wheel, too."""

    def included(directive: re.Match[str]) -> str:
        path = page.parent / directive[1]
        return path.read_text(encoding="utf-8") if path.is_file() else directive[0]

    return INCLUDE.sub(included, page.read_text(encoding="utf-8"))


def topic_titles() -> dict[str, str]:
    """Titles of the topics by name, without pages that have no text before the documentation is built."""
    files = _files()
    pages = {topic_name(page): page for page in files}
    topics = [Topic(name, _source(files[pages[name]])) for name in topic_names()]
    folders = {name for name, page in pages.items() if page.endswith("/index")}
    return {topic.name: topic.title for topic in topics if topic.name in folders or has_prose(topic.source)}


def read_topic(name: str) -> Topic:
    """Topic of a name; InputError with near matches for an unknown one.

    name   "conventions", "formats/beam", or the last part alone where only one topic ends so
    """
    files = {topic_name(page): path for page, path in _files().items()}
    key = topic_name(name.strip("/").removeprefix("docs/").lower())
    full = [key] if key in files else [topic for topic in files if topic.rpartition("/")[2] == key]
    if len(full) == 1:
        return Topic(full[0], _source(files[full[0]]))
    if full:
        raise InputError(f"topic {shown(name)} is not unique (expected {' or '.join(sorted(full))})")
    near = _near(key, sorted(files))
    advice = f"did you mean {' or '.join(near)}? " if near else ""
    raise InputError(f"topic {shown(name)} not found ({advice}catseye help lists all topics)")


def _near(name: str, names: list[str]) -> list[str]:
    """Topics whose names, or whose last parts, are like a name; or hold it."""
    ends: dict[str, list[str]] = {}
    for topic in names:
        ends.setdefault(topic.rpartition("/")[2], []).append(topic)
    words = get_close_matches(name.rpartition("/")[2], list(ends), NEAR, LIKENESS)
    if len(exact := get_close_matches(name, names, 1, ALIKE)) == 1:
        return exact
    near = [*get_close_matches(name, names, NEAR, LIKENESS), *(topic for word in words for topic in ends[word])]
    return list(dict.fromkeys([*near, *(topic for topic in names if len(name) > 2 and name in topic)]))[:NEAR]
