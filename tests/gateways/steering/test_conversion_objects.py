"""Text of converted points: the subreflector's six are told only where they matter."""

import numpy as np

from catseye.gateways.steering.conversion_objects import conversion_lines, conversion_passages
from catseye.geometry.antenna.rigid_telescope import RigidTelescope
from catseye.reduction.steering.conversion import converted

TELESCOPE = RigidTelescope(0.0, 0.5, subreflector_shift=(0.001, 0.0, 0.0))
POINT = np.zeros((1, 3))


def titles(to, from_):
    return [passage.title for passage in conversion_passages(converted(POINT, TELESCOPE, to=to, from_=from_))]


def test_the_subreflector_is_told_where_it_is_in_the_chain():
    assert "Subreflector" in titles("ground", "subreflector")
    assert "Subreflector" not in titles("ground", "prime_focus")
    assert "Note" not in titles("reflector", "reflector")


def test_a_table_with_u_has_three_more_columns():
    plain, spread = (
        conversion_lines(converted(POINT, TELESCOPE, to="alidade", from_="ground", covariance=q))
        for q in (None, 1e-6 * np.eye(3)[None])
    )
    assert spread[2].split()[-3:] == ["1.000"] * 3
    assert len(spread[2].split()) == len(plain[2].split()) + 3
