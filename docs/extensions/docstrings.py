"""Hooks of autodoc for catseye's docstrings: aligned blocks become fields, signatures stay short."""

import enum
import inspect
import re
from functools import cache
from typing import Any

from sphinx.application import Sphinx
from sphinx.domains.python import PyObject
from sphinx.util.docfields import TypedField
from sphinx.util.typing import stringify_annotation

from aligned import Names, restructured

PREFIXES = re.compile(r"\b(?:[a-z_]\w*\.)+(?=[A-Za-z])")  # of modules
RESULT = "catseye.api.result"


@cache
def grounds() -> tuple[frozenset[str], frozenset[str]]:
    """Keys of the bibliography, and names of the package's floors."""
    from pkgutil import iter_modules

    import catseye
    from catseye.bibliography import SOURCES

    return frozenset(SOURCES), frozenset(module.name for module in iter_modules(catseye.__path__))


def type_text(annotation: Any) -> str:
    """Type as a reader writes it; "" where it says nothing."""
    if annotation in (inspect.Parameter.empty, Any, None):
        return ""
    text = annotation if isinstance(annotation, str) else stringify_annotation(annotation, "smart")
    text = text.replace("~", "").strip("\"'")
    text = without_metadata(text)
    text = re.sub(r"\bos\.PathLike\[str\]", "PathLike", PREFIXES.sub("", text))
    text = re.sub(r"\bPathLike\[str\]", "PathLike", text).replace("'", "").replace('"', "")
    return "" if text in ("Any", "Any | None") or len(text) > 100 else text


def without_metadata(text: str) -> str:
    """Type without what `Annotated` adds to it.

    >>> without_metadata("Annotated[float, In('m', one=True)] | None")
    'float | None'
    """
    while (start := text.find("Annotated[")) >= 0:
        depth, cut = 0, None
        for k in range(start + len("Annotated["), len(text)):
            if text[k] in "[(":
                depth += 1
            elif text[k] in ")]" and depth:
                depth -= 1
            elif text[k] == "," and not depth and cut is None:
                cut = k
            elif text[k] == "]":
                break
        prefix = re.search(r"[\w.]*$", text[:start])
        text = text[: prefix.start()] + text[start + len("Annotated[") : cut] + text[k + 1 :]
    return text


def signature_of(thing: Any) -> inspect.Signature | None:
    """Signature of a function, compiled or not; None for anything else."""
    try:
        return inspect.signature(getattr(thing, "py_func", thing))
    except (TypeError, ValueError):
        return None


def names_of(what: str, thing: Any) -> Names:
    """Names that the docstring of a thing may describe."""
    sources, floors = grounds()
    parameters: dict[str, str] = {}
    attributes: dict[str, str] = {}
    if what in ("class", "exception") and inspect.isclass(thing):
        for each in reversed(thing.__mro__):
            if each.__module__.startswith("catseye"):
                attributes.update({name: type_text(kind) for name, kind in inspect.get_annotations(each).items()})
                attributes.update({name: "" for name, value in vars(each).items() if isinstance(value, property)})
        if issubclass(thing, enum.Enum):
            attributes.update(dict.fromkeys(thing.__members__, ""))
        if not attributes and (signature := signature_of(thing)):
            parameters = {name: type_text(each.annotation) for name, each in signature.parameters.items()}
    elif what in ("function", "method", "data") and (signature := signature_of(thing)):
        parameters = {name: type_text(each.annotation) for name, each in signature.parameters.items()}
    return Names(parameters=parameters, attributes=attributes, sources=sources, floors=floors)


def process_docstring(_app: Sphinx, what: str, _name: str, thing: Any, _options: Any, lines: list[str]) -> None:
    """Turn a docstring into reStructuredText, in place."""
    if getattr(thing, "__module__", "catseye") is None or not lines:
        return
    lines[:] = restructured(lines, names_of(what, thing))
    if what in ("function", "method") and (returned := return_field(thing)):
        lines += [returned, ""]


def return_field(thing: Any) -> str:
    """Field of the return type, a link where it is a class of catseye."""
    signature = signature_of(thing)
    if signature is None or signature.return_annotation in (inspect.Signature.empty, None, "None"):
        return ""
    annotation = signature.return_annotation
    if inspect.isclass(annotation) and annotation.__module__.startswith("catseye"):
        return f":rtype: :py:obj:`~{annotation.__module__}.{annotation.__qualname__}`"
    text = type_text(annotation)
    return f":rtype: ``{text}``" if text and "`" not in text else ""


def process_signature(
    _app: Sphinx, what: str, _name: str, thing: Any, _options: Any, *_: Any
) -> tuple[str, None] | None:
    """Drop the signature of what nobody constructs: results and enumerations."""
    if what == "class" and inspect.isclass(thing):
        is_result = any(f"{each.__module__}.{each.__name__}" == f"{RESULT}.Result" for each in thing.__mro__)
        if is_result or issubclass(thing, enum.Enum):
            return "", None
    return None


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the hooks and add the field of attributes."""
    field = TypedField(
        "attribute",
        label="Attributes",
        names=("attribute",),
        typenames=("attributetype",),
        can_collapse=True,
    )
    if not any(each.name == "attribute" for each in PyObject.doc_field_types):
        PyObject.doc_field_types = [field, *PyObject.doc_field_types]
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", process_docstring)
    app.connect("autodoc-process-signature", process_signature)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
