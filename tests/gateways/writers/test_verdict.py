"""Verdicts pass on: a result is no better than what it rests on, and one that is as bad keeps its own reason."""

import hashlib
import itertools
import json

import pytest

from catseye.errors import InputError
from catseye.records.files.reading import Folder
from catseye.records.files.verdicts import stored_verdict, verdict_of_export, verdict_of_table
from catseye.verdict import ORDER, Verdict


@pytest.mark.parametrize(("own", "source"), list(itertools.product(ORDER, ORDER)))
def test_a_result_is_no_better_than_its_source(own, source):
    found = Verdict(own, "mine").resting_on({"night": Verdict(source, "theirs"), "old": None, "a": Verdict("good", "")})
    assert ORDER.index(found.word) == max(ORDER.index(own), ORDER.index(source))
    assert ("theirs" in found.why and "night" in found.why) == (ORDER.index(source) > ORDER.index(own))


def test_doubts_make_a_good_verdict_doubtful_but_not_failed():
    assert Verdict("good", "all fits").hearing(["it is wrong."]) == ("doubtful", "it is wrong")
    assert Verdict("failed", "no answer").hearing(["it is wrong"]).word == "failed"
    assert Verdict("good", "all fits").hearing([]).word == "good"


def test_a_written_verdict_comes_back_and_a_damaged_one_is_refused():
    written = Verdict("doubtful", "nothing was measured twice")
    assert stored_verdict("a.json", {"verdict": written.to_object()}) == written
    assert stored_verdict("a.json", {}) is None
    for damaged in ({"word": "fine", "why": ""}, {"word": "good"}, "good", 3):
        with pytest.raises(InputError, match=r"a\.json: verdict = .*expected word, one of good, doubtful, failed"):
            stored_verdict("a.json", {"verdict": damaged})


def test_foreign_provenance_gives_no_verdict(tmp_path):
    for text in ("not JSON", "[]", '{"format": "theirs", "verdict": 3}'):
        (tmp_path / "provenance.json").write_text(text)
        (tmp_path / "coordinates.json").write_text("{}")
        (tmp_path / "t.csv").write_text("point\n")
        assert verdict_of_export(Folder(tmp_path)) is None
        assert verdict_of_table(tmp_path / "t.csv") is None


def test_unedited_table_has_the_verdict_of_its_reduction(tmp_path):
    table = tmp_path / "surface.csv"
    table.write_text("point\n")
    digest = hashlib.sha256(table.read_bytes()).hexdigest()
    (tmp_path / "provenance.json").write_text(json.dumps({"outputs": {"surface.csv": digest}}))
    (tmp_path / "coordinates.json").write_text(json.dumps({"verdict": {"word": "failed", "why": "it ran away"}}))
    assert verdict_of_table(table) == ("failed", "it ran away")
    table.write_text("point,x_m\n")
    assert verdict_of_table(table) is None
