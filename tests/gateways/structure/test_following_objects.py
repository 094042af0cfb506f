"""Text of a followed vibration: an axis without vibration has a bound, an unlocked mode is named."""

import numpy as np
import pytest

from catseye.gateways.structure.following_objects import following_lines, following_passages
from catseye.reduction.structure.following import VibrationSamples, follow_vibration
from catseye.signal.vibration.filter import Mode


def test_an_axis_without_vibration_has_a_bound_and_a_mode_without_phase_says_so():
    rng, times = np.random.default_rng(3), np.arange(400) / 20.0
    values = 1e-5 * rng.standard_normal((400, 2))
    values[:, 0] += 1e-3 * np.cos(2 * np.pi * 0.8 * times)
    samples = VibrationSamples(("x", "y"), times, values, np.tile(1e-10 * np.eye(2), (400, 1, 1)))
    modes = (Mode(0.8, 0.002, np.diag([1e-6, 1e-12]), 0.01), Mode(3.0, 0.05, np.eye(2) * 1e-13, 0.01))
    found = follow_vibration(samples, modes=modes, leads=(0.5,))
    first, second, following = (passage.text for passage in following_passages(found, None))
    size = 1e3 * found.state.amplitudes()[0][0, 0]
    assert size == pytest.approx(1.0, abs=0.08)
    assert f"x {size:.3f} mm" in first
    assert "y below" in first
    assert "its phase is not known" in second
    assert "rms x 0.7" in following
    assert len(following_lines(found, None)) == 2
