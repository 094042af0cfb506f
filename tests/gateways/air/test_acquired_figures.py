"""Figures of acquired data: every reading of a refractometer's night, and the wave that an acoustic path sends."""

import numpy as np
import pytest

import catseye


def test_the_acquired_night_shows_raw_phase_pressure_and_humidity():
    night = catseye.refractometer("refractometer/path-a.csv")
    phase, warm, pressure, humid = catseye.show(night, "acquired")["acquired"].axes
    readings = night.calibration.readings
    shown = phase.collections[0].get_offsets()[:, 1]
    np.testing.assert_allclose(shown, np.mod(readings.phase, 2.0 * np.pi))
    assert len(warm.lines) == len(readings.thermometers) == 5
    for axes, values in ((pressure, readings.pressure_hpa), (humid, readings.humidity_percent)):
        np.testing.assert_allclose(np.ma.getdata(axes.collections[0].get_offsets())[:, 1], values)


def test_the_signature_is_the_sheets_wave_alone():
    """Autocorrelation 1 at no delay; 20 ms of chirp, as the sheet has it."""
    evening = catseye.acoustic("acoustic/evening-1.wav", sheet="acoustic/evening.toml")
    [name] = [each for each in evening.figures() if each.endswith("signature")]
    pure, own = catseye.show(evening, name)[name].axes
    assert pure.lines[0].get_xdata()[-1] == pytest.approx(20.0, abs=0.1)
    assert np.abs(pure.lines[0].get_ydata()).max() == pytest.approx(1.0, abs=0.01)
    lag, height = own.lines[0].get_data()
    assert lag[np.argmax(height)] == pytest.approx(0.0, abs=1e-9)
    assert height.max() == pytest.approx(1.0)
