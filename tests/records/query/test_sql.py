"""Plain SQL: its answers, their units, and that nothing else can be reached or changed."""

from hashlib import sha256

import numpy as np
import pytest

from archive_scene import flip, written_year
from catseye.errors import InputError
from catseye.records.archive.reading import read_table
from catseye.records.query import sql
from catseye.records.query.sql import run_sql


@pytest.fixture(scope="module")
def year(tmp_path_factory):
    return written_year(tmp_path_factory.mktemp("year") / "archive", nights=5, points=20)


def test_rows_and_units_of_plain_columns(year):
    rows = run_sql(year, "SELECT point, night, x, temperature_c FROM points WHERE point = 'ZP00003' ORDER BY mjd;")
    expected = read_table(year, "points", ("night", "x"), where={"point": "ZP00003"})
    assert rows.columns["night"].tolist() == expected["night"].tolist()
    assert np.array_equal(rows.columns["x"], expected["x"])
    assert rows.units == {"x": "m", "temperature_c": "deg_C"}


@pytest.mark.parametrize(
    ("statement", "units"),
    [
        ("SELECT avg(x), min(elevation) AS low, count(*), sum(x) FROM points", {"avg(x)": "m", "low": "rad"}),
        ("SELECT p.x AS place FROM points AS p LIMIT 1", {"place": "m"}),
        ("SELECT 1000 * x AS x, x + 1 FROM points LIMIT 1", {}),
        ("SELECT x FROM (SELECT 1000 * x AS x FROM points) LIMIT 1", {}),
        ("WITH points AS (SELECT 1000 * x AS x FROM points) SELECT x FROM points LIMIT 1", {}),
        ("SELECT x FROM points JOIN nights USING (night) LIMIT 1", {}),
        ("SELECT * REPLACE (1000 * x AS x) FROM points LIMIT 1", {}),
    ],
)
def test_a_unit_stands_only_where_it_is_sure(year, statement, units):
    assert run_sql(year, statement).units == units


def test_a_star_has_the_units_of_its_table(year):
    rows = run_sql(year, "SELECT * FROM weather LIMIT 3")
    assert (rows.count, rows.units["pressure_hpa"], rows.units["mjd"]) == (3, "hPa", "d")


def test_joins_over_tables(year):
    rows = run_sql(
        year,
        "SELECT n.night, z.value FROM nights n JOIN zeros z USING (night) WHERE z.ranger = 'ZY104' ORDER BY n.mjd",
    )
    expected = read_table(year, "zeros", ("night", "value"), where={"ranger": "ZY104"})
    assert np.array_equal(rows.columns["value"], expected["value"])


def test_nulls_words_and_double_names(year):
    rows = run_sql(
        year, "SELECT NULL::DOUBLE AS a, 1 AS b, 2 AS b, 'w' AS c, NULL::VARCHAR AS d, DATE '2026-01-02' AS e"
    )
    assert {name: values.tolist() for name, values in rows.columns.items() if name != "a"} == {
        "b": [1], "b_": [2], "c": ["w"], "d": [""], "e": ["2026-01-02"],
    }  # fmt: skip
    assert np.isnan(rows.columns["a"]).all()


def contents(year):
    return {path: sha256(path.read_bytes()).hexdigest() for path in sorted(year.directory.rglob("*")) if path.is_file()}


ESCAPES = [
    "SELECT * FROM read_csv('{secret}')",
    "SELECT * FROM read_text('{secret}')",
    "SELECT * FROM read_blob('{secret}')",
    "SELECT * FROM '{secret}'",
    "SELECT * FROM '{parquet}'",
    "SELECT * FROM read_parquet('{parquet}')",
    "SELECT * FROM parquet_metadata('{parquet}')",
    "SELECT * FROM glob('{folder}/*')",
    "SELECT * FROM sniff_csv('{secret}')",
    "SELECT * FROM read_csv('https://example.org/data.csv')",
    "SELECT getenv('HOME')",
    "SELECT * FROM secret_rows",
    "SELECT * FROM query('COPY points TO ''{folder}/out.csv''')",
    "SELECT * FROM enable_logging(storage = 'file', storage_config = {{'path': '{folder}/log'}})",
    "SELECT * FROM duckdb_secrets()",
    "COPY points TO '{folder}/out.csv'",
    "COPY (SELECT 1) TO '{parquet}'",
    "EXPORT DATABASE '{folder}/out'",
    "ATTACH '{folder}/other.db'",
    "INSTALL httpfs",
    "LOAD httpfs",
    "SET enable_external_access = true",
    "PRAGMA enable_profiling",
    "CALL enable_logging()",
    "CREATE TABLE t AS SELECT 1",
    "DROP VIEW points",
    "INSERT INTO points SELECT * FROM points",
    "WITH t AS (INSERT INTO points SELECT * FROM points RETURNING *) SELECT * FROM t",
    "UPDATE points SET x = 0",
    "DELETE FROM points",
    "SELECT 1; COPY points TO '{folder}/out.csv'",
    "SELECT 1; SET lock_configuration = false",
    "EXPLAIN ANALYZE SELECT 1",
    "",
    ";",
    "SELECT nope FROM points",
    "not SQL at all",
]


@pytest.mark.parametrize("statement", ESCAPES)
def test_nothing_but_the_tables_can_be_reached_or_changed(year, tmp_path, statement):
    secret_rows = {"a": np.arange(3)}  # a name of ours that a statement must not see
    secret = tmp_path / "secret.csv"
    secret.write_text("a,b\n1,classified\n")
    before, parquet = contents(year), year.directory / year.files("points")[0].path
    with pytest.raises(InputError) as problem:
        run_sql(year, statement.format(secret=secret, parquet=parquet, folder=tmp_path))
    assert str(problem.value).startswith("sql")
    assert "\n" not in str(problem.value)
    assert "classified" not in str(problem.value)
    assert contents(year) == before
    assert [path.name for path in tmp_path.iterdir()] == ["secret.csv"]
    assert len(secret_rows["a"]) == 3


def test_a_damaged_file_of_a_table_in_use_is_named(tmp_path):
    year = written_year(tmp_path / "archive", nights=2, points=10)
    path = year.directory / year.files("zeros")[1].path
    flip(path, 300)
    assert run_sql(year, "SELECT count(*) AS n FROM points").columns["n"].tolist() == [20]
    for statement in ("SELECT * FROM zeros", "SELECT * FROM query('SELECT * FROM zeros')", "DESCRIBE zeros"):
        with pytest.raises(InputError, match=path.name):
            run_sql(year, statement)


def test_an_answer_has_a_limit(year, monkeypatch):
    monkeypatch.setattr(sql, "MOST_ROWS", 99)
    with pytest.raises(InputError, match="more than 99 rows"):
        run_sql(year, "SELECT * FROM points")
    with pytest.raises(InputError, match="at most 20000"):
        run_sql(year, "SELECT " + "1," * 20_000 + "1")
