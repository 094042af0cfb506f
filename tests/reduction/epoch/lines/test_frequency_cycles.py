"""Whole cycles of a campaign's lines by several modulation frequencies."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from catseye.api.night import night
from catseye.constants import SPEED_OF_LIGHT
from catseye.errors import InputError
from catseye.records.night.campaign import Campaign, read_campaign
from catseye.reduction.epoch.epoch import Reduction, reduce_epoch
from catseye.reduction.epoch.lines.frequency_cycles import FrequencySet, frequency_cycles
from catseye.reduction.epoch.lines.frequency_places import uncertain
from catseye.reduction.epoch.ranges import ElectronicsPhase, Phases, follow_electronics, measure_phases
from catseye.reduction.epoch.reason import ShotStatus
from catseye.reduction.epoch.settings import ReductionSettings

FURTHER = (1500.5e6, 1510e6)
WRONG = ("DP003", "DP004")  # dish prisms typed half a metre off


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Night at three modulation frequencies, and its truth."""
    where = tmp_path_factory.mktemp("several") / "night"
    return night(where, seed=5, dish_prisms=6, again=0.0, nature=0.0, frequencies_hz=FURTHER)


@pytest.fixture(scope="module")
def campaign(folder: Path) -> Campaign:
    return read_campaign(folder)


@pytest.fixture(scope="module")
def measured(campaign: Campaign) -> tuple[Phases, dict[str, ElectronicsPhase]]:
    """Phases and electronics of the night."""
    phases = measure_phases(campaign, ReductionSettings())
    return phases, follow_electronics(campaign, phases)[0]


def displaced(campaign: Campaign, names: tuple[str, ...], metres: float) -> Campaign:
    """Campaign whose typed positions of some targets are wrong, without saying so."""
    rng = np.random.default_rng(3)
    targets = dict(campaign.targets)
    for name in names:
        by = rng.normal(size=3)
        by *= 1e3 * metres / np.linalg.norm(by)
        moved = tuple((np.array(targets[name].position_mm) + by).tolist())
        targets[name] = targets[name].model_copy(update={"position_mm": moved})
    return replace(campaign, targets=targets)


def mistuned(campaign: Campaign, hz: float, typed: float) -> Campaign:
    """Campaign with one frequency typed wrong in shots.csv and in every sheet."""
    assert campaign.shots.modulation_hz is not None
    column = np.where(campaign.shots.modulation_hz == hz, typed, campaign.shots.modulation_hz)
    mirrors = {
        zp: sheet.model_copy(
            update={
                "frequency": tuple(
                    f.model_copy(update={"modulation_hz": typed}) if f.modulation_hz == hz else f
                    for f in sheet.frequency
                )
            }
        )
        for zp, sheet in campaign.mirrors.items()
    }
    return replace(campaign, shots=replace(campaign.shots, modulation_hz=column), mirrors=mirrors)


def errors(reduction: Reduction, folder: Path) -> dict[str, float]:
    """Chi-square of each point against the truth, three degrees of freedom."""
    points = json.loads((folder / "truth.json").read_text())["points"]
    truth = {n: np.array(list(p.values())) for n, p in points.items()}
    c = reduction.coordinates
    off = {n: c.x[i] - truth[n] for i, n in enumerate(c.points) if n in truth}
    return {n: float(e @ np.linalg.solve(c.block([n]), e)) for n, e in off.items()}


def true_cycles(reduction: Reduction, s: FrequencySet) -> tuple[int, ...]:
    """Whole cycles by the adjusted coordinates, which are good to a tenth of a millimetre."""
    r = reduction.coordinates.ranges
    at = {int(k): i for i, k in enumerate(r.shot)}
    return tuple(int(r.cycles[at[k]]) for k in s.shots)


@pytest.fixture(scope="module")
def reduction(campaign: Campaign) -> Reduction:
    """Reduction of the night with two positions half a metre wrong."""
    return reduce_epoch(displaced(campaign, WRONG, 0.5))


def test_half_a_metre_of_a_typed_position_does_no_harm(reduction: Reduction, folder: Path) -> None:
    square = errors(reduction, folder)
    assert reduction.verdict.word == "good"
    for name in WRONG:
        assert square[name] < 16.3  # one in a thousand
        assert (
            np.linalg.norm(reduction.coordinates.x - reduction.coordinates.start, axis=1)[
                reduction.coordinates.index(name)
            ]
            > 0.4
        )
        assert any(note.startswith(f"{name}: its typed position is") for note in reduction.notes)
    assert 1.5 < np.mean(list(square.values())) < 6.0  # expectation 3; sixty points that share their errors


def test_one_frequency_cannot_do_the_same(campaign: Campaign, folder: Path) -> None:
    assert campaign.shots.modulation_hz is not None
    usual = campaign.site.ranging.modulation_hz
    rows = np.flatnonzero(campaign.shots.modulation_hz == usual)
    shots = replace(
        campaign.shots,
        modulation_hz=None,
        ranger=tuple(campaign.shots.ranger[k] for k in rows),
        target=tuple(campaign.shots.target[k] for k in rows),
        **{n: getattr(campaign.shots, n)[rows] for n in ("shot", "mjd_utc", "cycles", "samples_per_cycle", "frame")},
    )
    alone = reduce_epoch(displaced(replace(campaign, shots=shots), WRONG, 0.5))
    square = errors(alone, folder)
    assert all(square.get(name, np.inf) > 1e3 for name in WRONG)


def test_every_set_called_found_has_the_cycles_of_the_adjusted_points(reduction: Reduction) -> None:
    sets = reduction.coordinates.frequencies.sets
    sure = [s for s in sets if s.status == "found"]
    assert len(sure) > 0.9 * len(sets)
    used = set(reduction.coordinates.ranges.shot[reduction.coordinates.ranges.used].tolist())
    assert all(true_cycles(reduction, s) == s.cycles for s in sure)
    lengths = [[n * SPEED_OF_LIGHT / 2.0 / hz for n, hz in zip(s.cycles, s.frequencies_hz, strict=True)] for s in sure]
    assert max(map(np.ptp, lengths)) < 0.1  # one length, a part of a half wavelength left out of each
    assert sum(used.issuperset(s.shots) for s in sure) > 0.95 * len(sure)


def test_cycles_known_by_frequencies_are_not_called_thin(reduction: Reduction) -> None:
    r = reduction.coordinates.ranges
    resolved = reduction.coordinates.frequencies.cycles_of_shots(len(reduction.campaign.shots))[r.shot] >= 0
    assert resolved.any()
    assert not np.any(r.thin & resolved)


def test_a_mistyped_frequency_is_named_and_left_out(campaign: Campaign, folder: Path) -> None:
    wrong = reduce_epoch(mistuned(campaign, 1510e6, 1510.1e6))
    assert wrong.verdict.word == "doubtful"
    assert "without 1510.1 MHz they agree" in wrong.verdict.why
    column = wrong.campaign.shots.modulation_hz
    assert column is not None
    doubted = {float(column[k]) for k, s in enumerate(wrong.status) if s is ShotStatus.DOUBTED}
    assert doubted == {1510.1e6}
    assert np.mean(list(errors(wrong, folder).values())) < 6.0  # the others do without it


def test_one_ppm_of_one_frequency_is_named_by_the_ranges(campaign: Campaign) -> None:
    wrong = reduce_epoch(mistuned(campaign, 1510e6, 1510e6 * (1.0 + 1e-6)))
    assert wrong.verdict.word == "doubtful"
    assert "modulation frequency 1510.00151 MHz" in wrong.verdict.why
    said = float(re.findall(r"by \+?([0-9.]+) ppm", wrong.verdict.why)[0])
    assert said == pytest.approx(1.0, abs=0.15)


def test_frequencies_that_nothing_decides_are_refused(campaign: Campaign) -> None:
    with pytest.raises(InputError, match=r"disagree in .* and nothing decides which is wrong"):
        reduce_epoch(mistuned(campaign, 1510e6, 1501e6))


def test_a_wrong_phase_is_a_set_without_a_common_length(
    campaign: Campaign, measured: tuple[Phases, dict[str, ElectronicsPhase]]
) -> None:
    phases, electronics = measured
    good = next(s for s in frequency_cycles(campaign, phases, electronics).sets if s.status == "found")
    turned = phases.phasor.copy()
    turned[good.shots[1]] *= np.exp(0.5j)
    cycles = frequency_cycles(campaign, replace(phases, phasor=turned), electronics)
    (bad,) = [s for s in cycles.sets if s.shots == good.shots]
    assert bad.status == "misfit"
    assert (
        any(f"{bad.ranger} {bad.target}" in note for note in cycles.notes() if "disagree" in note)
        or len([s for s in cycles.sets if s.status == "misfit"]) > 6
    )


def test_success_is_as_often_as_claimed(
    campaign: Campaign, measured: tuple[Phases, dict[str, ElectronicsPhase]]
) -> None:
    """Noise eight times as large makes slips: their share is that of the mean claimed probability."""
    phases, electronics = measured
    truth = {s.shots: s.cycles for s in frequency_cycles(campaign, phases, electronics).sets if s.status == "found"}
    rng, wide = np.random.default_rng(11), uncertain(campaign, {})
    slips, claimed = [], []
    factor = 8.0
    noisy = replace(phases, u_across=factor * phases.u_across)
    for _ in range(12):
        turn = rng.normal(size=len(phases.phasor)) * factor * phases.u_phase
        drawn = replace(noisy, phasor=phases.phasor * np.exp(1j * np.where(np.isfinite(turn), turn, 0.0)))
        for s in frequency_cycles(wide, drawn, electronics).sets:
            if s.shots in truth and s.status in ("found", "ambiguous") and np.isfinite(s.misfit):
                slips.append(s.cycles != truth[s.shots])
                claimed.append(s.slip_probability)
    expected, count = float(np.sum(claimed)), float(np.sum(slips))
    assert expected > 10.0
    assert count == pytest.approx(expected, abs=4.0 * np.sqrt(expected) + 0.5 * expected)


def test_sheet_s_coupling_lengthens_a_set_as_equation_5_18_has_it(
    campaign: Campaign, measured: tuple[Phases, dict[str, ElectronicsPhase]]
) -> None:
    """A phase that the amplitude raises by c ln(A/A0) is taken back: the length grows by c ln(A/A0) lambda/4 pi."""
    phases, electronics = measured
    c = 0.02
    keys = {"amplitude_to_phase_rad": c, "u_amplitude_to_phase_rad": 1e-5}
    coupled = {zp: m.model_copy(update=keys) for zp, m in campaign.mirrors.items()}
    plain = frequency_cycles(campaign, phases, electronics)
    turned = frequency_cycles(replace(campaign, mirrors=coupled), phases, electronics)
    reference = {
        int(k): abs(r) for part in electronics.values() for k, r in zip(part.shots, part.reference, strict=True)
    }
    change, expected = [], []
    for before, after in zip(plain.sets, turned.sets, strict=True):
        if before.status == after.status == "found":
            rows = list(after.shots)
            lead = c * np.log(phases.amplitude[rows] / [reference[k] for k in rows])
            change.append(after.off - before.off)
            expected.append(float(np.mean(lead * campaign.half_wavelengths(np.array(rows)) / (2.0 * np.pi))))
    assert len(change) > 30
    assert np.ptp(expected) > 1e-4
    np.testing.assert_allclose(change, expected, rtol=0.0, atol=3e-6)
