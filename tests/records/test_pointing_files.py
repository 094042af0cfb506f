"""Pointing models, tables of tilts, solved points: read as written, refused with the place and what was expected."""

import json

import numpy as np
import pytest

from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import InputError
from catseye.geometry.antenna.pointing_series import TERMS
from catseye.records.files.reading import read_record
from catseye.records.files.toml_text import record_toml
from catseye.records.laboratory.star_offsets import read_star_offsets
from catseye.records.laboratory.tilts import read_tilts
from catseye.records.network.solved_points import read_solved_points
from catseye.records.site.pointing_model import PointingModel
from repository import TESTS

MODEL = """\
format = "catseye-pointing-series-1"
name = "two terms"
terms = ["IA", "HZCZ"]
values_arcsec = [-14.18, 680.72]
covariance_arcsec2 = [[4.0, 0.5], [0.5, 9.0]]
"""


def test_a_model_survives_its_file(tmp_path):
    (tmp_path / "m.toml").write_text(MODEL)
    record = read_record(tmp_path / "m.toml", PointingModel)
    series = record.series
    assert series.terms == ("IA", "HZCZ")
    np.testing.assert_allclose(series.values / ARCSECOND, [-14.18, 680.72], rtol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(series.covariance)) / ARCSECOND, [2.0, 3.0], rtol=1e-12)
    (tmp_path / "n.toml").write_text(record_toml(record))
    assert read_record(tmp_path / "n.toml", PointingModel) == record


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('"HZCZ"]', '"HZXX"]'), "HZXX"),
        (('"HZCZ"]', '"IA"]'), "twice"),
        (("[-14.18, 680.72]", "[-14.18]"), "has 1 values"),
        (("[[4.0, 0.5], [0.5, 9.0]]", "[[4.0, 0.5]]"), "expected 2 of 2"),
        (("[[4.0, 0.5], [0.5, 9.0]]", "[[4.0, 0.5], [0.6, 9.0]]"), "not a covariance"),
        (("[[4.0, 0.5], [0.5, 9.0]]", "[[4.0, 7.0], [7.0, 9.0]]"), "not a covariance"),
        (("[[4.0, 0.5], [0.5, 9.0]]", "[[-4.0, 0.0], [0.0, 9.0]]"), "variance -4"),
        (("series-1", "series-9"), "catseye-pointing-series-1"),
        (("680.72]", "680720.0]"), "expected"),
    ],
)
def test_implausible_model_is_refused(tmp_path, change, said):
    (tmp_path / "m.toml").write_text(MODEL.replace(*change))
    with pytest.raises(InputError, match=said):
        read_record(tmp_path / "m.toml", PointingModel)


def test_the_terms_of_files_are_those_of_the_series():
    schema = PointingModel.model_json_schema()
    assert tuple(schema["properties"]["terms"]["items"]["enum"]) == TERMS


TILTS = "mjd,azimuth_deg,tilt_x_arcsec,tilt_y_arcsec,u_arcsec\n52271.1,90.0,1.5,-2.0,0.2\n"


def test_tilts_are_read(tmp_path):
    (tmp_path / "t.csv").write_text(TILTS)
    found = read_tilts(tmp_path / "t.csv")
    assert (len(found), found.mjd[0]) == (1, 52271.1)
    np.testing.assert_allclose(found.azimuth, 90 * DEGREE)
    np.testing.assert_allclose(found.tilt / ARCSECOND, [[1.5, -2.0]])
    np.testing.assert_allclose(found.u / ARCSECOND, 0.2)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("52271.1", "2452271.6"), "line 2, mjd"),
        (("90.0", "900.0"), "azimuth_deg"),
        (("1.5", "15000"), "tilt_x_arcsec"),
        (("0.2", "0"), "u_arcsec = '0'"),
        (("u_arcsec", "u"), "column 'u' is unknown"),
    ],
)
def test_bad_tilts_are_refused(tmp_path, change, said):
    (tmp_path / "t.csv").write_text(TILTS.replace(*change))
    with pytest.raises(InputError, match=said):
        read_tilts(tmp_path / "t.csv")


def written(folder, **change):
    points = {n: {"x": float(k), "y": 2.0, "z": 3.0} for k, n in enumerate("AB")}
    made = {
        "format": "catseye-reduction-1", "campaign": "c", "frame": "ground", "points": points,
        "covariance_order": [f"{n} {a}" for n in "AB" for a in "xyz"], "covariance": (np.eye(6) * 1e-8).tolist(),
    }  # fmt: skip
    (folder / "coordinates.json").write_text(json.dumps({**made, **change}))
    return folder


def test_points_of_a_reduction_are_read_with_their_posture(tmp_path):
    posture = {"azimuth_deg": 145.3, "elevation_deg": 30.0}
    (tmp_path / "pose.json").write_text(json.dumps({"format": "catseye-reduction-1", "nominal_posture": posture}))
    found = read_solved_points(written(tmp_path))
    assert (found.names, found.campaign) == (("A", "B"), "c")
    assert found.posture == pytest.approx((145.3 * DEGREE, 30 * DEGREE))
    assert found.block(["B", "A"]).shape == (6, 6)
    np.testing.assert_array_equal(found.places(["B"]), [[1.0, 2.0, 3.0]])
    assert len(found.hashes) == 2
    (tmp_path / "pose.json").unlink()
    assert read_solved_points(tmp_path / "coordinates.json").posture is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": "other"}, "format = 'other'"),
        ({"points": {}}, "has no points"),
        ({"covariance_order": ["A x"]}, "covariance_order"),
        ({"frame": "reflector"}, "expected 'ground'"),
        ({"covariance": [[1.0]]}, "shape"),
        ({"covariance": (np.eye(6) * -1e-8).tolist()}, "negative variance"),
        ({"covariance": (np.eye(6) + np.triu(np.ones((6, 6)), 1)).tolist()}, "not symmetric"),
        ({"points": {"A": {"x": 0, "y": 0, "z": "0"}, "B": {"x": 0, "y": 0, "z": 0}}}, r"points\['A'\].z"),
    ],
)
def test_invalid_points_are_refused(tmp_path, change, said):
    with pytest.raises(InputError, match=said):
        read_solved_points(written(tmp_path, **change))


FORMATS = TESTS / "vectors" / "formats"


def test_released_files_still_load():
    assert len(read_star_offsets(FORMATS / "stars-1.dat")) == 72
    assert len(read_tilts(FORMATS / "tilts-1.csv")) == 4
    record = read_record(FORMATS / "pointing-series-1.toml", PointingModel)
    assert record.series.terms == ("IA", "IE", "HZSZ")
