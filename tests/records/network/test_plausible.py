"""Angles beyond the circle and lengths in another unit: refused with both readings, or doubtful where only unlikely."""

import numpy as np
import pytest

from catseye.api.network import adjust
from catseye.api.planning import plan
from catseye.errors import InputError
from catseye.records.network.any_file import read_network
from catseye.records.network.gama import gama_network
from catseye.records.network.starnet import starnet_network

STATIONS = {"S1": (0.0, 0.0, 0.0), "S2": (42.0, 3.0, 0.4), "S3": (20.0, 38.0, 1.2), "S4": (-5.0, 25.0, -0.7)}
TARGETS = {"T1": (12.0, 9.0, 3.0), "T2": (25.0, 21.0, 6.5), "T3": (4.0, 18.0, -4.0)}


def folder(tmp_path, factor, *, role="fixed", between=False, separator=","):
    """Ranges from four stations to three targets, every distance multiplied by a factor."""
    rng = np.random.default_rng(8)
    points = ["point,x,y,z,role", *(f"{n},{x},{y},{z},{role}" for n, (x, y, z) in STATIONS.items())]
    points += [f"{n},{x + 0.01},{y - 0.02},{z},free" for n, (x, y, z) in TARGETS.items()] if role != "fixed" else []
    rows = ["from,to,distance,sigma"]
    pairs = [(a, b) for a in STATIONS for b in TARGETS]
    pairs += [(a, b) for a in STATIONS for b in STATIONS if a < b] if between else []
    both = STATIONS | TARGETS
    for a, b in pairs:
        d = np.linalg.norm(np.subtract(both[a], both[b])) + 3e-4 * rng.standard_normal()
        rows.append(f"{a},{b},{factor * d:.9g},{0.0003 * max(factor, 1.0)}")
    tmp_path.mkdir(exist_ok=True)
    for name, lines in (("points.csv", points), ("ranges.csv", rows)):
        text = "\n".join(lines) + "\n"
        text = text.replace(",", ";").replace(".", ",") if separator == ";" else text
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "mm"), (1e-3, "km")])
@pytest.mark.parametrize("between", [False, True])
@pytest.mark.parametrize("separator", [",", ";"])
def test_lengths_in_another_unit_than_held_stations_allow_are_refused(tmp_path, factor, unit, between, separator):
    path = folder(tmp_path / "network", factor, between=between, separator=separator)
    with pytest.raises(InputError, match=f"does not fit the coordinates of its points; in {unit} it is"):
        read_network(path)


@pytest.mark.parametrize("between", [False, True])
@pytest.mark.parametrize("role", ["fixed", "datum", "free"])
def test_lengths_in_metres_are_believed(tmp_path, between, role):
    network = read_network(folder(tmp_path / "network", 1.0, between=between, role=role))
    assert network.doubts == ()


@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_lengths_that_only_approximate_coordinates_contradict_are_doubtful(tmp_path, factor):
    path = folder(tmp_path / "network", factor, role="datum", between=True)
    result = adjust(path)
    assert result.verdict.word != "good"
    assert "lengths in another unit than the coordinates?" in result.verdict.why


def test_one_blunder_is_no_unit(tmp_path):
    path = folder(tmp_path / "network", 1.0, between=True)
    lines = (path / "ranges.csv").read_text(encoding="utf-8").splitlines()
    start, end, distance, sigma = lines[1].split(",")
    lines[1] = ",".join([start, end, str(1e3 * float(distance)), sigma])
    (path / "ranges.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert read_network(path).doubts == ()


def test_a_plan_does_not_look_at_lengths(tmp_path):
    good, wrong = (folder(tmp_path / name, f) for name, f in (("good", 1.0), ("wrong", 1e3)))
    for path in (good, wrong):  # a plan needs a place for every point, and the same sigmas
        with (path / "points.csv").open("a", encoding="utf-8") as file:
            file.writelines(f"{n},{x},{y},{z},free\n" for n, (x, y, z) in TARGETS.items())
        text = (path / "ranges.csv").read_text(encoding="utf-8").splitlines()
        rows = [",".join(line.split(",")[:3]) for line in text]
        (path / "ranges.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    planned = [plan(path, sigma_mm=0.3, sigma_ppm=2.0) for path in (good, wrong)]
    assert planned[1].covariances == pytest.approx(planned[0].covariances, rel=1e-12)


def plane(unit, angle):
    return (
        f".UNITS Meters {unit}\n.2D\nC 1 0 0 ! !\nC 2 100 0 ! !\nA 1-2-3 {angle} 3\nA 2-3-1 {angle} 3\nD 1-3 71 .01\n"
    )


@pytest.mark.parametrize(
    ("unit", "angle", "words"),
    [
        ("DMS", "453015", ["453015 deg", "packed 45-30-15", "45.5042 deg"]),
        ("DD", "1203000", ["1203000 deg", "packed 120-30-00", "120.5 deg"]),
        ("DD", "905.5", ["905.5 deg is 2 turns and 185.5 deg"]),
        ("GONS", "4500", ["4500 gon is 11 turns and 100 gon", "point lost, 45.00"]),
    ],
)
def test_an_angle_of_several_turns_is_refused_with_both_readings(unit, angle, words):
    with pytest.raises(InputError) as refused:
        starnet_network(plane(unit, angle), "plane.dat")
    assert all(word in str(refused.value) for word in ["line 5", "beyond the circle", *words])


@pytest.mark.parametrize(("unit", "angle"), [("DD", "405"), ("GONS", "450")])
def test_an_angle_in_its_second_turn_is_doubtful(unit, angle):
    doubtful = starnet_network(plane(unit, angle), "plane.dat")
    assert len(doubtful.doubts) == 2
    assert "is 1 turn and" in doubtful.doubts[0]
    result = adjust(doubtful)
    assert result.verdict.word == "doubtful"
    assert "beyond the circle" in result.verdict.why


@pytest.mark.parametrize(
    ("unit", "angle"), [("DMS", "45-30-15"), ("DD", "359.9999"), ("GONS", "399.99"), ("DD", "-45")]
)
def test_an_angle_within_the_circle_is_believed(unit, angle):
    assert starnet_network(plane(unit, angle), "plane.dat").doubts == ()


def test_other_files_know_the_circle_too(tmp_path):
    points = '<point id="1" x="0" y="0" fix="xy"/><point id="2" x="9" y="9" adj="xy"/>'
    seen = '<obs from="1"><direction to="2" val="4500" stdev="10"/><distance to="2" val="12.7" stdev="2"/></obs>'
    text = f"<gama-local><network><points-observations>{points}{seen}</points-observations></network></gama-local>"
    with pytest.raises(InputError, match="4500 gon is 11 turns"):
        gama_network(text.encode(), "network.gkf")
    file = tmp_path / "network.toml"
    file.write_text(
        'format = "catseye-network-1"\n[[points]]\ncolumns = ["name", "x_m", "y_m"]\nfixed = "xy"\n'
        'rows = [["A", 0.0, 0.0], ["B", 9.0, 9.0]]\n'
        '[[observation]]\nkind = "azimuth"\nfrom = "A"\nto = "B"\nvalue_deg = 453015\nu_arcsec = 3\n',
        encoding="utf-8",
    )
    with pytest.raises(InputError, match="packed 45-30-15"):
        read_network(file)
