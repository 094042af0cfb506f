"""Arguments of a pose that do not fit together are refused by name, before a file is read."""

import pytest

import catseye
from catseye.errors import ArgumentError


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ({"group": "dish", "points": ["A", "B", "C"]}, {"group", "points"}),
        ({"tilt_arcsec": (1.0, 2.0, 3.0)}, {"tilt_arcsec"}),
        ({"group": "alidade", "frame": "ground", "tilt_arcsec": (1.0, 2.0, 3.0)}, {"tilt_arcsec"}),
        ({"group": "alidade", "tilt_arcsec": (1.0, 2.0, 0.0)}, {"tilt_arcsec"}),
        ({"pointing": "newton"}, {"pointing"}),
        ({"pointing": "prime", "frame": "ground"}, {"pointing"}),
        ({"pointing": "prime", "group": "alidade"}, {"pointing"}),
        ({"posture_deg": (0.0, 96.0)}, {"posture_deg"}),
        ({"earlier_posture_deg": (541.0, 30.0)}, {"earlier_posture_deg"}),
    ],
)
def test_what_does_not_fit_is_refused_by_name(arguments, names):
    with pytest.raises(ArgumentError) as refused:
        catseye.pose("nowhere", site="nowhere", **arguments)
    assert set(refused.value.names) == names
