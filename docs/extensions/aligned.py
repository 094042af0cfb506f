"""Docstrings of catseye as reStructuredText.

A docstring here is plain text: paragraphs, blocks of aligned lines `name   text`, and examples. `restructured` turns
the blocks into fields of parameters and attributes and escapes what reStructuredText would take for markup.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

ROW = re.compile(r"^(?P<key>\S(?:.*?\S)?) {2,}(?P<text>\S.*)$")
ITEM = re.compile(r"^(?:[-*] |\d+\. )")
NAME = re.compile(r"^\*{0,2}[A-Za-z_]\w*$")
LONGEST_KEY = 60  # characters of the first column
CITATION = r"\[[A-Z]{3,}\d{2,3}\]"
DIMENSION = r"(?:\.\.\.|\d*[a-z](?:_?\w)?(?: [-+] \d+)?|\d+)"  # n, 2n, n + 1, n_1, 3, ...
ARRAY = rf"\((?:{DIMENSION}, ?)+(?:{DIMENSION})?\)"
INLINE = re.compile(rf"``.+?``|`[^`]+`|{CITATION}|(?<![\w`]){ARRAY}|\b[A-Z][a-z]\w+Error\b", re.DOTALL)
ERRORS = {"ArgumentError", "CatseyeError", "EstimationError", "FrameError", "InputError", "ValidityError"}
OBJECT = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*(?:\(\))?")
OPENERS, CLOSERS = " \n([{<-/'\"–—:", " \n)]}>-/'\".,:;!?–—\\"  # around inline markup
AFTER = "".join(c for c in OPENERS if c != ":")


@dataclass(frozen=True)
class Names:
    """Names that a docstring may describe, and the sources that it may cite.

    parameters   name -> type as text, "" for none
    attributes   the same of a class
    sources      keys of the bibliography
    floors       first parts of module names, written without `catseye.`
    """

    parameters: Mapping[str, str] = field(default_factory=dict)
    attributes: Mapping[str, str] = field(default_factory=dict)
    sources: frozenset[str] = frozenset()
    floors: frozenset[str] = frozenset()


def restructured(lines: Iterable[str], names: Names) -> list[str]:
    """Lines of a docstring as reStructuredText."""
    made: list[str] = []
    for paragraph in paragraphs(lines):
        made += [*_paragraph(paragraph, names), ""]
    return made


def paragraphs(lines: Iterable[str]) -> list[list[str]]:
    """Runs of lines without a blank one; an example and a source begin one of their own."""
    found: list[list[str]] = [[]]
    for line in lines:
        is_start = found[-1] and not _is_example(found[-1]) and line.lstrip().startswith((">>> ", "Source: "))
        if not line.strip() or is_start:
            found.append([])
        if line.strip():
            found[-1].append(line.rstrip())
    return [paragraph for paragraph in found if paragraph]


def _is_example(paragraph: list[str]) -> bool:
    return paragraph[0].lstrip().startswith(">>>")


def _paragraph(paragraph: list[str], names: Names) -> list[str]:
    """One paragraph: example, literal text, list, aligned block or prose."""
    if _is_example(paragraph):
        indent = len(paragraph[0]) - len(paragraph[0].lstrip())
        return [line[indent:] for line in paragraph]
    if all(line.startswith("    ") for line in paragraph):
        return ["::", "", *paragraph]
    if ITEM.match(paragraph[0]):
        return _list(paragraph, names)
    start = next((k for k in range(len(paragraph)) if _is_block(paragraph[k:])), None)
    if start is None:
        return prose("\n".join(line.strip() for line in paragraph), names).split("\n")
    before = paragraph[:start]
    made = [*prose("\n".join(line.strip() for line in before), names).split("\n"), ""] if before else []
    return made + _block(rows(paragraph[start:]), names)


def _is_block(lines: list[str]) -> bool:
    """True for lines that begin with an aligned row and hold nothing but rows and their continuations."""
    match = ROW.match(lines[0])
    if not match or len(match["key"]) > LONGEST_KEY or lines[0].startswith(" "):
        return False
    column = match.start("text")
    if re.search(r"[.:;]$", match["key"]):  # prose with two spaces after a full stop
        return False
    for line in lines[1:]:
        is_continued = line[:column].strip() == "" and len(line) > column
        if not is_continued and not (ROW.match(line) and not line.startswith(" ")):
            return False
    return True


def rows(lines: list[str]) -> list[tuple[str, str]]:
    """First column and text of each row of an aligned block."""
    found: list[tuple[str, list[str]]] = []
    for line in lines:
        match = None if line.startswith(" ") else ROW.match(line)
        if match:
            found.append((match["key"], [match["text"]]))
        else:
            found[-1][1].append(line.strip())
    return [(key, "\n".join(texts)) for key, texts in found]


def split_names(key: str) -> list[str]:
    """Names of a first column such as "shot, ranger, target"; empty where it holds something else."""
    parts = [re.sub(r" \(.*\)$", "", part.strip()) for part in re.split(r",(?![^(]*\))", key)]
    return parts if all(NAME.match(part) for part in parts) else []


def _block(pairs: list[tuple[str, str]], names: Names) -> list[str]:
    """Fields of parameters or attributes, or a list of definitions."""
    described = [name.lstrip("*") for key, _ in pairs for name in split_names(key)]
    for kind, types in (("param", names.parameters), ("attribute", names.attributes)):
        if any(name in types for name in described):
            return [line for key, text in pairs for line in _fields(kind, key, text, types, names)]
    made = []
    for key, text in pairs:
        term = f"``{key}``" if "`" not in key else prose(key, names)
        made += [term, *(f"    {line}" for line in prose(text, names).split("\n"))]
    return made


def _fields(kind: str, key: str, text: str, types: Mapping[str, str], names: Names) -> list[str]:
    """One field a name of the first column, all with its text."""
    shape = re.search(r" (\([^()]*\))$", key)
    text = f"{shape[1]} {text}" if shape else text
    made = []
    for name in split_names(key) or [key]:
        first, *others = prose(text, names).split("\n")
        shown = _escaped(name)
        made += [f":{kind} {shown}: {first}", *(f"    {line}" for line in others)]
        if types.get(name.lstrip("*")):
            made.append(f":{'type' if kind == 'param' else 'attributetype'} {shown}: ``{types[name.lstrip('*')]}``")
    return made


def _list(paragraph: list[str], names: Names) -> list[str]:
    """Items of a list, each with its continuation indented."""
    made: list[str] = []
    for line in paragraph:
        match = ITEM.match(line)
        if match:
            made.append(match[0] + line[match.end() :])
        else:
            made.append(" " * len(ITEM.match(made[0])[0]) + line.strip())
    text = "\n".join(made)
    return prose(text, names, keep_bullets=True).split("\n")


def prose(text: str, names: Names, *, keep_bullets: bool = False) -> str:
    """Text with code, citations and arrays marked, and everything else escaped."""
    made, end = "", 0
    for match in INLINE.finditer(text):
        marked = _inline(match[0], names)
        if marked is None:
            continue
        made += _plain(text[end : match.start()], keep_bullets)
        before, after = made[-1:], text[match.end() : match.end() + 1]
        opening = "\\ " if before and before not in AFTER and not made.endswith("\\ ") else ""
        closing = "\\ " if after and after not in CLOSERS else ""
        made += opening + marked + closing
        end = match.end()
    return made + _plain(text[end:], keep_bullets)


def _inline(text: str, names: Names) -> str | None:
    """Markup of a piece of code, a citation, an array's shape or an error; None for plain text."""
    if text.startswith("["):
        key = text[1:-1]
        return f":ref:`{text} <source-{key.lower()}>`" if key in names.sources else None
    if text.startswith("("):
        return f"``{text}``"
    if not text.startswith("`"):
        return f":py:obj:`~catseye.errors.{text}`" if text in ERRORS else None
    code = " ".join(text.strip("`").split())
    if OBJECT.fullmatch(code):
        bare = code.removesuffix("()")
        if "." in bare and bare.split(".")[0] in names.floors:
            return f":py:obj:`{code} <catseye.{bare}>`"
        return f":py:obj:`{code} <{bare}>`" if not bare.endswith("_") else f"``{code}``"
    return f"``{code}``"


def _plain(text: str, keep_bullets: bool) -> str:
    """Plain text with its special characters escaped."""
    if keep_bullets:
        return "\n".join(
            (match[0] if (match := ITEM.match(line)) else "") + _escaped(line[match.end() if match else 0 :])
            for line in text.split("\n")
        )
    return _escaped(text)


def _escaped(text: str) -> str:
    text = re.sub(r"([\\*|`])", r"\\\1", text)
    text = re.sub(r"(?<=\w)_(?!\w)", r"\\_", text)
    return re.sub(r"(?<!\w)_(?=\w)", r"\\_", text)
