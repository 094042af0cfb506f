"""What a beam train says on screens and in files."""

import csv
import io
import xml.etree.ElementTree as ET

import pytest

from catseye.errors import ValidityError
from catseye.gateways.optics.beam_figures import beam_figure, beam_object, coating_plot, lines, write_beam
from catseye.gateways.writers.objects import json_line
from catseye.reduction.optics.beam import read_beam
from column_scene import assert_columns
from repository import ROOT

EXAMPLE = ROOT / "examples" / "beams" / "head.toml"


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    text = EXAMPLE.read_text()
    start, end = text.index("distances_m"), text.index("[laser]")
    file = tmp_path_factory.mktemp("beam") / "head.toml"
    file.write_text(text[:start] + "distances_m = [60, 100]\n" + text[end:])
    return read_beam(file)


def test_the_text_has_a_line_for_each_place_and_distance(found):
    said = list(lines(found[0]))
    for place in found[0].places:
        assert any(place.name in line for line in said)
    assert sum(line.startswith(("60 ", "100 ")) for line in said) == 2
    assert any(line.startswith("u of the range") for line in said)
    assert max(map(len, said)) <= 120


def test_the_object_has_no_nan_in_it(found):
    assert "NaN" not in json_line(beam_object(found[0]))
    assert beam_object(found[0])["places"][-1]["leg"] == "detector"


def test_the_files_say_the_same_as_the_object(found, tmp_path):
    write_beam(found[0], tmp_path, found[1])
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"beam.csv", "returned.csv", "beam.json", "beam.svg", "provenance.json"}
    rows = list(csv.DictReader(io.StringIO((tmp_path / "beam.csv").read_text())))
    for row, place in zip(rows, found[0].places, strict=True):
        assert row["name"] == place.name
        assert float(row["power_w"]) == pytest.approx(place.power)
        assert (row["aperture_m"] == "") == (place.aperture == float("inf"))


def test_figures_are_drawn_alike_twice(found):
    first = beam_figure(found[0])
    assert first == beam_figure(found[0])
    assert ET.fromstring(first).tag.endswith("svg")


def test_the_coating_figure_tells_reflectance_and_range():
    drawn, told = coating_plot(("gold", "dielectric"), 0.780, 0.0)
    assert ET.fromstring(drawn).tag.endswith("svg")
    assert told["gold_s_reflectance"] == told["gold_p_reflectance"] == pytest.approx(0.975, abs=0.002)
    assert told["dielectric_s_range"] == pytest.approx(0.61e-6, abs=0.01e-6)
    with pytest.raises(ValidityError, match="copper"):
        coating_plot(("copper",))
    with pytest.raises(ValidityError, match="at most 6"):
        coating_plot(("gold",) * 7)


def test_every_column_of_the_tables_has_the_unit_of_its_name(found, tmp_path):
    path = found[0]
    write_beam(path, tmp_path, found[1])
    told = {
        "leg": lambda p: p.leg,
        "name": lambda p: p.name,
        "way_m": lambda p: p.way,
        "radius_x_m": lambda p: p.radius[0],
        "radius_y_m": lambda p: p.radius[1],
        "curvature_x_per_m": lambda p: p.curvature[0],
        "curvature_y_per_m": lambda p: p.curvature[1],
        "aperture_m": lambda p: p.aperture,
        "clipped": lambda p: p.clipped,
        "power_w": lambda p: p.power,
    }
    assert_columns((tmp_path / "beam.csv").read_text(), told, path.places)
    told = {
        "distance_m": lambda r: r.distance,
        "radius_x_m": lambda r: r.radius[0],
        "radius_y_m": lambda r: r.radius[1],
        "hit": lambda r: r.hit,
        "collected": lambda r: r.collected,
        "power_w": lambda r: r.power,
        "status": lambda r: r.status,
    }
    assert [r.distance for r in path.returned] == [60.0, 100.0]  # m, as the file of the train says
    assert_columns((tmp_path / "returned.csv").read_text(), told, path.returned)
