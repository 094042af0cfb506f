"""The printed numbers in geometry.toml, optics.toml and signal.toml, each to its own tolerance."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from catseye.constants import SPEED_OF_LIGHT
from catseye.optics.glass import group_index
from catseye.optics.retroreflector import prism
from vector_scene import function_of

UNITS = {"_mm": 1e-3, "_um": 1e-6, "_inch": 0.0254, "_deg": np.pi / 180, "_arcsec": np.pi / 648000}
KEEP = ("wavelength_um",)  # an argument's own unit, not ours to convert
DERIVED = {  # one line beyond a public function
    "group_wavelength": lambda frequency, wavelength_um: SPEED_OF_LIGHT / (group_index(wavelength_um) * frequency),
    "half_group_wavelength": lambda frequency, wavelength_um: (
        SPEED_OF_LIGHT / (2 * group_index(wavelength_um) * frequency)
    ),
    "index_ratio": lambda wavelength_um, air: group_index(wavelength_um) / air,
    "oblique_prism": lambda height, n, incidence: prism.obliquity_correction(height, n, np.cos(incidence)),
    "half_wavelength": lambda frequency, index: SPEED_OF_LIGHT / (2 * frequency * index),
    "wavelength": lambda frequency, index: SPEED_OF_LIGHT / (frequency * index),
}
VECTORS = [
    pytest.param(vector, id=f"{room}: {vector['name']}")
    for room in ("geometry", "optics", "signal")
    for vector in tomllib.loads((Path(__file__).parent / f"{room}.toml").read_text(encoding="utf-8"))["vector"]
]


def si(name, value):
    """The name without its unit, and the value in metres or radians."""
    for suffix, factor in UNITS.items():
        if name.endswith(suffix) and name not in KEEP:
            return name.removesuffix(suffix), np.multiply(value, factor)
    return name, value


def formula(name):
    return DERIVED[name] if name in DERIVED else function_of(name)


@pytest.mark.parametrize("vector", VECTORS)
def test_printed_number_is_reproduced(vector):
    answer = formula(vector["function"])(**dict(si(k, v) for k, v in vector["inputs"].items()))
    if "points_mm" in vector:
        answer = answer.points(np.multiply(vector["points_mm"], 1e-3))
    key = next(k for k in vector if k.startswith("expected"))
    unit = si(key, 1.0)[1]
    np.testing.assert_allclose(np.asarray(answer) / unit, vector[key], rtol=0, atol=vector["tolerance"])
    if "truncated_digits" in vector:
        scale = 10.0 ** vector["truncated_digits"]
        printed = np.rint(np.multiply(vector[key], scale))
        assert np.array_equal(np.trunc(np.asarray(answer) / unit * scale), printed)
