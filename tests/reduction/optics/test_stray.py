"""Stray light against phasors added one by one, and the size of a laser's fringe against its own simulation."""

import numpy as np
import pytest

from catseye.reduction.optics.stray import LaserFeedback, StrayCauses, stray_light

WAVELENGTH, LIMIT = 0.2, 1e-5
LASER = LaserFeedback(
    returned=1e-13,
    coherence=0.8,
    regulation=0.5,
    laser_path=1e-3,
    facet=0.32,
    enhancement=5.0,
    optical_wavelength=0.78e-6,
    shots=4,
    movement=0.0,
)


def made(distance=100.0, **causes):
    return stray_light(distance, StrayCauses(**causes), wavelength=WAVELENGTH, limit=LIMIT)


def seen(place, extra):
    """Range of a phasor sum less the true place, m: light there and back falls by 4 pi over the wavelength a metre."""
    light = np.exp(-4j * np.pi * place / WAVELENGTH)
    return -np.angle((light + extra) / light) * WAVELENGTH / (4 * np.pi)


def test_each_cause_is_the_phase_of_phasors_added():
    found = made(paths=[(0.003, 0.031)], reflectors=[(0.002, -0.025), (0.004, 0.4)], second_pass=4e-4, leakage=5e-4)
    place = 100.0 + found.moved
    back = [-0.025 + 100.0, 0.4 + 100.0]
    expected = [
        seen(place, 0.003 * np.exp(-2j * np.pi * (2 * place + 0.031) / WAVELENGTH)),
        seen(place, 0.002 * np.exp(-4j * np.pi * back[0] / WAVELENGTH)),
        seen(place, 0.004 * np.exp(-4j * np.pi * back[1] / WAVELENGTH)),
        seen(place, sum(4e-4**k * np.exp(-4j * np.pi * (k + 1) * place / WAVELENGTH) for k in (1, 2, 3))),
    ]
    for effect, curve in zip(found.effects, expected, strict=False):
        np.testing.assert_allclose(effect.curve, curve, atol=1e-12, err_msg=effect.name)
        assert effect.at == effect.curve[0]
    leakage = found.effects[-1]
    assert leakage.name == "leakage"
    assert leakage.largest == pytest.approx(5e-4 * WAVELENGTH / (4 * np.pi), rel=1e-3)
    assert found.effects[0].largest == pytest.approx(0.0, abs=1e-15)  # it moves with the target: a zero


def test_the_share_that_the_limit_allows_is_at_the_limit():
    share = made(leakage=0.001).share
    found = made(reflectors=[(share, 0.0)])
    assert found.largest == pytest.approx(LIMIT, rel=1e-3)
    assert made(reflectors=[(0.9 * share, 0.0)]).verdict.word == "good"
    assert made(reflectors=[(1.1 * share, 0.0)]).verdict.word == "doubtful"


def test_a_fringe_of_the_light_scatters_as_its_uncertainty_says():
    """Places at random over many fringes: two fields, the returned one's modulation late by the way there and back.

    Regulation turns the phase in proportion to the power; interference by the phase of the product of both fields.
    """
    found = made(feedback=LASER).feedback
    rng = np.random.default_rng(5)
    optical = 2 * np.pi * rng.uniform(size=200_000)
    contrast = 2 * 0.8 * np.sqrt(1e-13)
    late = np.exp(-4j * np.pi * 100.013 / WAVELENGTH)
    turned = made(100.013, feedback=LASER).feedback
    phase = 0.5 * contrast * np.cos(optical) + np.angle(1 + 0.5 * contrast * np.cos(optical) * (1 + late))
    scatter = np.std(phase) * WAVELENGTH / (4 * np.pi)
    assert turned.u_range == pytest.approx(scatter, rel=0.01)  # 4 of 200 000 draws
    assert found.contrast == pytest.approx(contrast, rel=1e-12)
    assert found.u_range == pytest.approx(0.5 * contrast / np.sqrt(2.0) * WAVELENGTH / (4 * np.pi), rel=1e-9)


def test_a_path_at_rest_averages_nothing_and_one_that_moves_does():
    still = made(feedback=LASER).feedback
    moving = made(feedback=LaserFeedback(**{**vars(LASER), "movement": 1e-6})).feedback
    assert still.u_mean == pytest.approx(still.u_range)
    assert moving.u_mean == pytest.approx(0.5 * moving.u_range, rel=1e-6)


def test_a_laser_that_jumps_is_doubtful_and_has_no_fringe():
    found = made(feedback=LaserFeedback(**{**vars(LASER), "returned": 1e-9}))
    assert found.feedback.parameter > 1.0
    assert found.feedback.fringe.size == 0
    assert found.verdict.word == "doubtful"
    assert "jumps between modes" in found.verdict.why
