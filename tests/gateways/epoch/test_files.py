"""The files of a reduction of many points: the covariance beside, figures without labels, notes in one line."""

import json
from dataclasses import replace

import numpy as np
import pytest
from astropy.io import fits

import catseye.gateways.epoch.figures as figures_module
import catseye.gateways.epoch.files as files_module
import catseye.gateways.epoch.objects as objects_module
from catseye.errors import InputError
from catseye.estimation.least_squares.covariance import JointPoints
from catseye.gateways.epoch.figures import figures
from catseye.gateways.epoch.files import write_reduction
from catseye.gateways.writers.drawing import svg
from catseye.gateways.writers.matrix_fits import BLOCK
from catseye.gateways.writers.objects import plain
from catseye.records.network.solved_points import read_solved_points
from gateways.report_scene import read, texts
from kept_scene import reduction_directory, reduction_of_example


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Night-01 as if its 130 points were many."""
    directory = tmp_path_factory.mktemp("many")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(objects_module, "MOST_INSIDE", 100)
        patch.setattr(files_module, "STEP", 37)
        write_reduction(reduction_of_example(), directory)
    return directory


def test_the_matrix_beside_coordinates_json_is_the_full_covariance(written):
    expected = reduction_of_example().coordinates.covariance
    u = np.sqrt(np.diag(expected))
    rounding = 1e-15 * np.outer(u, u) + 1e-30  # of a sum over what is considered, of a block or of all
    told = json.loads((written / "coordinates.json").read_text())
    assert told["covariance"] is None
    assert told["covariance_file"] == "covariance.fits"
    with fits.open(written / "covariance.fits") as pages:
        pages.verify("exception")
        assert pages[0].header["BUNIT"] == "m2"
        np.testing.assert_array_less(np.abs(pages[0].data - expected), rounding)
    path = written / "covariance.fits"
    assert path.stat().st_size % BLOCK == 0
    offset = (path.read_bytes().index(b"END".ljust(80)) // BLOCK + 1) * BLOCK  # as its reader's docstring says
    raw = np.memmap(path, ">f8", "r", offset, expected.shape)
    np.testing.assert_array_less(np.abs(raw - expected), rounding)
    assert "covariance.fits" in json.loads((written / "provenance.json").read_text())["outputs"]
    own = told["points"]["DP007"]["covariance"]
    at = 3 * list(told["points"]).index("DP007")
    np.testing.assert_allclose(own, expected[at : at + 3, at : at + 3], rtol=1e-14)


def test_solved_points_are_read_with_it(written):
    expected = reduction_of_example().coordinates
    points = read_solved_points(written)
    names = ["DP031", "ZY116", "TR03-B"]
    np.testing.assert_allclose(points.block(names), expected.block(names), rtol=1e-14)
    assert points.block(names).dtype == float
    np.testing.assert_array_equal(points.places(names), expected.x[expected.rows(names)])


def test_a_reduction_tells_its_dish_and_its_covariance_as_printed():
    surface, written = reduction_of_example().surface, reduction_directory()
    points, printed = read_solved_points(written), read_solved_points(written, averaged=False)
    assert points.dish == surface.names
    assert points.focal_length == surface.focal_length
    q, stored = np.asarray(printed.covariance), json.loads((written / "coordinates.json").read_text())
    np.testing.assert_array_equal(q, stored["covariance"])
    np.testing.assert_array_equal(points.covariance, 0.5 * (q + q.T))


def test_surface_and_pose_say_the_same_from_either_file(written, tmp_path):
    from catseye.api.pose import pose
    from catseye.api.surface import surface

    inside = tmp_path / "inside"
    inside.mkdir()
    write_reduction(reduction_of_example(), inside)
    for job in (surface, pose):
        one, other = (flat(plain(job(place, site="night-01").to_object())) for place in (inside, written))
        assert other.keys() == one.keys()
        for name, value in one.items():
            if isinstance(value, float):  # a matrix may differ from its transpose by rounding
                assert other[name] == pytest.approx(value, rel=1e-8, abs=1e-11)
            else:
                assert str(other[name]).replace(str(written), str(inside)) == str(value)


def flat(value, name=""):
    """Every leaf of nested objects and lists by its path."""
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list | tuple) else None
    if inside is None:
        return {name: value}
    return {path: leaf for key, one in inside for path, leaf in flat(one, f"{name}.{key}").items()}


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("../covariance.fits", "expected the name of a file in the same directory"),
        ("gone.fits", "is not a FITS image"),
        (7, "expected"),
    ],
)
def test_invalid_covariance_file_is_refused(written, tmp_path, name, said):
    told = json.loads((written / "coordinates.json").read_text())
    (tmp_path / "coordinates.json").write_text(json.dumps({**told, "covariance_file": name}))
    with pytest.raises(InputError, match=said):
        read_solved_points(tmp_path)


def test_a_matrix_of_another_night_is_refused(written, tmp_path):
    (tmp_path / "coordinates.json").write_bytes((written / "coordinates.json").read_bytes())
    fits.PrimaryHDU(np.eye(6)).writeto(tmp_path / "covariance.fits")
    with pytest.raises(InputError, match=r"has shape \(6, 6\) \(expected doubles, \(390, 390\)\)"):
        read_solved_points(tmp_path)


def test_figures_of_many_points_are_maps_of_pixels_without_labels(monkeypatch):
    reduction = reduction_of_example()
    labelled = svg(figures(reduction)["dish"])
    assert labelled.count("DP0") > 50
    for name, value in (("CROWD", 20), ("PIXELS", 20)):
        monkeypatch.setattr(figures_module, name, value)
    drawn = figures(reduction)
    assert "DP0" not in svg(drawn["dish"])
    assert "<image" in svg(drawn["plan"])
    assert "<image" in svg(drawn["residuals"])
    assert len(svg(drawn["plan"])) < 300_000


class Asked:
    """A covariance that is not at hand: whole matrices that are asked of it are counted."""

    def __init__(self, inner):
        self.inner, self.large = inner, []

    def __getattr__(self, name):
        return getattr(self.inner, name)

    def _counted(self, name, *given):
        answer = getattr(self.inner, name)(*given)
        self.large.append(answer.size)
        return answer

    def within(self, columns):
        return self._counted("within", columns)

    def across(self, columns):
        return self._counted("across", columns)

    def carried(self, *given):
        return self._counted("carried", *given)


def test_rows_of_the_points_are_computed_once(tmp_path, monkeypatch):
    """For the matrix in its file, the page's three fits of the dish and its pose."""
    whole = reduction_of_example()
    points = whole.coordinates.joint
    asked = Asked(points.q)
    coordinates = replace(whole.coordinates, joint=JointPoints(asked, points.columns))
    monkeypatch.setattr(objects_module, "MOST_INSIDE", 100)
    told = []
    write_reduction(replace(whole, coordinates=coordinates), tmp_path, lambda *each: told.append(each))
    assert sum(asked.large) == points.columns.size**2
    said = [what for what, _, _ in told]
    page = said.index("writing report.html")
    assert said[page + 1 :] == ["page: dish pose by each command", "writing"]
    assert all(done <= of for _, done, of in told)


def test_page_names_the_matrix_file(written, tmp_path):
    assert "the full matrix in covariance.fits" in texts(read((written / "report.html").read_text()))
    write_reduction(reduction_of_example(), tmp_path)
    assert "the full matrix in coordinates.json" in texts(read((tmp_path / "report.html").read_text()))
