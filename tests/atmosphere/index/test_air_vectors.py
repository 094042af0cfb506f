"""The printed numbers in vectors/air.toml, each to its own tolerance."""

import tomllib
from operator import attrgetter

import pytest

from catseye.names import AIR_MODEL, AIR_MODELS
from repository import TESTS
from vector_scene import function_of

VECTORS = tomllib.loads((TESTS / "vectors" / "air.toml").read_text(encoding="utf-8"))["vector"]


@pytest.mark.parametrize("vector", VECTORS, ids=lambda vector: vector["name"])
def test_a_printed_number_is_reproduced(vector):
    got = function_of(vector["function"])(**vector["inputs"])
    if "field" in vector:
        got = attrgetter(vector["field"])(got)
    assert float(got) / vector.get("scale", 1.0) == pytest.approx(
        vector["expected"], rel=0.0, abs=vector["tolerance"]
    ), f"{vector['source']}: {vector['why']}"


@pytest.mark.parametrize("model", AIR_MODELS)
def test_every_model_has_two_vectors_at_least(model):
    """A vector names its model as an argument, or its function is in the model's file, or it is the default's."""
    own = [
        vector["name"]
        for vector in VECTORS
        if vector["inputs"].get("model", AIR_MODEL if ".air." in vector["function"] else "") == model
        or f".{model}." in vector["function"]
    ]
    assert len(own) >= 2


def test_carbon_dioxide_moves_the_group_index_as_stated():
    from catseye.atmosphere.index.air import group_refractivity

    grown = group_refractivity(20.0, 1013.25, 50.0, co2_ppm=550.0) - group_refractivity(20.0, 1013.25, 50.0)
    # the fact sheet's 0.0145 ppm per 100 ppm is truncated: 0.534e-6 of the dry air's 272.4 ppm is 0.014 55
    assert grown * 1e6 == pytest.approx(0.0145, abs=1e-4)
