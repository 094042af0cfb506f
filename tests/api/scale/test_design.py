"""`catseye.design`: its result in Python, its files, and its refusals."""

import json

import numpy as np
import pytest

import catseye
from catseye.errors import ArgumentError, InputError
from catseye.records.site.design_layout import read_design_layout
from repository import ROOT

SMALL = "designs/structure-60m.toml"
QUICK = {"steps": 6, "exchanges": 0, "map_side": 0, "runs": 0}


@pytest.fixture(scope="module")
def result():
    return catseye.design(
        SMALL, vary="rangers from 8 to 9 between 5 and 45 m", steps=10, exchanges=1, map_side=4, runs=400
    )


def test_a_result_says_before_and_after(result):
    assert result.u_after < result.u_before
    assert len(result.names) == 30
    assert result.longest_before.max() == pytest.approx(result.u_before)
    assert result.longest_after.max() == pytest.approx(result.u_after)
    assert result.places["NEW09"].shape == (3,)
    assert "9" in repr(result)
    said = {passage.title for passage in result.passages()}
    assert said >= {"The design", "The worst axis", "The moves", "The numbers", "The scatter", "The map", "The search"}


def test_its_network_is_planned_with_the_same_uncertainties(result):
    for before, u in ((True, result.u_before), (False, result.u_after)):
        planned = catseye.plan(result.network(before=before), interest=result.names)
        longest = dict(zip(planned.names, planned.planned.plan.weakest, strict=True))
        assert max(longest[name] for name in result.names) == pytest.approx(u, rel=1e-5)


def test_tables_have_units_and_all_rows(result):
    points, moves, numbers = (result.to_table(name) for name in ("points", "moves", "numbers"))
    assert str(points["longest_after"].unit) == "mm"
    assert len(points) == 30
    assert len(numbers) == 2
    new = moves["unit"] == "NEW09"
    assert np.isnan(moves["x_before"][new].value).all()


def test_json_is_in_metres_and_without_nan(result):
    answer = json.loads(result.to_json(), parse_constant=pytest.fail)
    assert answer["after"]["u"] == pytest.approx(result.u_after)
    assert [n["number"] for n in answer["numbers"]] == [8, 9]
    assert len(answer["scatter"]) == 2
    assert next(m for m in answer["moves"] if m["unit"] == "NEW09")["before"] == [None] * 3
    assert np.array(answer["maps"][0]["u"]).shape == (4, 4)


def test_saved_files_hold_what_the_result_says(result, tmp_path):
    out = catseye.save(result, tmp_path / "out")
    written = {path.name for path in out.iterdir()}
    assert written >= {"report.html", "design.json", "moves.csv", "points.csv", "numbers.csv", "map-one-more.csv"}
    assert written >= {"places.svg", "points.svg", "numbers.svg", "search.svg", "map-one-more.svg", "provenance.json"}
    rows = (out / "points.csv").read_text().splitlines()
    worst = max(float(row.split(",")[2]) for row in rows[1:])
    assert worst == pytest.approx(result.u_after * 1e3, abs=1e-6)
    assert json.loads((out / "provenance.json").read_text())["inputs_sha256"].keys() == {"structure-60m.toml"}
    report = catseye.report_of(out / "report.html")
    assert report["verdict"] == result.verdict.to_object()
    assert set(report["drawings"]) >= {"places", "points", "numbers", "map-one-more", "search"}
    assert report["tables"]["points"]["columns"][2]["values"][0] == pytest.approx(result.longest_after[0] * 1e3, 1e-3)


def test_a_layout_and_a_path_give_the_same():
    layout = read_design_layout(ROOT / "examples" / SMALL)
    first, second = (catseye.design(site, vary="ranger RG003 within 4 m", **QUICK) for site in (SMALL, layout))
    assert first.u_after == second.u_after
    assert second.inputs() == {}


def test_obstacles_are_obeyed(tmp_path):
    """A keep-out box across the roof takes sights, and no ranger stands in it."""
    box = tmp_path / "keep-out.toml"
    box.write_text(
        'format = "catseye-keep-out-1"\n[[box]]\nname = "hall"\nwhy = "people work there"\n'
        "centre_mm = [22000.0, 0.0, 4000.0]\nsize_mm = [10000.0, 20000.0, 8000.0]\n"
    )
    free = catseye.design(SMALL, vary="rangers within 9 m", **QUICK)
    held = catseye.design(SMALL, vary="rangers within 9 m", keep_out=box, **QUICK)
    assert held.study.before.ranges < free.study.before.ranges
    for name, (x, y, _) in held.places.items():
        if name.startswith("RG"):
            assert not (16.0 < x < 28.0 and abs(y) < 11.0), name
    assert set(held.inputs()) == {"structure-60m.toml", "keep-out.toml"}


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"criterion": "gain"}, "frequency_ghz is missing"),
        ({"frequency_ghz": 100.0}, "frequency_ghz is not for criterion 'worst'"),
        ({"criterion": "best"}, "expected one of trace, worst, pose, gain"),
        ({"runs": 5}, "expected 0, or 100 to"),
        ({"map_side": 1}, "expected 0, or 2 to"),
        ({"apart_m": -1.0}, "expected 0 to 1000"),
        ({"sigma_mm": 0.0}, "sigma_mm = 0"),
        ({"posture_deg": [[10.0, 50.0]]}, "posture_deg needs a site with a telescope"),
        ({"criterion": "gain", "frequency_ghz": 90.0}, "criterion needs a site with a telescope"),
    ],
)
def test_options_that_do_not_fit_are_refused(options, why):
    with pytest.raises(ArgumentError, match=why):
        catseye.design(SMALL, vary="rangers", **{**QUICK, **options})


def test_a_posture_out_of_range_is_refused():
    with pytest.raises(ArgumentError, match="elevation 0 to 95"):
        catseye.design("gbt", vary="rangers", posture_deg=[[10.0, 120.0]], **QUICK)


def test_a_missing_site_is_refused():
    with pytest.raises(InputError, match="nowhere"):
        catseye.design("nowhere.toml", vary="rangers", **QUICK)


def test_several_postures_count_together():
    one = catseye.design("gbt", vary="ranger ZY107 within 20 m", **QUICK)
    two = catseye.design("gbt", vary="ranger ZY107 within 20 m", posture_deg=[[145.3, 30.0], [0.0, 70.0]], **QUICK)
    assert len(two.study.after.values) == 2
    assert two.study.before.values[0] == pytest.approx(one.study.before.values[0], rel=1e-9)
    assert two.u_after < two.u_before
