"""From buffers to phases, and the electronics from the reference shots."""

import dataclasses

import numpy as np
import pytest

from catseye.records.night.campaign import REFERENCE
from catseye.reduction.epoch.ranges import follow_electronics, measure_phases, walk_notes
from catseye.reduction.epoch.settings import ReductionSettings

VOLT = 10.0 / 32768.0


def naive_phasor(codes, samples_per_cycle):
    """The README's sums, term by term, nothing folded."""
    j = np.arange(len(codes))
    turn = 2 * np.pi * j / samples_per_cycle
    volts = codes.astype(float) * VOLT
    return 2 / len(codes) * complex(np.sum(volts * np.cos(turn)), np.sum(volts * np.sin(turn)))


def turned(codes, angle, factor=1.0):
    """The buffer of a return whose fundamental is turned by an angle, noise and harmonics kept."""
    n = len(codes)
    phasor = naive_phasor(codes, 64)
    change = phasor * (factor * np.exp(1j * angle) - 1.0)
    wave = np.real(change * np.exp(-2j * np.pi * np.arange(n) / 64)) / VOLT
    return np.rint(codes + wave).astype(np.int16)


def with_frames(campaign, rows, change):
    frames = np.array(campaign.frames)
    for k in np.atleast_1d(rows):
        frames[campaign.shots.frame[k]] = change(frames[campaign.shots.frame[k]])
    return dataclasses.replace(campaign, frames=frames)


def test_phases_of_night_01_are_those_of_a_plain_fourier_sum_less_the_leakage(night_01, reduced_night_01):
    for k in range(0, len(night_01.shots), 29):
        mirror = night_01.mirror_of(night_01.shots.ranger[k])
        leakage = mirror.leakage_amplitude_volt * np.exp(1j * mirror.leakage_phase_rad)
        expected = naive_phasor(np.array(night_01.frames[night_01.shots.frame[k]]), 64) - leakage
        assert reduced_night_01.phases.phasor[k] == pytest.approx(expected, abs=1e-12)  # V, rounding
        assert reduced_night_01.phases.amplitude[k] == pytest.approx(abs(expected), abs=1e-12)
        assert reduced_night_01.phases.phase[k] == pytest.approx(np.angle(expected) % (2 * np.pi), abs=1e-8)


def test_the_noise_of_a_phasor_is_that_of_its_samples(night_01, reduced_night_01):
    # 0.165 to 0.245 V rms a sample, so sqrt(2/8192) of it a quadrature
    good = np.array([not r for r in reduced_night_01.phases.reason])
    u = reduced_night_01.phases.u_phasor[good] / np.sqrt(2 / 8192)
    assert np.all((u > 0.12) & (u < 0.30))


def test_a_buffer_without_light_is_blocked_one_at_the_converters_end_is_clipped(night_01, part):
    head = part(night_01, np.arange(40))
    mirror = night_01.mirror_of(head.shots.ranger[7])
    rng = np.random.default_rng(1)
    leak = mirror.leakage_amplitude_volt * np.cos(2 * np.pi * np.arange(8192) / 64 - mirror.leakage_phase_rad)
    dark = np.rint((leak + rng.normal(0, 0.2, 8192)) / VOLT).astype(np.int16)
    changed = with_frames(head, 7, lambda codes: dark)
    changed = with_frames(changed, 11, lambda codes: np.where(np.arange(8192) == 5, 32767, codes))
    changed = with_frames(changed, 13, lambda codes: np.where(np.arange(8192) == 5, -32768, codes))
    reason = measure_phases(changed, ReductionSettings()).reason
    assert reason[7].startswith("blocked: return 0.00")
    assert reason[11].startswith("clipped: 1 samples")
    assert reason[13].startswith("clipped: 1 samples")
    before = measure_phases(head, ReductionSettings()).reason
    assert [r for k, r in enumerate(reason) if k not in (7, 11, 13)] == [
        r for k, r in enumerate(before) if k not in (7, 11, 13)
    ]


@pytest.mark.parametrize("level", [0, 1000, -32000])
def test_a_dead_buffer_is_no_return_although_minus_the_leakage_looks_like_one(night_01, part, level):
    head = part(night_01, np.arange(40))
    dead = with_frames(head, [3, 5], lambda codes: np.full_like(codes, level))
    reason = measure_phases(dead, ReductionSettings()).reason
    assert reason[3].startswith("dead: the samples hold 0.0000 V")
    assert reason[5].startswith("dead: ")


def test_shots_of_different_length_and_rate_stand_side_by_side(night_01, part, reduced_night_01):
    head = part(night_01, np.arange(40))
    cycles, samples = np.array(head.shots.cycles), np.array(head.shots.samples_per_cycle)
    cycles[10:20], cycles[20:30] = 16, 256
    samples[20:30] = 32
    frames = np.array(head.frames)
    rng = np.random.default_rng(8)
    wanted = rng.uniform(0, 2 * np.pi, 10)
    for k in range(20, 30):  # a wave of 32 samples a cycle
        wave = 4.0 * np.cos(2 * np.pi * np.arange(8192) / 32 - wanted[k - 20]) + rng.normal(0, 0.2, 8192)
        frames[head.shots.frame[k]] = np.rint(wave / VOLT)
    mixed = dataclasses.replace(part(head, np.arange(40), cycles=cycles, samples_per_cycle=samples), frames=frames)
    phases = measure_phases(mixed, ReductionSettings())
    for k in range(40):
        mirror = mixed.mirror_of(mixed.shots.ranger[k])
        leakage = mirror.leakage_amplitude_volt * np.exp(1j * mirror.leakage_phase_rad)
        codes = frames[mixed.shots.frame[k]][: cycles[k] * samples[k]]
        assert phases.phasor[k] == pytest.approx(naive_phasor(codes, samples[k]) - leakage, abs=1e-12)
    # an eighth of the samples: sqrt(8) of the noise, which 16 cycles tell to a sixth
    ratio = phases.u_phasor[10:20] / reduced_night_01.phases.u_phasor[10:20]
    np.testing.assert_allclose(ratio, np.sqrt(8), rtol=0.5)


def test_progress_counts_every_shot(night_01, part):
    seen = []
    measure_phases(
        part(night_01, np.arange(130)), ReductionSettings(), lambda what, done, total: seen.append((done, total))
    )
    assert seen == [(64, 130), (128, 130), (130, 130)]


def references_of(campaign, name):
    shots = campaign.shots
    return [k for k in range(len(shots)) if shots.ranger[k] == name and shots.target[k] == REFERENCE]


@pytest.mark.parametrize("name", ["ZY114", "ZY103"])
@pytest.mark.parametrize("which", [0, 1, -2, -1])
def test_a_turned_reference_is_found_and_no_other_is_blamed(night_01, name, which):
    """A foreign return in quadrature turns the phase and leaves the amplitude alone: 0.2 rad is 3 mm."""
    k = references_of(night_01, name)[which]
    bad = with_frames(night_01, k, lambda codes: turned(codes, 0.2))
    _, rejected = follow_electronics(bad, measure_phases(bad, ReductionSettings()))
    assert list(rejected) == [k]
    assert rejected[k].startswith("bad reference: phase ")


def test_two_turned_references_are_both_found(night_01):
    k = references_of(night_01, "ZY115")
    bad = with_frames(night_01, [k[0], k[4]], lambda codes: turned(codes, -0.25))
    _, rejected = follow_electronics(bad, measure_phases(bad, ReductionSettings()))
    assert sorted(rejected) == sorted([k[0], k[4]])


def test_a_reference_of_foreign_strength_is_found_by_its_amplitude(night_01):
    k = references_of(night_01, "ZY113")[3]
    bad = with_frames(night_01, k, lambda codes: turned(codes, 0.0, 1.1))
    _, rejected = follow_electronics(bad, measure_phases(bad, ReductionSettings()))
    assert list(rejected) == [k]
    assert "another object is in the beam" in rejected[k]


def test_good_references_are_all_kept(night_01, reduced_night_01):
    _, rejected = follow_electronics(night_01, reduced_night_01.phases)
    assert rejected == {}


def test_a_ranger_without_reference_cannot_range_and_says_so(night_01, part, rangers_01, references_01):
    without = part(night_01, ~(references_01 & (rangers_01 == "ZY105")))
    electronics, rejected = follow_electronics(without, measure_phases(without, ReductionSettings()))
    assert "ZY105" not in electronics
    mine = [k for k in range(len(without.shots)) if without.shots.ranger[k] == "ZY105"]
    assert sorted(rejected) == mine
    assert all(rejected[k].startswith("no reference: ZY105 has no usable shot") for k in mine)


def test_one_cycle_of_few_samples_says_that_its_noise_is_unknown(night_01, part):
    m = 20
    short = part(night_01, np.arange(m), cycles=np.ones(m, int), samples_per_cycle=np.full(m, 4))
    phases = measure_phases(short, ReductionSettings())
    assert all(r.startswith("noise unknown: 1 cycles of 4 samples") for r in phases.reason)


def test_the_drift_is_known_best_beside_its_references(night_01, reduced_night_01):
    """Walk of 10 mrad per root hour: a quarter of it remains half-way between references 126 s apart."""
    seconds = night_01.shots.mjd_utc * 86400.0
    e = reduced_night_01.electronics["ZY113"]
    gap = np.array([np.min(np.abs(seconds[references_of(night_01, "ZY113")] - seconds[k])) for k in e.shots])
    sigma = np.sqrt(np.diag(e.covariance))
    assert np.all(sigma[gap > 40].min() > sigma[gap < 16].max())
    between = np.sqrt(126.0 / 4 / 3600.0) * 0.010
    assert sigma.max() == pytest.approx(between, rel=0.35)  # the references' own noise adds 0.3 mrad
    assert np.linalg.eigvalsh(e.covariance).min() > -1e-18


def test_a_site_whose_electronics_walk_otherwise_than_it_says_is_told(night_01):
    phases = measure_phases(night_01, ReductionSettings())
    _, wrong = follow_electronics(night_01, phases)
    assert walk_notes(night_01, phases, wrong) == []
    for claimed, word in ((3.0, "small"), (40.0, "large")):
        ranging = night_01.site.ranging.model_copy(update={"electronic_drift_mrad_per_sqrt_hour": claimed})
        told = dataclasses.replace(night_01, site=night_01.site.model_copy(update={"ranging": ranging}))
        (note,) = walk_notes(told, phases, wrong)
        assert f"unlike the {claimed:g} of site.toml: u_range is too {word}" in note


def test_a_walk_that_one_difference_contradicts_is_a_note_and_no_failure(night_01):
    phases = measure_phases(night_01, ReductionSettings())
    shots = night_01.shots
    wrong = [
        k
        for name in night_01.rangers
        for k in [
            k for k, (r, t) in enumerate(zip(shots.ranger, shots.target, strict=True)) if (r, t) == (name, REFERENCE)
        ][3 if name == "ZY116" else 2 :]
    ]
    ranging = night_01.site.ranging.model_copy(update={"electronic_drift_mrad_per_sqrt_hour": 0.5})
    told = dataclasses.replace(night_01, site=night_01.site.model_copy(update={"ranging": ranging}))
    (note,) = walk_notes(told, phases, wrong)
    assert "unlike the 0.5 of site.toml: u_range is too small" in note


def test_electronics_that_stand_still_are_told_without_limits_that_mean_nothing(night_01):
    phases = measure_phases(night_01, ReductionSettings())
    reference = np.array([t == REFERENCE for t in night_01.shots.target])
    noise = 3e-4 * np.random.default_rng(0).normal(size=len(reference))
    still = np.where(reference, phases.amplitude * np.exp(1j * noise), phases.phasor)
    (note,) = walk_notes(night_01, dataclasses.replace(phases, phasor=still), [])
    assert "no walk" in note
    assert "inf" not in note
