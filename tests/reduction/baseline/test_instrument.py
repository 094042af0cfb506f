"""From what an instrument shows to pillars: exact geometry on a round earth, planted faults, honest uncertainties."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from catseye.atmosphere.index.air import group_refractivity
from catseye.atmosphere.sound.velocity import EARTH_RADIUS
from catseye.errors import ArgumentError, EstimationError, InputError, ValidityError
from catseye.estimation.baseline.adjustment import BaselineNoise, adjust_baseline
from catseye.estimation.baseline.model import BaselineSights, Claim
from catseye.records.laboratory.baseline import FORMAT, Baseline, read_heights, read_observations
from catseye.reduction.baseline.instrument import calibrate_baseline, record_values
from catseye.reduction.baseline.lengths import horizontal_distance, reduce_lengths
from catseye.reduction.baseline.settings import BaselineSettings
from catseye.reduction.baseline.statistical_tests import suspects_of
from draws import draws, same_sigmas

NAMES = ("A", "B", "C", "D", "E", "F")
ALONG = np.array([0.0, 20.4, 122.4, 306.0, 448.8, 510.0])
LEFT = np.array([0.0, -0.112, -0.116, 0.131, 0.150, 0.0])
TOPS = np.array([4.563, 6.0, 4.0, 3.5, 9.0, 4.2])
INDEX = 1.000286338
EXACT = BaselineSettings(refraction=0.0, u_temperature_c=0.0, u_pressure_hpa=0.0, u_humidity_percent=0.0,
                         u_scale_ppm=0.0)  # fmt: skip


def straight(i, j, over_i=0.235, over_j=0.24):
    """The straight line between two tripods on a round earth, by vectors from its centre."""

    def place(k, over):
        arc = np.array([ALONG[k], LEFT[k]]) / (EARTH_RADIUS + TOPS[0])
        up = np.array([np.sin(arc[0]), np.sin(arc[1]), 0.0])
        up[2] = np.sqrt(1.0 - up @ up)
        return (EARTH_RADIUS + TOPS[k] + over) * up

    return float(np.linalg.norm(place(j, over_j) - place(i, over_i)))


def table(path, rng=None, *, pairs=None, repeats=3, zero=0.0, scale=0.0, shot=0.0, one=0.0, warm=0.0, tops=0.0,
          aimed=True, followed=1.0, wave=(0.0, 0.0), unit=1.5, faulty=()):  # fmt: skip
    """An OBSERVATIONS.csv as an instrument would have shown it; weather changes during the day."""
    header = "from_pillar,to_pillar,height_of_instrument,height_of_target,slope_distance,temperature,pressure,humidity"
    rows = [header + (",horizontal_direction(dd)" if aimed else "")]
    for k, (i, j) in enumerate(pairs or permutations(range(6), 2)):
        weather = (12.0 + 0.3 * k, 1018.0 + 0.1 * k, 90.0 - k)
        n = 1.0 + group_refractivity(weather[0] - warm, *weather[1:], wavelength_um=0.658, co2_ppm=420.0)
        n = 1.0 + (n - 1.0) * followed + (1.0 - followed) * 280e-6
        shown = straight(i, j) * n / INDEX * (1.0 + scale)
        phase = 2 * np.pi * shown / unit
        shown += zero + wave[0] * np.cos(phase) + wave[1] * np.sin(phase)
        shown += one * rng.standard_normal() if one else 0.0
        bearing = np.degrees(-np.arctan2(LEFT[j] - LEFT[i], ALONG[j] - ALONG[i]))
        for r in range(repeats):
            d = shown + (shot * rng.standard_normal() if shot else 0.0)
            d += dict(faulty).get((k, r), 0.0)
            rows.append(f"{NAMES[i]},{NAMES[j]},0.235,0.24,{d:.9f},{weather[0]!r},{weather[1]!r},{weather[2]!r}"
                        + (f",{bearing % 360:.8f}" if aimed else ""))  # fmt: skip
    path.write_text("\n".join(rows) + "\n")
    return read_observations(path)


@pytest.fixture
def heights(tmp_path):
    def made(u=0.0):
        path = tmp_path / "heights.csv"
        rows = [f"{n},{float(h)!r},{0.0 if k == 0 else u!r}" for k, (n, h) in enumerate(zip(NAMES, TOPS, strict=True))]
        path.write_text("\n".join(["pillar_name,pillar_rl,rl_standard_deviation", *rows]) + "\n")
        return read_heights(path)

    return made


def test_a_slope_is_reduced_like_vectors_on_a_round_earth():
    """2 km and 300 m of height: along the level surface at the reference height, by vectors from the centre."""
    arc = 2000.0 / (EARTH_RADIUS + 50.0)
    one = (EARTH_RADIUS + 120.0) * np.array([0.0, 1.0])
    other = (EARTH_RADIUS + 420.0) * np.array([np.sin(arc), np.cos(arc)])
    found = horizontal_distance(np.linalg.norm(other - one), 120.0, 420.0, reference_height=50.0)
    assert found == pytest.approx(2000.0, abs=1e-6)
    with pytest.raises(ValidityError, match="heights differ by 30 m"):
        horizontal_distance(np.array([20.0]), np.array([0.0]), np.array([30.0]))


def test_perfect_shots_give_pillars_and_zero_exactly(tmp_path, heights):
    """Off the line, off the level, through changing air: 1 um is what 9 digits and the arc's curvature leave."""
    found = calibrate_baseline(table(tmp_path / "o.csv", zero=-0.0123), heights(), settings=EXACT)
    assert found.solution.x == pytest.approx(ALONG, abs=1e-6)
    assert found.solution.y == pytest.approx(LEFT, abs=2e-5)  # 20 nm (zero² on a slope) over y/D = 0.005
    assert found.solution.of("zero")[0] == pytest.approx(-0.0123, abs=1e-7)
    assert found.test.zero == pytest.approx(-0.0123, abs=1e-6)
    assert found.test.s < 1e-6
    assert found.test.degrees_of_freedom == 30 - 6
    assert found.reference_height == TOPS[0]
    assert found.names[0] == "A"


def test_each_correction_has_its_sign(tmp_path, heights):
    found = calibrate_baseline(table(tmp_path / "o.csv"), heights(), settings=EXACT)
    way = found.lengths
    thin = way.index < INDEX
    assert thin.any()
    assert np.all(way.first[thin] > 0.0)
    assert np.all(way.first[~thin] <= 0.0)
    assert np.all(way.level[np.abs(TOPS[found.observations.start] - TOPS[found.observations.end]) > 1.0] < 0.0)
    temperature = way.systematic[:, way.effects.index("temperature")]
    assert not temperature.any()
    warm = calibrate_baseline(table(tmp_path / "o.csv"), heights(), settings=replace(EXACT, u_temperature_c=1.0))
    assert warm.lengths.systematic[:, 0] / warm.lengths.distance == pytest.approx(0.98e-6, rel=0.08)


def test_effects_of_heights_are_those_of_moved_heights(tmp_path, heights):
    """Against the distances of pillars set 1 mm higher, one after the other."""
    seen = table(tmp_path / "o.csv")
    u = heights(0.001)
    base = calibrate_baseline(seen, u, settings=EXACT).lengths
    for name in NAMES[1:]:
        moved = heights()
        moved.height[name] += 0.001
        there = calibrate_baseline(seen, moved, settings=EXACT).lengths
        effect = base.systematic[:, base.effects.index(f"height of {name}")]
        assert effect == pytest.approx(there.distance - base.distance, abs=5e-8)  # half of (1 mm)²/20 m


def test_without_directions_or_heights_the_notes_state_the_assumptions(tmp_path):
    found = calibrate_baseline(table(tmp_path / "o.csv", aimed=False), None, settings=EXACT)
    text = " ".join(found.notes)
    assert "straight line" in text
    assert "taken as level" in text
    assert "scale is not determined" in text
    assert not found.solution.y.any()
    assert found.reference_height is None


def known(found):
    return Baseline(format=FORMAT, name="known", **record_values(found))


def test_against_known_pillars_zero_and_scale_come_back(tmp_path, heights):
    best = known(calibrate_baseline(table(tmp_path / "o.csv", zero=0.001), heights(), settings=EXACT))
    seen = table(tmp_path / "p.csv", pairs=[(0, k) for k in range(1, 6)] + [(1, k) for k in (5, 4, 3, 2, 0)],
                 zero=0.0021, scale=-4.5e-6, aimed=False)  # fmt: skip
    found = calibrate_baseline(seen, heights(), best, settings=EXACT)
    assert found.solution.of("zero")[0] == pytest.approx(0.0021, abs=2e-6)
    assert found.solution.of("scale")[0] == pytest.approx(-4.5e-6, abs=1e-8)
    outcome = {d.name: d.passed for d in found.decisions}
    assert outcome["zero against the known baseline"] is False
    assert outcome["scale against the known baseline"] is False


def test_cyclic_terms_are_found_or_left_out_with_a_reason(tmp_path, heights):
    seen = table(tmp_path / "o.csv", wave=(3e-4, -4e-4))
    found = calibrate_baseline(seen, heights(), settings=replace(EXACT, unit_length=1.5))
    assert found.solution.of("cyclic cosine 1")[0] == pytest.approx(3e-4, abs=2e-6)
    assert found.solution.of("cyclic sine 1")[0] == pytest.approx(-4e-4, abs=2e-6)
    blind = calibrate_baseline(seen, heights(), settings=replace(EXACT, unit_length=1e6))
    assert blind.cyclic == ()
    assert any("do not separate them from the zero" in note for note in blind.notes)
    few = table(tmp_path / "f.csv", pairs=[(0, k) for k in range(1, 6)] + [(k, 5) for k in range(1, 5)])
    few = calibrate_baseline(few, heights(), settings=replace(EXACT, unit_length=1.5))
    assert any("3 redundant sets for 2" in note for note in few.notes)


def test_lengths_corrected_in_the_field_are_detected(tmp_path, heights):
    """The light of raw lengths follows the weather, 1; of corrected ones not, 0."""
    rng = np.random.default_rng(1)
    raw = calibrate_baseline(table(tmp_path / "o.csv", rng, one=2e-4), heights(), settings=EXACT)
    done = calibrate_baseline(table(tmp_path / "p.csv", rng, one=2e-4, followed=0.0), heights(), settings=EXACT)
    for found, share in ((raw, 1.0), (done, 0.0)):
        assert found.weather[0] == pytest.approx(share, abs=3 * found.weather[1])
        assert found.weather[1] < 0.15
        assert {d.name: d.passed for d in found.decisions}["the light follows the weather as read"] is (share == 1.0)
        assert any("which no u here includes" in note for note in found.notes) is (share == 0.0)


def test_wrong_shots_and_sets_are_named_and_rejected_only_on_request(tmp_path, heights):
    rng = np.random.default_rng(2)
    faulty = [((4, 1), 0.003)] + [((11, r), -0.004) for r in range(3)]
    seen = table(tmp_path / "o.csv", rng, shot=1e-4, one=2e-4, faulty=faulty)
    kept = calibrate_baseline(seen, heights(), settings=EXACT)
    assert {s.kind for s in kept.suspects} >= {"shot"}
    assert kept.keep.all()
    found = calibrate_baseline(seen, heights(), settings=replace(EXACT, reject=True))
    assert np.flatnonzero(~found.keep).tolist() == [3 * 4 + 1, 33, 34, 35]
    assert found.suspects == ()
    assert found.rejected[13].startswith("shot rejected")
    assert found.rejected[34].startswith("set rejected")
    assert found.test.degrees_of_freedom == 29 - 6


def test_good_data_are_accused_in_five_of_a_hundred(tmp_path, heights):
    """40 tables: no more than 6 accused (three standard deviations above 2)."""
    rng, accused = np.random.default_rng(3), 0
    tops = heights()
    for _ in range(40):
        found = calibrate_baseline(
            table(tmp_path / "o.csv", rng, shot=1e-4, one=3e-4, aimed=False), tops, settings=EXACT
        )
        accused += bool(found.suspects)
    assert accused <= 6


@draws(500, name="tables")
def test_few_good_data_are_accused_in_five_of_a_hundred(tables):
    """4 pillars, 2 redundant sets, the maker's claim as noise: three standard deviations above 5 %."""
    x, pairs = ALONG[:4], np.array([(i, j) for i in range(4) for j in range(i + 1, 4)])
    rng, accused = np.random.default_rng(6), 0
    for _ in range(tables):
        d = x[pairs[:, 1]] - x[pairs[:, 0]] + 6e-4 * rng.standard_normal(6)
        none = np.full(6, np.nan)
        s = BaselineSights(*pairs.T, np.arange(6), pairs[:, 0], d, np.ones(6), np.zeros((6, 0)), (), none, none)
        found = adjust_baseline(s, x, np.zeros(4), before=BaselineNoise(claim=Claim(3.6e-9, 3.6e-7, 0.0)))
        accused += bool(suspects_of(found, np.arange(6), 0.05))
    assert accused <= 0.05 * tables + same_sigmas(40 / 500 - 0.05, 500, tables) * tables


def test_one_redundant_set_is_enough_to_accuse(tmp_path):
    pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3)]
    faulty = [((4, r), 0.02) for r in range(3)]
    found = calibrate_baseline(table(tmp_path / "o.csv", pairs=pairs, faulty=faulty, aimed=False))
    assert found.solution.freedom_sets == 1
    assert found.suspects


def test_of_two_sets_that_contradict_each_other_neither_is_left_out(tmp_path, heights):
    """E has two sets; one is 50 mm wrong: nothing tells which."""
    pairs = [*permutations(range(4), 2), (4, 0), (4, 2)]
    rng = np.random.default_rng(3)
    seen = table(tmp_path / "o.csv", rng, pairs=pairs, shot=1e-4, one=3e-4, aimed=False,
                 faulty=[((13, r), 0.05) for r in range(3)])  # fmt: skip
    found = calibrate_baseline(seen, heights(), settings=replace(EXACT, reject=True))
    assert found.keep.all()
    assert {s.rows for s in found.suspects} == {(36, 37, 38), (39, 40, 41)}
    assert all(set(s.rows + s.twins) == set(range(36, 42)) for s in found.suspects)
    assert any("undecided which is wrong" in note for note in found.notes)


def test_a_wrong_pillar_is_refused_with_its_line(tmp_path, heights):
    text = (table(tmp_path / "o.csv", repeats=1), (tmp_path / "o.csv").read_text())[1]
    (tmp_path / "o.csv").write_text(text.replace("\nA,B,", "\nA,C,"))
    with pytest.raises(EstimationError, match=r"o.csv: shots contradict .* at line 2 first"):
        calibrate_baseline(read_observations(tmp_path / "o.csv"), heights(), settings=EXACT)


def test_second_velocity_and_chord_shorten_a_long_line(tmp_path):
    """11 km, k = 0.13: -k (1 - k) d³/12R² = -0.309 mm and -k² d³/24R² = -0.023 mm by hand; none for k = 0."""
    seen, level = table(tmp_path / "o.csv", pairs=[(0, 1)], aimed=False), np.zeros(2)
    seen.slope = seen.slope * 0.0 + 11_000.0
    settings = replace(EXACT, corrected=True)
    bent = reduce_lengths(
        seen, level, level, reference_height=0.0, settings=replace(settings, refraction=0.13)
    ).distance
    assert bent - reduce_lengths(seen, level, level, reference_height=0.0, settings=settings).distance == pytest.approx(
        -0.332e-3, abs=2e-6
    )


def test_weather_works_on_the_slope(tmp_path, heights):
    """Against the distance in air 0.1 °C warmer, on a line of 45 degrees."""
    seen, tops = table(tmp_path / "o.csv", pairs=[(0, 2)], aimed=False), np.array([0.0, 86.6])
    settings = replace(EXACT, u_temperature_c=0.1)
    base = reduce_lengths(seen, tops, np.zeros(2), reference_height=0.0, settings=settings)
    seen.temperature_c = seen.temperature_c + 0.1
    moved = reduce_lengths(seen, tops, np.zeros(2), reference_height=0.0, settings=settings)
    assert base.stretch[0] > 1.4
    assert moved.distance - base.distance == pytest.approx(base.systematic[:, 0], rel=1e-3)


def campaigns(path, tops, runs, seed):
    """Two instruments, one thermometer offset each: what is claimed for the second, and what it does."""
    rng = np.random.default_rng(seed)
    settings = replace(EXACT, u_temperature_c=1.0, u_scale_ppm=1.5)
    missed, claimed = [], []
    for _ in range(runs):
        first = table(path, rng, repeats=2, zero=0.001, scale=1.5e-6 * rng.standard_normal(), shot=1e-4, one=3e-4,
                      warm=rng.standard_normal())  # fmt: skip
        baseline = calibrate_baseline(first, tops, settings=settings)
        pairs = [(0, k) for k in range(1, 6)] + [(1, k) for k in (5, 4, 3, 2, 0)] + [(5, k) for k in range(5)]
        second = table(path, rng, pairs=pairs, repeats=2, zero=-0.002, scale=3e-6, shot=1e-4, one=3e-4,
                       warm=rng.standard_normal(), aimed=False)  # fmt: skip
        other = calibrate_baseline(second, tops, known(baseline), settings=settings)
        far = baseline.solution
        missed.append([far.x[5] - ALONG[5], far.x[1] - ALONG[1], far.of("zero")[0] - 0.001,
                       other.solution.of("zero")[0] + 0.002, other.solution.of("scale")[0] - 3e-6])  # fmt: skip
        claimed.append([far.of("x 5")[1], far.of("x 1")[1], far.of("zero")[1], other.solution.of("zero")[1],
                        other.solution.of("scale")[1]])  # fmt: skip
    missed, claimed = np.array(missed), np.sqrt(np.mean(np.square(claimed), axis=0))
    return missed, claimed


@draws(30, name="pairs")
def test_claims_match_the_scatter_of_pairs_of_campaigns(tmp_path, heights, pairs):
    """A standard deviation of 30 is known to 13 %; three of these."""
    missed, claimed = campaigns(tmp_path / "o.csv", heights(), pairs, 4)
    assert missed.std(axis=0) == pytest.approx(claimed, rel=same_sigmas(0.39, 30, pairs))
    assert np.all(np.abs(missed.mean(axis=0)) < 4 * claimed / pairs**0.5)


@pytest.mark.slow
def test_claims_match_the_scatter_of_600_pairs_of_campaigns(tmp_path, heights):
    missed, claimed = campaigns(tmp_path / "o.csv", heights(), 600, 5)
    assert missed.std(axis=0) == pytest.approx(claimed, rel=0.09)


def test_tables_that_do_not_join_are_refused_in_one_line(tmp_path, heights):
    seen = table(tmp_path / "o.csv")
    tops = heights()
    best = known(calibrate_baseline(seen, tops, settings=EXACT))
    del tops.height["C"]
    with pytest.raises(InputError, match=r"heights.csv: pillar 'C' of .*o.csv is missing"):
        calibrate_baseline(seen, tops, settings=EXACT)
    (tmp_path / "x.csv").write_text((tmp_path / "o.csv").read_text().replace("\nA,", "\nX,"))
    with pytest.raises(InputError, match=r"pillar 'X' is unknown \(expected one of A, B, C, D, E, F\)"):
        calibrate_baseline(read_observations(tmp_path / "x.csv"), None, best, settings=EXACT)
    with pytest.raises(InputError, match="reference_height_m 100 is not the known"):
        calibrate_baseline(seen, heights(), best, settings=replace(EXACT, reference_height=100.0))
    with pytest.raises(ArgumentError, match="reference_height_m needs heights"):
        calibrate_baseline(seen, None, settings=replace(EXACT, reference_height=100.0))
    tops = heights()
    tops.height["B"] = 60.0
    with pytest.raises(InputError, match=r"o.csv: line 2, heights differ by 55.4"):
        calibrate_baseline(seen, tops, settings=EXACT)
    two = table(tmp_path / "t.csv", pairs=[(0, 1), (1, 0)])
    with pytest.raises(EstimationError, match=r"do not determine x of B.*zero"):
        calibrate_baseline(two, heights(), settings=EXACT)
