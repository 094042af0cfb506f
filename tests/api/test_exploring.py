"""Reports of written results and of results in Python are the same data."""

import pytest

import catseye
from catseye.errors import InputError
from catseye.records.files.report_file import FORMAT
from kept_scene import reduction_directory
from repository import ROOT

EXAMPLES = ROOT / "examples"
NETWORK = EXAMPLES / "networks" / "feed-arm.toml"


def without_time(report):
    """The report but for when it was made."""
    rows = report["tables"]["versions"]["columns"]
    rows[1]["values"] = [
        value for name, value in zip(rows[0]["values"], rows[1]["values"], strict=True) if "made" not in name
    ]
    return {**report, "subtitle": ""}


RESULTS = {
    "adjust": lambda: catseye.adjust(NETWORK),
    "plan": lambda: catseye.plan(NETWORK),
    "baseline": lambda: catseye.baseline(EXAMPLES / "baselines" / "busselton" / "ts30-baseline-observations.csv"),
    "refractometer": lambda: catseye.refractometer(EXAMPLES / "refractometer" / "path-a.csv"),
    "acoustic": lambda: catseye.acoustic(EXAMPLES / "acoustic" / "night.csv"),
    "track": lambda: catseye.track_pointing(tilts=EXAMPLES / "pointing" / "tilts.csv", harmonics=3),
    "fit": lambda: catseye.fit_pointing(EXAMPLES / "pointing" / "stars.dat"),
}


@pytest.mark.parametrize("name", RESULTS)
def test_the_report_of_a_result_is_that_of_its_directory(name, tmp_path):
    result = RESULTS[name]()
    catseye.save(result, tmp_path / "out")
    read = catseye.report_of(tmp_path / "out")
    assert read["format"] == FORMAT
    assert read["verdict"] == result.verdict.to_object()
    assert without_time(read) == without_time(result.to_report())


def test_the_report_of_a_night_is_read_from_its_directory():
    report = catseye.report_of(reduction_directory())
    assert report["title"] == "night-01: coordinates, pose and surface"
    assert len(report["scenes"]["network"]["points"]["name"]) == 118


def test_a_shot_has_a_report_in_its_page(tmp_path):
    shot = catseye.explain("night-01", 3, monte_carlo=0)
    page = shot.save_page(tmp_path / "shot.html")
    assert without_time(catseye.report_of(page)) == without_time(shot.to_report())


def test_a_result_without_a_report_says_so(tmp_path):
    with pytest.raises(InputError, match="a GlassResult has no report"):
        catseye.glass("BK7-old").to_report()
    with pytest.raises(InputError, match="missing"):
        catseye.report_of(tmp_path / "none")
