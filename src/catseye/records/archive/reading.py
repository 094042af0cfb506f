"""Reading of an archive: its index, and columns of its tables."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from catseye.errors import InputError
from catseye.records.archive.index import ArchivedFile, ArchivedNight, JoinedYear, damaged, night_path, read_entry
from catseye.records.archive.layout import FORMAT, HEAD, INDEX, JOINED, Field, table_layout
from catseye.records.archive.parquet import footer_sha256, scale_module, schema
from catseye.records.files.reading import toml_of
from catseye.records.files.refusal import refusal, unreadable


@dataclass(frozen=True)
class ArchiveFolder:
    """Archive as its index has it.

    directory   of the archive
    entries     a night each, by identifier, in order of time
    joined      years whose tables are joined, by year
    """

    directory: Path
    entries: Mapping[str, ArchivedNight]
    joined: Mapping[int, JoinedYear]

    @property
    def nights(self) -> tuple[str, ...]:
        """Identifiers in order of time."""
        return tuple(self.entries)

    @property
    def years(self) -> tuple[int, ...]:
        """Calendar years with a night, UTC."""
        return tuple(sorted({entry.year for entry in self.entries.values()}))

    def entry(self, night: str) -> ArchivedNight:
        """Entry of a night, named by its identifier or by a beginning that only one has; InputError if unknown."""
        if night in self.entries:
            return self.entries[night]
        alike = [name for name in self.entries if name.startswith(night)]
        if len(alike) == 1:
            return self.entries[alike[0]]
        state = "is the beginning of several" if alike else "is not in the archive"
        names = (alike or list(self.entries))[:5]
        more = ", ..." if len(alike or self.entries) > len(names) else ""
        raise refusal(str(self.directory), f"night {night!r} {state} (expected one of {', '.join(names)}{more})")

    def files(
        self, kind: str, *, nights: Iterable[str] | None = None, since: float | None = None, until: float | None = None
    ) -> list[ArchivedFile]:
        """Parquet files of a table that can hold rows of these nights and times.

        nights         identifiers; None for all
        since, until   MJD, the last excluded; None for no limit
        """
        table_layout(kind)
        chosen = self.entries if nights is None else [name for name in dict.fromkeys(nights) if name in self.entries]
        files: dict[str, ArchivedFile] = {}
        for name in chosen:
            entry = self.entries[name]
            if (since is not None and entry.last < since) or (until is not None and entry.first >= until):
                continue
            holder = self._joined_year.get(name)
            for file in entry.files if holder is None else holder.files:
                if file.kind == kind:
                    files.setdefault(file.path, file)
        return list(files.values())

    @cached_property
    def _joined_year(self) -> dict[str, JoinedYear]:
        return {name: year for year in self.joined.values() for name in year.nights}


def open_archive(directory: Path) -> ArchiveFolder:
    """Archive in a directory; InputError if it is none, or if an entry of its index is damaged."""
    folder, problems = read_index(directory)
    if problems:
        raise problems[0]
    return folder


def read_index(directory: Path) -> tuple[ArchiveFolder, list[InputError]]:
    """Archive as far as its index can be read, and an error for each damaged entry.

    Raises InputError where the directory is no archive.
    """
    refuse_foreign(directory)
    problems: list[InputError] = []
    nights: dict[str, ArchivedNight] = {}
    joined: dict[int, JoinedYear] = {}
    try:
        names = sorted(name for name in os.listdir(directory / INDEX) if name.endswith(".json"))
    except OSError as problem:
        raise unreadable(str(directory / INDEX), problem) from problem
    for name in names:
        try:
            entry = read_entry(directory, Path(INDEX) / name)
        except InputError as problem:
            problems.append(problem)
            continue
        if isinstance(entry, JoinedYear):
            joined[entry.year] = entry
        else:
            nights[entry.night] = entry
    for year in joined.values():  # an entry that joining left behind is older
        nights |= year.nights
    ordered = dict(sorted(nights.items(), key=lambda item: (item[1].first, item[0])))
    return ArchiveFolder(directory, ordered, joined), problems


def intact_night(directory: Path, night: str) -> ArchivedNight | None:
    """Entry of a night whose files are all as they were written; None where it is not in the archive, or damaged.

    Raises InputError for a damaged file of its year's joined tables.
    """
    for path in sorted((directory / INDEX).glob(f"{JOINED}-*.json")):
        year = read_entry(directory, path.relative_to(directory))
        if isinstance(year, JoinedYear) and night in year.nights:
            for file in year.files:
                refuse_damaged(directory, file)
            return year.nights[night] if _is_intact(directory, year.nights[night]) else None
    try:
        entry = read_entry(directory, night_path(night))
    except InputError:
        return None
    return entry if isinstance(entry, ArchivedNight) and _is_intact(directory, entry) else None


def _is_intact(directory: Path, entry: ArchivedNight) -> bool:
    try:
        for file in entry.files:
            refuse_damaged(directory, file)
    except InputError:
        return False
    return True


def refuse_foreign(directory: Path) -> None:
    """Raise InputError unless the directory is an archive of a known version."""
    head = directory / HEAD
    try:
        text = head.read_text(encoding="utf-8")
    except FileNotFoundError as problem:
        state = "is not a directory" if not directory.is_dir() else f"holds no {HEAD}"
        raise refusal(str(directory), f"{state} (expected an archive, as `catseye archive` writes it)") from problem
    except (OSError, UnicodeDecodeError) as problem:
        raise refusal(str(head), f"cannot be read: {problem}") from problem
    form = toml_of(text, str(head)).get("format")
    if form != FORMAT:
        raise refusal(str(head), f"format = {form!r} (expected {FORMAT!r}; a newer one needs a newer catseye)")


def read_table(
    archive: ArchiveFolder,
    kind: str,
    columns: Sequence[str] | None = None,
    *,
    where: Mapping[str, Any] | None = None,
    since: float | None = None,
    until: float | None = None,
) -> dict[str, np.ndarray]:
    """Columns of a table over all nights, sorted by the table's first column and `mjd`.

    kind           name of the table
    columns        names, in the order of the answer; None for all
    where          value or tuple of values that a row's column must equal, by column
    since, until   MJD, the last excluded; None for no limit

    Text comes as an array of str, float as float64 with NaN for null, integer as int64.

    Raises InputError: an unknown table or column, a file that is missing or damaged.
    """
    layout = table_layout(kind)
    names = list(layout.names if columns is None else columns)
    conditions = dict(where or {})
    for name in (*names, *conditions):
        layout.field(name)
    nights = _values(conditions["night"]) if "night" in conditions else None
    files = archive.files(kind, nights=nights, since=since, until=until)
    if not files:
        return {name: _empty(layout.field(name)) for name in names}
    key = layout.fields[0].name
    table = _scanned(archive, kind, files, list(dict.fromkeys([*names, key, "mjd"])), conditions, (since, until))
    arrays = {name: _array(table.column(name)) for name in table.column_names}
    order = np.lexsort((arrays["mjd"][0], _ranks(arrays[key])))
    return {name: _plain(arrays[name], layout.field(name))[order] for name in names}


def _scanned(
    archive: ArchiveFolder,
    kind: str,
    files: Sequence[ArchivedFile],
    names: list[str],
    conditions: Mapping[str, Any],
    span: tuple[float | None, float | None],
) -> Any:
    """Table of pyarrow with these columns of the rows that fulfil the conditions."""
    data, arrow = scale_module("pyarrow.dataset"), scale_module("pyarrow")
    for file in files:
        refuse_damaged(archive.directory, file, footer=True)
    texts = [field.name for field in table_layout(kind).fields if field.kind == "text" and field.name in names]
    form = data.ParquetFileFormat(
        read_options=data.ParquetReadOptions(dictionary_columns=texts),
        default_fragment_scan_options=data.ParquetFragmentScanOptions(page_checksum_verification=True),
    )
    expression = None
    tests = [_equals(data.field(name), values) for name, values in conditions.items()]
    tests += [data.field("mjd") >= span[0]] if span[0] is not None else []
    tests += [data.field("mjd") < span[1]] if span[1] is not None else []
    for test in tests:
        expression = test if expression is None else expression & test
    fields = [
        arrow.field(field.name, arrow.dictionary(arrow.int32(), arrow.string())) if field.name in texts else field
        for field in schema(kind)
    ]
    paths = [str(archive.directory / file.path) for file in files]
    try:
        source = data.dataset(paths, schema=arrow.schema(fields), format=form)
        return source.to_table(columns=names, filter=expression)
    except (arrow.ArrowException, OSError) as problem:
        for file in files:
            refuse_damaged(archive.directory, file)
        raise refusal(str(archive.directory), f"table {kind} cannot be read: {problem}") from problem


def rows_of_nights(archive: ArchiveFolder, kind: str, nights: Iterable[str]) -> Any:
    """All rows of some nights in a table, sorted as `read_table` sorts, as a table of pyarrow; None for no file.

    Raises InputError, naming the file, for one that differs from its SHA-256.
    """
    names = tuple(nights)
    files = archive.files(kind, nights=names)
    if not files:
        return None
    for file in files:
        refuse_damaged(archive.directory, file)
    layout = table_layout(kind)
    table = _scanned(archive, kind, files, list(layout.names), {"night": names}, (None, None))
    key = layout.fields[0].name
    order = np.lexsort((_array(table.column("mjd"))[0], _ranks(_array(table.column(key)))))
    return table.take(order).cast(schema(kind))


def refuse_damaged(directory: Path, file: ArchivedFile, *, footer: bool = False) -> None:
    """Raise InputError, naming the file, unless it is as it was written.

    footer   True to compare size and footer alone; pages and blocks of samples have checksums of their own
    """
    path = directory / file.path
    try:
        size = path.stat().st_size
        if size != file.size:
            raise damaged(path, f"holds {size} bytes, {file.size} in the index")
        if footer:
            intact = not file.footer or footer_sha256(path) == file.footer
        else:
            intact = file_sha256(path) == file.sha256
    except FileNotFoundError as problem:
        raise damaged(path, "missing") from problem
    except OSError as problem:
        raise unreadable(str(path), problem) from problem
    if not intact:
        raise damaged(path, "differs from its SHA-256 in the index")


def file_sha256(path: Path) -> str:
    """SHA-256 of a file's content, hexadecimal."""
    from hashlib import file_digest

    with path.open("rb") as stream:
        return file_digest(stream, "sha256").hexdigest()


def _values(condition: Any) -> list[Any]:
    return list(condition) if isinstance(condition, tuple | list | set | frozenset | np.ndarray) else [condition]


def _equals(field: Any, condition: Any) -> Any:
    values = [value.item() if isinstance(value, np.generic) else value for value in _values(condition)]
    return field == values[0] if len(values) == 1 else field.isin(values)


def _array(column: Any) -> tuple[np.ndarray, np.ndarray | None]:
    """Values, or indices with the dictionary that they point into."""
    if str(column.type).startswith("dictionary"):
        array = column.unify_dictionaries().combine_chunks()
        chunk = array.chunk(0) if hasattr(array, "chunk") else array
        words = np.array(chunk.dictionary.to_pylist() or [""], dtype=np.str_)
        return chunk.indices.to_numpy(zero_copy_only=False), words
    return column.to_numpy(), None


def _ranks(array: tuple[np.ndarray, np.ndarray | None]) -> np.ndarray:
    """Order of a column's values, as numbers."""
    values, words = array
    return values if words is None else np.unique(words, return_inverse=True)[1].reshape(-1)[values]


def _plain(array: tuple[np.ndarray, np.ndarray | None], field: Field) -> np.ndarray:
    values, words = array
    return np.asarray(values, _dtype(field)) if words is None else words[values]


def _dtype(field: Field) -> type:
    return {"text": np.str_, "float": np.float64, "integer": np.int64}[field.kind]


def _empty(field: Field) -> np.ndarray:
    return np.empty(0, _dtype(field))
