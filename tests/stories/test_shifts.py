"""What moves between two nights is found, and nothing else is said to have moved.

The two nights share seed, noise and weather, so a difference is free of them: tolerances are a fraction of u.
"""

import numpy as np
import pytest

from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.simulator.night.faults import Planted
from catseye.simulator.night.simulate import simulate_night

SEED = 4711
SHIFT = np.array([0.2, -0.1, 0.2]) * 1e-3  # 0.3 mm long


@pytest.mark.parametrize(
    "moved",
    [("DP017",), ("TR04-L", "TR04-R", "TR04-B"), ("ZY114",), ("ZEG41040L",)],
    ids=["dish prism", "triplet", "feed-arm ranger", "structural target"],
)
def test_a_shift_of_0_3_mm_is_recovered_and_nothing_else_moves(written_few, few, moved, u):
    after = reduce_epoch(written_few(simulate_night(SEED, planted=Planted(shifts=dict.fromkeys(moved, SHIFT)))))
    before, c = few.coordinates, after.coordinates
    assert c.points == before.points
    assert after.rejected.keys() == few.rejected.keys()
    for name in c.places:
        expected = SHIFT if name in moved else np.zeros(3)
        found = c.x[c.index(name)] - before.x[before.index(name)]
        limit = np.minimum(0.5 * u(c, name), 50e-6) if name in moved else 0.5 * u(c, name)
        assert np.all(np.abs(found - expected) < limit), (name, found, u(c, name))


def test_a_shift_of_one_prism_along_its_normal_shows_in_the_surface(written, whole):
    name = "DP017"
    normal = whole.surface.fit.frame.rotation[:, 2]
    planted = Planted(shifts={name: 0.3e-3 * normal})
    after = reduce_epoch(written(simulate_night(SEED, planted=planted)))
    k = whole.surface.names.index(name)
    change = after.surface.fit.deviation - whole.surface.fit.deviation
    x, y = whole.surface.fit.local[k, :2]
    along = 1.0 / np.sqrt(1.0 + (x**2 + y**2) / (4 * 60.0**2))  # the normal leans against the axis
    # the fit takes up some 5 of 60 parts itself
    assert change[k] == pytest.approx(0.3e-3 * along, rel=0.25)
    assert np.all(np.abs(np.delete(change, k)) < 40e-6)


def test_the_whole_dish_moved_is_a_change_of_pose_and_not_of_surface(written, whole):
    prisms = dict.fromkeys(whole.surface.names, np.array([0.1e-3, 0.2e-3, 0.2e-3]))
    after = reduce_epoch(written(simulate_night(SEED, planted=Planted(shifts=prisms))))
    moved = np.array(after.surface.pose()["vertex"]) - np.array(whole.surface.pose()["vertex"])
    np.testing.assert_allclose(moved, [0.1e-3, 0.2e-3, 0.2e-3], atol=30e-6)
    np.testing.assert_allclose(after.surface.fit.deviation, whole.surface.fit.deviation, atol=20e-6)
