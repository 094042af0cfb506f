"""Tables of an EDM baseline and BASELINE.toml: what is read, and every refusal in one line."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.laboratory.baseline import Baseline, baseline_text, read_baseline, read_heights, read_observations
from repository import ROOT, TESTS

VECTORS = TESTS / "vectors" / "baselines"
TS30 = ROOT / "examples" / "baselines" / "busselton" / "ts30-baseline-observations.csv"
RELEASED = VECTORS / "baseline-1.toml"


def test_real_table_is_read_completely():
    seen = read_observations(TS30)
    assert len(seen) == 127
    assert seen.names == ("1", "2", "3", "4", "5", "6")
    assert seen.setup.max() + 1 == 6
    assert seen.set.max() + 1 == 30
    assert seen.slope[0] == 20.4005
    assert np.degrees(seen.direction[2]) == pytest.approx(0.3136239)
    assert np.degrees(seen.u_rounding[0]) == pytest.approx(0.001 / 12**0.5)  # 3.14E-01: three digits were printed
    assert np.degrees(seen.u_rounding[2]) < 1e-7
    assert read_heights(TS30.with_name("pillar-heights.csv")).u["6"] == 0.003


def test_a_table_without_directions_has_none():
    seen = read_observations(TS30.with_name("ts16-calibration-observations.csv"))
    assert len(seen) == 40
    assert np.isnan(seen.direction).all()


def test_coming_back_to_a_pillar_is_another_set_up(tmp_path):
    lines = TS30.with_name("ts16-calibration-observations.csv").read_text().splitlines()
    path = tmp_path / "o.csv"
    path.write_text("\n".join([lines[0], lines[1], lines[2], lines[40], lines[1]]))
    seen = read_observations(path)
    assert seen.setup.tolist() == [0, 0, 1, 2]
    assert seen.set.tolist() == [0, 0, 1, 2]


def test_dry_air_at_freezing_is_legal(tmp_path):
    path = tmp_path / "o.csv"
    lines = TS30.with_name("ts16-calibration-observations.csv").read_text().splitlines()
    path.write_text(f"{lines[0]}\n1,2,0.235,0.24,20.4011,0,1015.8,0\n")
    seen = read_observations(path)
    assert (seen.temperature_c[0], seen.humidity_percent[0]) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "1,2,0.235,0.24,20.4011,15,",
            "1,1,0.235,0.24,20.4011,15,",
            "line 2, to_pillar = '1' (expected another pillar",
        ),
        ("1,2,0.235,0.24,20.4011,15,", "1,,0.235,0.24,20.4011,15,", "line 2, to_pillar = '' (expected the name"),
        ("20.4011,15,", "20.4011,288.15,", "line 2, temperature = '288.15' (expected -40 to 60 °C)"),
        ("20.4011,15,1015.8", "20.4011,15,101.58", "line 2, pressure = '101.58' (expected 500 to 1100 hPa)"),
        ("1015.8,46.2", "1015.8,146.2", "humidity = '146.2'"),
        ("20.4011", "-20.4011", "slope_distance = '-20.4011'"),
        ("20.4011", "nan", "slope_distance = 'nan' (expected a finite number)"),
        ("0.235,0.24,20.4011", "235,0.24,20.4011", "height_of_instrument = '235' (expected -5 to 5 m)"),
        ("slope_distance", "slope", "line 1, column 'slope' is unknown"),
        (",humidity", "", "column 'humidity' is missing"),
        ("46.2\n", "46.2,1\n", "fields"),
    ],
)
def test_a_bad_table_is_refused_in_one_line(tmp_path, old, new, said):
    text = TS30.with_name("ts16-calibration-observations.csv").read_text().replace("\r\n", "\n")
    assert old in text
    path = tmp_path / "bad.csv"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError) as refused:
        read_observations(path)
    assert said in str(refused.value)
    assert "bad.csv" in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("1,4.5,0", "pillar_name = '1' (expected a new name)"),
        ("7,4.5,-0.001", "rl_standard_deviation = '-0.001' (expected 0 to 10 m)"),
        ("7,tall,0", "pillar_rl = 'tall'"),
    ],
)
def test_bad_heights_are_refused_in_one_line(tmp_path, row, said):
    path = tmp_path / "heights.csv"
    path.write_text(f"pillar_name,pillar_rl,rl_standard_deviation\n1,4.563,0\n{row}\n")
    with pytest.raises(InputError, match=r"heights\.csv") as refused:
        read_heights(path)
    assert said in str(refused.value)


def test_the_released_record_loads_and_survives_the_round_trip(tmp_path):
    record = read_baseline(RELEASED)
    assert record.pillars == ("1", "2", "3", "4", "5", "6")
    assert record.covariance.shape == (9, 9)
    assert record.by == "Landgate"
    path = tmp_path / "again.toml"
    path.write_text(baseline_text(record))
    assert read_baseline(path) == record


def test_texts_with_quotes_and_breaks_survive(tmp_path):
    record = read_baseline(RELEASED).model_copy(update={"by": 'a "b" \\ c\nd é', "name": "ü"})
    path = tmp_path / "again.toml"
    path.write_text(baseline_text(record), encoding="utf-8")
    assert read_baseline(path) == record


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": "catseye-baseline-2"}, "format"),
        ({"x_m": (0.0, 1.0)}, "x_m has 2 values for 6 pillars"),
        ({"known": ("x 2",)}, "covariance_mm2 is not 1 x 1"),
        ({"known": ("x 9",), "covariance_mm2": ((1.0,),)}, "known names 'x 9'"),
        ({"known": ("x 2", "x 3"), "covariance_mm2": ((1.0, 2.0), (2.0, 1.0))}, "not positive definite"),
        ({"known": ("x 2", "x 3"), "covariance_mm2": ((1.0, 0.5), (0.4, 1.0))}, "not symmetric"),
        ({"known": ("x 2",), "covariance_mm2": ((0.0,),)}, "not positive definite"),
        ({"pillars": ("1", "1", "3", "4", "5", "6")}, "pillars names one twice"),
        ({"reference_height_m": 1e5}, "reference_height_m"),
    ],
)
def test_a_bad_record_is_refused_in_one_line(tmp_path, change, said):
    path = tmp_path / "bad.toml"
    values = read_baseline(RELEASED).model_dump() | change
    path.write_text(baseline_text(Baseline.model_construct(**values)))
    with pytest.raises(InputError) as refused:
        read_baseline(path)
    assert said in str(refused.value)
    assert str(refused.value).startswith("bad.toml: ")
    assert "\n" not in str(refused.value)


def test_a_record_without_its_covariance_or_with_a_strange_key_is_refused(tmp_path):
    path = tmp_path / "bad.toml"
    text = RELEASED.read_text()
    path.write_text("colour = 1\n" + text)
    with pytest.raises(InputError, match="colour = 1 is not a known key"):
        read_baseline(path)
    path.write_text(text[: text.index("covariance_mm2")])
    with pytest.raises(InputError, match="covariance_mm2 is missing"):
        read_baseline(path)
