"""Base of every result of `import catseye`: text, tables, figures, JSON's types and files."""

import hashlib
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from catseye.aliases import Progress
from catseye.errors import InputError

if TYPE_CHECKING:
    from datetime import datetime

    from astropy.table import QTable
    from matplotlib.figure import Figure

    from catseye.gateways.writers.passage import Passage
    from catseye.gateways.writers.report import ResultReport
    from catseye.verdict import Verdict


WIDTH = 100  # columns of a paragraph
FORMAT = "catseye-result-1"  # of what `save` writes of a result that has no files of its own


class SinglePage(NamedTuple):
    """File that a result can write by itself.

    mark   text in its first 4096 bytes that identifies a file of catseye, which may be replaced
    text   its content, from the time of writing, UTC, and the path
    html   True: its name ends in .html
    """

    mark: str
    text: "Callable[[datetime, Path], str]"
    html: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """Answer with its verdict; `repr` is a paragraph, a notebook shows all.

    verdict   whether it may be relied on: word ("good", "doubtful", "failed") and why
    """

    verdict: "Verdict"

    def passages(self) -> "Sequence[Passage]":
        """Sentences that the command prints, by title, without the verdict."""
        raise NotImplementedError

    def to_object(self) -> dict[str, Any]:
        """JSON object of the command, in Python's and numpy's own types."""
        raise NotImplementedError

    def to_json(self) -> str:
        """JSON object of the command, on one line."""
        return json_text(self.to_object())

    @property
    def answered(self) -> bool:
        """True if there is an answer to tell and to save; False for an adjustment that failed."""
        return True

    def require_answer(self) -> None:
        """Raise EstimationError where there is no answer."""

    def tables(self) -> "dict[str, QTable]":
        """Tables of the answer by name, the main one first, with units."""
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

    def to_report(self) -> dict[str, Any]:
        """Report of the answer as `report_of` reads it from its page, docs/formats/results.md.

        Raises InputError for a result without a report, EstimationError where there is no answer.
        """
        from datetime import UTC, datetime

        from catseye.gateways.writers.report import report_object

        made = self._report(datetime.now(UTC))
        if made is None:
            raise InputError(f"a {type(self).__name__} has no report; its tables are to_table()")
        return report_object(made)

    def _report(self, when: "datetime") -> "ResultReport | None":
        """Report, made at a time, UTC; None unless a result has one."""
        return None

    def pages(self) -> dict[str, SinglePage]:
        """Single files by name, such as a record or a certificate."""
        return {}

    def page_texts(self, names: Mapping[str, str]) -> "dict[str, Callable[[datetime], str]]":
        """Text of single files for `write_files`.

        names   file in a directory -> name of `pages`
        """
        pages = self.pages()

        def text(name: str, file: str, now: "datetime") -> str:
            return pages[name].text(now, Path(file))

        return {file: partial(text, name, file) for file, name in names.items()}

    def save_pages(self, **paths: "str | Path | None") -> None:
        """Write single files, all of them or none.

        paths   name of `pages` -> file: new, or an earlier one of catseye; None: not written

        Raises InputError for an unknown name, and where a foreign file would be lost or nothing can be written.
        """
        with _opened(self, paths):
            pass

    def write(self, directory: Path, progress: Progress | None = None) -> None:
        """Write tables as CSV, figures and JSON into an empty directory."""
        self.write_files(directory, progress)

    def write_files(
        self,
        directory: Path,
        progress: Progress | None = None,
        pages: "Mapping[str, Callable[[datetime], str]] | None" = None,
    ) -> None:
        """Write JSON, tables as CSV, figures as SVG, pages; last the provenance.

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
        files["result.json"] = lambda: json_page({"format": FORMAT, **_keyed(self.to_object())})
        for name, table in self.tables().items():
            files[f"{name}.csv"] = partial(_csv_of, table)
        for name, drawn in self.figures().items():
            files[f"{name}.svg"] = partial(svg, drawn)
        made_by = {"format": FORMAT, "made_by": f"catseye.save of {type(self).__name__}"}
        write_files(files, directory, {**made_by, **origin(now, self.inputs())}, progress=progress)

    def inputs(self) -> dict[str, str]:
        """SHA-256 of each input file, by its name."""
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


def save(
    result: Result, directory: "str | Path", *, progress: Progress | None = None, **pages: "str | Path | None"
) -> Path:
    """Write the files of a result, whole or not at all.

    result      what a function of catseye gave
    directory   to be made: new, empty, or an earlier output of catseye
    progress    called with (what, done, of how many)
    pages       single files beside it, by the names of `Result.pages`: record="TR01.toml"

    Returns the directory. Raises InputError where another's files would be lost or nothing can be written.
    """
    from catseye.gateways.writers.output import atomic_directory
    from catseye.processors import free_threads

    if not isinstance(result, Result):
        raise InputError(
            f"save needs a result of catseye, not {type(result).__name__}; reduce, adjust and so on give one"
        )
    where = Path(directory)
    with (
        _opened(result, pages, where),
        atomic_directory(where, *result.sources()) as fresh,
        free_threads(),
    ):
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


def _keyed(answer: Any) -> dict[str, Any]:
    """JSON object of an answer; a list of objects stands under "items"."""
    return answer if isinstance(answer, dict) else {"items": answer}


def _csv_of(table: "QTable") -> str:
    """The table as CSV, units in the heads of its columns."""
    from catseye.gateways.writers.written import csv_text

    heads = [f"{name} [{table[name].unit}]" if getattr(table[name], "unit", None) else name for name in table.colnames]
    columns = [getattr(table[name], "value", table[name]).tolist() for name in table.colnames]
    return csv_text(heads, zip(*columns, strict=True))


def require_writable(out: "Path | None", *sources: "str | Path | None", **pages: "str | Path | None") -> None:
    """Refuse an output that `save` would refuse, before the long work.

    out       directory to be written; None: none
    sources   files and directories that are read; None: none
    pages     single files to be written, by their names; None: none

    Raises InputError where another's files would be lost or nothing can be written.
    """
    from catseye.gateways.writers.output import refuse_output

    read = [Path(source) for source in sources if source is not None]
    _require_pages({name: Path(path) for name, path in pages.items() if path is not None}, read, out)
    if out is not None:
        refuse_output(out, *read)


@contextmanager
def _opened(result: Result, paths: "Mapping[str, str | Path | None]", directory: Path | None = None) -> Iterator[None]:
    """Write single files of a result on success, all or none."""
    from datetime import UTC, datetime

    from catseye.gateways.writers.output import atomic_file, refuse_suffix

    now, pages = datetime.now(UTC), result.pages()
    named = {name: Path(path) for name, path in paths.items() if path is not None}
    for name in named:
        if name not in pages:
            expected = f"expected one of {', '.join(pages)}" if pages else "it has none"
            raise InputError(f"page {name!r} is not in this result ({expected})")
    _require_pages(named, result.sources(), directory)
    for name, path in named.items():
        if pages[name].html:
            refuse_suffix(path, name)
    with ExitStack() as files:
        for name, path in named.items():
            files.enter_context(atomic_file(path, name, pages[name].mark)).append(pages[name].text(now, path))
        yield


def _require_pages(pages: Mapping[str, Path], sources: Sequence[Path], directory: Path | None) -> None:
    """Raise InputError for a single file that may not be written."""
    read = {source.resolve() for source in sources}
    names: dict[Path, str] = {}
    for name, path in pages.items():
        where = path.resolve()
        if where in read:
            raise InputError(f"{name} {path}: is an input (expected another name)")
        if where in names:
            raise InputError(f"{name} {path}: is the {names[where]} too (expected two names)")
        if not where.parent.is_dir():
            raise InputError(f"{name} {path}: its directory does not exist (expected one that does)")
        if directory is not None and directory.resolve() in (where, *where.parents):
            raise InputError(f"{name} {path}: is or lies in {directory} (expected a place outside it)")
        names[where] = name
