"""Plain SQL over the tables of an archive, by DuckDB: one SELECT, and nothing reachable but the archive's own tables.

The session has no file system, no network, no extensions and a locked configuration: it sees each table as columns of
pyarrow, which read the archive's files for it. So no statement can read another file or change one of the archive.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from catseye.errors import InputError
from catseye.records.archive.layout import TABLES
from catseye.records.archive.parquet import scale_module, schema
from catseye.records.archive.reading import ArchiveFolder, refuse_damaged
from catseye.records.query.rows import first_line

MEMORY = "2GB"  # of one statement; it has no file to continue in
LONGEST = 20_000  # characters of a statement
MOST_ROWS = 1_000_000  # of an answer, which is held in memory
PIECE = 100_000  # rows fetched at once
LOCKED = (  # in this order: the last forbids any change
    "SET temp_directory = ''",
    "SET enable_external_access = false",
    f"SET memory_limit = '{MEMORY}'",
    "SET lock_configuration = true",
)
CONFIGURATION = {
    "python_enable_replacements": False,  # a name in the statement is no variable of ours
    "autoinstall_known_extensions": False,
    "autoload_known_extensions": False,
    "allow_community_extensions": False,
    "allow_unsigned_extensions": False,
}
UNIT_KEPT = frozenset(
    {"min", "max", "avg", "mean", "median", "mode", "stddev", "stddev_samp", "stddev_pop", "any_value", "first", "last"}
)  # functions of a column whose value has the column's unit


@dataclass(frozen=True, eq=False)
class SqlRows:
    """Answer to a statement, n rows.

    statement   as it ran
    columns     name -> (n,) values; text as str, NULL numbers as nan
    units       name -> unit as astropy spells it, of plain columns of the archive and their means and extremes; others
                are not there
    """

    statement: str
    columns: dict[str, np.ndarray]
    units: Mapping[str, str]

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values()), ()))


def run_sql(archive: ArchiveFolder, statement: str) -> SqlRows:
    """Rows of one SELECT over the tables of an archive, whose names and columns are those of docs/formats/archive.md.

    Raises InputError: no single SELECT, a mistake in it, one that reaches out of the archive, a damaged file of a
    table that it names, an answer that is too large.
    """
    if len(statement) > LONGEST:
        raise InputError(f"sql has {len(statement)} characters (expected at most {LONGEST})")
    duckdb = scale_module("duckdb")
    with _locked_session(archive) as session:
        try:
            text = _single_select(session, statement)
            tree = _tree(session, text)
            for kind in _tables_named(tree):
                for file in archive.files(kind):
                    refuse_damaged(archive.directory, file)
            columns = _fetched(session.sql(text))
        except duckdb.Error as problem:
            raise InputError(f"sql: {first_line(problem)} (expected one SELECT over {', '.join(TABLES)})") from problem
    return SqlRows(text, columns, _units(tree, list(columns)))


@contextmanager
def _locked_session(archive: ArchiveFolder) -> Iterator[Any]:
    """Session of DuckDB that has the tables of an archive, and nothing else."""
    duckdb, data = scale_module("duckdb"), scale_module("pyarrow.dataset")
    with duckdb.connect(config=CONFIGURATION) as session:
        for kind in TABLES:
            paths = [str(archive.directory / file.path) for file in archive.files(kind)]
            form = data.ParquetFileFormat(
                default_fragment_scan_options=data.ParquetFragmentScanOptions(page_checksum_verification=True)
            )
            source = data.dataset(paths, schema=schema(kind), format=form) if paths else schema(kind).empty_table()
            session.register(kind, source)
        for setting in LOCKED:
            session.execute(setting)
        yield session


def _single_select(session: Any, statement: str) -> str:
    """Text of the one SELECT of a statement."""
    parts = session.extract_statements(statement)
    if len(parts) != 1 or parts[0].type.name != "SELECT":
        found = ", ".join(part.type.name for part in parts) or "nothing"
        raise InputError(f"sql has {found} (expected one SELECT over {', '.join(TABLES)})")
    return str(parts[0].query).strip().rstrip(";")


def _tree(session: Any, text: str) -> dict[str, Any]:
    """Parsed statement as DuckDB describes it; empty where it cannot."""
    [[described]] = session.execute("SELECT json_serialize_sql(?::VARCHAR)", [text]).fetchall()
    found = json.loads(described)
    return {} if found.get("error") else found["statements"][0]["node"]


def _tables_named(tree: Any) -> set[str]:
    """Tables of the archive that a statement names anywhere; all of them where its parts are not known."""
    if not tree:
        return set(TABLES)
    found: set[str] = set()
    stack = [tree]
    while stack:
        part = stack.pop()
        if isinstance(part, dict):
            found |= {str(part["table_name"]).lower()} & set(TABLES) if part.get("table_name") else set()
            found |= set(TABLES) if part.get("type") == "TABLE_FUNCTION" else set()
            stack.extend(part.values())
        elif isinstance(part, list):
            stack.extend(part)
    return found


def _units(tree: dict[str, Any], names: list[str]) -> dict[str, str]:
    """Units of an answer's columns that are columns of one table, or means and extremes of one."""
    source = tree.get("from_table") or {}
    kind = str(source.get("table_name", "")).lower() if source.get("type") == "BASE_TABLE" else ""
    if kind not in TABLES or (tree.get("cte_map") or {}).get("map"):
        return {}
    units = {field.name: field.unit for field in TABLES[kind].fields if field.unit}
    selected = tree.get("select_list", [])
    if len(selected) == 1 and selected[0].get("class") == "STAR":
        plain = not any(selected[0].get(key) for key in ("replace_list", "rename_list", "expr"))
        return {name: units[name] for name in names if name in units} if plain else {}
    if len(selected) != len(names):
        return {}
    columns = {name: _column_of(part) for name, part in zip(names, selected, strict=True)}
    return {name: units[column] for name, column in columns.items() if column in units}


def _column_of(part: dict[str, Any]) -> str:
    """Column that an item of a select list is, or a mean or an extreme of; "" for all else."""
    arguments = part.get("arguments") or []
    if part.get("class") == "FUNCTION" and part.get("function_name") in UNIT_KEPT and len(arguments) == 1:
        inner = arguments[0].get("expression", arguments[0])
        return _column_of(inner) if inner.get("class") == "COLUMN_REF" else ""
    names = part.get("column_names") or []
    return str(names[-1]) if part.get("class") == "COLUMN_REF" and names else ""


def _fetched(answer: Any) -> dict[str, np.ndarray]:
    """Columns of an answer; a name that stands twice is numbered."""
    arrow = scale_module("pyarrow")
    batches, count = [], 0
    reader = answer.to_arrow_reader(PIECE)
    for batch in reader:
        count += batch.num_rows
        if count > MOST_ROWS:
            expected = "expected fewer: WHERE, GROUP BY or LIMIT"
            raise InputError(f"sql: the answer has more than {MOST_ROWS} rows ({expected})")
        batches.append(batch)
    table = arrow.Table.from_batches(batches, schema=reader.schema)
    columns: dict[str, np.ndarray] = {}
    for place, name in enumerate(table.column_names):
        while name in columns:
            name += "_"
        columns[name] = _plain(arrow, table.column(place))
    return columns


def _plain(arrow: Any, column: Any) -> np.ndarray:
    """Column of an answer: text, whole numbers, or floats with nan for NULL."""
    kind = column.type
    if arrow.types.is_floating(kind) or arrow.types.is_decimal(kind):
        return np.asarray(column.cast(arrow.float64()).to_numpy(), dtype=np.float64)
    if arrow.types.is_integer(kind) or arrow.types.is_boolean(kind):
        return np.asarray(column.to_numpy(), dtype=np.float64 if column.null_count else None)
    return np.array(["" if value is None else str(value) for value in column.to_pylist()], dtype=np.str_)
