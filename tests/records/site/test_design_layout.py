"""Layouts by rule: places worked by hand, and what is refused."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.site.design_layout import TargetSet, read_design_layout
from repository import ROOT

TEXT = (ROOT / "examples" / "designs" / "structure-60m.toml").read_text()


def test_a_ring_begins_at_its_first_angle_and_goes_from_x_towards_y():
    ring = TargetSet(name="T", shape="ring", count=4, radius_m=2.0, centre_m=(1.0, 0.0, 3.0), first_deg=90.0)
    np.testing.assert_allclose(ring.places, [[1, 2, 3], [-1, 0, 3], [1, -2, 3], [3, 0, 3]], atol=1e-12)
    assert ring.names == ("T001", "T002", "T003", "T004")


def test_a_disc_is_a_sunflower_on_a_paraboloid():
    disc = TargetSet(name="T", shape="disc", count=2, radius_m=2.0, focal_length_m=0.5)
    radius, angle = np.array([1.0, np.sqrt(3.0)]), np.radians([0.0, 137.50776405])
    expected = np.stack([radius * np.cos(angle), radius * np.sin(angle), radius**2 / 2.0], axis=1)
    np.testing.assert_allclose(disc.places, expected, atol=1e-9)


def test_the_bundled_structure_has_200_rangers_and_600_targets():
    layout = read_design_layout(ROOT / "examples" / "designs" / "structure-500m.toml")
    rangers, targets = layout.rangers[0].places, layout.targets[0].places
    assert (len(rangers), len(targets)) == (200, 600)
    assert np.ptp(targets[:, 0]) == pytest.approx(500.0, abs=5.0)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('shape = "ring"', 'shape = "square"', "shape"),
        ("count = 8", "count = 0", "count"),
        ('name = "T"', 'name = "RG"', "is there twice"),
        ("far_m = 120.0", "far_m = 1.5", "near_m = 2 is not below far_m"),
        ("count = 30", 'type = "prism"\ncount = 30', "has an axis"),
        ("count = 30", "count = 19999", "points"),
    ],
)
def test_wrong_layouts_are_refused_by_place(old, new, why, tmp_path):
    assert old in TEXT
    path = tmp_path / "wrong.toml"
    path.write_text(TEXT.replace(old, new))
    with pytest.raises(InputError, match=why):
        read_design_layout(path)
