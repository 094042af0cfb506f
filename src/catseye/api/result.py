"""Base of every result of `import catseye`: text, tables, figures, JSON's types and files."""

import hashlib
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catseye.aliases import Progress
from catseye.errors import InputError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.verdict import Verdict


WIDTH = 100  # columns of a paragraph
FORMAT = "catseye-result-1"  # of what `save` writes of a result that has no files of its own


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """An answer: frozen, with its verdict; `repr` is a paragraph, a notebook shows all its sentences.

    verdict   whether it may be relied on: word ("good", "doubtful", "failed") and why
    """

    verdict: "Verdict"

    def passages(self) -> "Sequence[Passage]":
        """The sentences that the command prints, each under a word or two, without the verdict."""
        raise NotImplementedError

    def to_object(self) -> dict[str, Any]:
        """JSON object of the command, in Python's and numpy's own types."""
        raise NotImplementedError

    def to_json(self) -> str:
        """JSON object of the command, on one line."""
        return json_text(self.to_object())

    def tables(self) -> "dict[str, QTable]":
        """Every table of the answer by its name, the main one first; columns have units where they have one."""
        raise NotImplementedError

    def to_table(self, name: str | None = None) -> "QTable":
        """One of its tables, the main one without a name.

        Raises InputError for a name that is none of them.
        """
        tables = self.tables()
        if name is None:
            return next(iter(tables.values()))
        if name not in tables:
            raise InputError(f"table {name!r} is not in this result (expected one of {', '.join(tables)})")
        return tables[name]

    def figures(self) -> "dict[str, Figure]":
        """Figures by their names; none unless a result has some."""
        return {}

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Its files into a directory that is there and empty: tables as CSV, figures, the whole as JSON."""
        self.write_files(directory, progress)

    def write_files(
        self,
        directory: Path,
        progress: Progress | None = None,
        pages: "Mapping[str, Callable[[datetime], str]] | None" = None,
    ) -> None:
        """The whole as JSON, each table as CSV, each figure as SVG, and pages; last the provenance.

        pages   name -> what gives its text, told when it is made, UTC
        """
        from datetime import UTC, datetime

        from catseye.gateways.writers.drawing import svg
        from catseye.gateways.writers.objects import json_page
        from catseye.gateways.writers.written import origin, write_files

        now = datetime.now(UTC)
        files: dict[str, Callable[[], str]] = {}
        for name, made in (pages or {}).items():
            files[name] = partial(made, now)
        files["result.json"] = lambda: json_page({"format": FORMAT, **self.to_object()})
        for name, table in self.tables().items():
            files[f"{name}.csv"] = partial(_csv_of, table)
        for name, drawn in self.figures().items():
            files[f"{name}.svg"] = partial(svg, drawn)
        made_by = {"format": FORMAT, "made_by": f"catseye.save of {type(self).__name__}"}
        write_files(files, directory, {**made_by, **origin(now, self.inputs())}, progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file that went in, by its name; none where there was no file."""
        return {}

    def sources(self) -> tuple[Path, ...]:
        """Files and directories that were read, which `save` must not write over."""
        return ()

    def __repr__(self) -> str:
        said = [self.verdict.text, *(f"{p.title}: {p.text.rstrip('.')}." for p in self.headline())]
        return textwrap.fill(f"<{type(self).__name__}> " + " ".join(said), WIDTH)

    def headline(self) -> "Sequence[Passage]":
        """The passages of `repr`, a paragraph together."""
        return self.passages()[:2]

    def _repr_html_(self) -> str:
        rows = "".join(f"<dt><b>{escape(p.title)}</b></dt><dd>{escape(p.text)}</dd>" for p in self.passages())
        from catseye.gateways.writers.verdict import SIGNS

        word = f"{SIGNS[self.verdict.word]} {self.verdict.word.capitalize()}"
        return f"<p><b>{word}</b>: {escape(self.verdict.why)}.</p><dl>{rows}</dl>"


class Figures(dict[str, "Figure"]):
    """Matplotlib figures by their names; a notebook shows them all."""

    def _repr_html_(self) -> str:
        from catseye.gateways.writers.drawing import svg
        from catseye.gateways.writers.page import picture

        return "".join(picture(svg(figure), name.replace("_", " ")) for name, figure in self.items())


def show(result: Result, *names: str) -> Figures:
    """Figures of a result, as matplotlib's own.

    result   what a function of catseye gave
    names    of the figures wanted; all without

    Raises InputError for a name that is none of them, and where a result has no figure.
    """
    if not isinstance(result, Result):
        raise InputError(
            f"show needs a result of catseye, not {type(result).__name__}; reduce, adjust and so on give one"
        )
    drawn = result.figures()
    if not drawn:
        raise InputError(f"a {type(result).__name__} has no figure; its table is to_table()")
    for name in names:
        if name not in drawn:
            raise InputError(f"figure {name!r} is not in this result (expected one of {', '.join(drawn)})")
    return Figures({name: drawn[name] for name in names or drawn})


def save(result: Result, directory: "str | Path", *, progress: Progress | None = None) -> Path:
    """Write what the command's `--out` writes, whole or not at all.

    result      what a function of catseye gave
    directory   to be made: new, empty, or an earlier output of catseye
    progress    called with (what, done, of how many)

    Returns the directory. Raises InputError where another's files would be lost or nothing can be written.
    """
    from catseye.gateways.writers.output import atomic_directory
    from catseye.processors import free_threads

    if not isinstance(result, Result):
        raise InputError(
            f"save needs a result of catseye, not {type(result).__name__}; reduce, adjust and so on give one"
        )
    where = Path(directory)
    with atomic_directory(where, *result.sources()) as fresh, free_threads():
        result.write(fresh, progress)
    return where


def quantities(columns: "Mapping[str, tuple[Any, str]]", **meta: Any) -> "QTable":
    """A table of columns with units.

    columns   name -> values (n, ...) and the unit as astropy spells it, "" for none and for text
    meta      kept in the table's `meta`
    """
    import numpy as np
    from astropy import units
    from astropy.table import QTable

    return QTable(
        {
            name: np.asarray(values) << units.Unit(unit) if unit else np.asarray(values)
            for name, (values, unit) in columns.items()
        },
        meta=meta,
    )


def json_text(value: Any) -> str:
    """JSON text on one line; NaN and infinity become null."""
    from catseye.gateways.writers.objects import json_line

    return json_line(value)


def digest_of(path: Path) -> str:
    """SHA-256 of a file, as provenance has it."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _csv_of(table: "QTable") -> str:
    """The table as CSV, units in the heads of its columns."""
    from catseye.gateways.writers.written import csv_text

    heads = [f"{name} [{table[name].unit}]" if getattr(table[name], "unit", None) else name for name in table.colnames]
    columns = [getattr(table[name], "value", table[name]).tolist() for name in table.colnames]
    return csv_text(heads, zip(*columns, strict=True))


def require_writable(out: "Path | None", *sources: "str | Path") -> None:
    """Refuse an output that `save` would refuse, before the long work.

    out       directory to be written; None: none
    sources   files and directories that are read

    Raises InputError where another's files would be lost or nothing can be written.
    """
    from catseye.gateways.writers.output import refuse_output

    if out is not None:
        refuse_output(out, *(Path(source) for source in sources))
