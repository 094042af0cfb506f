"""The sheet, the object, the figure and the blank form of a triplet's calibration."""

import csv
import io
import re
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from catseye.gateways.triplet.figure import triplet_figure
from catseye.gateways.triplet.form import DATA_SHEET, HEAD, PLATE, RANGES, blank_form
from catseye.gateways.triplet.objects import triplet_object
from catseye.gateways.triplet.sheet import cell, results, text_sheet, triplet_report
from catseye.gateways.triplet.symbols import PLACEMENT, UNIT, point_places, symbol_values
from catseye.gateways.triplet.symbols import PLATE as PLATE_SYMBOLS
from catseye.gateways.triplet.tables import triplets_csv
from catseye.gateways.writers.drawing import svg as svg_of
from catseye.gateways.writers.objects import json_line, plain
from catseye.gateways.writers.report_page import report_page
from catseye.records.files.reading import read_record
from catseye.records.laboratory.triplet_measurement import TripletMeasurement
from catseye.reduction.triplet.unit import reduce_triplet
from column_scene import assert_columns
from gateways.report_scene import column, read, row, words_of
from triplet_scene import SHEET, document, measurement

# section 3.4, in the order of the memo; T1, T2, S and so on are points
# fmt: off
MEMO = [
    "prism_D_1", "prism_D_2", "R_1", "R_2", "D_12", "Pc_B", "Pc_T1", "Pc_T2", "I_1", "I_2", "dPc_1", "dPc_2",
    "L_T1", "L_T2", "L_MP", "L_BT", "L_BC", "L_MPBC", "L_post", "D_TOPPL", "delta_dsp", "HWLV", "T_c", "P_hpa",
    "h_percent", "eta_A", "eta_G", "n", "HWLA", "Hrp_T1", "Hrp_T2", "D_1", "D_2", "D_BCfp", "h_S", "Phi_1",
    "Phi_2", "Phi_ZRG", "Phi_Cal", "Phi_BCfp", "Delta_1", "Delta_2", "Delta_BC", "Delta", "D_0", "delta_1",
    "delta_2", "delta_MP", "delta_BCfp", "alpha", "Psi", "delta_range", "H_corr",
]
# fmt: on
POINTS = ["T_1", "T_2", "MP", "BC", "PP_1", "PP_2", "S", "BC_fp"]


@pytest.fixture(scope="module")
def found():
    return reduce_triplet(read_record(SHEET, TripletMeasurement))


def test_every_symbol_of_the_memo_is_in_the_object(found):
    told = plain(triplet_object(found, "TR99.toml"))
    assert [name for name in MEMO if told.get(name) is None] == []
    assert [name for name in POINTS if told["points"].get(name) is None] == []
    assert [sorted(c) for c in told["cycles"]] == [["N_1", "N_2", "N_BC", "margin"]] * 3
    assert [sorted(c) for c in told["memo_cycles"]] == [["N_1", "N_2", "N_BC"]] * 3
    assert "NaN" not in json_line(told)


def test_one_placement_gives_numbers_and_several_give_lists(found):
    many = plain(triplet_object(found, "a"))
    one = plain(triplet_object(reduce_triplet(measurement(placement=document()["placement"][:1])), "a"))
    assert isinstance(one["cycles"], dict)
    assert isinstance(one["D_MP"], float)
    assert np.shape(one["points"]["T_1"]) == (3,)
    assert one["p"] is None  # nothing to compare with
    assert len(many["cycles"]) == len(many["D_MP"]) == len(many["points"]["T_1"]) == 3
    assert isinstance(many["L_MP"], float)


def test_the_symbols_obey_the_memos_definitions(found):
    t = {k: np.asarray(v) for k, v in triplet_object(found, "a").items() if k in {*MEMO, "L_1", "L_2", "D_MP"}}
    c = {k: np.array([each[k] for each in triplet_object(found, "a")["cycles"]]) for k in ("N_1", "N_2", "N_BC")}
    np.testing.assert_allclose(t["HWLA"], t["HWLV"] / t["eta_A"], rtol=1e-15)
    np.testing.assert_allclose(t["Delta"], c["N_1"] * t["HWLA"], rtol=1e-15)
    np.testing.assert_allclose(t["delta_MP"], t["D_MP"] - t["Delta"], atol=1e-15)
    np.testing.assert_allclose(t["delta_BCfp"], t["D_BCfp"] - t["Delta"], atol=1e-15)
    np.testing.assert_allclose(t["L_T1"], t["L_1"] - t["Hrp_T1"], atol=1e-15)
    np.testing.assert_allclose(t["L_BC"], t["L_BT"] + t["R_1"], atol=1e-15)
    np.testing.assert_allclose(t["D_0"], np.sqrt(t["h_S"] ** 2 + t["D_TOPPL"] ** 2), rtol=1e-15)
    np.testing.assert_allclose(t["alpha"], 0.5 + (t["D_1"] ** 2 - t["D_2"] ** 2) / 2 / t["D_12"] ** 2, atol=1e-12)
    np.testing.assert_allclose(t["Psi"], np.arcsin((0.5 - t["alpha"]) * t["D_12"] / t["D_0"]), atol=1e-15)
    np.testing.assert_allclose(t["I_1"], np.arccos(t["D_0"] / t["D_1"]), atol=1e-7)  # the memo's D_1 lacks dPc, 0.3 nm
    way = c["N_1"] - (t["Phi_1"] - t["Phi_ZRG"] - t["Phi_Cal"]) / 2 / np.pi
    np.testing.assert_allclose(t["D_1"], way * t["HWLA"] + t["Pc_T1"] + t["dPc_1"], atol=1e-12)
    np.testing.assert_allclose(t["H_corr"], 2 * t["L_post"] - 2 * t["L_MP"] - t["delta_range"], atol=1e-15)
    np.testing.assert_allclose(t["delta_dsp"], 2 * t["L_post"] - 2 * t["L_MP"] - t["L_MPBC"], atol=1e-15)
    # 3.28, the secant: the same to a nanometre this near to the axis
    np.testing.assert_allclose(t["delta_range"], (t["D_MP"] - t["D_BCfp"]) / np.cos(t["Psi"]), atol=1e-9)


def test_the_points_lie_where_the_distances_say(found):
    at = point_places(found)
    for name, distance in (("T_1", "d_1"), ("T_2", "d_2"), ("MP", "d_mp"), ("BC_fp", "d_bcfp")):
        np.testing.assert_allclose(np.linalg.norm(at[name], axis=-1), getattr(found.lengths, distance), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(at["T_1"] - at["T_2"], axis=-1), 0.635, atol=1e-12)
    np.testing.assert_allclose(0.5 * (at["T_1"] + at["T_2"]), at["MP"], atol=1e-12)
    np.testing.assert_allclose((at["BC"] - at["MP"])[:, 2], found.h, atol=1e-14)
    np.testing.assert_allclose((at["BC_fp"] - at["MP_fp"])[:, 2], -found.h, atol=1e-14)  # turned over


def test_the_text_has_a_line_for_every_symbol_and_a_column_for_every_placement(found):
    lines = text_sheet(found, "TR99.toml").splitlines()
    for symbol in (*UNIT, *PLATE_SYMBOLS, *PLACEMENT):
        mine = [line for line in lines if line.startswith(f"{symbol.label:<14}")]
        assert mine, symbol.name
        values = symbol_values(symbol, found)
        shown = [cell(symbol, value) for value in values]
        assert any(all(each in line for each in shown) and symbol.meaning in line for line in mine), symbol.name
    assert any(line.startswith("H_corr      -0.0230 mm") for line in lines)


def page_of(found, file="TR99.toml"):
    return report_page(triplet_report(found, file, datetime(2026, 11, 21, tzinfo=UTC), "ab" * 32))


def test_page_is_self_contained_and_has_the_same_values(found):
    page = page_of(found)
    report = read(page)
    for table, symbols in (("unit", UNIT), ("plate", PLATE_SYMBOLS), ("ranges", PLACEMENT)):
        for symbol in symbols:
            shown = row(report, table, symbol.label)
            assert shown["value_1"] == cell(symbol, symbol_values(symbol, found)[0]), symbol.name
    assert column(report, "inputs", "value") == ["ab" * 32]
    assert "-0.0230 mm" in " ".join(words_of(page))
    placements = report["charts"]["placements"]
    assert placements["y"]["values"] == pytest.approx([h * 1e6 for h in found.h], abs=5.1e-3)
    assert placements["limits"] == pytest.approx([found.l_mpbc * 1e6 + side for side in (-150.0, 0.0, 150.0)], rel=1e-5)


def test_names_from_a_sheet_cannot_become_tags():
    found = reduce_triplet(measurement(by="<b>bold & brave</b>"))
    page = page_of(found, "<i>.toml")
    assert "<b>bold" not in page
    assert "<i>.toml" not in page
    assert column(read(page), "inputs", "name") == ["<i>.toml"]


def test_many_placements_go_into_several_tables_of_the_text_and_one_of_the_page():
    first = document()["placement"][0]
    found = reduce_triplet(measurement(placement=[first] * 8))
    text = text_sheet(found, "a")
    assert [f"no. {k}" in text for k in (1, 8, 9)] == [True, True, False]
    labels = [c["label"] for c in read(page_of(found))["tables"]["ranges"]["columns"]]
    assert labels == ["symbol", "description", "design value", *(f"no. {k}" for k in range(1, 9)), "unit"]


def test_a_slip_is_named_at_the_edge_of_the_figure_and_a_refusal_in_the_words():
    values = {"placement__1__phi_bcfp_rad": 4.0}
    found = reduce_triplet(measurement(**values))
    assert found.status[1] == "whole cycles doubtful"
    svg = svg_of(triplet_figure(found))
    assert svg.startswith("<?xml")
    assert svg == svg_of(triplet_figure(found))  # the same picture for the same calibration
    words = dict(line for line in results(found) if line[0])
    assert "NOT ACCEPTED" in words["Difference"]
    assert "DO NOT AGREE" in words["Placements"]


def test_the_blank_form_has_a_box_for_every_key_of_a_sheet():
    page = blank_form()
    keys = set(re.findall(r"<code>([a-z0-9_.]+)</code>", page))
    values = document()
    wanted = {k for k in values if not isinstance(values[k], dict | list)} - {"format"}
    wanted |= {f"{side}_prism.{k}" for side in ("left", "right") for k in values["left_prism"]}
    wanted |= {f"ball.{k}" for k in values["ball"]}
    wanted |= set(values["surface_plate"]) | set(values["placement"][0])
    assert wanted <= keys
    known = TripletMeasurement.model_json_schema()
    every = {k for table in [known, *known["$defs"].values()] for k in table["properties"]}
    assert {key.split(".")[-1] for key in keys} <= every
    assert page.count('class="box"') == len(HEAD) + len(DATA_SHEET) + len(PLATE) + 3 * len(RANGES)


def test_the_table_of_several_units(found):
    single = reduce_triplet(measurement(placement=document()["placement"][:1]))
    rows = list(csv.DictReader(io.StringIO(triplets_csv({"a.toml": found, "b.toml": single}))))
    assert [row["file"] for row in rows] == ["a.toml", "b.toml"]
    assert float(rows[0]["h_corr_mm"]) == pytest.approx(found.h_corr * 1e3, abs=1e-6)
    assert rows[1]["p"] == ""
    assert rows[0]["accepted"] == "yes"


def test_a_text_sheet_of_one_placement_has_no_nan_and_no_word_cut_off():
    own = document()["placement"][0] | {"phi_bcfp_rad": 3.9}
    text = text_sheet(reduce_triplet(measurement(placement=[own])), "T.toml")
    assert not re.search(r"\bnan\b", text)
    (status,) = re.findall(r"^status +(.+)$", text, re.MULTILINE)
    assert status == "cycles doubted"


def test_a_calibration_phase_of_the_flip_is_on_the_sheet():
    found = reduce_triplet(measurement(placement__0__phi_cal_flipped_rad=1.25))
    assert triplet_object(found, "T.toml")["Phi_Cal_fp"] == [1.25, 1.1, 1.1]
    assert "Φ_Cal fp" in text_sheet(found, "T.toml")


def test_unit_without_result_shows_unknown():
    """Three metres away and a metre aside, prisms 100 mm apart that seem 93 mm nearer and farther: no triangle."""
    own = document()["placement"][0] | {"d_toppl_mm": 3000.0, "h_s_mm": 1000.0, "phi_1_rad": 0.318, "phi_2_rad": 0.218}
    found = reduce_triplet(measurement(placement=[own], d12_mm=100.0))
    assert found.status == ("no triangle: left out",)
    text, page = text_sheet(found, "T.toml"), page_of(found, "T.toml")
    assert "H_corr      unknown, u –" in text
    assert not re.search(r"\bnan\b", text)
    assert not re.search(r"\bnan\b", " ".join(words_of(page)))
    assert read(page)["charts"]["placements"]["x"]["values"] == []
    assert not found.accepted


def test_every_column_of_the_table_of_units_has_the_unit_of_its_name(found):
    units = {"TR99.toml": found, "TR98.toml": replace(found, difference=-1.6e-4, accepted=False)}  # 99's is below a nm
    told = {
        "file": lambda f: "TR99.toml" if f is found else "TR98.toml",
        "triplet": lambda f: f.measurement.triplet,
        "h_corr_mm": lambda f: f.h_corr,
        "u_h_corr_mm": lambda f: f.u_h_corr,
        "l_mpbc_mm": lambda f: f.l_mpbc,
        "u_l_mpbc_mm": lambda f: f.u_l_mpbc,
        "difference_mm": lambda f: f.difference,
        "u_difference_mm": lambda f: f.u_difference,
        "accepted": lambda f: "yes" if f.accepted else "no",
        "conformity_probability": lambda f: f.conformity_probability,
        "placements": lambda f: len(f.h),
        "p": lambda f: f.p,
    }
    assert found.accepted == (abs(found.difference) <= 0.15e-3)  # m, the memo's limit
    assert_columns(triplets_csv(units), told, list(units.values()))
