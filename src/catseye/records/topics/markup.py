"""MyST pages as plain Markdown: what a terminal can show of a page that is written for Sphinx."""

import re
from collections.abc import Callable
from typing import NamedTuple

from catseye.records.topics.formulas import plain_formula

FENCE = re.compile(r"^\s*(?P<fence>`{3,}|~{3,}|:{3,})\s*(?:\{(?P<kind>[\w:+.-]+)\})?\s*(?P<argument>.*?)\s*$")
FENCED = re.compile(  # code that is shown as it is
    r"^ *(`{3,}|~{3,}) *(?:\{(?:code|command)[\w-]*\})?[^`{\n]*$.*?^ *\1[`~]* *$", re.DOTALL | re.MULTILINE
)
OPTION = re.compile(r"^:(?P<key>[\w-]+):\s*(?P<value>.*)$")
LABEL = re.compile(r"^\([\w.:/-]+\)=\s*$|^%( |$).*$")
HEADING = re.compile(r"(?m)^# +(.+?)\s*$")
ESCAPED = re.compile(r"\\([*_#\[\]])")  # a backslash before a mark that is no Markdown
FRONT = re.compile(r"\A---\n.*?\n---\n", re.DOTALL)
CODE = re.compile(r"(`+)(?!`).*?(?<!`)\1(?!`)", re.DOTALL)
DISPLAY = re.compile(r"\$\$(.+?)\$\$(?:\s*\([\w:-]+\))?", re.DOTALL)
INLINE = re.compile(r"(?<![\\$\w])\$(?![\s$])((?:[^$\n]|\n(?!\s*\n))+?)(?<![\s\\])\$(?![\d$])")
ROLE = re.compile(r"\{[\w:+.-]+\}`(?:(?P<text>[^`<]+?)\s*<[^`>]*>|(?P<alone>[^`]+))`")
IMAGE = re.compile(r"!\[([^\]]*)\]\([^)]*\)")
LINK = re.compile(r"(?<!!)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")
CODES = {"code-cell": "python", "code-block": "", "code": "", "sourcecode": "", "literalinclude": ""}
NOTES = ("note", "tip", "hint", "important", "warning", "caution", "attention", "danger", "error", "seealso")
FIGURES = ("figure", "image", "command-figure")
BUILT = "*(made by the build of the documentation"  # beginning of a line in place of what a terminal has not
IN_PYTHON = "In Python: "
OUTSIDE = ("http://", "https://", "mailto:")


class Directive(NamedTuple):
    """A directive of a page: kind, argument, options, lines beneath them."""

    kind: str
    argument: str
    options: dict[str, str]
    body: list[str]


def page_title(text: str) -> str:
    """First heading of a page, "" without one."""
    heading = HEADING.search(FENCED.sub("", plain_markdown(text)))
    return ESCAPED.sub(r"\1", heading[1]).replace("`", "") if heading else ""


def plain_markdown(text: str) -> str:
    r"""Page without front matter, directives, roles, labels and TeX; links to other pages are their texts.

    >>> plain_markdown("(sec)=\n# Air\n:::{note}\nSee [the glossary](glossary.md), $n-1 = 10^{-6}N$.\n:::\n")
    '# Air\n> **Note.** See the glossary, `n-1 = 10⁻⁶N`.\n'
    """
    lines = _lines(FRONT.sub("", text).splitlines())
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)).strip("\n") + "\n"


def has_prose(text: str) -> bool:
    """True if a page has text of its own, beside headings and what the build makes."""
    lines = plain_markdown(text).splitlines()
    return any(line and not line.startswith(("#", BUILT, IN_PYTHON)) for line in lines)


def linked_pages(text: str) -> list[str]:
    """Targets of a page's links to other pages of the documentation, as they are written, in order."""
    pages = (target.partition("#")[0] for _, target in LINK.findall(FENCED.sub("", text)))
    return [page for page in dict.fromkeys(pages) if page.endswith(".md") and not page.startswith(OUTSIDE)]


def _lines(lines: list[str]) -> list[str]:
    """Lines as plain Markdown: prose by paragraphs, directives by their kind, code as it is."""
    result: list[str] = []
    prose: list[str] = []
    place = 0
    while place < len(lines):
        opening = FENCE.match(lines[place])
        if opening is None or (opening["fence"][0] != ":" and "`" in opening["argument"]):
            prose.append(lines[place])
            place += 1
            continue
        result += _prose(prose)
        prose = []
        end = _closing(lines, place, opening["fence"])
        inside = lines[place + 1 : end]
        if opening["kind"]:
            result += _rendered(_directive(opening["kind"], opening["argument"], inside))
        elif opening["fence"][0] == ":":
            result += _lines(inside)
        else:
            result += lines[place : end + 1]
        place = end + 1
    return result + _prose(prose)


def _closing(lines: list[str], place: int, fence: str) -> int:
    """Index of the line that closes the fence opened at a place; the page's end without one."""
    for index in range(place + 1, len(lines)):
        line = lines[index].strip()
        if len(line) >= len(fence) and set(line) == {fence[0]}:
            return index
    return len(lines)


def _directive(kind: str, argument: str, inside: list[str]) -> Directive:
    """Directive of the lines between its fences."""
    options: dict[str, str] = {}
    start = 0
    if inside and inside[0].strip() == "---":
        start = next((i + 1 for i in range(1, len(inside)) if inside[i].strip() == "---"), len(inside))
    while start < len(inside) and (option := OPTION.match(inside[start].strip())):
        options[option["key"]] = option["value"]
        start += 1
    return Directive(kind, argument, options, inside[start:])


def _rendered(directive: Directive) -> list[str]:
    """Lines of plain Markdown for a directive."""
    kind = directive.kind
    for kinds, render in RENDERED.items():
        if kind in kinds:
            return render(directive)
    if kind.startswith(("grid", "tab-", "card", "dropdown")) or kind in ("div", "container", "margin", "topic"):
        page = directive.options.get("link", "").removesuffix("/index")
        command = f" (`catseye help {page}`)" if page and directive.options.get("link-type") == "doc" else ""
        title = [f"**{directive.argument}**{command}", ""] if re.search(r"[A-Za-z]", directive.argument) else []
        return ["", *title, *_lines(directive.body), ""]
    return ["", f"{BUILT}: {f'{kind} {directive.argument}'.strip()})*", ""]


def _code(directive: Directive) -> list[str]:
    """Fenced block of a directive's code; none where the built page does not show it either."""
    if "remove-" in directive.options.get("tags", ""):
        return []
    language = CODES[directive.kind] or directive.argument
    return ["", f"```{language}", *_trimmed(directive.body), "```", ""]


def _command(directive: Directive) -> list[str]:
    """Command lines with their prompt; a line that a backslash continues has none."""
    if "hide" in directive.options:
        return []
    lines: list[str] = []
    for line in _trimmed(directive.body):
        lines.append(f"  {line}" if lines and lines[-1].endswith("\\") else f"$ {line}")
    return ["", "```console", *lines, "```", ""]


def _note(directive: Directive) -> list[str]:
    title = directive.argument if directive.kind == "admonition" else directive.kind.capitalize()
    if directive.kind != "admonition" and directive.argument:
        directive = directive._replace(body=[directive.argument, *directive.body])
    body = _trimmed(_lines(_trimmed(directive.body)))
    first = f"> **{title}.** {body[0] if body else ''}".rstrip()
    return [first, *(f"> {line}".rstrip() for line in body[1:])]


def _figure(directive: Directive) -> list[str]:
    caption = " ".join(directive.options.get("alt", "").split()) or directive.argument
    return ["", f"*[Figure: {caption}]*", "", *_lines(directive.body), ""]


def _formula(directive: Directive) -> list[str]:
    return _display(" ".join(filter(None, [directive.argument, *directive.body])))


def _display(tex: str) -> list[str]:
    return ["", "```", *plain_formula(tex).splitlines(), "```", ""]


def _written_file(directive: Directive) -> list[str]:
    return ["", f"File `{directive.argument}`:", "", "```text", *_trimmed(directive.body), "```", ""]


def _command_options(directive: Directive) -> list[str]:
    return ["", f"Options: `catseye {directive.argument} --help`", ""]


def _public(directive: Directive) -> list[str]:
    names = " ".join([directive.argument, *directive.body]).split()
    return ["", IN_PYTHON + ", ".join(f"`help(catseye.{name})`" for name in names), ""]


def _module(directive: Directive) -> list[str]:
    return ["", f"{IN_PYTHON}`help('{directive.argument}')`", ""]


def _sources(directive: Directive) -> list[str]:
    return ["", f"{IN_PYTHON}`from catseye.bibliography import SOURCES`", ""]


def _gallery(directive: Directive) -> list[str]:
    figures = [line.partition("=") for line in directive.body if "=" in line]
    lines = [f"- {name.strip()}: {caption.strip()}" for name, _, caption in figures]
    return ["", f"Figures of `{directive.options.get('command', directive.argument)}`:", "", *lines, ""]


def _nothing(directive: Directive) -> list[str]:
    return []


RENDERED: dict[tuple[str, ...], Callable[[Directive], list[str]]] = {
    tuple(CODES): _code,
    ("command",): _command,
    (*NOTES, "admonition"): _note,
    FIGURES: _figure,
    ("math",): _formula,
    ("command-file",): _written_file,
    ("command-reference",): _command_options,
    ("public",): _public,
    ("formulas",): _module,
    ("references",): _sources,
    ("gallery",): _gallery,
    ("toctree", "contents", "index", "raw"): _nothing,
}


def _trimmed(lines: list[str]) -> list[str]:
    """Lines without empty ones at both ends."""
    return "\n".join(lines).strip("\n").splitlines()


def _prose(lines: list[str]) -> list[str]:
    """Lines outside fences, without labels, roles and TeX."""
    text = "\n".join(line for line in lines if not LABEL.match(line))
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = ROLE.sub(lambda role: f"`{(role['text'] or role['alone']).lstrip('~')}`", text)
    pieces: list[str] = []
    place = 0
    for code in CODE.finditer(text):
        pieces += [_words(text[place : code.start()]), code[0]]
        place = code.end()
    text = "".join([*pieces, _words(text[place:])])
    text = LINK.sub(lambda link: link[0] if link[2].startswith(OUTSIDE) else link[1], text)
    return text.split("\n") if lines else []


def _words(text: str) -> str:
    """Text without code, its formulas and images in words."""
    text = DISPLAY.sub(lambda formula: "\n".join(_display(formula[1])), text)
    text = INLINE.sub(lambda formula: f"`{' '.join(plain_formula(formula[1]).split())}`", text)
    return IMAGE.sub(lambda image: f"*[Figure: {' '.join(image[1].split())}]*", text)
