"""Displayed distances with weather: the index of each, its correction by hand, the air's common error."""

import json
from pathlib import Path

import numpy as np
import pytest

import catseye
from catseye.errors import InputError
from catseye.records.files.examples import example
from catseye.records.network.any_file import read_network

HEAD = 'format = "catseye-network-1"\n'
AIR = '[air]\nwavelength_um = 0.78\nreference_index = 1.0002818\nmodel = "rueger1990"\n'
POINTS = """
[[point]]
name = "A"
xyz_m = [0.0, 0.0, 0.0]
fixed = "xyz"

[[point]]
name = "B"
xyz_m = [100.0, 0.0, 0.0]
fixed = "xyz"
"""
LINE = '\n[[observation]]\nkind = "slope_distance"\nfrom = "A"\nto = "B"\nvalue_m = 99.99715\nu_mm = 0.2\n'
WEATHER = "temperature_c = 20.0\npressure_hpa = 933.0\nhumidity_percent = 50.0\n"
STATION = f'[[weather]]\npoint = "A"\n{WEATHER}'


def adjusted(tmp_path: Path, text: str):
    (tmp_path / "n.toml").write_text(HEAD + text, encoding="utf-8")
    return catseye.adjust(tmp_path / "n.toml")


@pytest.mark.parametrize(
    "text",
    [AIR + POINTS + LINE + WEATHER, AIR + STATION + POINTS + LINE, AIR + POINTS + LINE + "group_index = 1.00025325"],
)
def test_the_correction_is_that_of_the_notes_air_by_hand(tmp_path, text):
    """The notes' n_g of 20 °C, 933 mb, 50 % is 1.000 253 24 (eq. 1.49, truncated): 28.55 ppm below 281.8 ppm.

    28.55 ppm of 100 m are 2.855 mm; positive, as thinner air than the reference makes the display too short.
    """
    found = adjusted(tmp_path, text)
    assert found.adjusted.table.velocity[0] == pytest.approx(2.855e-3, abs=1e-6)
    assert found.residuals[0] == pytest.approx(99.99715 - 100.0 * 1.00025324 / 1.0002818, abs=1.5e-6)


def test_it_agrees_with_the_command_air_and_with_indices_worked_out_beforehand(tmp_path):
    text = example("networks/weather.toml").read_text(encoding="utf-8")
    weather = adjusted(tmp_path, text.removeprefix(HEAD))
    air = catseye.air(19.4, 931.6, 48.0, wavelength_um=0.658)
    kinds = weather.adjusted.table.kinds
    rows = weather.adjusted.table.kind == kinds.index("slope_distance")
    display, velocity = weather.adjusted.table.observed[rows], weather.adjusted.table.velocity[rows]
    np.testing.assert_allclose(velocity[:5], display[:5] * (1.0002818 / air.group_index - 1.0), rtol=0, atol=1e-9)
    groups = [group for group in weather.adjusted.network.groups if group.kind == "slope_distance"]
    plain = text[: text.index("[air]")] + "[[parameter]]\nname = 'common'\nvalue_ppm = 0.0\nu_ppm = 0.3\n"
    plain += "".join(f"[[ranger]]\nname = 'P{k}'\nu_scale_ppm = 0.1\n" for k in range(1, 7))
    plain += text[text.index("[[points]]") : text.index('columns = ["from"')] + "refractivity = 'common'\n"
    values = groups[0].scale
    lines = text[text.index('rows = [\n  ["P1", "T1"') :].splitlines()[1:-1]
    plain += 'columns = ["from", "to", "value_m", "index"]\nrows = [\n'
    plain += "".join(f"{line.rstrip('],')}, {n:.15f}],\n" for line, n in zip(lines, values, strict=True)) + "]\n"
    again = adjusted(tmp_path, plain.removeprefix(HEAD))
    np.testing.assert_allclose(weather.x, again.x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(weather.covariances, again.covariances, rtol=1e-6, atol=1e-14)


def test_the_airs_common_error_widens_lengths_and_is_estimated(tmp_path):
    text = example("networks/weather.toml").read_text(encoding="utf-8").removeprefix(HEAD)
    free, exact = adjusted(tmp_path, text), adjusted(tmp_path, text.replace("u_ppm = 0.3  ", "u_ppm = 0.0  "))
    names = [p.name for p in free.adjusted.network.parameters]
    assert names == ["air", *(f"air at P{k}" for k in range(1, 7))]
    u = free.adjusted.u_parameters
    assert 0.0 < u[0] < 0.3e-6
    assert (free.u >= exact.u - 1e-12).all()
    assert (free.u > exact.u * 1.0001).any()
    said = {p.title: p.text for p in free.passages()}
    assert said["The air"].startswith("First velocity correction of 30 distances: +")
    assert "air " in said["Parameters"]
    assert json.loads(free.to_json())["observations"][-1]["velocity"] > 0.0
    assert json.loads(catseye.adjust("networks/ground-ring").to_json())["observations"][0]["velocity"] is None


def test_reference_weather_gives_the_reference_index(tmp_path):
    reference = "".join(f"reference_{line}\n" for line in WEATHER.splitlines())
    air = AIR.replace("reference_index = 1.0002818\n", reference)
    assert adjusted(tmp_path, air + POINTS + LINE + WEATHER).residuals[0] == pytest.approx(99.99715 - 100.0, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (POINTS + LINE + WEATHER, "observation 1, temperature_c needs [air]"),
        (STATION + POINTS + LINE, "weather 1, needs [air]"),
        (AIR + POINTS + LINE, "observation 1, has no weather (expected temperature_c, pressure_hpa, humidity_percent"),
        (AIR + POINTS + LINE + WEATHER + "index = 1.0\n", "has index and temperature_c"),
        (AIR + POINTS + LINE + WEATHER + "group_index = 1.00025\n", "has group_index and temperature_c"),
        (AIR + POINTS + LINE + "group_index = 253.2\n", "group_index = 253.2 (expected 1 to 1.001)"),
        (AIR + POINTS + LINE + WEATHER.replace("20.0", "200.0"), "temperature 200 C is outside"),
        (AIR + STATION + STATION + POINTS + LINE, "weather 2, weather of 'A' occurs twice"),
        (AIR.replace("1.0002818", "281.8") + POINTS + LINE, "air, reference_index = 281.8 (expected 1 to 1.001)"),
        (
            AIR + "reference_temperature_c = 20.0\n" + POINTS + LINE,
            "air, expected reference_index, or reference_temperature_c",
        ),
        (AIR.replace("rueger1990", "edlen") + POINTS + LINE, "air, model = 'edlen' (expected "),
        (AIR + "u_ppm = -0.3\n" + POINTS + LINE + WEATHER, "air, u_ppm or u_station_ppm is negative"),
    ],
)
def test_weather_that_cannot_be_used_is_refused(tmp_path, text, complaint):
    (tmp_path / "n.toml").write_text(HEAD + text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_network(tmp_path / "n.toml")
    assert complaint in str(caught.value)
