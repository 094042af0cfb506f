"""`catseye phase`: the example, a campaign's shot, an array in Python, and one line for what cannot be."""

import json

import numpy as np
import pytest

import catseye as package
from repository import ROOT

BUFFERS = ROOT / "examples" / "buffers"


def test_the_clipped_example_is_what_its_readme_says(catseye):
    status, out, err = catseye("phase", BUFFERS / "clipped.csv", "--json")
    assert (status, err) == (0, "")
    found = json.loads(out, parse_constant=pytest.fail)
    assert found["phase"] == pytest.approx(2.0, abs=3 * found["u_phase"])
    assert found["amplitude_volt"] == pytest.approx(3.7918, abs=3 * found["u_amplitude_volt"])  # Fourier integral
    by_order = {h["order"]: h["relative"] for h in found["harmonics"]}
    assert by_order[2] == pytest.approx(0.0484, abs=0.0006)
    assert by_order[3] == pytest.approx(0.0387, abs=0.0006)
    assert found["verdict"]["word"] == "doubtful"
    assert found["clipped"] == 0  # not by the converter
    assert all(method["agrees"] for method in found["methods"])


def test_the_example_can_be_made_again():
    j, rng = np.arange(1024), np.random.default_rng(46)
    volts = np.minimum(4.0 * np.cos(2.0 * np.pi * j / 64 - 2.0), 3.2) + 0.03 + rng.normal(0.0, 0.02, 1024)
    written = np.loadtxt(BUFFERS / "clipped.csv", skiprows=1)
    np.testing.assert_allclose(written, volts, rtol=0.0, atol=0.51e-4)  # four decimals


def test_people_see_methods_side_by_side_and_files(catseye, tmp_path):
    status, out, err = catseye("phase", BUFFERS / "clipped.csv", "--out", tmp_path / "out")
    assert (status, err) == (0, "")
    for text in (
        "Doubtful: distorted: harmonic 2",
        "synchronous detection",
        "zero crossings",
        "spectrum",
        "Written to",
    ):
        assert text in " ".join(out.split())
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"buffer.svg", "harmonics.csv", "methods.csv", "phase.json", "provenance.json"}


def test_a_shot_has_the_phase_of_the_reduction_without_its_leakage(catseye):
    """Samples' phasor less leakage of ZP115's sheet is ranges.csv's `phase_rad` of shot 120: exact, by hand."""
    found = json.loads(catseye("phase", "night-01", "--shot", 120, "--json")[1])
    mirror = package.load(ROOT / "examples" / "night-01").mirror_of("ZY115")
    leakage = mirror.leakage_amplitude_volt * np.exp(1j * mirror.leakage_phase_rad)
    raw = complex(*found["phasor_volt"])
    assert found["amplitude_volt"] == pytest.approx(abs(raw))
    phases = package.reduce("night-01").reduction.phases
    assert phases.phase[119] == pytest.approx(np.angle(raw - leakage) % (2 * np.pi), abs=1e-6)
    second = next(h["amplitude"] for h in found["harmonics"] if h["order"] == 2)
    assert phases.relative_harmonics[119, 0] == pytest.approx(second / abs(raw - leakage), abs=1e-9)


def test_an_array_is_a_buffer():
    wave = np.cos(2.0 * np.pi * np.arange(640) / 64 - 1.0) + np.random.default_rng(1).normal(0.0, 0.01, 640)
    answer = package.phase(wave)
    assert answer.phase == pytest.approx(1.0, abs=4 * answer.u_phase)
    assert answer.verdict.word == "good"
    assert list(answer.to_table("harmonics")["order"]) == list(range(2, 11))
    assert package.show(answer).keys() == {"buffer"}


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        ([BUFFERS / "none.csv"], 1, "missing"),
        ([BUFFERS / "README.md"], 1, "no column of samples"),
        ([BUFFERS / "clipped.csv", "--cycles", "17"], 2, "--cycles = 17 is not within 1 to 16"),
        ([BUFFERS / "clipped.csv", "--sample-rate-hz", "50000.5"], 2, "--sample-rate-hz"),
        ([BUFFERS / "clipped.csv", "--sample-rate-hz", "60000"], 2, "1024 samples are 17 times 60 and 4 more"),
        (["night-01"], 1, "expected a shot of it"),
        (["night-01", "--shot", "5000"], 1, "shot 5000 is not there"),
        ([BUFFERS / "clipped.csv", "--strict"], 1, "distorted"),
    ],
)
def test_what_cannot_be_is_one_line(catseye, arguments, status, said, tmp_path):
    ended, _, err = catseye("phase", *arguments, "--quiet")
    assert ended == status
    assert said in err
    assert "Traceback" not in err
