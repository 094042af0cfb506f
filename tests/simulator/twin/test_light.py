"""Glass, acceptance and noise of a path against independent formulas and stated sizes."""

import numpy as np
import pytest

from catseye.constants import DEGREE
from catseye.optics.retroreflector import cats_eye, prism
from catseye.optics.retroreflector.kinds import registry as kinds
from catseye.simulator.night.faults import Planted, Streams
from catseye.simulator.night.glass import GLASS_TO_AIR, prism_delay
from catseye.simulator.twin.light import ElectronicsWalk, acceptance, glass_way, path_waves, prism_way
from catseye.simulator.twin.targets import BodyRetroreflector
from simulator.living_scene import only, rms

UP = np.array([0.0, 0.0, 1.0])
ANGLES = np.linspace(0.0, 44.0, 12) * DEGREE
SLAB = BodyRetroreflector(kinds.PRISM, "dish", np.zeros(3), UP, (0.0381,), (4.0, 5.0))
BALL = BodyRetroreflector(kinds.BALL, "dish", np.zeros(3), UP, (0.050, 0.0965), (2.0, 3.0))
HOLLOW = BodyRetroreflector(kinds.HOLLOW, "ground", np.zeros(3), None, (), (3.0, 4.0))


def test_a_prism_delays_as_the_rays_of_the_night_do():
    towards = np.column_stack([np.sin(ANGLES), 0 * ANGLES, np.cos(ANGLES)])
    expected = prism_delay(np.full(12, 0.0381), np.tile(UP, (12, 1)), towards)
    found = prism_way(0.0381, np.cos(ANGLES), group=GLASS_TO_AIR, phase=GLASS_TO_AIR)
    assert found == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("phase", [1.510811, 1.527077])
def test_a_prism_delays_as_the_reductions_formulas_say(phase):
    constant = prism.range_constant(0.0381, 1.527077)
    change = prism.oblique_change(0.0381, ANGLES, group=1.527077, phase=phase)
    found = prism_way(0.0381, np.cos(ANGLES), group=1.527077, phase=phase)
    assert found == pytest.approx(-(constant + change), abs=1e-13)


def test_each_kind_has_its_glass():
    cosine = np.cos(ANGLES)
    index = {"group": 1.527077, "phase": 1.527077}
    assert glass_way(HOLLOW, cosine, **index, obliquity=1.0) == pytest.approx(np.zeros(12))
    ball = glass_way(BALL, cosine, **index, obliquity=1.0)
    assert ball == pytest.approx(np.full(12, -cats_eye.range_constant(0.050, 0.0965, 1.527077)), abs=1e-15)
    straight = glass_way(SLAB, cosine, **index, obliquity=0.0)
    assert np.ptp(straight) == 0.0
    slanted = glass_way(SLAB, cosine, **index, obliquity=1.0)
    assert slanted[0] == pytest.approx(straight[0], abs=1e-15)
    assert slanted[-1] - straight[-1] > 100e-6  # at 44 degrees


def test_acceptance_falls_with_the_angle_to_nothing():
    angle = np.linspace(0.0, 180.0, 721) * DEGREE
    for retro, full, end in ((SLAB, 0.1, 45.0), (BALL, 60.0, 79.0)):
        share = acceptance(retro, np.cos(angle))
        assert share[angle < full * DEGREE] == pytest.approx(1.0, abs=1e-3)
        assert np.all(share[angle > (end + 1e-6) * DEGREE] == 0.0)
        assert np.all(np.diff(share) <= 1e-12)
        assert np.all(share[angle < (end - 1) * DEGREE] > 0.0)
    assert np.all(acceptance(HOLLOW, np.cos(angle)) == 1.0)
    assert acceptance(SLAB, np.cos(np.array([30 * DEGREE])))[0] == pytest.approx(0.5)
    quarter = acceptance(BALL, np.cos(np.array([64.75, 69.5]) * DEGREE))
    assert quarter == pytest.approx([1 - 2.5 / 16, 0.5])  # without a corner at either end


def heads(*effects, count=250):
    planted = only(*effects)
    return [ElectronicsWalk(f"head {k}", Streams(5), planted) for k in range(count)]


@pytest.mark.parametrize("lag", [120.0, 3600.0, 14_400.0])
def test_electronics_walk_by_ten_milliradians_in_the_root_of_an_hour(lag):
    passed = [float(np.diff(head(np.array([777.0, 777.0 + lag])))[0]) for head in heads("drift")]
    assert rms(passed) == pytest.approx(0.010 * np.sqrt(lag / 3600), rel=0.15)  # 250 draws: 4.5 %, and the bands' steps


def test_every_third_head_warms_up_in_five_minutes():
    t = np.array([0.0, 300.0, 7200.0])
    rise = np.array([head(t) - head(t)[-1] for head in heads("warm_up")])
    warms = np.abs(rise[:, 0]) > 1e-9
    assert warms.mean() == pytest.approx(1 / 3, abs=0.1)
    assert np.all((np.abs(rise[warms, 0]) > 0.0099) & (np.abs(rise[warms, 0]) < 0.0301))
    assert rise[warms, 1] == pytest.approx(rise[warms, 0] / np.e, rel=1e-6)
    start = np.array([head(np.zeros(1))[0] for head in heads()])
    assert np.ptp(start) > 6.0  # any phase of the turn


def test_a_path_fluctuates_by_what_the_site_says_fast_and_slow():
    t = np.array([100.0, 100.05, 104.0, 160.0, 1e5])
    paths = np.array(
        [path_waves("ZY1", f"T{k}", index_ppm=0.15, streams=Streams(2), planted=Planted())(t) for k in range(900)]
    )
    ppm, flicker = paths[..., 0], paths[..., 1]
    assert ppm.std(axis=0) == pytest.approx(np.full(5, 0.15), rel=0.1)
    # gusts (0.7 of it) forget in 4 s, the rest in half an hour
    share = (
        2
        * 0.15**2
        * np.array([0.49 * (1 - np.exp(-1)) + 0.51 * (1 - np.exp(-4 / 1800)), 0.49 + 0.51 * (1 - np.exp(-60 / 1800))])
    )
    assert np.mean((ppm[:, 2:4] - ppm[:, :1]) ** 2, axis=0) == pytest.approx(share, rel=0.2)
    assert rms(flicker) == pytest.approx(0.022, rel=0.1)
    assert rms(flicker[:, 1] - flicker[:, 0]) < 0.022  # within a buffer it is much the same
    assert rms(flicker[:, 2] - flicker[:, 0]) == pytest.approx(0.022 * np.sqrt(2), rel=0.1)
    assert path_waves("ZY1", "T1", index_ppm=0.15, streams=Streams(2), planted=only())(t) == pytest.approx(
        np.zeros((5, 2))
    )
