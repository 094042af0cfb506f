"""Figures of a design study draw what the study holds; words say directions."""

import numpy as np
import pytest
from matplotlib.patches import Circle, Polygon

from catseye.gateways.design.figures import caption_of, design_figures
from catseye.gateways.design.tables import MAPS, MOVES, map_name
from catseye.gateways.design.words import direction_of
from catseye.records.site.design_layout import read_design_layout
from catseye.records.site.solids import BoxRecord, Solids, SphereRecord
from catseye.reduction.design.aim import aim_of
from catseye.reduction.design.regions import Constraints
from catseye.reduction.design.scene import scene_of_layout
from catseye.reduction.design.search import SearchSettings
from catseye.reduction.design.study import StudySettings, design_study
from catseye.reduction.design.vary import variations
from repository import ROOT


@pytest.fixture(scope="module")
def study():
    hut = BoxRecord(name="hut", frame="ground", centre_mm=(5e3, 0.0, 1e3), size_mm=(4e3, 2e3, 3e3), turn_deg=90.0)
    tank = SphereRecord(name="tank", frame="ground", centre_mm=(-9e3, 3e3, 0.0), radius_mm=1500.0)
    layout = read_design_layout(ROOT / "examples" / "designs" / "structure-60m.toml")
    scene = scene_of_layout(layout, Solids(box=(hut,), sphere=(tank,)))
    settings = StudySettings(SearchSettings(5, 0), runs=100, map_side=4)
    varied = variations(["rangers within 4 m"])
    return design_study(scene, aim_of(scene, "worst", []), varied, Constraints(5.0, 1.0, scene.solids), settings)


def test_regions_and_obstacles_are_drawn_to_scale(study):
    ax = design_figures(study)["places"].axes[0]
    circles = [patch for patch in ax.patches if type(patch) is Circle]
    assert sorted(circle.radius for circle in circles) == [1.5, *([4.0] * 8)]
    (box,) = [patch for patch in ax.patches if type(patch) is Polygon]
    assert np.ptp(box.get_xy()[:, 0]) == pytest.approx(2.0)  # turned by a quarter
    assert np.ptp(box.get_xy()[:, 1]) == pytest.approx(4.0)
    assert box.get_xy()[:-1].mean(axis=0) == pytest.approx([5.0, 0.0])


def test_every_figure_has_a_caption_and_the_map_its_values(study):
    figures = design_figures(study)
    names = {map_name(each) for each in study.maps}
    assert set(figures) == {"places", "points", "search", *names}
    assert all(caption_of(study, name).endswith(".") for name in figures)
    mesh = figures["map-one-more"].axes[0].collections[0]
    np.testing.assert_allclose(np.ma.filled(mesh.get_array(), np.nan), study.maps[0].u * 1e3)


def test_tables_hold_the_study_s_numbers(study):
    rows = [row.split(",") for row in MOVES.csv(study).splitlines()]
    assert [row[0] for row in rows[1:]] == [move.unit for move in study.moves]
    assert float(rows[1][-1]) == pytest.approx(study.moves[0].distance, abs=1e-4)
    drawn = study.maps[0]
    last = MAPS.csv(drawn).splitlines()[-1].split(",")
    assert [float(cell) for cell in last] == pytest.approx([drawn.x[-1], drawn.y[-1], drawn.u[-1, -1] * 1e3], abs=1e-4)


@pytest.mark.parametrize(
    ("axis", "words"),
    [
        ((0.0, 0.0, 1.0), "up"),
        ((0.0, 1.0, 0.0), "to the north, 0° up"),
        ((-0.6, 0.0, 0.8), "to the west, 53° up"),
        ((0.5, -0.5, np.sqrt(0.5)), "to the south-east, 45° up"),
    ],
)
def test_directions_in_words(axis, words):
    assert direction_of(np.array(axis)) == words
