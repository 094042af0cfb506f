"""Leakage as a vector in the phase plane."""

import numpy as np
import pytest

from catseye.signal.leakage import quadrature_range_error, subtract_leakage
from catseye.signal.phase import detect


def test_leakage_in_the_samples_is_taken_out_of_the_phasor():
    j = 2 * np.pi * np.arange(640) / 64
    light, leak = 2.0 * np.cos(j - 1.2), 0.02 * np.cos(j - 5.0)
    phasor = subtract_leakage(detect(light + leak, 64).phasor, 0.02, 5.0)
    assert complex(phasor) == pytest.approx(2.0 * np.exp(1.2j), abs=1e-13)


def test_leakage_broadcasts_one_ranger_a_row():
    phasors = subtract_leakage(np.ones((3, 4)), np.array([[0.1], [0.2], [0.3]]), 0.0)
    np.testing.assert_allclose(phasors, np.broadcast_to([[0.9], [0.8], [0.7]], (3, 4)), rtol=0, atol=1e-15)


@pytest.mark.parametrize("ratio", [0.001, 0.1])
def test_quadrature_error_is_the_phase_of_the_disturbed_phasor(ratio):
    half = 0.0999
    turned = np.angle(1.0 + 1j * ratio)
    assert float(quadrature_range_error(ratio, 2 * half)) == pytest.approx(turned / (2 * np.pi) * half, rel=1e-14)


@pytest.mark.parametrize(("ratio", "excess"), [(0.001, 5e-7), (0.1, 5e-3)])
def test_the_worst_direction_exceeds_quadrature_as_the_docstring_says(ratio, excess):
    worst = np.angle(1.0 + ratio * np.exp(1j * np.linspace(0, 2 * np.pi, 1_000_001))).max()
    assert worst / np.arctan(ratio) - 1 == pytest.approx(excess, rel=0.1)
