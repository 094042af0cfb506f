"""Drawings of the conventions: each is made, described in words on the page, and has its signs right."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from repository import ROOT

pytest.importorskip("sphinx.application", reason="extra docs is not installed")
from drawings import FOLDER, draw

PAGE = (ROOT / "docs" / "conventions.md").read_text(encoding="utf-8")
IMAGE = re.compile(r"!\[([^\]]+)\]\(reference/drawings/([\w-]+)\.svg\)")


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """Every drawing, in a folder of its own."""
    return draw(tmp_path_factory.mktemp("drawings"))


def test_every_drawing_is_an_image_of_the_page_with_an_alternative(drawn):
    shown = {name: alternative for alternative, name in IMAGE.findall(PAGE)}
    assert sorted(shown) == sorted(path.stem for path in drawn)
    assert all(len(text) > 60 for text in shown.values())
    for path in drawn:
        root = ET.fromstring(path.read_text(encoding="utf-8"))
        assert root.tag.endswith("svg")
        assert len(list(root.iter("{http://www.w3.org/2000/svg}path"))) > 10


def test_the_same_bytes_come_again(drawn, tmp_path):
    assert [path.read_bytes() for path in draw(tmp_path)] == [path.read_bytes() for path in drawn]


def test_the_drawn_mount_is_right_handed_with_its_azimuth_clockwise_from_north(drawn):
    from kelvin import AZIMUTH, axis_angles

    x, z = axis_angles(np.pi - np.radians(AZIMUTH))
    assert z == pytest.approx(90.0 - AZIMUTH)  # counter-clockwise from east
    assert (x - z) % 360.0 == pytest.approx(90.0)  # seen from above, as y is up


def test_git_ignores_what_a_build_draws():
    folder = FOLDER.relative_to(ROOT).as_posix()
    assert f"/{folder}/*.svg" in (ROOT / ".gitignore").read_text(encoding="utf-8").splitlines()
