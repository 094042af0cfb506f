"""`watch_site` and `watch_journal`: what they accept, and refuse in one line."""

import json

import pytest

from catseye.api.live.watching import watch_journal, watch_site
from catseye.errors import InputError
from cli.living_scene import recorded


def test_site_by_its_bundled_name_is_not_connected_yet():
    watch = watch_site("gbt", coordinator=("127.0.0.1", 1))
    state = watch.state()
    assert (state["source"], state["connected"], watch.history) == ("live", False, False)
    assert len(state["rangers"]) == 18
    assert json.loads(json.dumps(watch.site()))["name"] == "gbt"


def test_site_with_a_journal_has_both():
    watch = watch_site("gbt", coordinator=("127.0.0.1", 1), journal=recorded())
    assert watch.history is True
    assert watch.state()["source"] == "live"
    at = watch.epochs()["epochs"][-1]["mjd"]
    assert watch.state(at)["source"] == "journal"
    assert watch.site()["runs"][0]["run"] == 1


def test_site_waits_for_a_journal_that_is_not_there_yet(tmp_path):
    watch = watch_site("gbt", coordinator=("127.0.0.1", 1), journal=tmp_path / "later.db")
    assert watch.site()["runs"] == []
    with pytest.raises(InputError, match="is missing"):
        watch.epochs()
    (tmp_path / "later.db").write_bytes(recorded().read_bytes())
    assert watch.epochs()["epochs"]


def test_key_of_the_environment_is_checked_at_once(monkeypatch):
    monkeypatch.setenv("CATSEYE_KEY", "short")
    with pytest.raises(InputError, match="CATSEYE_KEY: 5 characters"):
        watch_site("gbt", coordinator=("127.0.0.1", 1))


@pytest.mark.parametrize("call", [lambda p: watch_journal(p / "no.db"), lambda p: watch_site(p, coordinator=("x", 1))])
def test_what_is_not_there_is_refused_in_one_line(tmp_path, call):
    with pytest.raises(InputError) as refusal:
        call(tmp_path)
    assert "\n" not in str(refusal.value)
