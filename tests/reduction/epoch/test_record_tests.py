"""Every record is tested by everything else; a wrong one is named, or is among those that explain the misfit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from catseye.constants import MILLIMETRE, PPM
from catseye.estimation.least_squares.adjustment import NONCENTRALITY, adjust
from catseye.estimation.least_squares.influence import Influence
from catseye.estimation.least_squares.patterns import PatternTests
from catseye.records.night.campaign import REFERENCE, read_campaign
from catseye.reduction.epoch.contradictions.contradiction import RecordGroup
from catseye.reduction.epoch.contradictions.hypotheses import DIRECTIONS, RecordKey, widened
from catseye.reduction.epoch.contradictions.in_common import DATUM
from catseye.reduction.epoch.coordinates import adjust_coordinates, settled_network
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.lines.cycles import without_shots
from catseye.reduction.epoch.lines.hidden_errors import hidden_shifts, leaning_of
from catseye.reduction.epoch.record_tests import EpochRecords, record_tests
from catseye.reduction.epoch.settling import SettledNetwork, iterate_adjustment, selection_of
from catseye.reduction.epoch.unknowns import rebuilt
from catseye.simulator.night.lies.lie import lying_night
from catseye.simulator.night.sheets import write_night
from nature_scene import natural_setting


def with_record(campaign, part, name, **values):
    table = dict(getattr(campaign, part))
    table[name] = table[name].model_copy(update=values)
    return replace(campaign, **{part: table})


def adjusted(campaign, reduced):
    return adjust_coordinates(campaign, reduced.phases, reduced.electronics, settings=reduced.settings)


@pytest.fixture(scope="module")
def records(few_01, reduced_few_01):
    r = reduced_few_01
    settled, _ = settled_network(few_01, r.phases, r.electronics, settings=r.settings)
    return EpochRecords(*settled)


def test_an_honest_night_contradicts_no_record(reduced_few_01):
    coordinates = reduced_few_01.coordinates
    assert coordinates.contradictions == ()
    groups = {g.group: g for g in coordinates.groups}
    assert {RecordGroup.MONUMENTS, RecordGroup.ZEROS, RecordGroup.BENCHMARKS, RecordGroup.MODULATION} <= groups.keys()
    assert min(g.probability for g in coordinates.groups) > 1e-3
    w = np.array([row.w for row in coordinates.records if row.group is not RecordGroup.POSITIONS])
    w = w[np.isfinite(w)]
    assert len(w) > 150
    assert 0.5 < np.sqrt(np.mean(w**2)) < 1.5  # they are not independent
    assert np.abs(w).max() < 4.0


def first_certificate(coordinates, campaign):
    """Test of the first benchmark's certificate."""
    mark = campaign.benchmarks[0]
    return next(r for r in coordinates.records if r.record == f"certificate of {mark.ranger}-{mark.target}")


def with_first_certificate(campaign, longer_mm):
    first, *others = campaign.benchmarks
    longer = first.model_copy(update={"certified_distance_mm": first.certified_distance_mm + longer_mm})
    return replace(campaign, benchmarks=(longer, *others))


def leaning_notes(coordinates):
    return [note for note in coordinates.notes if note.startswith("the ranges lean to an error of ")]


def test_what_the_ranges_lean_to_stays_in_the_answer_and_is_in_its_covariance(few_01, reduced_few_01, monkeypatch):
    """An error of 3.8 u may be chance, and must not pull the answer; and may be none, and must be covered."""
    right = reduced_few_01.coordinates
    row = first_certificate(right, few_01)
    night = with_first_certificate(few_01, 3.8 * row.u_error - row.error)
    leaning = adjusted(night, reduced_few_01)
    assert leaning_notes(right) == []
    (note,) = leaning_notes(leaning)
    assert row.record in note
    assert leaning.contradictions == ()
    monkeypatch.setattr("catseye.reduction.epoch.coordinates.leaning_of", lambda records: None)
    plain = adjusted(night, reduced_few_01)
    np.testing.assert_array_equal(leaning.x, plain.x)
    added = leaning.joint.matrix() - plain.joint.matrix()
    assert np.linalg.eigvalsh(added)[0] > -1e-9 * np.trace(added)
    monkeypatch.undo()
    r = reduced_few_01
    settled, _ = settled_network(night, r.phases, r.electronics, settings=r.settings)
    reach = leaning_of(EpochRecords(*settled)).reach[settled.network.layout.columns(few_01.benchmarks[0].ranger)]
    shift = (plain.x - right.x)[right.index(few_01.benchmarks[0].ranger)] * 3.8 / (3.8 - row.w)  # by 3.8 u, not by less
    assert np.linalg.norm(shift) > 1e-5
    apart = np.minimum(*(np.linalg.norm(reach - sign * shift[:, None], axis=0) for sign in (1.0, -1.0)))
    assert apart.min() < 0.05 * np.linalg.norm(shift)


def test_nothing_leans_where_a_record_is_off_by_little(few_01, reduced_few_01):
    row = first_certificate(reduced_few_01.coordinates, few_01)
    night = with_first_certificate(few_01, 1.5 * row.u_error - row.error)
    assert leaning_notes(adjusted(night, reduced_few_01)) == []


def test_a_hidden_error_of_a_survey_moves_its_point_as_far_as_told(records):
    """Against adjustments with the survey wrong both ways along each axis, and along two of them."""
    network, solution = records.network, records.solution
    hidden = hidden_shifts(records, solution.q)
    name = "ZY105"
    ((i, (rows, _)),) = next(h for h in records.of_priors if h.key == (RecordGroup.MONUMENTS, name)).priors.items()
    columns = network.layout.columns(name)
    free, active = np.array(network.layout.free), [f.active for f in solution.fits]
    prior = network.priors[i]

    def with_error(error):
        observed = prior.observed.copy()
        observed[rows] += error
        groups = list(records.groups)
        groups[len(records.shots) + i] = replace(prior, observed=observed)
        again = adjust(solution.x, groups, free=free, active=active)
        return again.x[columns], sum(f.pvv for f in again.fits)

    size, (_, usual) = 1e-3, with_error(np.zeros(3))

    def both_ways(direction):
        (there, more), (back, less) = with_error(size * direction), with_error(-size * direction)
        return 0.5 * (there - back) / size, (0.5 * (more + less) - usual) / size**2

    axes = np.eye(3)
    shifts, seen = zip(*(both_ways(axis) for axis in axes), strict=True)
    information = np.diag(seen)
    for j, k in ((0, 1), (0, 2), (1, 2)):
        both = both_ways(axes[j] + axes[k])[1]
        information[j, k] = information[k, j] = 0.5 * (both - seen[j] - seen[k])
    moved = np.column_stack(shifts)
    far = moved.T @ np.linalg.inv(solution.q.within(columns)) @ moved
    assert hidden[name] == pytest.approx(NONCENTRALITY * np.sqrt(eigh(far, information)[0][-1]), rel=0.01)
    assert hidden["ZY118"] < 0.2 * hidden[name]  # many lines hold a ranger of the feed arm


def test_a_survey_that_no_line_tests_in_one_direction_leaves_its_ranger_unchecked(few_01, reduced_few_01):
    """All lines of a ranger but those to two targets are taken away."""
    ends = list(zip(few_01.shots.ranger, few_01.shots.target, strict=True))
    two = [t for r, t in dict.fromkeys(ends) if r == "ZY107" and t != REFERENCE][:2]
    lost = {k for k, (r, t) in enumerate(ends) if r == "ZY107" and t not in (*two, REFERENCE)}
    assert "ZY107" not in reduced_few_01.coordinates.unchecked
    r = reduced_few_01
    electronics = without_shots(r.electronics, lost)
    few = adjust_coordinates(few_01, r.phases, electronics, settings=r.settings)
    assert "ZY107" in few.unchecked
    assert few.lines[few.index("ZY107")] == 2


@pytest.mark.parametrize("wider", [3.0, 1000.0])
@pytest.mark.parametrize("key", [(RecordGroup.MODULATION, "ZY113"), (RecordGroup.MOVEMENTS, "arm")])
def test_an_error_that_is_a_parameter_is_tested_as_if_it_were_none(records, key, wider):
    """However wide its prior is: a pattern beside it would see nothing."""
    named = RecordKey(*key)
    (h,) = (h for h in records.of_ranges if h.key == named)
    plain = PatternTests(Influence(records.groups, records.solution), records.patterns([h])).fit(0)
    sigma = (wider * float(plain.u.max()),) * len(h.parts)
    allowance = replace(records.network.allowance, errors={named: sigma})
    settled = SettledNetwork(records.network, records.solution, records.shots)
    network = rebuilt(replace(records.network, allowance=allowance))
    starts = {name: records.solution.x[network.layout.columns(name)] for name in network.places}
    again = EpochRecords(*iterate_adjustment(network, starts, active=selection_of(settled, network)))
    rows = [r for r in record_tests(again)[0] if r.record == h.record]
    np.testing.assert_allclose([r.error for r in rows], plain.errors / h.per_unit, atol=0.1 * plain.u[0] / h.per_unit)
    np.testing.assert_allclose([r.u_error for r in rows], plain.u / h.per_unit, rtol=0.05)


def test_a_frequency_is_not_taken_back_for_a_zero_beside_another_lie(tmp_path):
    """The zero was named until November 2026: its ranger's frequency, 30 u off, was taken for innocent."""
    lies = ("oscillator ZY113 10", "certificate ZBM06 0.3")
    night = lying_night(9815, lies, **natural_setting(9815, 60))
    coordinates = reduce_epoch(read_campaign(write_night(night, tmp_path / "night"))).coordinates
    named = {c.named.record for c in coordinates.contradictions if c.named is not None}
    assert named == {"modulation frequency of ZY113"}
    (row,) = (r for r in coordinates.records if r.record == "modulation frequency of ZY113")
    assert row.error == pytest.approx(10.0, abs=4.0 * row.u_error)
    assert row.w > 20.0


def test_the_error_of_a_record_is_what_the_others_say_of_it(records):
    """Against an adjustment without the record: its value less what comes out, by their variances."""
    rows, _ = record_tests(records)
    network, solution, _ = records.network, records.solution, records.shots
    tested = 0
    for h in records.of_priors:
        if h.key not in {
            RecordKey(RecordGroup.MONUMENTS, "ZY104"),
            RecordKey(RecordGroup.ZEROS, "ZY113"),
            RecordKey(RecordGroup.BENCHMARKS, "ZY104 ZBM02"),
        }:
            continue
        ((i, (at, change)),) = h.priors.items()
        for k in range(len(h.parts)):
            alone = (at[change[:, k] != 0.0], np.eye(1))
            loose = widened(network.priors[i], alone, np.array([10.0]))
            groups = list(records.groups)
            groups[len(records.shots) + i] = loose
            free, active = np.array(network.layout.free), [f.active for f in solution.fits]
            again = adjust(solution.x, groups, free=free, active=active)
            fit = again.fits[len(records.shots) + i]
            (row,) = (r for r in rows if r.record == h.record and r.part == h.parts[k])
            (at_row,) = alone[0]
            expected = float(fit.residual[at_row]) / h.per_unit
            assert row.error == pytest.approx(expected, abs=1e-3 * row.u_error)
            jacobian = network.priors[i].predict(again.x)[1]
            columns = network.priors[i].columns
            columns = columns if columns.ndim == 1 else columns[at_row]
            along = jacobian[at_row]
            used = along != 0.0
            predicted = along[used] @ again.q.within(columns[used]) @ along[used]
            assert row.u_error == pytest.approx(np.sqrt(predicted + (row.u * h.per_unit) ** 2) / h.per_unit, rel=1e-3)
            tested += 1
    assert tested == 5


def test_a_certificate_a_millimetre_long_is_not_blamed_on_a_zero(few_01, reduced_few_01):
    found = adjusted(with_first_certificate(few_01, 1.0), reduced_few_01)
    (contradiction,) = found.contradictions
    groups = {e.group for e in contradiction.explanations}
    assert RecordGroup.BENCHMARKS in groups
    assert RecordGroup.ZEROS not in groups
    certificate = next(e for e in contradiction.explanations if e.group is RecordGroup.BENCHMARKS)
    assert certificate.errors[0] == pytest.approx(1.0, abs=4.0 * certificate.u[0])
    assert "certified_distance_mm" in certificate.text
    assert any(contradiction.text in doubt for doubt in found.doubts)


@pytest.mark.parametrize("ranger", ["ZY113", "ZY117"])
def test_a_wrong_zero_of_a_ranger_with_many_lines_is_named_alone(few_01, reduced_few_01, ranger):
    zp = few_01.mirror_of(ranger).zp
    found = adjusted(with_record(few_01, "mirrors", zp, d0_mm=few_01.mirrors[zp].d0_mm + 0.5), reduced_few_01)
    (contradiction,) = found.contradictions
    assert contradiction.named is not None
    assert (contradiction.named.group, contradiction.named.of) == (RecordGroup.ZEROS, ranger)
    assert abs(contradiction.named.errors[0] - 0.5) < 4.0 * contradiction.named.u[0]
    usual = reduced_few_01.coordinates
    assert np.all(np.abs(found.x - usual.x) <= 3.0 * found.u)
    assert np.array_equal(found.ranges.used, usual.ranges.used)


def test_a_frequency_is_one_explanation_of_a_common_scale(few_01, reduced_few_01):
    """5 ppm too high: half wavelengths too short. All thermometers and the pressure change lengths alike."""
    ranging = few_01.site.ranging
    faster = ranging.model_copy(update={"modulation_hz": ranging.modulation_hz * (1.0 + 5.0 * PPM)})
    campaign = replace(few_01, site=few_01.site.model_copy(update={"ranging": faster}))
    found = adjusted(campaign, reduced_few_01)
    (contradiction,) = found.contradictions
    errors = {(e.group, e.of): e.errors[0] for e in contradiction.explanations}
    assert errors[RecordGroup.MODULATION, ""] == pytest.approx(5.0, abs=1.5)
    assert errors[RecordGroup.PRESSURE, ""] == pytest.approx(5.0 / 0.27, abs=6.0)  # 0.27 ppm a hPa
    assert contradiction.named is None


def test_two_monuments_are_two_contradictions(few_01, reduced_few_01):
    """Each with its mirror's offset, which is the same vector."""
    campaign = few_01
    for name in ("ZY102", "ZY108"):
        campaign = with_record(campaign, "monuments", name, x_mm=few_01.monuments[name].x_mm + 2.0)
    found = adjusted(campaign, reduced_few_01)
    named = [{e.of for e in c.explanations} for c in found.contradictions]
    assert {"ZY102"} in named
    assert {"ZY108"} in named
    assert all(owners <= {"ZY102", "ZY108"} for owners in named)
    for contradiction in found.contradictions:
        (place,) = (e for e in contradiction.explanations if e.group is RecordGroup.MONUMENTS)
        east = place.errors[place.parts.index("east")]
        assert east == pytest.approx(2.0, abs=4.0 * place.u[place.parts.index("east")] + 0.1)


def with_zeros(campaign, chosen):
    mirrors = {
        zp: m.model_copy(update={"d0_mm": m.d0_mm + 0.3}) if chosen(f"ZY{zp[2:]}") else m
        for zp, m in campaign.mirrors.items()
    }
    return replace(campaign, mirrors=mirrors)


def with_certificates(campaign, change):
    marks = [
        m.model_copy(update={"certified_distance_mm": change(m.certified_distance_mm)}) for m in campaign.benchmarks
    ]
    return replace(campaign, benchmarks=tuple(marks))


def with_survey(campaign, scale):
    """Scaled about the site's middle, with heights as they were."""
    surveyed = {
        n: m.model_copy(update={"x_mm": m.x_mm * scale, "y_mm": m.y_mm * scale}) for n, m in campaign.monuments.items()
    }
    return replace(campaign, monuments=surveyed)


@pytest.mark.parametrize(
    ("of", "changed", "size"),
    [
        ("zeros of all rangers", lambda c: with_zeros(c, lambda _: True), 0.3),
        ("zeros of all rangers on monuments", lambda c: with_zeros(c, lambda n: n in c.monuments), 0.3),
        ("certificates of all benchmarks", lambda c: with_certificates(c, lambda mm: mm + 0.3), 0.3),
        ("scale of all certificates", lambda c: with_certificates(c, lambda mm: mm * (1.0 + 5.0 * PPM)), 5.0),
        ("scale of all monuments", lambda c: with_survey(c, 1.0 + 10.0 * PPM), 10.0),
    ],
)
def test_an_error_that_many_records_share_is_one_contradiction(few_01, reduced_few_01, of, changed, size):
    """A batch, a bench or a survey: named as such, not as several of its records, and within the claim."""
    found = adjusted(changed(few_01), reduced_few_01)
    first = found.contradictions[0].explanations[0]
    assert (first.group, first.of) == (RecordGroup.COMMON, of)
    assert abs(first.errors[0] - size) < 4.0 * first.u[0]
    usual = reduced_few_01.coordinates
    assert np.all(np.abs(found.x - usual.x) <= 3.0 * found.u)


def test_the_datum_of_a_survey_is_unchecked_and_never_blamed(records):
    """No range shows where a whole survey is, or where it points: only positions that somebody typed."""
    rows, groups = record_tests(records)
    datum = [row for row in rows if row.record.removesuffix(" alike") in DATUM]
    assert {row.record.removesuffix(" alike") for row in datum} == DATUM
    assert all(row.unchecked and np.isnan(row.w) and np.isinf(row.detectable) for row in datum)
    assert not [h for h in records.rivals if h.key.of in DATUM]
    (degrees,) = [g.degrees for g in groups if g.group is RecordGroup.COMMON]
    assert degrees <= sum(np.isfinite(row.w) for row in rows if row.group is RecordGroup.COMMON)


def test_a_monument_that_is_held_tests_where_the_others_are(few_01, reduced_few_01):
    held = few_01.monuments["ZY103"].model_copy(update={"u_x_mm": 0.0, "u_y_mm": 0.0})
    campaign = replace(few_01, monuments={**few_01.monuments, "ZY103": held})
    rows = adjusted(campaign, reduced_few_01).records
    tested = {row.record.removesuffix(" alike"): row.w for row in rows if np.isfinite(row.w)}
    assert set(tested) & DATUM == {"places of all monuments", "directions of all monuments"}


def test_a_drifting_feed_arm_is_a_movement(few_01, reduced_few_01):
    """2 mm/h upwards, written into the phases of shots from the ground; the arm's rangers see the dish sink."""
    r, shots = reduced_few_01, few_01.shots
    c = r.coordinates
    arm = {n for n, p in c.places.items() if p.body == "arm"}
    hours = (shots.mjd_utc - 0.5 * (shots.mjd_utc.min() + shots.mjd_utc.max())) * 24.0
    turn = np.zeros(len(hours))
    per_metre = -4.0 * np.pi * few_01.site.ranging.modulation_hz / 299792458.0
    for k, (a, b) in enumerate(zip(shots.ranger, shots.target, strict=True)):
        if b in c.places and (a in arm) != (b in arm):
            line = c.x[c.index(b)] - c.x[c.index(a)]
            along = line[2] / np.linalg.norm(line) * (1.0 if b in arm else -1.0)
            turn[k] = per_metre * 2.0 * MILLIMETRE * hours[k] * along
    phases = replace(r.phases, phasor=r.phases.phasor * np.exp(1j * turn))
    found = adjust_coordinates(few_01, phases, r.electronics, settings=r.settings)
    moved = [e for contradiction in found.contradictions for e in contradiction.explanations if e.of == "arm"]
    assert moved
    assert moved[0].parts == DIRECTIONS
    up = moved[0].errors[2]
    assert up == pytest.approx(2.0, abs=max(5.0 * moved[0].u[2], 0.5))
    assert "the feed arm" in moved[0].record


def test_a_zero_of_30_mm_is_named_though_whole_cycles_move_with_it(few_01):
    """Beyond a quarter wavelength of 50 mm each shot's nearest cycle is another one; the search leaves the zero out."""
    zp = few_01.mirror_of("ZY105").zp
    found = reduce_epoch(with_record(few_01, "mirrors", zp, d0_mm=few_01.mirrors[zp].d0_mm + 30.0))
    (contradiction,) = found.coordinates.contradictions
    assert contradiction.named is not None
    assert (contradiction.named.group, contradiction.named.of) == (RecordGroup.ZEROS, "ZY105")
    assert contradiction.named.errors[0] == pytest.approx(30.0, abs=0.5)
    assert found.verdict.word == "doubtful"
    assert found.verdict.why.startswith("ZY105's zero is not the sheet's: its ranges imply -29.9")


def test_four_lies_at_once_are_four_contradictions(night_01, reduced_night_01):
    first, *others = night_01.benchmarks
    longer = first.model_copy(update={"certified_distance_mm": first.certified_distance_mm + 1.0})
    taller = {n: t.model_copy(update={"h_corr_mm": t.h_corr_mm + 0.3}) for n, t in night_01.triplets.items()}
    campaign = replace(night_01, benchmarks=(longer, *others), triplets=taller)
    zp = night_01.mirror_of("ZY108").zp
    campaign = with_record(campaign, "mirrors", zp, d0_mm=night_01.mirrors[zp].d0_mm + 1.0)
    campaign = with_record(campaign, "monuments", "ZY103", x_mm=night_01.monuments["ZY103"].x_mm + 1.0)
    found = adjusted(campaign, reduced_night_01)
    explained = [{(e.group, e.of) for e in c.explanations} for c in found.contradictions]
    assert len(explained) == 4
    for lie in (
        (RecordGroup.BENCHMARKS, "ZY102 ZBM01"),
        (RecordGroup.ZEROS, "ZY108"),
        (RecordGroup.MONUMENTS, "ZY103"),
        (RecordGroup.TRIPLETS, ""),
    ):
        assert sum(lie in owners for owners in explained) == 1
    arm = [found.index(f"ZY{k}") for k in range(113, 119)]
    before = [reduced_night_01.coordinates.index(f"ZY{k}") for k in range(113, 119)]
    moved = found.x[arm] - reduced_night_01.coordinates.x[before]
    assert np.abs(moved).max() < 0.3e-3
    assert np.all(np.abs(moved) < 2.0 * found.u[arm])
