"""Displayed distances in a folder: index and correction of each row, the air's common error, refusals."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import catseye
from catseye.errors import InputError
from catseye.records.files.examples import example

AIR = '[air]\nwavelength_um = 0.78\nreference_index = 1.0002818\nmodel = "rueger1990"\n'
POINTS = "point,x,y,z,role\nA,0,0,0,fixed\nB,100,0,0,fixed\n"
ROW = "A,B,99.99715,0.0002"
HEAD = "from,to,distance,sigma"
WEATHER = ",temperature_c,pressure_hpa,humidity_percent"
STATION = '[[weather]]\npoint = "A"\ntemperature_c = 20.0\npressure_hpa = 933.0\nhumidity_percent = 50.0\n'


def written(tmp_path: Path, ranges: str, air: str | None = AIR, points: str = POINTS) -> Path:
    for name, text in (("points.csv", points), ("ranges.csv", ranges), ("air.toml", air)):
        if text is not None:
            (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    ("ranges", "air"),
    [
        (f"{HEAD}{WEATHER}\n{ROW},20,933,50\n", AIR),
        (f"{HEAD}\n{ROW}\n", AIR + STATION),
        (f"{HEAD}{WEATHER}\n{ROW},,,\n", AIR + STATION),
        (f"{HEAD},group_index\n{ROW},1.00025324\n", AIR),
        (f"{HEAD},index\n{ROW},{1.00025324 / 1.0002818:.10f}\n", AIR),
    ],
)
def test_the_correction_is_that_of_the_notes_air_by_hand(tmp_path, ranges, air):
    """The notes' n_g of 20 °C, 933 mb, 50 % is 1.000 253 24 (eq. 1.49, truncated): 28.55 ppm below 281.8 ppm.

    28.55 ppm of 100 m are 2.855 mm; positive, as thinner air than the reference makes the display too short.
    """
    found = catseye.adjust(written(tmp_path, ranges, air))
    assert found.adjusted.table.velocity[0] == pytest.approx(2.855e-3, abs=1e-6)
    assert found.residuals[0] == pytest.approx(99.99715 - 100.0 * 1.00025324 / 1.0002818, abs=1.5e-6)


def barrell_sears(t, p, h, um):
    """Group index of [BARRELLSEARS39] for moist air, worked out here; e by Magnus."""
    s = 1.0 / um**2
    group = 287.604 + 3 * 1.6288 * s + 5 * 0.0136 * s * s
    e = h / 100.0 * 6.1094 * np.exp(17.625 * t / (243.04 + t))
    k = 273.15 / (273.15 + t)
    return 1.0 + 1e-6 * (group * k * p / 1013.25 - 11.27 * e / (273.15 + t))


def test_the_example_agrees_with_another_index_and_with_the_same_network_in_toml(tmp_path):
    folder, toml = catseye.adjust("networks/displayed"), catseye.adjust("networks/weather.toml")
    np.testing.assert_allclose(folder.x, toml.x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(folder.covariances, toml.covariances, rtol=1e-5, atol=1e-14)
    names = [p.name for p in folder.adjusted.network.parameters]
    assert names == ["air", *(f"air at P{k}" for k in range(1, 7))]
    rows = np.genfromtxt(example("networks/displayed") / "ranges.csv", delimiter=",", skip_header=1)
    display, weather = rows[:, 2], rows[:, 4:].T
    velocity = folder.adjusted.table.velocity[:30]
    by_hand = display * (1.0002818 / barrell_sears(*weather, 0.658) - 1.0)
    assert np.abs(velocity - by_hand).max() < 0.4e-6 * display.max()  # two formulas of the index: 0.4 ppm
    assert np.abs(velocity).min() > 0.4e-3
    said = {p.title: p.text for p in folder.passages()}
    assert said["The air"].startswith("First velocity correction of 30 distances: +0.476 to +2.398 mm")
    assert set(folder.inputs()) == {"air.toml", "points.csv", "ranges.csv"}


def test_a_thermometer_that_is_wrong_for_all_is_within_the_claimed_u(tmp_path):
    """Twenty nights, each with its own error of the air (20 ppm) and noise: chi-square of air and places."""
    rng = np.random.default_rng(8)
    source = example("networks/displayed")
    shutil.copytree(source, tmp_path / "n")
    air = (
        (source / "air.toml")
        .read_text()
        .replace("u_ppm = 0.3 ", "u_ppm = 20 ")
        .replace("u_station_ppm = 0.1", "u_station_ppm = 0")
    )
    (tmp_path / "n" / "air.toml").write_text(air)
    first = catseye.adjust("networks/displayed")
    true = first.x
    at = {name: true[k] for k, name in enumerate(first.names)}
    cells = [line.split(",") for line in (source / "ranges.csv").read_text().splitlines()[1:]]
    places = "point,x,y,z,role\n" + "".join(
        f"P{k},{','.join(f'{v:.7f}' for v in at[f'P{k}'])},fixed\n" for k in range(1, 7)
    )
    (tmp_path / "n" / "points.csv").write_text(places)
    z, parameter = [], []
    for _ in range(20):
        error = 20e-6 * rng.standard_normal()
        lines = [HEAD + WEATHER]
        for a, b, _, sigma, *weather in cells:
            n = barrell_sears(*map(float, weather), 0.658)  # another formula than the adjustment's
            display = np.linalg.norm(at[b] - at[a]) * (n / 1.0002818 + error) + float(sigma) * rng.standard_normal()
            lines.append(",".join([a, b, f"{display:.7f}", sigma, *weather]))
        (tmp_path / "n" / "ranges.csv").write_text("\n".join(lines) + "\n")
        found = catseye.adjust(tmp_path / "n")
        parameter.append((found.adjusted.solution.parameters[0] - error) / found.adjusted.u_parameters[0])
        free = [k for k, name in enumerate(found.names) if name.startswith("T")]
        z.append(((found.x - np.array([at[name] for name in found.names]))[free] / found.u[free]).ravel())
    assert np.mean(np.square(parameter)) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 20))
    assert np.mean(np.square(z)) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 100))  # some 100 of 300 are independent


@pytest.mark.parametrize(
    ("ranges", "air", "said"),
    [
        (f"{HEAD}{WEATHER}\n{ROW},20,933,50\n", None, "ranges.csv: temperature_c needs air.toml"),
        (f"{HEAD}\n{ROW}\n", AIR, "ranges.csv: line 2, has no weather"),
        (f"{HEAD}{WEATHER}\n{ROW},20,,50\n", AIR, "line 2, pressure_hpa is blank"),
        (f"{HEAD}{WEATHER},group_index\n{ROW},20,933,50,1.0003\n", AIR, "line 2, has temperature_c and group_index"),
        (f"{HEAD},group_index\n{ROW},281.8\n", AIR, "group_index = '281.8' (expected 1 to 1.001)"),
        (f"{HEAD}{WEATHER}\n{ROW},20,933,50\n{ROW},200,933,50\n", AIR, "ranges.csv: line 3, "),
        (f"{HEAD}\n{ROW}\n", "[air]\nwavelength_um = 0.78\n", "air.toml: air, expected reference_index"),
        (f"{HEAD}\n{ROW}\n", STATION, "air.toml: [air] is missing"),
        (f"{HEAD}\n{ROW}\n", AIR + "[wether]\n", "'wether' is not a known table"),
        (f"{HEAD}\n{ROW}\n", AIR.replace("reference_index", "refrence_index") + STATION, "air.toml: air, "),
    ],
)
def test_what_is_wrong_is_one_line_with_its_place(tmp_path, ranges, air, said):
    with pytest.raises(InputError) as problem:
        catseye.adjust(written(tmp_path, ranges, air))
    assert said in str(problem.value)
    assert "\n" not in str(problem.value)


def test_a_length_without_air_has_neither_correction_nor_its_error(tmp_path):
    ranges = f"{HEAD},index\n{ROW},1\nA,B,99.99716,0.0002,\n"
    found = catseye.adjust(written(tmp_path, ranges, AIR + "u_ppm = 1.0\n" + STATION))
    (group,) = found.adjusted.network.groups
    assert group.scale[0] == 1.0
    assert group.scaling[:, 0].tolist() == [-1, 6]
    velocity = [row["velocity"] for row in json.loads(found.to_json())["observations"]]
    assert velocity[1] == pytest.approx(2.855e-3, abs=1e-6)
