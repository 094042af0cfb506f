"""Check of a built site: every link inside it leads to a page and to an anchor that are there.

python docs/extensions/site_links.py docs/_build/html
"""

import sys
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

ATTRIBUTES = {"a": "href", "link": "href", "img": "src", "script": "src", "object": "data", "source": "src"}
LOADED = ("img", "script", "link", "object", "source")  # what a browser loads by itself


class _Page(HTMLParser):
    """Anchors of a page, and its links with the tag and the line of each."""

    def __init__(self) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[tuple[str, str, int]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take the anchor and the link of an element."""
        values = dict(attrs)
        self.anchors.update(value for name in ("id", "name") if (value := values.get(name)))
        if tag == "link" and "canonical" in (values.get("rel") or ""):
            return
        target = values.get(ATTRIBUTES.get(tag, ""))
        if target:
            self.links.append((tag, target, self.getpos()[0]))


@cache
def _read(path: Path) -> _Page:
    page = _Page()
    page.feed(path.read_text(encoding="utf-8"))
    return page


def broken_links(site: Path) -> Iterator[str]:
    """Lines that name a broken link: page, line of its HTML, link, and what is missing."""
    site = site.resolve()
    for path in pages_of(site):
        for tag, target, line in _read(path).links:
            problem = _problem(site, path, tag, target)
            if problem:
                yield f"{path.relative_to(site)}:{line}: {target}: {problem}"


def pages_of(site: Path) -> list[Path]:
    """Pages of a site; what lies in _static are templates and parts."""
    return [path for path in sorted(site.rglob("*.html")) if "_static" not in path.relative_to(site).parts]


def _problem(site: Path, path: Path, tag: str, target: str) -> str:
    """Reason why a link is broken; "" for a good one."""
    parts = urlsplit(target)
    if parts.scheme == "data" or (parts.scheme in ("http", "https", "mailto") and tag not in LOADED):
        return ""
    if parts.scheme or parts.netloc:
        return "leads elsewhere" if tag == "a" else "is loaded from elsewhere"
    place = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if not place.is_relative_to(site):
        return "leads out of the site"
    if not place.is_file():
        return "no such file"
    if parts.fragment and place.suffix == ".html" and unquote(parts.fragment) not in _read(place).anchors:
        return "no such anchor"
    return ""


def main(arguments: list[str]) -> int:
    """Print broken links; exit status 1 if there are any."""
    if len(arguments) != 1 or not Path(arguments[0]).is_dir():
        sys.stderr.write("usage: site_links.py DIRECTORY, which holds a built site\n")
        return 2
    site = Path(arguments[0])
    broken = list(broken_links(site))
    pages = len(pages_of(site.resolve()))
    sys.stdout.write("\n".join([*broken, f"links: {len(broken)} broken in {pages} pages\n"]))
    return 1 if broken or not pages else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
