"""The printed numbers in humidity.toml, each to its own tolerance."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from vector_scene import function_of

VECTORS = tomllib.loads((Path(__file__).parent / "humidity.toml").read_text(encoding="utf-8"))["vector"]


@pytest.mark.parametrize("vector", VECTORS, ids=lambda vector: vector["name"])
def test_a_printed_number_is_reproduced(vector):
    inputs = dict(vector["inputs"])
    if "latitude_deg" in inputs:
        inputs["latitude"] = np.radians(inputs.pop("latitude_deg"))
    got = function_of(vector["function"])(**inputs)
    got = getattr(got, vector["field"]) if "field" in vector else got
    assert float(got) / vector.get("scale", 1.0) == pytest.approx(
        vector["expected"], rel=0.0, abs=vector["tolerance"]
    ), f"{vector['source']}: {vector['why']}"


def test_the_notes_example_with_its_own_rounded_factors_is_929_383():
    """The project's fact sheet, [PARKER04] eqs. 1.19 and 1.20 as printed."""
    from catseye.atmosphere.weather.barometer import temperature_corrected_mmhg

    got = 0.999102 * 1.333224 * float(temperature_corrected_mmhg(700.0, 20.0))
    assert got == pytest.approx(929.383, abs=5e-4)
