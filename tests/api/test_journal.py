"""A journal's export, verification and copy from Python."""

import shutil
import sqlite3

import pytest

import catseye
from catseye.errors import ArgumentError, InputError
from cli.living_scene import recorded


def test_tables_are_written_and_counted(tmp_path):
    result = catseye.export(recorded(), tmp_path / "out", to="csv")
    assert (result.run, result.verdict.word, result.directory) == (1, "good", tmp_path / "out")
    assert result.to_object()["rows"]["shots"] == result.rows["shots"] > 100
    assert (tmp_path / "out" / "shots.csv").exists()
    assert list(result.to_table()["table"]) == list(result.rows)
    assert result.passages()[0].title == "Written to"


def test_a_span_is_text_a_number_or_an_astropy_time(tmp_path):
    from astropy.time import Time

    begin = Time(60635.12505, format="mjd")
    spans = [begin, 60635.12505, "60635.12505"]
    counts = [
        catseye.export(recorded(), tmp_path / str(k), to="csv", since=since).rows for k, since in enumerate(spans)
    ]
    assert counts[0] == counts[1] == counts[2]
    assert 0 < counts[0]["shots"] < catseye.export(recorded(), tmp_path / "all", to="csv").rows["shots"]


@pytest.mark.parametrize(
    ("more", "names"),
    [
        ({"to": "xls"}, ("to",)),
        ({"to": "csv", "since": "noon"}, ("since",)),
        ({"to": "csv", "until": 2e6}, ("until",)),
        ({"to": "csv", "since": float("nan")}, ("since",)),
    ],
)
def test_invalid_arguments_are_named_and_nothing_is_written(tmp_path, more, names):
    with pytest.raises(ArgumentError) as refused:
        catseye.export(recorded(), tmp_path / "out", **more)
    assert refused.value.names == names
    assert list(tmp_path.iterdir()) == []


def test_a_span_that_ends_before_it_begins_is_refused(tmp_path):
    with pytest.raises(InputError, match="expected a later end"):
        catseye.export(recorded(), tmp_path / "out", to="csv", since=60636.0, until=60635.0)


def test_a_journal_is_verified_against_its_own_head_and_a_copy(tmp_path):
    result = catseye.check_journal(recorded())
    assert (result.verdict.word, result.unaltered) == ("good", True)
    head = str(result.reports[0].head)
    backup = catseye.backup_journal(catseye.load(recorded()), tmp_path / "copy.db")
    assert backup.size_bytes == backup.copy.stat().st_size
    assert str(backup.reports[0].head) == head
    again = catseye.check_journal(backup.copy, run="1", head=[head], against=recorded())
    assert (again.unaltered, again.reports[0].heads, len(again.differences)) == (True, 1, 1)
    with pytest.raises(InputError, match="already exists"):
        catseye.backup_journal(recorded(), tmp_path / "copy.db")


def test_an_altered_event_fails(tmp_path):
    shutil.copy(recorded(), tmp_path / "j.db")
    with sqlite3.connect(tmp_path / "j.db") as connection:
        connection.execute("UPDATE shots SET range_m = range_m + 1e-9 WHERE status = 'used'")
    connection.close()
    result = catseye.check_journal(tmp_path / "j.db")
    assert (result.verdict.word, result.unaltered) == ("failed", False)
    assert not result.to_table()["intact"][0]
    with pytest.raises(InputError, match="fails verification"):
        catseye.export(tmp_path / "j.db", tmp_path / "out", to="csv")
    assert catseye.export(tmp_path / "j.db", tmp_path / "out", to="csv", damaged=True).verdict.word == "doubtful"
