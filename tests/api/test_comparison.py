"""Two epochs of small networks of every dimension from their files: what moved, how far, and what is doubtful."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import catseye
from catseye.errors import EstimationError
from gateways.report_scene import column, read, texts, words_of
from repository import TESTS

EPOCHS = TESTS / "vectors" / "networks" / "epochs"


def compared(first, second, **options):
    return catseye.compare(EPOCHS / first, EPOCHS / second, **options)


@pytest.mark.parametrize(
    ("later", "moved"),
    [("one", {"P": 150.14}), ("two", {"P": 150.12, "Q": 299.62})],  # mm along y, by numpy; planted 150 and 300
)
def test_points_that_went_far_are_named_and_doubted(later, moved):
    found = compared("stations-1.gkf", f"stations-2-{later}.gkf")
    assert found.names == tuple("ABCDPQRST")
    assert {n for n, word in zip(found.names, found.words, strict=True) if word == "moved"} == set(moved)
    for name, along in moved.items():
        i = found.names.index(name)
        assert found.displacement[i, 1] == pytest.approx(1e-3 * along, abs=2e-5)
        assert found.u[i, 1] == pytest.approx(3.8e-4, abs=1e-5)
        assert found.p[i] < 1e-300
    assert found.verdict.word == "doubtful"
    assert "another point of the same name: P (0.1" in found.verdict.why
    assert all(name in found.verdict.why for name in moved)
    told = found.to_object()
    assert told["moved"] == list(moved)
    assert set(told["apart"]) == set(moved)
    assert told["conclusive"] is True
    assert "moved by more" not in told["status"]
    asked = compared("stations-1.gkf", f"stations-2-{later}.gkf", points=tuple("PQRST"))
    assert asked.verdict.word == "good"  # who names a point says that it is the same


def test_a_displacement_is_judged_by_its_uncertainty_not_by_its_size():
    """Vectors of u = 0.5 m between all pairs of five points: by symmetry a point is the mean of what the others say."""
    found = compared("coarse-1.toml", "coarse-2.toml")
    assert set(found.words) == {"stable"}
    assert found.verdict.word == "good"
    import tomllib

    ends = []
    for name in ("coarse-1.toml", "coarse-2.toml"):
        x = np.zeros((5, 3))
        for o in tomllib.loads((EPOCHS / name).read_text())["observation"]:
            i, j = "ABCDE".index(o["from"]), "ABCDE".index(o["to"])
            x[j] += np.array(o["xyz_m"]) / 5.0
            x[i] -= np.array(o["xyz_m"]) / 5.0
        ends.append(x)
    plain, covariance = found.compared.difference
    np.testing.assert_allclose(plain, ends[1] - ends[0], rtol=0, atol=1e-9)
    assert np.abs(plain).max() > 0.2
    np.testing.assert_allclose(covariance, np.tile(2 * 0.25 * 4 / 25 * np.eye(3), (5, 1, 1)), rtol=1e-6, atol=1e-9)


def test_two_levelling_networks_are_compared_in_height_alone():
    """Two held benchmarks and two points; least squares by numpy."""
    found = compared("levels-1.gkf", "levels-2.gkf")
    a = np.array([[1.0, 0], [1, 0], [-1, 1], [0, 1]])  # 1-4, 2-4, 4-5, 1-5 in the heights of 4 and 5
    readings = np.array([[10.001, 10.0005], [6.0005, 6.0005], [-9.0012, -9.0012], [1.0003, 1.0003]])
    heights = np.linalg.lstsq(a, readings + np.array([[100], [104], [0], [100]]), rcond=None)[0]
    d, weight = heights[:, 1] - heights[:, 0], a.T @ a / 2e-6  # of differences, each u = 1 mm
    assert found.words == ("held", "held", "stable", "stable")
    assert np.isnan(found.displacement[:, :2]).all()
    np.testing.assert_allclose(found.compared.difference[0][2:, 2], d, rtol=0, atol=1e-9)
    alone = weight @ d / np.diag(weight)  # each if the other did not move
    np.testing.assert_allclose(found.displacement[2:, 2], alone, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.u[2:, 2], np.diag(weight) ** -0.5, rtol=1e-6)
    told = found.to_object()["points"]["4"]
    assert told["displacement"][:2] == [None, None]
    assert told["covariance"][0] == [None] * 3
    assert told["length"] == pytest.approx(abs(alone[0]), abs=1e-9)
    assert found.figures() == {}  # there is no plan and no elevation


@pytest.mark.parametrize("datum", ["held", "free"])
def test_a_point_of_a_plane_network_moved_twelve_millimetres(datum):
    """Held and free; planted 12 mm, u 1.1 mm; the displacement does not depend on the datum."""
    found = compared(f"plane-{datum}-1.gkf", f"plane-{datum}-2.gkf")
    assert {n for n, word in zip(found.names, found.words, strict=True) if word == "moved"} == {"4"}
    i = found.names.index("4")
    assert np.linalg.norm(found.displacement[i, :2]) == pytest.approx(0.012, abs=2.5e-3)
    assert found.displacement[i, :2] == pytest.approx([11.137e-3, -0.229e-3], abs=2e-6)
    assert found.u[i, :2] == pytest.approx([1.111e-3, 1.127e-3], abs=2e-6)
    assert found.p[i] < 1e-20
    assert np.isnan(found.displacement[:, 2]).all()
    assert np.isnan(found.covariances[:, 2]).all()
    assert ("held" in found.words) == (datum == "held")
    assert {"plan"} == set(found.figures())
    said = " ".join(p.text for p in found.passages())
    assert ("are fixed in both epochs" in said) == (datum == "held")
    assert "nan" not in said


def renamed(tmp_path, change):
    """The second epoch of the stations with some names changed."""
    text = (EPOCHS / "stations-2-one.gkf").read_text()
    for old, new in change.items():
        text = text.replace(f'"{old}"', f'"{new}"')
    file = tmp_path / "renamed.gkf"
    file.write_text(text)
    return file


def test_names_that_differ_by_case_are_said(tmp_path):
    lower = renamed(tmp_path, {name: name.lower() for name in "ABCDPQRST"})
    with pytest.raises(
        EstimationError, match=r"no point name in common, but .* only by upper and lower case: A and a, "
    ):
        catseye.compare(EPOCHS / "stations-1.gkf", lower)
    strange = renamed(tmp_path, {name: f"{name}9" for name in "ABCDPQRST"})
    with pytest.raises(EstimationError, match=r"no point name in common; .* \(first: A, B, .*; second: A9, B9, "):
        catseye.compare(EPOCHS / "stations-1.gkf", strange)
    part = catseye.compare(EPOCHS / "stations-1.gkf", renamed(tmp_path, {"P": "p", "Q": "Q2"}))
    assert part.verdict.word == "doubtful"
    assert "not compared, as the names differ by upper and lower case: P and p" in part.verdict.why
    words = part.compared.moved.words
    assert "in the first epoch only: P, Q" in words
    assert "in the second epoch only: p, Q2" in words
    gone = renamed(tmp_path, {"D": "d"})  # a held point that the other epoch does not have
    with pytest.raises(
        EstimationError,
        match=r"the first epoch fixes D, missing in the other epoch \(differing only in case: D and d\)",
    ):
        catseye.compare(EPOCHS / "stations-1.gkf", gone)


def test_no_answer_says_nan(tmp_path):
    """An epoch without redundancy: said in words, in either place, in both, and with estimated variance factors."""
    text = (EPOCHS / "levels-1.gkf").read_text()
    rows = [part.split("/>")[0] + "/>" for part in text.split("<dh")[1:]]
    bare = tmp_path / "bare.gkf"
    bare.write_text(text.replace("<dh" + rows[1], "").replace("<dh" + rows[3], ""))
    whole = EPOCHS / "levels-2.gkf"
    for pair, said in (
        ((bare, whole), "variance factor 0.2 of the second epoch, no redundancy in the first"),
        ((whole, bare), "variance factor 0.2 of the first epoch, no redundancy in the second"),
        ((bare, bare), "neither epoch has redundancy"),
    ):
        found = catseye.compare(*pair)
        assert any(said in word for word in found.compared.moved.words)
        assert not any("nan" in word for word in found.compared.moved.words)
        assert np.isfinite(found.p[2:]).all()
        assert found.verdict.word == "doubtful"
        assert "NaN" not in json.dumps(found.to_object())
    scaled = catseye.compare(bare, whole, scale_by_variance_factor=True)
    factor = scaled.compared.variance_factor
    assert (factor.value, factor.degrees_of_freedom) == (pytest.approx(0.2, abs=1e-3), 2)
    plain = catseye.compare(bare, whole)
    np.testing.assert_allclose(scaled.covariances[2:, 2, 2], factor.value * plain.covariances[2:, 2, 2])


def test_every_file_of_a_comparison_is_written_for_every_dimension(tmp_path):
    for first, second in (("levels-1.gkf", "levels-2.gkf"), ("plane-free-1.gkf", "plane-free-2.gkf")):
        out = Path(tmp_path / first)
        catseye.save(compared(first, second), out)
        page = (out / "report.html").read_text()
        report = read(page)
        assert not re.search(r"\bnan\b", " ".join(words_of(page)) + texts(report))
        assert set(column(report, "displacements", "dx" if "levels" in first else "dz")) == {None}
        assert ("displacements" in report["scenes"]) == ("plane" in first)
        header, *rows = (out / "displacements.csv").read_text().splitlines()
        gone = ["dx_mm", "dy_mm"] if "levels" in first else ["dz_mm"]
        for row in rows:
            cells = dict(zip(header.split(","), row.split(","), strict=True))
            assert all(cells[column] == "" for column in gone)
            assert float(cells["length_mm"]) >= 0.0
