"""Parquet files of an archive."""

from pathlib import Path
from typing import Any

import numpy as np

from catseye.gateways.archive.content import Columns
from catseye.records.archive.layout import TableLayout, table_layout
from catseye.records.archive.parquet import scale_module, schema

LEVEL = 3  # of zstd
GROUP = 8192  # rows of a row group: a point of ten years in a joined file lies in one or two
REPEATED = ("mjd", "azimuth", "elevation", "temperature_c")  # few values in a night: by dictionary


def write_table(path: Path, kind: str, columns: Columns) -> int:
    """Write rows of a table, sorted, and return their number.

    path      of the new file
    columns   arrays of one length; a missing one is null, "" or 0

    Raises InputError: an unknown table or column.
    """
    table = arrow_table(kind, columns)
    write_arrow(path, kind, table)
    return int(table.num_rows)


def arrow_table(kind: str, columns: Columns) -> Any:
    """Table of pyarrow, sorted by the layout's first column and `mjd`."""
    arrow = scale_module("pyarrow")
    layout = table_layout(kind)
    for name in columns:
        layout.field(name)
    rows = len(next(iter(columns.values()), ()))
    arrays = {field.name: _filled(layout, field.name, columns, rows) for field in layout.fields}
    order = np.lexsort((arrays["mjd"], arrays[layout.fields[0].name]))
    form = schema(kind)
    cells = [arrow.array(arrays[field.name][order], type=field.type, from_pandas=True) for field in form]
    return arrow.Table.from_arrays(cells, schema=form)


def write_arrow(path: Path, kind: str, table: Any) -> None:
    """Write a table of pyarrow: zstd, a checksum a page."""
    layout = table_layout(kind)
    texts = [field.name for field in layout.fields if field.kind == "text"]
    repeated = [name for name in REPEATED if name in layout.names and not (kind == "weather" and name != "mjd")]
    split = [field.name for field in layout.fields if field.kind == "float" and field.name not in repeated]
    scale_module("pyarrow.parquet").write_table(
        table,
        path,
        compression="zstd",
        compression_level=LEVEL,
        row_group_size=GROUP,
        use_dictionary=[*texts, *repeated],
        use_byte_stream_split=split,
        write_page_checksum=True,
        store_schema=False,
    )


def _filled(layout: TableLayout, name: str, columns: Columns, rows: int) -> np.ndarray:
    """Column as an array of its type, null where it is missing."""
    kind = layout.field(name).kind
    if name not in columns:
        return np.full(rows, {"text": "", "float": np.nan, "integer": 0}[kind])
    return np.asarray(columns[name], {"text": np.str_, "float": np.float64, "integer": np.int64}[kind])
