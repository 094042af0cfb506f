"""A status for every buffer, whatever comes in."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.signal.detection.buffers import BufferStatus, has_long_run, inspect_buffers, shortest_run
from catseye.signal.detection.phase import detect

VOLTS = 10 / 32768
USUAL = 9830.0  # codes, 3 V


def shot(amplitude=USUAL, phase=1.0, n=64, m=128, seed=0, noise=30.0):
    rng = np.random.default_rng(seed)
    wave = amplitude * np.cos(2 * np.pi * np.arange(n * m) / n - phase) + noise * rng.normal(size=n * m)
    return np.clip(np.rint(wave), -32768, 32767).astype(np.int16)


def test_a_lot_with_everything_wrong_gives_a_status_each():
    hole = shot().astype(float)
    hole[77] = np.nan
    endless = shot().astype(np.float32)
    endless[5] = np.inf
    cut = shot()
    cut[64 * 20 : 64 * 30] = shot(0.0)[:640]
    stuck = shot()
    stuck[1000:1033] = stuck[1000]
    lot = {
        "good": (shot(), BufferStatus.GOOD),
        "three per cent": (shot(0.03 * USUAL), BufferStatus.GOOD),
        "clipped": (shot(4 * USUAL), BufferStatus.CLIPPED),
        "nan": (hole, BufferStatus.NOT_FINITE),
        "inf": (endless, BufferStatus.NOT_FINITE),
        "short": (shot()[:-1], BufferStatus.WRONG_LENGTH),
        "empty": (np.zeros(0), BufferStatus.WRONG_LENGTH),
        "fewer cycles": (shot(m=10), BufferStatus.GOOD),
        "cut": (cut, BufferStatus.DROPOUT),
        "stuck": (stuck, BufferStatus.STUCK),
        "dead": (np.full(8192, 12, dtype=np.int16), BufferStatus.STUCK),
        "one small cycle": (np.array([1.0, 0.0, -1.0, 0.0]), BufferStatus.WRONG_LENGTH),
        "lists": ([[1, 2], [3]], BufferStatus.NOT_SAMPLES),
        "nothing": (None, BufferStatus.NOT_SAMPLES),
        "words": ("1 2 3", BufferStatus.NOT_SAMPLES),
        "complex": (np.zeros(64, dtype=complex), BufferStatus.NOT_SAMPLES),
        "a plain list": (shot().tolist(), BufferStatus.GOOD),
    }
    seen = inspect_buffers([buffer for buffer, _ in lot.values()], 64, VOLTS)
    assert dict(zip(lot, map(BufferStatus, seen.status), strict=True)) == {name: s for name, (_, s) in lot.items()}
    found = dict(zip(lot, range(len(lot)), strict=True))
    assert seen.text(found["cut"]) == "dropout: 10 of 128 cycles have less than half the amplitude; was the beam cut?"
    assert seen.text(found["stuck"]).startswith("stuck: a run of at least 33 equal samples")
    assert seen.text(found["short"]) == "wrong length: 8191 samples, expected a whole number of cycles of 64"
    assert seen.text(found["clipped"]).startswith("clipped: ")
    assert "(largest 10 V)" in seen.text(found["clipped"])
    assert seen.text(found["nothing"]) == "not samples: expected a row of integers or floats"
    assert all("\n" not in seen.text(i) for i in range(len(lot)))
    alone = detect(shot(m=10), 64, VOLTS)
    at = found["fewer cycles"]
    assert seen.detection.phasor[at] == pytest.approx(complex(alone.phasor), rel=1e-12)
    assert seen.detection.u_phase[at] == pytest.approx(float(alone.u_phase), rel=1e-9)
    assert seen.detection.scatter.cycles[[0, at]].tolist() == [128, 10]
    assert np.isnan(seen.detection.phasor[found["short"]])


def test_a_three_per_cent_beam_is_good_and_its_uncertainty_tells():
    seen = inspect_buffers([shot(seed=1), shot(0.03 * USUAL, seed=2)], 64, VOLTS)
    assert seen.status.tolist() == [BufferStatus.GOOD] * 2
    u = seen.detection.u_phase
    assert u[1] / u[0] == pytest.approx(1 / 0.03, rel=0.25)  # 127 degrees of freedom each: 9 %, at 2.8 sigma
    asked = inspect_buffers([shot(seed=1), shot(0.03 * USUAL, seed=2)], 64, VOLTS, weakest=0.15)
    assert asked.status.tolist() == [BufferStatus.GOOD, BufferStatus.WEAK]
    assert asked.text(1) == "weak: amplitude 0.09012 V is below the limit 0.15 V"


def test_the_number_of_cycles_can_be_demanded():
    seen = inspect_buffers([shot(m=4), shot(m=5)], 64, VOLTS, cycles=5)
    assert seen.status.tolist() == [BufferStatus.WRONG_LENGTH, BufferStatus.GOOD]
    assert seen.text(0) == "wrong length: 256 samples, expected 5 cycles of 64"


def test_one_short_cycle_has_no_scatter():
    wave = np.cos(2 * np.pi * np.arange(6) / 6)
    seen = inspect_buffers([wave], 6)
    assert seen.status.tolist() == [BufferStatus.NO_SCATTER]
    assert seen.text(0).startswith("no scatter: 1 cycles of 6 samples do not show their noise")


def test_integers_that_repeat_exactly_hide_their_noise():
    wave = np.tile(np.rint(1000 * np.cos(2 * np.pi * np.arange(64) / 64)), 16).astype(np.int16)
    assert inspect_buffers([wave], 64).status.tolist() == [BufferStatus.NO_SCATTER]


def test_a_table_is_a_lot_too():
    table = np.stack([shot(), shot(4 * USUAL), np.zeros(8192, dtype=np.int16)])
    seen = inspect_buffers(table, 64, VOLTS)
    assert seen.status.tolist() == [BufferStatus.GOOD, BufferStatus.CLIPPED, BufferStatus.STUCK]
    assert inspect_buffers(table[:, :-3], 64).status.tolist() == [BufferStatus.WRONG_LENGTH] * 3
    assert inspect_buffers(table[:0], 64).status.tolist() == []
    assert inspect_buffers([], 64).status.tolist() == []


@pytest.mark.parametrize(("n", "run"), [(3, 8), (16, 9), (64, 33), (200, 101)])
def test_runs_are_found_wherever_they_lie(n, run):
    assert shortest_run(n) == run
    rng = np.random.default_rng(n)
    samples = rng.integers(0, 3, size=(4 * run, 5 * run)).astype(np.int16)
    samples[:, ::3] = np.arange(len(samples[0, ::3])) % 7 + 3  # no run of three
    assert not has_long_run(samples, run).any()
    just, short = samples.copy(), samples.copy()
    for i in range(len(samples)):
        just[i, i : i + run] = 99
        short[i, i : i + run - 1] = 99
    assert has_long_run(just, run).all()
    assert not has_long_run(short, run).any()


@pytest.mark.parametrize("amplitude", [3.0, 10.0, 3000.0])
def test_a_live_sine_of_some_codes_is_never_stuck(amplitude):
    phases = np.linspace(0, 2 * np.pi, 50)
    for n in (3, 16, 64, 500):
        wave = amplitude * np.cos(2 * np.pi * np.arange(8 * n) / n - phases[:, None])
        assert not has_long_run(np.rint(wave).astype(np.int16), shortest_run(n)).any()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"samples_per_cycle": 2}, "2 samples a cycle do not determine a phase"),
        ({"samples_per_cycle": 64, "weakest": -1.0}, "weakest amplitude -1.0 V"),
        ({"samples_per_cycle": 64, "cycles": 0}, "0 cycles are not a buffer"),
        ({"samples_per_cycle": 64, "volts_per_code": 0.0}, "volts per code 0.0 V"),
        ({"samples_per_cycle": 64, "harmonics": (1,)}, "harmonics [1]"),
    ],
)
def test_arguments_that_fit_no_buffer_are_refused(arguments, text):
    with pytest.raises(ValidityError) as caught:
        inspect_buffers([np.zeros(64)], **arguments)
    assert text in str(caught.value)
