"""An archive of nights: samples in and out, a year of 365 nights of 2209 points, one night put away.

python benchmarks/bench_archive.py [--quick] [--curves]

Samples are night-01's, four times over; all packings give them back bit for bit, and the notes have their sizes. The
year has simulated coordinates with covariances that differ from point to point and night to night. A series is read by
a process of its own, imports included, from files that the system has in memory.
"""

import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import blosc2
import numpy as np
import pyarrow as pa

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from archive_scene import written_year
from catseye.coordinator.journal.rows import PACKED, pack, unpack
from catseye.gateways.archive.files import create_archive
from catseye.gateways.archive.joining import join_years
from catseye.gateways.archive.samples import write_samples
from catseye.records.archive.reading import open_archive, read_table
from catseye.records.archive.samples import SampleFrame
from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.service.archive.campaigns import archive_campaign
from harness import Contender, Curve, Row, main, raced

NIGHT = Path(__file__).parents[1] / "examples" / "night-01"
COPIES, PERIOD, CYCLES = 4, 64, 128
NIGHTS, POINTS, POINT = 365, 2209, "ZP01234"
COLUMNS = ("mjd", "x", "y", "z", "xx", "xy", "xz", "yy", "yz", "zz")
RAW_NIGHT = 19_439 * PERIOD * CYCLES * 2  # bytes: samples of a night of the whole dish, as `catseye night` has it

SERIES = f"""
import sys
from pathlib import Path
from catseye.records.archive.reading import open_archive, read_table
series = read_table(open_archive(Path(sys.argv[1])), "points", {COLUMNS}, where={{"point": "{POINT}"}})
assert len(series["x"]) == {NIGHTS}
"""
DUCKDB = f"""
import sys, duckdb
sql = "SELECT {", ".join(COLUMNS)} FROM read_parquet(?) WHERE point = '{POINT}' ORDER BY mjd"
series = duckdb.connect().execute(sql, [sys.argv[1] + "/points/*/*.parquet"]).fetchnumpy()
assert len(series["x"]) == {NIGHTS}
"""
SQLITE = f"""
import sys, sqlite3
sql = "SELECT {", ".join(COLUMNS)} FROM points WHERE point = '{POINT}' ORDER BY mjd"
assert len(sqlite3.connect(sys.argv[1]).execute(sql).fetchall()) == {NIGHTS}
"""
TEXT = f"""
import csv, sys
from pathlib import Path
found = []
for path in sorted(Path(sys.argv[1]).iterdir()):
    with path.open() as lines:
        found += [list(map(float, row[1:])) for row in csv.reader(lines) if row[0] == "{POINT}"]
assert len(found) == {NIGHTS}
"""


def apart(code: str, place: Path) -> float:
    """Seconds of a program in a process of its own."""
    begun = time.perf_counter()
    subprocess.run([sys.executable, "-c", code, str(place)], check=True)
    return time.perf_counter() - begun


def samples_rows(folder: Path, quick: bool) -> Iterator[Row]:
    """Samples written to a file and read back, by several packings."""
    samples = np.tile(np.load(NIGHT / "frames.npy"), (COPIES, 1))
    periods, cycles = np.full(len(samples), PERIOD), np.full(len(samples), CYCLES)
    zstd, raw = pa.Codec("zstd", compression_level=3), samples.tobytes()

    def ours() -> None:
        (folder / "ours").unlink(missing_ok=True)
        write_samples(folder / "ours", samples, periods, cycles)

    def by_journal() -> None:
        (folder / "journal").write_bytes(b"".join(pack(row, PERIOD, PACKED)["samples"] for row in samples))

    def blosc() -> None:
        (folder / "blosc").write_bytes(bytes(blosc2.pack_array2(samples, cparams=PLAIN)))

    writing: dict[str, Callable[[], object]] = {
        "catseye, read back and compared": ours,
        "zstd 3 alone": lambda: (folder / "zstd").write_bytes(zstd.compress(raw)),
        "the journal's packing": by_journal,
        "blosc2 as it comes, zstd 5": blosc,
        "as they are (numpy.save)": lambda: np.save(folder / "plain.npy", samples),
    }
    size = f"{samples.nbytes / 1e6:.0f} MB of night-01's"
    for work in writing.values():
        work()
    files = dict(zip(writing, ("ours", "zstd", "journal", "blosc", "plain.npy"), strict=True))
    sizes = ", ".join(f"{name} {(folder / file).stat().st_size / samples.nbytes:.3f}" for name, file in files.items())
    yield raced(
        "samples into the archive",
        size,
        {name: Contender(work) for name, work in writing.items()},
        quick=quick,
        clock=time.process_time,
        note=f"size: {sizes}; a Gaussian bound of this noise is 0.719",
    )
    packed = [pack(row, PERIOD, PACKED) for row in samples]
    reading: dict[str, Callable[[], object]] = {
        "catseye": lambda: [len(block) for block in SampleFrame.open(folder / "ours").blocks()],
        "zstd 3 alone": lambda: zstd.decompress((folder / "zstd").read_bytes(), len(raw), asbytes=True),
        "the journal's packing": lambda: [unpack(StoredBuffer(row), PERIOD, "here") for row in packed],
        "blosc2 as it comes, zstd 5": lambda: blosc2.unpack_array2((folder / "blosc").read_bytes()),
        "as they are (numpy.load)": lambda: np.load(folder / "plain.npy"),
    }
    assert np.array_equal(np.concatenate(list(SampleFrame.open(folder / "ours").blocks())), samples)
    yield raced(
        "samples from the archive",
        size,
        {name: Contender(work) for name, work in reading.items()},
        quick=quick,
        clock=time.process_time,
        note="ours and the journal's with a checksum of what comes out",
    )


PLAIN = {"codec": blosc2.Codec.ZSTD, "clevel": 5, "typesize": 2, "filters": [blosc2.Filter.BITSHUFFLE], "nthreads": 1}


class StoredBuffer:
    """Row of the journal's table of buffers."""

    def __init__(self, row: dict[str, object]):
        self.__dict__ |= row


def year_rows(folder: Path, quick: bool) -> Iterator[Row]:
    """One point's series of a year, from nights' own tables and from joined ones; joining."""
    begun = time.perf_counter()
    archive = written_year(folder / "year", NIGHTS, POINTS, seed=1)
    wrote = time.perf_counter() - begun
    whole = read_table(archive, "points", ["point", *COLUMNS])
    database, text = folder / "year.db", folder / "text"
    write_sqlite(database, whole)
    write_text(text, whole)
    single = size_of(folder / "year/points")
    what = f"one of {POINTS} points, {NIGHTS} nights"
    others = {
        "SQLite, indexed by point": Contender(partial(apart, SQLITE, database), timed=True),
        **({} if quick else {f"{NIGHTS} CSV files": Contender(partial(apart, TEXT, text), timed=True)}),
    }

    def series(name: str, note: str) -> Row:
        return raced(
            name,
            what,
            {
                "catseye": Contender(partial(apart, SERIES, folder / "year"), timed=True),
                "DuckDB on the same files": Contender(partial(apart, DUCKDB, folder / "year"), timed=True),
                **others,
            },
            quick=quick,
            note=note,
        )

    yield series(
        "a point's series, nights apart",
        f"tables {single / 1e6:.1f} MB, SQLite {database.stat().st_size / 1e6:.0f} MB, CSV "
        f"{size_of(text) / 1e6:.0f} MB; ours verifies checksums; the year was written in {wrote:.0f} s",
    )
    before = [read_table(open_archive(folder / "year"), "points", where={"point": POINT})]
    begun = time.process_time()
    join_years(folder / "year")
    joining = time.process_time() - begun
    after = read_table(open_archive(folder / "year"), "points", where={"point": POINT})
    assert all(np.array_equal(after[name], before[0][name]) for name in after)
    joined = size_of(folder / "year")
    yield series(
        "a point's series, the year joined",
        f"archive without samples {joined / 1e6:.1f} MB, joined in {joining:.1f} s of processor time; raw samples of "
        f"such nights would be {NIGHTS * RAW_NIGHT / 1e9:.0f} GB",
    )


def write_sqlite(path: Path, whole: dict[str, np.ndarray]) -> None:
    """The year's points as a table, indexed."""
    with sqlite3.connect(path) as connection:
        connection.execute(f"CREATE TABLE points (point TEXT, {', '.join(f'{name} REAL' for name in COLUMNS)})")
        cells = zip(*(column.tolist() for column in whole.values()), strict=True)
        connection.executemany(f"INSERT INTO points VALUES ({', '.join('?' * len(whole))})", cells)
        connection.execute("CREATE INDEX by_point ON points (point)")
    connection.close()


def write_text(folder: Path, whole: dict[str, np.ndarray]) -> None:
    """The year's points as a CSV file a night, digits as `catseye reduce` writes them."""
    folder.mkdir()
    nights = np.unique(whole["mjd"])
    for number, mjd in enumerate(nights):
        rows = whole["mjd"] == mjd
        table = np.stack([whole[name][rows] for name in COLUMNS], axis=1)
        lines = (
            f"{point},{row[0]:.9f},{row[1]:.7f},{row[2]:.7f},{row[3]:.7f}," + ",".join(f"{c:.6e}" for c in row[4:])
            for point, row in zip(whole["point"][rows].tolist(), table.tolist(), strict=True)
        )
        (folder / f"{number:03d}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def size_of(folder: Path) -> int:
    """Bytes of all files below a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def night_rows(folder: Path, quick: bool) -> Iterator[Row]:
    """A night reduced and put away, beside its reduction alone."""

    def put_away() -> None:
        shutil.rmtree(folder / "night", ignore_errors=True)
        create_archive(folder / "night")
        archive_campaign(str(folder / "night"), str(NIGHT))

    put_away()
    size, raw = size_of(folder / "night"), size_of(NIGHT)
    yield raced(
        "a night into the archive",
        "night-01, reduced",
        {
            "catseye": Contender(put_away),
            "its reduction alone": Contender(lambda: reduce_epoch(read_campaign(NIGHT))),
        },
        quick=quick,
        clock=time.process_time,
        note=f"archive {size / 1e6:.2f} MB, the campaign {raw / 1e6:.2f} MB: {size / raw:.3f}",
    )


def rows(quick: bool) -> Iterator[Row]:
    """Samples, a year, a night."""
    for part in (samples_rows, night_rows, year_rows):
        with tempfile.TemporaryDirectory() as folder:
            yield from part(Path(folder), quick)


def curves(quick: bool) -> Iterator[Curve]:
    """Processor time of one point's series against the number of nights, joined and not."""
    sizes, single, joined = (23, 46, 91, 182), [], []
    for nights in sizes:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place) / "year"
            written_year(folder, nights, POINTS, seed=1)
            single.append(seconds_of_series(folder, quick))
            join_years(folder)
            joined.append(seconds_of_series(folder, quick))
    yield Curve("a point's series, nights apart", f"{POINTS} points, without imports", "nights", sizes, tuple(single))
    yield Curve(
        "a point's series, the year joined", f"{POINTS} points, without imports", "nights", sizes, tuple(joined)
    )


def seconds_of_series(folder: Path, quick: bool) -> float:
    """Median processor time of one point's series."""
    taken = []
    for _ in range(3 if quick else 7):
        begun = time.process_time()
        read_table(open_archive(folder), "points", COLUMNS, where={"point": POINT})
        taken.append(time.process_time() - begun)
    return float(np.median(taken))


if __name__ == "__main__":
    main(rows, curves)
