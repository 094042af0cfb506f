"""Laws of the reduction: what may be turned, shifted or reordered without changing the answer."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catseye.constants import SPEED_OF_LIGHT
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.ranges import follow_electronics
from catseye.reduction.epoch.shots import shot_group
from catseye.reduction.epoch.unknowns import build_network
from few_scene import with_few_targets, with_shots

FEW = settings(max_examples=4, deadline=None, derandomize=True)  # a reduction takes a second
SOME = settings(max_examples=25, deadline=None, derandomize=True)


@pytest.fixture(scope="module")
def few(night_01):
    """Night-01 with fewer targets, those that are named here among them."""
    return with_few_targets(night_01, "DP007", "DP033", "TR02")


@pytest.fixture(scope="module")
def reduced_few(few):
    return reduce_epoch(few)


@pytest.fixture(scope="module")
def network(few, reduced_few):
    r = reduced_few
    return build_network(few, r.phases, r.electronics, settings=r.settings)


@pytest.fixture(scope="module")
def answer(network, reduced_few):
    """Parameters with the adjusted coordinates, all else at its start."""
    x, c = np.array(network.layout.start), reduced_few.coordinates
    for row, name in enumerate(c.points):
        x[network.layout.columns(name)] = c.x[row]
    return x


@pytest.fixture(scope="module")
def at_answer(network, answer):
    """Every ranger's shots as they are there."""
    return {ranger: shot_group(network, ranger, answer)[1] for ranger in network.rangers}


def turned(campaign, degrees):
    """The same site, surveyed against a north that lies elsewhere: everything turned clockwise about the vertical."""
    a = np.radians(degrees)
    turn = np.array([[np.cos(a), np.sin(a), 0.0], [-np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])

    def moved(point):
        return tuple(float(v) for v in turn @ np.array(point))

    monuments = {}
    for name, m in campaign.monuments.items():
        x, y, z = moved((m.x_mm, m.y_mm, m.z_mm))
        monuments[name] = m.model_copy(
            update={"x_mm": x, "y_mm": y, "z_mm": z, "alpha1_rad": m.alpha1_rad - a, "azimuth_deg": m.azimuth_deg}
        )
    targets = {
        name: t.model_copy(update={"position_mm": moved(t.position_mm)}) if t.frame == "ground" else t
        for name, t in campaign.targets.items()
    }
    posture = campaign.site.campaign
    site = campaign.site.model_copy(
        update={"campaign": posture.model_copy(update={"azimuth_deg": posture.azimuth_deg + degrees})}
    )
    return dataclasses.replace(campaign, monuments=monuments, targets=targets, site=site), turn


@FEW
@given(degrees=st.floats(-180.0, 180.0))
def test_the_answer_turns_with_the_site(few, reduced_few, degrees):
    campaign, turn = turned(few, degrees)
    a, b = reduced_few.coordinates, reduce_epoch(campaign).coordinates
    assert b.points == a.points
    np.testing.assert_allclose(b.x, a.x @ turn.T, atol=2e-7)  # where the passes end: a micrometre at most is settled
    assert b.variance_factor == pytest.approx(a.variance_factor, rel=1e-4)
    for name in ("DP007", "ZY113", "TR03-B"):
        np.testing.assert_allclose(b.block([name]), turn @ a.block([name]) @ turn.T, rtol=1e-3, atol=1e-13)


@FEW
@given(seed=st.integers(0, 2**32 - 1))
def test_shots_have_no_order_but_that_of_time(few, reduced_few, seed):
    order = np.random.default_rng(seed).permutation(len(few.shots))
    again = reduce_epoch(with_shots(few, order))
    np.testing.assert_allclose(again.coordinates.x, reduced_few.coordinates.x, atol=2e-7)
    assert again.rejected.keys() == reduced_few.rejected.keys()


@SOME
@given(offset=st.floats(-20.0, 20.0), name=st.sampled_from(["ZY101", "ZY105", "ZY113", "ZY116"]))
def test_the_phase_that_the_electronics_start_from_does_not_matter(night_01, reduced_night_01, offset, name):
    """Added to all shots of a ranger, reference and target alike, it leaves their difference as it was."""
    phases = reduced_night_01.phases
    mine = np.array(night_01.shots.ranger) == name
    shifted = dataclasses.replace(phases, phasor=np.where(mine, phases.phasor * np.exp(1j * offset), phases.phasor))
    electronics, rejected = follow_electronics(night_01, shifted)
    assert not rejected
    before, after = reduced_night_01.electronics[name], electronics[name]
    np.testing.assert_array_equal(after.shots, before.shots)
    was, now = phases.phase[before.shots] - before.phase, shifted.phase[after.shots] - after.phase
    np.testing.assert_allclose(np.exp(1j * now), np.exp(1j * was), atol=1e-10)
    np.testing.assert_allclose(after.covariance, before.covariance, rtol=1e-9, atol=1e-18)


@SOME
@given(turns=st.integers(-3, 3), name=st.sampled_from(["DP001", "TR02-L", "TR06-B", "ZAG731P"]))
def test_a_coarse_place_a_whole_half_wavelength_further_has_one_cycle_more_and_the_same_misfit(
    network, answer, at_answer, turns, name
):
    """Of one ranger, the target moved along the beam; the air's index changes by 1e-9 on the way."""
    ranger = next(r for r, parts in at_answer.items() if name in parts.target)
    group, parts = shot_group(network, ranger, answer)
    row = parts.target.index(name)
    half = SPEED_OF_LIGHT / (2 * 1.5e9) / (1.0 + parts.refractivity[row])
    at = network.layout.columns(name)
    along = answer[at] - answer[network.layout.columns(ranger)]
    x = np.array(answer)
    x[at] += turns * half * along / np.linalg.norm(along)
    moved, again = shot_group(network, ranger, x)
    assert again.cycles[row] == parts.cycles[row] + turns
    misfit = [(g.observed - g.predict(y)[0])[row] for g, y in ((group, answer), (moved, x))]
    assert misfit[0] == pytest.approx(misfit[1], abs=2e-6)  # obliquity and air along another path


@SOME
@given(
    shift=st.tuples(*[st.floats(-0.012, 0.012)] * 3),
    name=st.sampled_from(["DP001", "DP033", "TR02-R", "TR06-B", "ZAG731P"]),
)
def test_any_coarse_place_within_20_mm_finds_the_same_cycles(network, answer, at_answer, shift, name):
    """A quarter wavelength is 50 mm; the answer itself leaves 49 mm of it."""
    x = np.array(answer)
    x[network.layout.columns(name)] += shift
    seen = {ranger: before for ranger, before in at_answer.items() if name in before.target}
    assert seen
    for ranger, before in seen.items():
        after = shot_group(network, ranger, x)[1]
        ranged = [k for k, t in enumerate(before.target) if t == name and before.margin[k] > 0.045]
        np.testing.assert_array_equal(after.cycles[ranged], before.cycles[ranged])
