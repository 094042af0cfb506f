"""The files that docs/formats/network.md prints are read and adjusted as they stand."""

import re

import numpy as np
import pytest

import catseye
from catseye.records.network import toml
from catseye.records.network.kinds import ANGLES, ENDS, LENGTHS, MAKERS
from repository import ROOT

PAGE = (ROOT / "docs" / "formats" / "network.md").read_text(encoding="utf-8")


def block(after, language):
    return re.search(rf"(?ms){re.escape(after)}.*?^```{language}\n(.*?)^```", PAGE)[1]


def test_the_folder_is_adjusted_and_finds_the_point(tmp_path):
    for name in ("points.csv", "ranges.csv"):
        (tmp_path / name).write_text(block(f"`{name}`:", "csv"))
    found = catseye.adjust(tmp_path)
    assert found.verdict.word == "good"
    np.testing.assert_allclose(found.x[found.names.index("T1")], [12.3, 8.7, 3.1], rtol=0, atol=3e-3)


def test_the_toml_is_adjusted(tmp_path):
    (tmp_path / "n.toml").write_text(block("## Our TOML", "toml"))
    found = catseye.adjust(tmp_path / "n.toml")
    assert found.answered
    assert found.degrees_of_freedom >= 1
    assert found.names == ("A", "B", "P")
    assert 0.01 < found.variance_factor < 4.0


@pytest.mark.parametrize("kind", sorted({*MAKERS, *ENDS, *toml.ALLOWED, *LENGTHS, *ANGLES}))
def test_every_kind_and_its_points_are_told(kind):
    line = next(line for line in PAGE.splitlines() if line.startswith("|") and f"`{kind}`" in line)
    assert all(f"`{end}`" in line for end in ENDS.get(kind, ()))
    assert re.search(rf"\b{kind}\b", toml.__doc__)
