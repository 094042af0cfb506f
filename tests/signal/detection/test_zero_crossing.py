"""Crossings against the crossings' own equations, scatter; and what the study of estimators concludes."""

import importlib.util
import sys

import numpy as np
import pytest
from scipy.optimize import brentq

from catseye.errors import ValidityError
from catseye.signal.detection.zero_crossing import crossing_phase
from repository import ROOT

STUDY = ROOT / "studies" / "phase_estimators.py"
FINE = 4096


def turned(phase, other):
    """Difference of two phases in (-pi, pi]."""
    return np.angle(np.exp(1j * (np.asarray(phase) - other)))


def test_linear_interpolation_has_the_error_of_its_equation():
    for n in (16, 64):
        step = 2 * np.pi / n
        places = np.linspace(0.0, 1.0, 101)[1:-1]  # of the crossing between two samples
        waves = np.cos(step * np.arange(4 * n) - (np.pi / 2 + places * step)[:, None])
        bias = turned(crossing_phase(waves, n).phase, np.pi / 2 + places * step)
        low, high = np.sin(places * step), np.sin((1 - places) * step)
        np.testing.assert_allclose(bias, step * (low / (low + high) - places), rtol=0, atol=1e-12)
        assert np.max(np.abs(bias)) == pytest.approx(np.sqrt(3) / 108 * step**3, rel=0.02)  # 0.016 step^3


@pytest.mark.parametrize("cut", [0.9, 0.6, 0.2])
def test_clipping_on_top_moves_one_edge_by_the_lowered_level(cut):
    half = np.arccos(cut)
    level = -(np.sin(half) - half * np.cos(half)) / np.pi  # mean of what is left
    wave = np.minimum(np.cos(2 * np.pi * np.arange(2 * FINE) / FINE - 1.0), cut)
    found = crossing_phase(wave, FINE)
    assert float(turned(found.rising, 1.0)) == pytest.approx(np.arcsin(level), abs=1e-6)
    assert float(turned(found.falling, 1.0)) == pytest.approx(-np.arcsin(level), abs=1e-6)
    assert float(turned(found.phase, 1.0)) == pytest.approx(0.0, abs=1e-6)
    assert float(found.duty) == pytest.approx(0.5 - np.arcsin(level) / np.pi, abs=1e-6)


@pytest.mark.parametrize(("order", "lag"), [(2, 0.3), (2, 1.5), (3, 0.0), (3, 0.7), (3, np.pi / 2), (5, -1.0)])
@pytest.mark.parametrize("level", [0.0, -0.1])
def test_harmonics_move_the_edges_as_the_exact_roots(order, lag, level):
    def height(x):
        return np.cos(x) + 0.02 * np.cos(order * x - lag) - level

    rising = brentq(height, -np.pi / 2 - 0.5, -np.pi / 2 + 0.5, xtol=1e-14) + np.pi / 2
    falling = brentq(height, np.pi / 2 - 0.5, np.pi / 2 + 0.5, xtol=1e-14) - np.pi / 2
    wave = height(2 * np.pi * np.arange(2 * FINE) / FINE) + level
    found = crossing_phase(wave, FINE, level=level)
    line = (2 * np.pi / FINE) ** 2 / 8 * (0.15 + 0.02 * order**2)  # a line on a bent flank: step^2/8 bend/slope
    assert float(turned(found.rising, 0.0)) == pytest.approx(rising, abs=line)
    assert float(turned(found.falling, 0.0)) == pytest.approx(falling, abs=line)
    assert float(turned(found.phase, 0.0)) == pytest.approx((rising + falling) / 2, abs=line)


def test_hysteresis_delays_both_edges_and_ties_the_phase_to_the_amplitude():
    x = 2 * np.pi * np.arange(2 * FINE) / FINE - 2.0
    for amplitude in (0.5, 1.0, 4.0):
        found = crossing_phase(amplitude * np.cos(x), FINE, hysteresis=0.2)
        for phase in (found.rising, found.falling, found.phase):
            assert float(turned(phase, 2.0)) == pytest.approx(np.arcsin(0.2 / amplitude), abs=1e-6)
    silent = crossing_phase(0.1 * np.cos(x), FINE, hysteresis=0.2)
    assert np.isnan(silent.phase)
    assert silent.edges.tolist() == [0, 0]


def test_hysteresis_stops_the_chatter():
    rng = np.random.default_rng(4)
    waves = np.cos(2 * np.pi * np.arange(64 * 32) / 64 - 1.0) + rng.normal(scale=0.1, size=(50, 64 * 32))
    assert np.all(crossing_phase(waves, 64).edges.sum(axis=-1) > 64)
    calm = crossing_phase(waves, 64, hysteresis=0.5)
    assert np.max(np.abs(calm.edges - 32)) <= 1  # one may lie across the buffer's end
    # late by nearly arcsin(0.5): noise trips it a little before the wave alone would, within its own size
    assert np.arcsin(0.4) < np.mean(turned(calm.phase, 1.0)) < np.arcsin(0.5)


def test_white_noise_is_seen_by_two_samples_an_edge():
    rng, n, m, noise = np.random.default_rng(6), 64, 24, 0.005
    phase = rng.uniform(0, 2 * np.pi, 4000)
    waves = np.cos(2 * np.pi * np.arange(n * m) / n - phase[:, None]) + rng.normal(scale=noise, size=(4000, n * m))
    scatter = np.sqrt(np.mean(turned(crossing_phase(waves, n).phase, phase) ** 2))
    # 4000 buffers: 1.1 % at one sigma; some edges lie outside the buffer: 1/48
    assert scatter == pytest.approx(noise / np.sqrt(3 * m), rel=0.05)


def test_a_batch_is_its_buffers_and_bad_ones_are_nan():
    rng = np.random.default_rng(9)
    waves = np.cos(2 * np.pi * np.arange(64 * 128) / 64 - rng.uniform(0, 6, (3, 40, 1))) + rng.normal(
        scale=0.05, size=(3, 40, 64 * 128)
    )
    waves[1, 5, 7], waves[2, 0, 3], waves[0, 0] = np.nan, np.inf, 0.25
    together = crossing_phase(waves, 64)
    assert together.phase.shape == (3, 40)
    assert together.edges.shape == (3, 40, 2)
    bad = np.isnan(together.phase)
    assert sorted(zip(*np.nonzero(bad), strict=True)) == [(0, 0), (1, 5), (2, 0)]
    for index in ((0, 1), (1, 4), (2, 39)):
        assert float(crossing_phase(waves[index], 64).phase) == pytest.approx(float(together.phase[index]), abs=1e-14)
    codes = np.round(1000 * waves[1, 4]).astype(np.int16)
    assert float(crossing_phase(codes, 64).phase) == pytest.approx(float(together.phase[1, 4]), abs=1e-3)
    assert crossing_phase(waves[:, :0], 64).phase.shape == (3, 0)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: crossing_phase(np.zeros(64), 2), "2 samples a cycle do not determine a phase"),
        (lambda: crossing_phase(np.zeros(65), 64), "a buffer of 65 samples is not a whole number of cycles of 64"),
        (lambda: crossing_phase(np.zeros(0), 64), "a buffer of 0 samples"),
        (lambda: crossing_phase(np.zeros(64, dtype=complex), 64), "samples of type complex128"),
        (lambda: crossing_phase(np.zeros(64), 64, hysteresis=-1.0), "hysteresis -1.0 is not 0 or more"),
    ],
)
def test_samples_without_crossings_are_refused(call, text):
    with pytest.raises(ValidityError) as caught:
        call()
    assert text in str(caught.value)


@pytest.fixture(scope="module")
def study():
    spec = importlib.util.spec_from_file_location("phase_estimators", STUDY)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclass looks itself up
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


def test_the_study_concludes_who_is_biased_by_clipping(study):
    clip, size = 0.2, 0.01
    found = {case.name: study.bias(case, places=64) for case in study.cases(clip, size)}
    half = np.arccos(1 - clip)
    level = -(np.sin(half) - half * np.cos(half)) / np.pi
    alias = 2 / np.pi / 63**2  # a corner's harmonics fall as 2/(pi k^2); those at 63 and 65 land on the fundamental
    clipped = found["clipped on top"]
    np.testing.assert_allclose(clipped["rising edge"], np.arcsin(level), rtol=0, atol=1e-6)
    np.testing.assert_allclose(clipped["both edges"], 0.0, rtol=0, atol=1e-6)
    assert abs(np.mean(clipped["synchronous"])) < 1e-6
    assert 1e-5 < np.max(np.abs(clipped["synchronous"])) < 2 * alias
    odd = found["3rd harmonic in quadrature"]  # + h sin 3x: both edges early by h
    assert np.mean(odd["both edges"]) == pytest.approx(-size, rel=0.01)
    assert np.max(np.abs(odd["synchronous"])) < 1e-12
    both = found["2nd harmonic in quadrature, clipped on top"]
    amplitude = 1 - (half - np.sin(half) * np.cos(half)) / np.pi  # of the clipped wave's fundamental
    cut = -4 / (3 * np.pi) * size * np.sin(half) ** 3 / amplitude  # h sin 2x taken away within the clipped part
    assert np.mean(both["synchronous"]) == pytest.approx(cut, rel=0.02)
    assert np.mean(both["both edges"]) == pytest.approx(2 * size * level, rel=0.02)
    coupled = found["clipped on top, then AC coupled"]
    assert abs(np.mean(coupled["synchronous"])) < 1e-6
    assert np.mean(coupled["both edges"]) > 1e-3
    slow = found["clipped on top, slow to recover"]
    assert np.mean(slow["synchronous"]) > 5e-4
    assert abs(np.mean(slow["both edges"])) < 1e-6
    for biases in found.values():
        np.testing.assert_allclose(biases["FFT bin"], biases["synchronous"], rtol=0, atol=1e-12)


def test_the_study_concludes_who_reaches_the_bound(study):
    found = study.scatter(0.01, buffers=2500)
    # 2500 buffers: 1.4 % at one sigma
    assert found["synchronous"] == pytest.approx(1.0, abs=0.05)
    assert found["FFT bin"] == pytest.approx(found["synchronous"], abs=1e-6)
    assert found["FFT peak"] == pytest.approx(np.sqrt(1.5), abs=0.06)
    assert found["both edges"] == pytest.approx(np.sqrt(64 / 6), rel=0.06)
    assert found["rising edge"] > 1.3 * found["both edges"]


def test_the_study_writes_its_figure_and_table(study, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(study, "table", lambda: "biases")
    monkeypatch.setattr(study, "noise_table", lambda: "scatter")
    monkeypatch.setattr(study, "figure", lambda: "<svg/>")
    study.main(str(tmp_path / "out"))
    assert (tmp_path / "out" / "phase-estimators.svg").read_text() == "<svg/>"
    assert capsys.readouterr().out == "biases\n\nscatter\n"


@pytest.mark.slow
def test_the_study_runs_whole(study, tmp_path, capsys):
    study.main(str(tmp_path))
    assert (tmp_path / "phase-estimators.svg").read_text().rstrip().endswith("</svg>")
    assert "clipped on top, slow to recover" in capsys.readouterr().out
