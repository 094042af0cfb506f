"""Panel setting from Python: the answer of the command, its tables, figures and files."""

import numpy as np
import pytest

import catseye
from catseye.constants import MILLIMETRE
from catseye.errors import InputError
from panel_scene import EXAMPLE, dish

FILES = {"survey": EXAMPLE / "survey.csv", "cmm": EXAMPLE / "maps", "as_left": EXAMPLE / "as-left.csv"}


@pytest.fixture(scope="module")
def found():
    return catseye.panels(EXAMPLE / "as-found.csv", EXAMPLE / "tool.toml", layout=dish(), reject=True, **FILES)


def test_turns_and_advice_are_those_of_the_object(found):
    told = found.to_object()
    assert told["verdict"]["word"] == found.verdict.word
    assert found.turns.shape == found.u_turns.shape == found.advice.shape == (len(found.names), 4)
    rows = told["screws"]
    np.testing.assert_array_equal(found.turns.ravel(), [row["turns"] for row in rows])
    assert found.advice.ravel().tolist() == [row["verdict"] for row in rows]
    assert str((found.advice == "turn").sum()) in "".join(p.text for p in found.passages() if p.title == "The screws")


def test_columns_are_in_their_units(found):
    screws, fits = found.to_table("screws"), found.to_table("panels")
    heights = found.work.latest
    for name, values in (("height", heights.departure), ("u_relative", heights.u_relative)):
        np.testing.assert_allclose(screws[name].to_value("m"), values.ravel(), rtol=1e-12)
    np.testing.assert_allclose(fits["slope_x"].to_value("rad"), heights.fit[:, 1], rtol=1e-12)
    np.testing.assert_allclose(screws["x"].to_value("mm") * MILLIMETRE, [row.value for row in screws["x"]])
    assert set(catseye.show(found)) == {"corners", "surface", "lie", "control", "turning"}


def test_a_layout_is_a_site_a_table_or_a_record(found, tmp_path):
    names = ("panels/as-found.csv", "panels/tool.toml")
    site = catseye.panels(*names, layout=catseye.load("gbt"))
    table = catseye.panels(*names, layout="panels/layout.csv")
    np.testing.assert_allclose(site.turns, table.turns, atol=1e-6)
    assert site.work.setting is None
    where = catseye.save(table, tmp_path / "out")
    assert (where / "screws.csv").is_file()
    assert "as-found.csv" in table.inputs()


def test_what_cannot_be_is_named():
    names = ("panels/as-found.csv", "panels/tool.toml")
    with pytest.raises(InputError, match="focal_length_m = nan"):
        catseye.panels(*names, layout="panels/layout.csv", focal_length_m=float("nan"))
    with pytest.raises(InputError, match="two inputs have this name"):
        catseye.panels(*names, as_left=names[0])
    with pytest.raises(InputError, match="holds or lies"):
        catseye.save(catseye.panels(*names, layout="panels/layout.csv"), catseye.examples("panels/tool.toml"))
