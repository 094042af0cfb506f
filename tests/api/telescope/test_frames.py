"""`convert`: files, reductions and arrays; sites and postures; what does not fit is refused by name."""

import json

import numpy as np
import pytest

import catseye
from catseye.errors import ArgumentError, InputError
from repository import ROOT

UP = {"from_frame": "reflector", "to_frame": "ground", "posture_deg": (90.0, 45.0)}


def test_a_list_a_coord_dat_and_a_table_give_the_same(tmp_path):
    (tmp_path / "coord.dat").write_text("0 0 60000\n0 54000 12150\n")
    (tmp_path / "points.csv").write_text("name,x_mm,y_mm,z_mm,u_mm\nfocus,0,0,60000,0.1\ndish,0,54000,12150,0.2\n")
    plain = catseye.convert([[0.0, 0.0, 60.0], [0.0, 54.0, 12.15]], **UP)
    from_dat = catseye.convert(tmp_path / "coord.dat", **UP)
    table = catseye.convert(tmp_path / "points.csv", **UP, u_posture_arcsec=(0.0, 0.0))
    np.testing.assert_array_equal(plain.points, from_dat.points)
    np.testing.assert_allclose(plain.points, table.points, atol=1e-12)
    assert table.names == ("focus", "dish")
    assert plain.covariance is None
    np.testing.assert_allclose(np.sqrt(table.covariance[:, 0, 0]), [1e-4, 2e-4], rtol=1e-12)


def test_the_lengths_are_those_of_the_site(tmp_path):
    moved = catseye.load("night-01")
    frames = moved.site.frames
    reflector = frames.reflector.model_copy(update={"elevation_axis_height_mm": 50_260.0})
    site = moved.site.model_copy(update={"frames": frames.model_copy(update={"reflector": reflector})})
    object.__setattr__(moved, "site", site)
    higher = catseye.convert([0.0, 0.0, 0.0], from_frame="reflector", to_frame="ground", site=moved)
    usual = catseye.convert([0.0, 0.0, 0.0], from_frame="reflector", to_frame="ground", site="night-01")
    np.testing.assert_allclose(higher.points - usual.points, [[0.0, 0.0, 2.0]], atol=1e-12)
    said = catseye.convert([0.0, 0.0, 0.0], from_frame="reflector", to_frame="ground", posture_deg=(145.3, 30.0))
    np.testing.assert_allclose(usual.points, said.points, atol=1e-12)


def test_a_reduction_brings_posture_covariance_and_verdict(tmp_path):
    names, x = ("A", "B"), np.array([[10.0, 20.0, 60.0], [-5.0, 3.0, 70.0]])
    document = {
        "format": "catseye-reduction-1",
        "frame": "ground",
        "verdict": {"word": "doubtful", "why": "one wall of the network is weak"},
        "points": {name: dict(zip("xyz", row, strict=True)) for name, row in zip(names, x.tolist(), strict=True)},
        "covariance_order": [f"{name} {axis}" for name in names for axis in "xyz"],
        "covariance": np.diag([1e-8, 4e-8, 9e-8] * 2).tolist(),
    }
    (tmp_path / "coordinates.json").write_text(json.dumps(document))
    arguments = {"from_frame": "ground", "to_frame": "alidade", "posture_deg": (90.0, 30.0)}
    found = catseye.convert(tmp_path, **arguments)
    # at azimuth 90 the alidade looks east: its y is east, its x south
    np.testing.assert_allclose(found.points, np.stack([-x[:, 1], x[:, 0], x[:, 2]], axis=1), atol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diagonal(found.covariance[0])), [2e-4, 1e-4, 3e-4], rtol=1e-9)
    assert found.verdict.word == "doubtful"
    with pytest.raises(ArgumentError, match="are of the ground frame"):
        catseye.convert(tmp_path, from_frame="reflector", to_frame="ground", posture_deg=(90.0, 30.0))


def test_a_pose_says_its_frame_and_pivot(tmp_path):
    found = catseye.convert([0.0, 0.0, 0.0], **UP, u_mm=(1.0, 2.0, 3.0))
    said = found.to_object()
    assert (said["transform"]["frame"], said["subreflector"]["frame"]) == ("ground", "prime_focus")
    assert said["transform"]["pivot"] == said["transform"]["translation"]
    assert found.to_table()["u_z"].to_value("mm")[0] == pytest.approx(np.sqrt((2.0**2 + 3.0**2) / 2.0))
    written = catseye.save(found, tmp_path / "out")
    assert sorted(p.name for p in written.iterdir()) == ["frames.svg", "points.csv", "provenance.json", "result.json"]


def test_units_come_in_as_quantities():
    from astropy import units

    found = catseye.convert(np.array([0.0, 0.0, 6000.0]) * units.cm, **UP)
    np.testing.assert_allclose(found.points, [[7.184829, 0.0, 132.999039]], atol=0.6e-6)


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ({"from_frame": "dish"}, {"from_frame"}),
        ({"posture_deg": None}, {"posture_deg"}),
        ({"posture_deg": (0.0, 96.0)}, {"posture_deg"}),
        ({"u_posture_arcsec": (1.0, 1.0)}, {"u_posture_arcsec", "u_mm"}),
        ({"u_mm": (1.0, 1.0)}, {"u_mm"}),
        ({"u_mm": (1.0, 1.0, -1.0)}, {"u_mm"}),
        ({"u_mm": (1.0, 1.0, 1.0), "covariance": np.eye(3)}, {"u_mm", "covariance"}),
        ({"subreflector_turn_deg": (0.0, 90.0, 0.0)}, {"subreflector_turn_deg"}),
    ],
)
def test_what_does_not_fit_is_refused_by_name(arguments, names):
    with pytest.raises(ArgumentError) as refused:
        catseye.convert([0.0, 0.0, 60.0], **{**UP, **arguments})
    assert set(refused.value.names) == names


@pytest.mark.parametrize(
    ("points", "more", "complaint"),
    [
        ([0.0, 1.0], {}, r"points of shape \(1, 2\)"),
        ([[0.0, 1.0, np.nan]], {}, "finite"),
        ([0.0, 0.0, 60.0], {"covariance": np.eye(2)}, r"covariance has shape \(2, 2\)"),
        ([0.0, 0.0, 60.0], {"covariance": np.diag([1.0, 1.0, -1.0])}, "negative eigenvalue"),
        (ROOT / "none.dat", {}, "none.dat"),
    ],
)
def test_spoilt_points_are_refused(points, more, complaint):
    with pytest.raises(InputError, match=complaint):
        catseye.convert(points, **UP, **more)
