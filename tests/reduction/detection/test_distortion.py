"""Distorted shots of a night: marked, noted with their effect, never rejected for it."""

import dataclasses

import numpy as np
import pytest

from catseye.records.night.campaign import read_campaign
from catseye.reduction.detection.distortion import distortion_notes
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.ranges import measure_phases
from catseye.reduction.epoch.settings import ReductionSettings
from repository import ROOT


@pytest.fixture(scope="module")
def night():
    return read_campaign(ROOT / "examples" / "night-01")


def compressed(night, ranger, share):
    """The night with one ranger's receiver compressed: v - share v (v/v_0)^2, v_0 the buffer's own amplitude."""
    frames = np.array(night.frames)
    rows = night.shots.frame[np.array(night.shots.ranger) == ranger]
    samples = frames[rows].astype(float)
    peak = np.sqrt(2.0) * samples.std(axis=1, keepdims=True)
    frames[rows] = np.rint(samples * (1.0 - share * (samples / peak) ** 2)).astype(np.int16)
    return dataclasses.replace(night, frames=frames)


def test_night_01_is_not_distorted(night):
    phases = measure_phases(night, ReductionSettings())
    assert not phases.distorted.any()
    good = np.array([reason is None for reason in phases.reason])
    assert np.median(phases.relative_harmonics[good, 0]) == pytest.approx(0.0022, abs=0.0003)  # its own, from outside


def test_a_compressed_receiver_is_marked_and_named_and_turns_no_phase(night):
    """cos^3 x = (3 cos x + cos 3x)/4: the third harmonic is share/4 over 1 - 3 share/4, and phases stay."""
    plain = measure_phases(night, ReductionSettings())
    bent = measure_phases(compressed(night, "ZY105", 0.16), ReductionSettings())
    mine = np.array(night.shots.ranger) == "ZY105"
    strong = mine & (plain.amplitude > 1.5) & np.array([reason is None for reason in plain.reason])
    assert bent.distorted[strong].all()
    assert not bent.distorted[~mine].any()
    assert np.median(bent.relative_harmonics[strong, 1]) == pytest.approx(0.04 / 0.88, rel=0.05)
    turned = np.angle(bent.phasor[strong] / plain.phasor[strong])
    noise = plain.u_phase[strong]
    assert np.all(np.abs(turned) < 5.0 * noise)  # leakage of the sheet no longer fits: part of what the note warns of
    (note,) = distortion_notes(
        night.shots.ranger,
        bent.relative_harmonics,
        bent.distorted,
        shot=night.shots.shot,
        samples_per_cycle=night.shots.samples_per_cycle,
    )
    count = f"{int(bent.distorted.sum())} of its {int(mine.sum())} shots"
    assert note.startswith(f"ZY105: {count} are distorted, harmonic 3")


def test_a_shot_without_a_return_is_not_called_distorted(night):
    """Its samples hold nothing but a second harmonic and noise: blocked is the reason, not distortion."""
    frames = np.array(night.frames)
    j, rng = np.arange(frames.shape[1]), np.random.default_rng(8)
    frames[night.shots.frame[5]] = np.rint(8000.0 * np.cos(4.0 * np.pi * j / 64) + rng.normal(0.0, 500.0, len(j)))
    phases = measure_phases(dataclasses.replace(night, frames=frames), ReductionSettings())
    assert phases.reason[5] is not None
    assert phases.relative_harmonics[5, 0] > 1.0
    assert not phases.distorted.any()


def test_a_reduction_says_it_and_rejects_nothing_for_it(night):
    plain, bent = reduce_epoch(night), reduce_epoch(compressed(night, "ZY116", 0.16))
    assert not any("distorted" in note for note in plain.notes)
    assert any(note.startswith("ZY116: ") and "are distorted" in note for note in bent.notes)
    assert bent.phases.distorted.sum() > 20
    rejected = set(bent.rejected) - set(plain.rejected)
    assert all("distorted" not in bent.rejected[shot] for shot in rejected)
    shots = night.shots.shot[bent.phases.distorted].tolist()
    assert sum(shot in bent.rejected for shot in shots) < 0.2 * len(shots)


def test_many_rangers_share_a_note():
    n = 9
    notes = distortion_notes(
        [f"ZY{k}" for k in range(n)],
        np.full((n, 2), 0.05),
        np.ones(n, dtype=bool),
        shot=np.arange(n),
        samples_per_cycle=np.full(n, 64),
    )
    assert len(notes) == 1
    assert notes[0].startswith("9 shots of 9 rangers are distorted")


def test_without_distortion_there_is_no_note():
    assert (
        distortion_notes(
            ["A"], np.zeros((1, 2)), np.zeros(1, dtype=bool), shot=np.ones(1), samples_per_cycle=np.full(1, 64)
        )
        == []
    )
