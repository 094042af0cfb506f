"""The guard: a ratio that falls by a third in every try fails, and nothing else does."""

import json

import pytest

import guard
from harness import LIMIT, Row

BASELINE = {"sum: n": {"numpy": 6.0, LIMIT: 0.9}, "gone: n": {"numpy": 2.0}}


def never(keys):
    raise AssertionError(f"measured again without need: {keys}")


def test_a_ratio_just_above_two_thirds_is_good():
    judgement = guard.judge({"sum: n": {"numpy": 4.001, LIMIT: 0.601}}, BASELINE, never)
    assert (judgement.falls, judgement.compared, judgement.uncompared) == ((), 2, 0)


@pytest.mark.parametrize(("name", "ratio"), [("numpy", 3.99), (LIMIT, 0.59)])
def test_a_ratio_below_two_thirds_in_every_try_fails(name, ratio):
    tries = []

    def again(keys):
        tries.append(keys)
        return {"sum: n": {name: ratio}}

    now = {"sum: n": dict(BASELINE["sum: n"]) | {name: ratio}}
    judgement = guard.judge(now, BASELINE, again)
    assert tries == [{"sum: n"}] * (guard.TRIES - 1)
    (fall,) = judgement.falls
    assert (fall.key, fall.name, fall.now, fall.before) == ("sum: n", name, ratio, BASELINE["sum: n"][name])
    assert f"ratio {ratio:.3g}, baseline {fall.before:.3g}" in str(fall)


def test_a_try_that_is_good_is_enough():
    answers = iter([{"sum: n": {"numpy": 3.0}}, {"sum: n": {"numpy": 5.0}}])
    judgement = guard.judge({"sum: n": {"numpy": 1.0}}, BASELINE, lambda keys: next(answers))
    assert judgement.falls == ()


def test_a_good_first_alternative_does_not_excuse_another():
    """Retries may swap which alternative is low: each counts by its own best."""
    answers = iter([{"sum: n": {"numpy": 5.0, LIMIT: 0.1}}, {"sum: n": {"numpy": 1.0, LIMIT: 0.1}}])
    judgement = guard.judge({"sum: n": {"numpy": 1.0, LIMIT: 0.2}}, BASELINE, lambda keys: next(answers))
    assert [(fall.name, fall.now) for fall in judgement.falls] == [(LIMIT, 0.2)]


def test_a_row_that_does_not_come_in_a_retry_stays_low():
    judgement = guard.judge({"sum: n": {"numpy": 1.0}}, BASELINE, lambda keys: {})
    assert [fall.now for fall in judgement.falls] == [1.0]


def test_what_only_one_side_has_is_counted_and_not_compared():
    judgement = guard.judge({"sum: n": {"gtsam": 0.1}, "new: n": {"numpy": 0.1}}, BASELINE, never)
    assert (judgement.falls, judgement.compared, judgement.uncompared) == ((), 0, 2)


def test_the_baseline_that_is_written_is_read_back(tmp_path):
    rows = [Row(path="sum", what="n", ours_s=3.0, beside={"numpy": 10.0}, limit_s=1.0, spread=0.0)]
    path = tmp_path / "baseline.json"
    path.write_text(guard.written_baseline(rows), encoding="utf-8")
    assert guard.read_baseline(path) == {"sum: n": {"numpy": 3.333, LIMIT: 0.3333}}


@pytest.mark.parametrize("text", ["", "[]", json.dumps({"format": "another", "ratios": {}})])
def test_another_file_is_no_baseline(tmp_path, text):
    path = tmp_path / "baseline.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SystemExit, match="make bench"):
        guard.read_baseline(path)


def test_the_committed_baseline_has_rows():
    assert len(guard.read_baseline()) > 20
