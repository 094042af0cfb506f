"""`import catseye`: light, typed by its results, each of which says itself, is a table, and can be kept."""

import json
import subprocess
import sys

import numpy as np
import pytest

import catseye
from catseye.api.result import Result
from catseye.errors import InputError

HEAVY = ("scipy", "astropy", "matplotlib", "pydantic", "numba", "typer", "sqlalchemy", "rich")


def test_the_import_and_a_look_at_its_functions_load_nothing_heavier_than_numpy():
    code = (
        "import sys, catseye\n"
        "[getattr(catseye, name) for name in dir(catseye)]\n"
        f"print([m for m in sys.modules if m.split('.')[0] in {HEAVY}])"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


def test_every_name_is_there_and_no_other():
    assert all(getattr(catseye, name) is not None for name in dir(catseye))
    with pytest.raises(AttributeError, match="has no attribute 'reduced'"):
        catseye.reduced  # noqa: B018


def test_air_has_the_shape_of_its_inputs():
    answer = catseye.air([[0.0], [20.0]], 933.0, [0.0, 50.0, 100.0], u_temperature_c=0.3)
    assert answer.group_index.shape == answer.standard_uncertainty.shape == (2, 3)
    assert len(answer.to_table()) == 6
    assert str(answer.to_table()["temperature"].unit) == "deg_C"
    assert "of the formula only" not in answer.verdict.why
    assert "of the formula only" in catseye.air(20.0, 933.0, 50.0).verdict.why
    with pytest.raises(catseye.ValidityError, match="temperature"):
        catseye.air(200.0, 933.0, 50.0)


def test_sound_takes_arrays():
    answer = catseye.sound([0.0, 20.0], 933.0, 50.0, model="real_gas")
    assert answer.speed.shape == (2,)
    assert "to" in repr(answer)


def test_a_result_is_a_paragraph_a_table_a_page_and_files(tmp_path):
    answer = catseye.air([0.0, 20.0], 933.0, 50.0)
    assert repr(answer).startswith("<AirResult> Good: ")
    assert len(repr(answer)) < 1000
    assert answer._repr_html_().startswith("<p><b>✓ Good</b>")
    where = catseye.save(answer, tmp_path / "air")
    kept = json.loads((where / "result.json").read_text())
    np.testing.assert_array_equal(kept["group_index"], answer.group_index)
    assert (where / "air.csv").read_text().splitlines()[0].startswith("temperature [deg_C],pressure [hPa],")
    assert set(json.loads((where / "provenance.json").read_text())["outputs"]) == {"result.json", "air.csv"}
    catseye.save(answer, where)  # our own may be replaced
    (where / "mine.txt").touch()
    with pytest.raises(InputError, match="did not write"):
        catseye.save(answer, where)
    with pytest.raises(InputError, match="has no figure"):
        catseye.show(answer)
    with pytest.raises(InputError, match=r"table 'points' is not in this result \(expected one of air\)"):
        answer.to_table("points")
    with pytest.raises(InputError, match="needs a result of catseye, not dict"):
        catseye.save({}, tmp_path / "other")


def test_a_result_is_frozen():
    with pytest.raises(AttributeError):
        catseye.air(20.0, 933.0, 50.0).group_index = 1.0


def test_load_knows_what_a_file_holds(tmp_path):
    kinds = {
        "night-01": "Campaign",
        "gbt": "SiteFolder",
        "networks/ground-ring": "ObservationNetwork",
        "networks/feed-arm.toml": "ObservationNetwork",
        "networks/total-station.gkf": "ObservationNetwork",
        "monuments/ZY3.toml": "MonumentGeometry",
        "night-01/mirrors/ZP103.toml": "MirrorGeometry",
        "night-01/triplets/TR01.toml": "TripletRecord",
        "triplets/TR01.toml": "TripletMeasurement",
        "panels/tool.toml": "PanelInstrument",
        "keep-out.toml": "KeepOut",
        "solids.toml": "Solids",
        "beams/head.toml": "BeamTrain",
    }
    for name, kind in kinds.items():
        loaded = catseye.load(name)
        assert type(loaded).__name__ == kind, name
        assert len(repr(loaded)) < 5000, name
    with pytest.raises(InputError, match="of a kind that is not known"):
        catseye.load("night-01/README.md")
    with pytest.raises(InputError, match="missing"):
        catseye.load(tmp_path / "nowhere")
    with pytest.raises(InputError, match="holds none of"):
        catseye.load(tmp_path)


def test_every_result_class_says_its_fields():
    for kind in Result.__subclasses__():
        assert kind.__doc__, kind
        for field in kind.__annotations__:
            assert field in kind.__doc__ or field in ("campaign", "seed", "state", "co2_ppm"), (
                f"{kind.__name__}.{field}"
            )
