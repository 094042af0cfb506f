"""One range and its budget: against the reduction's own chain, against changed records, against closed forms."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import t as student

from catseye.constants import MILLIMETRE, PPM, TWO_PI
from catseye.errors import EstimationError, InputError
from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.quality.propagation import agrees
from catseye.optics.retroreflector.prism import oblique_change
from catseye.records.night.campaign import REFERENCE
from catseye.records.night.path_temperature import PathTemperatureTable
from catseye.reduction.budget.chain import measurement
from catseye.reduction.budget.explanation import _cycles, _places, budget_of, explain_shot, scatter_of
from catseye.reduction.budget.inputs import items_of
from catseye.reduction.budget.scene import Assumptions, scene_of, walk_of
from catseye.reduction.epoch.ranges import follow_electronics, measure_phases
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.settling import iterate_adjustment
from catseye.reduction.epoch.shots import shot_group
from catseye.reduction.epoch.unknowns import build_network
from catseye.signal.detection.buffers import inspect_buffers
from catseye.signal.detection.cycle_scatter import _turned
from few_scene import with_few_targets

PRISM, BALL, HOLLOW, GROUND = 3, 700, 2, 700  # shots of night-01; 2 is between two feed-arm rangers


def numerical_sensitivity(model, inputs):
    """Derivatives by central differences of one and half a standard uncertainty, extrapolated (JCGM 100, 5.1.3)."""
    x = np.array([i.value for i in inputs])
    step = np.array([i.u or 1e-6 * abs(i.value) or 1e-9 for i in inputs])
    offsets = np.concatenate([scale * np.diag(step) for scale in (1.0, -1.0, 0.5, -0.5)])
    high, low, half_high, half_low = model(x + offsets).reshape(4, len(x))
    return (4.0 * (half_high - half_low) / step - 0.5 * (high - low) / step) / 3.0


def changed(campaign, ranger, **values):
    """The campaign with other values in one ranger's mirror sheet."""
    mirror = campaign.mirror_of(ranger)
    return dataclasses.replace(campaign, mirrors=campaign.mirrors | {mirror.zp: mirror.model_copy(update=values)})


def with_site(campaign, part, **values):
    site = campaign.site
    return dataclasses.replace(
        campaign, site=site.model_copy(update={part: getattr(site, part).model_copy(update=values)})
    )


def with_weather(campaign, station=None, **shifts):
    """The campaign with readings of one station, or all, shifted."""
    weather = campaign.weather
    mine = np.array([station in (None, s) for s in weather.station])
    moved = {key: getattr(weather, key) + mine * shift for key, shift in shifts.items()}
    return dataclasses.replace(campaign, weather=dataclasses.replace(weather, **moved))


@pytest.fixture(scope="module")
def phases_of(night_01, planted, reduced_night_01):
    """Function (campaign, settings) -> phases; those of the two campaigns that most sights are in are measured once."""
    known = ((night_01, reduced_night_01.phases), (planted, measure_phases(planted, ReductionSettings())))

    def phases(campaign, settings):
        usual = [p for c, p in known if c is campaign and settings == ReductionSettings()]
        return usual[0] if usual else measure_phases(campaign, settings)

    return phases


@pytest.fixture(scope="module")
def sight(reduced_night_01, phases_of):
    """Function (campaign, shot, **phasors) -> scene, ends of the path as night-01's adjustment has them."""
    coordinates = reduced_night_01.coordinates

    def scene(campaign, shot, *, phases=None, settings=None, assumptions=None, place=None):
        row = int(np.flatnonzero(campaign.shots.shot == shot)[0])
        settings = settings or ReductionSettings()
        phases = phases or phases_of(campaign, settings)
        names = campaign.shots.ranger[row], campaign.shots.target[row]
        ends = tuple(coordinates.x[coordinates.index(name)] for name in names)
        return scene_of(
            campaign,
            phases,
            follow_electronics(campaign, phases)[1],
            row=row,
            ends=ends,
            place=place or coordinates.places[names[1]],
            settings=settings,
            assumptions=assumptions,
        )

    return scene


@pytest.fixture(scope="module")
def planted(night_01):
    """Night-01 with every effect of the head in the sheets of a ground ranger."""
    return changed(
        night_01,
        "ZY104",
        axis_offset_mm=0.31,
        mirror_offset_mm=-0.22,
        beam_x_mm=0.4,
        beam_y_mm=-0.3,
        u_axis_mm=0.02,
        amplitude_to_phase_rad=0.004,
        u_amplitude_to_phase_rad=0.0008,
        cyclic_cosine_mm=(0.03, -0.01),
        cyclic_sine_mm=(-0.02, 0.015),
        u_cyclic_mm=0.004,
        second_pass_cosine_per_volt=4e-4,
        second_pass_sine_per_volt=-3e-4,
        u_second_pass_per_volt=1e-4,
        u_feedback_rad=1.5e-3,
        detector_radius_mm=0.1,
        detector_lag_rad=0.02,
        image_offset_um=15.0,
        u_image_um=8.0,
    )


def slope_of(items, key):
    return next(item.slope for item in items if item.key == key)


def test_every_range_is_the_one_that_the_adjustment_starts_from(night_01, reduced_night_01):
    """By `shot_group`, a chain of its own, with all unknowns as the records have them: zeros, air, normals, leakage."""
    r = reduced_night_01
    network = build_network(night_01, r.phases, r.electronics, settings=r.settings)
    x = np.array(network.layout.start)
    for row, name in enumerate(r.coordinates.points):
        x[network.layout.columns(name)] = r.coordinates.x[row]
    count = 0
    for name in ("ZY104", "ZY116"):
        group, _ = shot_group(network, name, x)
        distance = (group.observed - group.offset) / group.scale
        for row, expected in list(zip(r.electronics[name].shots, distance, strict=True))[::5]:
            found = explain_shot(night_01, int(night_01.shots.shot[row]), reduction=r)
            assert found.budget.value == pytest.approx(expected, abs=1e-9)
            count += 1
    assert count > 10


@pytest.mark.parametrize("shot", [PRISM, BALL, HOLLOW])
def test_the_chain_of_the_monte_carlo_gives_the_range_at_the_best_values(night_01, sight, shot):
    scene = sight(night_01, shot)
    items = items_of(scene)
    best = np.array([[item.given.value for item in items]])
    assert measurement(scene, items)(best)[0] == pytest.approx(scene.range_, abs=1e-9)


@pytest.mark.parametrize("shot", [PRISM, BALL, HOLLOW, 455])
@pytest.mark.parametrize("heads", ["plain", "planted"])
def test_every_slope_worked_out_by_hand_is_the_derivative_of_the_chain(night_01, planted, sight, shot, heads):
    scene = sight(night_01 if heads == "plain" else planted, shot)
    items = items_of(scene)
    slopes = numerical_sensitivity(measurement(scene, items), [item.given for item in items])
    for item, numerical in zip(items, slopes, strict=True):
        off = abs(item.slope - numerical) * item.given.u
        assert off < 2e-9, f"{item.key}: {item.slope} by hand, {numerical} by differences"  # of some 50 um altogether


def weather_change(key):
    return lambda c, step: with_weather(c, **{key: step})


def mirror_change(ranger, key):
    return lambda c, step: changed(c, ranger, **{key: getattr(c.mirror_of(ranger), key) + step})


def cyclic_change(ranger, kind, order):
    def change(c, step):
        values = list(getattr(c.mirror_of(ranger), f"cyclic_{kind}_mm"))
        values[order - 1] += step
        return changed(c, ranger, **{f"cyclic_{kind}_mm": tuple(values)})

    return change


def leakage_change(ranger, unit):
    def change(c, step):
        mirror = c.mirror_of(ranger)
        moved = mirror.leakage_amplitude_volt * np.exp(1j * mirror.leakage_phase_rad) + unit * step
        return changed(c, ranger, leakage_amplitude_volt=abs(moved), leakage_phase_rad=float(np.angle(moved)))

    return change


@pytest.mark.parametrize(
    ("key", "change", "step", "sign"),
    [
        ("d0", mirror_change("ZY104", "d0_mm"), 0.5, 1),
        ("leakage real", leakage_change("ZY104", 1.0), 1e-3, 1),
        ("leakage imaginary", leakage_change("ZY104", 1.0j), 1e-3, 1),
        ("coupling", mirror_change("ZY104", "amplitude_to_phase_rad"), 2e-3, 1),
        ("second pass cosine", mirror_change("ZY104", "second_pass_cosine_per_volt"), 1e-4, 1),
        ("second pass sine", mirror_change("ZY104", "second_pass_sine_per_volt"), 1e-4, 1),
        ("axes axis offset", mirror_change("ZY104", "axis_offset_mm"), 0.05, 1),
        ("axes mirror offset", mirror_change("ZY104", "mirror_offset_mm"), 0.05, 1),
        ("cyclic cosine 1", cyclic_change("ZY104", "cosine", 1), 0.02, 1),
        ("cyclic sine 2", cyclic_change("ZY104", "sine", 2), 0.02, 1),
        ("pressure", weather_change("pressure_hpa"), 1.0, 1),
        ("humidity", weather_change("humidity_percent"), 5.0, 1),
        ("thermometer WX1", lambda c, s: with_weather(c, "WX1", temperature_c=s), 0.5, -1),
        ("thermometer WX2", lambda c, s: with_weather(c, "WX2", temperature_c=s), 0.5, -1),
    ],
)
def test_a_changed_record_moves_the_range_by_its_slope(planted, sight, key, change, step, sign):
    """Samples to metres by the reduction's functions, the record changed; a reading raised is an offset raised.

    A thermometer's reading raised by its offset leaves the true air alone, so here, where the offset is taken as zero,
    the range moves against the slope.
    """
    before, after = sight(planted, GROUND), sight(change(planted, step), GROUND)
    slope = slope_of(items_of(before), key)
    assert after.cycles == before.cycles
    expected = sign * slope * step
    assert after.range_ - before.range_ == pytest.approx(expected, rel=0.02, abs=2e-8)
    assert abs(expected) > 1e-7


def test_a_raised_frequency_shortens_the_range_in_proportion(planted, sight):
    scene = sight(planted, GROUND)
    f = planted.site.ranging.modulation_hz
    after = sight(with_site(planted, "ranging", modulation_hz=f * (1 + 1e-6)), GROUND)
    moved = slope_of(items_of(scene), "frequency") * f * 1e-6
    assert after.range_ - scene.range_ == pytest.approx(moved, rel=1e-3)
    assert moved == pytest.approx(-1e-6 * (scene.range_ - scene.glass - 0.18), rel=1e-3)


def test_a_thermometer_that_reads_too_high_makes_the_range_long_by_a_ppm_a_degree(night_01, sight):
    """Too high a reading means air truly colder, denser, slower: the true distance is shorter than computed."""
    scene = sight(night_01, GROUND)
    both = sum(slope_of(items_of(scene), f"thermometer {s}") for s in ("WX1", "WX2"))
    assert both == pytest.approx(-0.92 * PPM * scene.range_, rel=0.05)  # dn/dt of the notes' formula at 12 C, 928 hPa


def test_the_glass_moves_the_range_as_two_exact_evaluations_differ(night_01, sight):
    """Glass path n h cos r and the reference point's own depth, both written out once more, in millimetres."""
    scene = sight(night_01, 455)
    place, n = scene.place, night_01.site.ranging.bk7_to_air_group_index_ratio
    items, h, i = items_of(scene), place.height * 1e3, scene.incidence
    depth = h / n

    def correction(h, n, i):
        return depth * np.cos(i) - h * np.sqrt(n**2 - np.sin(i) ** 2)

    assert correction(h, n, i) * MILLIMETRE == pytest.approx(scene.glass + scene.obliquity, abs=1e-7)  # sheet's digits
    step = 1e-3
    for key, moved in (
        ("height", correction(h + step, n, i) - correction(h - step, n, i)),
        ("ratio", correction(h, n + step, i) - correction(h, n - step, i)),
        ("incidence", correction(h, n, i + np.radians(step)) - correction(h, n, i - np.radians(step))),
    ):
        slope = slope_of(items, key) / MILLIMETRE
        assert slope == pytest.approx(moved / (2 * step), rel=2e-4, abs=1e-8), key


def test_a_balls_glass_is_its_two_radii_and_the_index(night_01, sight):
    items = items_of(sight(night_01, BALL))
    given = {item.key: item.given for item in items}
    n, r1, r2 = given["ratio"].value, given["r1"].value, given["r2"].value
    slopes = [slope_of(items, key) / MILLIMETRE for key in ("r1", "r2", "ratio")]
    assert slopes == pytest.approx([-(n - 1.0), -n, -(r1 + r2)])  # Pc = -(n (r1 + r2) - r1)
    assert sum(item.unit == "°" for item in items) == 0  # a ball looks the same from everywhere


def test_the_walk_between_two_references_is_a_parabola(night_01, sight, part):
    """With one reference before and one after: q a b / (a + b), a Brownian bridge; their noise moves it by 2 %."""
    full = sight(night_01, PRISM)
    shots = night_01.shots
    rows = [int(k) for k in full.references.shots[np.argsort(np.abs(full.references.seconds - full.seconds))[:2]]]
    keep = np.array([t != REFERENCE or k in rows for k, t in enumerate(shots.target)])
    scene = sight(part(night_01, keep), PRISM)
    assert len(scene.references.shots) == 2
    a, b = np.sort(np.abs(scene.references.seconds - scene.seconds))
    noiseless = walk_of(night_01) * np.sqrt(a * b / (a + b))
    assert scene.references.u_walk == pytest.approx(noiseless, rel=0.05)
    assert scene.references.weight.sum() == pytest.approx(1.0, abs=1e-9)
    assert scene.references.weight[0] == pytest.approx(b / (a + b), abs=0.05)


def test_a_shot_before_any_reference_pays_for_the_whole_walk(night_01, sight, part):
    shots = night_01.shots
    references = [k for k, t in enumerate(shots.target) if t == REFERENCE and shots.ranger[k] == "ZY116"]
    late = np.array([t != REFERENCE or k == references[-1] for k, t in enumerate(shots.target)])
    scene = sight(part(night_01, late), PRISM)
    ahead = scene.references.seconds.min() - scene.seconds
    assert ahead > 500.0
    assert scene.references.u_walk == pytest.approx(walk_of(night_01) * np.sqrt(ahead), rel=0.02)
    assert scene.references.u_walk > 3.0 * sight(night_01, PRISM).references.u_walk


def test_noise_and_converter_steps_add_up_to_the_samples_scatter(night_01, sight):
    scene = sight(night_01, PRISM)
    given = {item.key: item.given for item in items_of(scene)}
    together = np.hypot(given["noise"].u, given["steps"].u)
    assert together == pytest.approx(scene.u_across / abs(scene.phasor), rel=1e-12)
    code = 10.0 / 2**15
    assert given["steps"].u * abs(scene.phasor) == pytest.approx(code / np.sqrt(12) * np.sqrt(2 / 8192), rel=1e-12)


def test_without_noise_the_converters_steps_do_not_average_from_cycle_to_cycle(night_01, sight, reduced_night_01):
    phases = reduced_night_01.phases
    quiet = dataclasses.replace(phases, u_phasor=0.0 * phases.u_phasor, u_across=0.0 * phases.u_across)
    scene = sight(night_01, PRISM, phases=quiet)
    given = {item.key: item.given for item in items_of(scene)}
    assert given["noise"].u == 0.0
    assert given["steps"].u * abs(scene.phasor) == pytest.approx(10.0 / 2**15 / np.sqrt(12) * np.sqrt(2 / 64))


def test_two_cycles_have_an_interval_but_no_standard_uncertainty_by_draws(night_01, sight, part):
    """Two degrees of freedom: a t distribution without a variance; its interval is its own."""
    short = part(night_01, np.arange(len(night_01.shots)), cycles=np.full(len(night_01.shots), 2))
    scene = sight(short, PRISM)
    items = items_of(scene)
    budget, scattered = budget_of(scene, items), scatter_of(scene, items, 50_000, seed=1)
    assert next(i for i in items if i.key == "noise").given.degrees_of_freedom == 2.0
    assert budget.degrees_of_freedom < 6.0
    assert np.isnan(scattered.u)
    noise = abs(budget.contribution[0])
    assert scattered.high - budget.value == pytest.approx(noise * student.ppf(0.975, 2.0), rel=0.15)
    assert not agrees(budget, scattered, digits=1)


def test_shares_sum_to_one_and_u_is_the_root_of_the_sum_of_squares(night_01, reduced_night_01):
    for shot in (PRISM, BALL, HOLLOW, 94):
        budget = explain_shot(night_01, shot, reduction=reduced_night_01).budget
        assert budget.share.sum() == pytest.approx(1.0, abs=1e-12)
        assert budget.u == pytest.approx(float(np.sqrt(np.sum(budget.contribution**2))), rel=1e-12)
        assert 1.95 < budget.coverage_factor < 1.98


def test_thermometers_that_err_alike_count_more(night_01, sight):
    alike = sight(night_01, GROUND, assumptions=Assumptions(thermometer_correlation=0.9))
    apart = sight(night_01, GROUND)
    found, plain = (budget_of(s, items_of(s)) for s in (alike, apart))
    items = items_of(apart)
    one, two = (plain.contribution[[i.key for i in items].index(f"thermometer {s}")] for s in ("WX1", "WX2"))
    assert found.u**2 - plain.u**2 == pytest.approx(2.0 * 0.9 * one * two, rel=1e-9)
    assert found.share.sum() == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(("shot", "status"), [(1, "reference"), (19, "blocked"), (94, "reflected"), (PRISM, "used")])
def test_a_shots_status_is_the_reductions(night_01, reduced_night_01, shot, status):
    found = explain_shot(night_01, shot, reduction=reduced_night_01)
    row = int(np.flatnonzero(night_01.shots.shot == shot)[0])
    assert (found.status, reduced_night_01.status[row]) == (status, status)
    assert found.reason == reduced_night_01.rejected.get(shot)
    assert abs(found.phasor) == pytest.approx(reduced_night_01.phases.amplitude[row])
    assert (found.budget is None) == (status in ("reference", "blocked"))


def test_the_adjustments_result_is_reported_too(night_01, reduced_night_01):
    coordinates = reduced_night_01.coordinates
    found = explain_shot(night_01, PRISM, reduction=reduced_night_01)
    a, b = (coordinates.x[coordinates.index(name)] for name in (found.ranger, found.target))
    assert found.adjusted.distance == pytest.approx(np.linalg.norm(b - a))
    assert found.adjusted.range_ - found.adjusted.residual == pytest.approx(found.adjusted.distance, abs=1e-12)
    direction = (b - a) / np.linalg.norm(b - a)
    block = coordinates.block([found.ranger, found.target])
    u = direction @ (block[:3, :3] + block[3:, 3:] - block[:3, 3:] - block[3:, :3]) @ direction
    assert found.adjusted.u_distance == pytest.approx(np.sqrt(u))


def test_before_and_after_the_adjustment_differ_as_the_budget_allows(night_01, reduced_night_01):
    """636 used shots: the adjusted distance lies within five u of each range, and the usual one within one."""
    used = [int(s) for s, status in zip(night_01.shots.shot, reduced_night_01.status, strict=True) if status == "used"]
    off = []
    for shot in used[::25]:
        found = explain_shot(night_01, shot, reduction=reduced_night_01)
        off.append((found.budget.value - found.adjusted.distance) / found.budget.u)
    assert np.max(np.abs(off)) < 5.0
    assert np.median(np.abs(off)) < 1.0


def test_whole_cycles_are_decided_by_the_other_shots_or_by_the_records(night_01, reduced_night_01):
    found = explain_shot(night_01, PRISM, reduction=reduced_night_01)
    assert found.coarse.startswith("the adjusted points")
    assert int(found.cycles.cycles) == found.scene.cycles
    assert float(found.cycles.u) < 0.2e-3
    typed, source = _cycles(found.scene, None, found.items)
    assert source == "the records' places"
    assert int(typed.cycles) == found.scene.cycles
    assert float(typed.u) == pytest.approx(np.sqrt(2.0) * 0.010, rel=0.01)  # feed-arm ranger and prism, 10 mm each
    # The places agree with the phase here, so both neighbours are 99.9 mm off: 7 u.
    assert float(typed.slip_probability) == pytest.approx(2.0 * np.exp(-0.5 * (0.09993 / 0.01414) ** 2), rel=0.2)
    ground = explain_shot(night_01, BALL, reduction=reduced_night_01)
    assert float(_cycles(ground.scene, None, ground.items)[0].u) == pytest.approx(0.010, rel=0.01)


def test_the_coarse_length_is_that_of_an_adjustment_without_the_shot(night_01, reduced_night_01):
    """Shot 120, half of whose residual hides in points, air and the telescope's expansion: adjusted without it."""
    found = explain_shot(night_01, 120, reduction=reduced_night_01)
    r = reduced_night_01
    network = build_network(night_01, r.phases, r.electronics, settings=r.settings)
    _, solution, shots = iterate_adjustment(network.with_strength(r.coordinates.strength), {})
    active = [fit.active.copy() for fit in solution.fits]
    row = int(np.flatnonzero(night_01.shots.shot == 120)[0])
    number = network.rangers.index(found.ranger)
    at = int(np.flatnonzero(network.electronics[found.ranger].shots == row)[0])
    active[number][at] = False
    groups = [*(group for group, _ in shots), *network.with_strength(r.coordinates.strength).priors]
    without = adjust(solution.x, groups, free=np.array(network.layout.free), active=active)
    predicted_less_seen = -without.fits[number].residual[at] / (1.0 + shots[number][1].refractivity[at])
    assert abs(predicted_less_seen) > 1.5 * abs(found.adjusted.residual)
    # a tenth: a residual over its redundancy is that but for the electronics that the shot shares with others
    assert float(found.cycles.misfit) == pytest.approx(predicted_less_seen, rel=0.1)
    expected = found.adjusted.u_range / np.sqrt(found.adjusted.redundancy)
    assert float(found.cycles.u) == pytest.approx(expected, rel=0.05)


def test_a_rejected_shot_keeps_its_misfit_as_margin(night_01, reduced_night_01):
    found = explain_shot(night_01, 94, reduction=reduced_night_01)
    quarter = 0.5 * found.scene.half
    assert float(found.cycles.margin) == pytest.approx(quarter - abs(found.adjusted.residual), rel=1e-3)


def test_a_shot_that_does_not_exist_is_refused_with_the_range_of_ids(night_01, reduced_night_01):
    with pytest.raises(InputError, match=r"shot 9999 is not in shots.csv \(expected 1 to 759"):
        explain_shot(night_01, 9999, reduction=reduced_night_01)


def test_a_campaign_that_cannot_be_adjusted_still_explains_its_shots(night_01, part):
    """No ranger has a reference but one, whose single shot has no partner: nothing to adjust but the shot's budget."""
    shots = night_01.shots
    row = int(np.flatnonzero(shots.shot == PRISM)[0])
    none = explain_shot(part(night_01, [row]), PRISM)
    assert none.status == "no reference"
    assert none.budget is None
    assert "cannot be adjusted" in none.notes[0]


def test_without_an_adjustment_the_records_places_decide_the_cycles(night_01, reduced_night_01, monkeypatch):
    def refuse(*arguments):
        raise EstimationError("no answer today")

    monkeypatch.setattr("catseye.reduction.budget.explanation.reduce_epoch", refuse)
    found = explain_shot(night_01, BALL)
    assert (found.status, found.reason, found.adjusted) == ("not adjusted", None, None)
    assert found.coarse == "the records' places"
    assert found.notes[0] == "the campaign cannot be adjusted: no answer today"
    settled = explain_shot(night_01, BALL, reduction=reduced_night_01)
    assert int(found.cycles.cycles) == int(settled.cycles.cycles)
    assert found.budget.value == pytest.approx(settled.budget.value, abs=1e-6)  # air and incidence along 20 mm off
    assert explain_shot(night_01, 19).status == "blocked"
    assert explain_shot(night_01, 1).status == "reference"


def test_a_point_that_was_not_adjusted_is_where_the_records_put_it(night_01, reduced_night_01):
    """Such as one whose whole cycles nothing resolves: it has shots, but no coordinates."""
    row = int(np.flatnonzero(night_01.shots.shot == BALL)[0])
    none = dataclasses.replace(reduced_night_01.coordinates, points=())
    (_, typed), place = _places(night_01, row, dataclasses.replace(reduced_night_01, coordinates=none))
    (_, adjusted), _ = _places(night_01, row, reduced_night_01)
    assert np.array_equal(typed, place.start)
    assert 0.0 < np.linalg.norm(typed - adjusted) < 0.05


def test_a_face_that_looks_away_has_no_range(night_01, reduced_night_01, sight):
    place = reduced_night_01.coordinates.places[night_01.shots.target[PRISM - 1]]
    with pytest.raises(InputError, match="looks away"):
        sight(night_01, PRISM, place=dataclasses.replace(place, axis=-place.axis))


def test_a_radian_is_half_a_wavelength_over_two_pi(night_01, sight):
    scene = sight(night_01, PRISM)
    slope = slope_of(items_of(scene), "noise")
    assert slope == pytest.approx(-0.0999305 / 1.00025 * 1.00025 / TWO_PI, rel=3e-4)  # phase falls, distance grows
    assert slope_of(items_of(scene), "walk") == -slope


def test_the_degrees_of_freedom_are_those_of_the_uncertainty_that_is_claimed(night_01, sight):
    """A weak return whose leakage turns along and across: noise slow across the light, not across the raw phasor."""
    mirror = night_01.mirror_of("ZY116")
    leakage = mirror.leakage_amplitude_volt * np.exp(1j * mirror.leakage_phase_rad)
    code, length = 10.0 / 2**15, 8192
    row = int(np.flatnonzero(night_01.shots.shot == PRISM)[0])
    rng = np.random.default_rng(1)
    told = set()
    for phase in np.arange(0.0, TWO_PI, 0.39):
        turn = np.exp(1j * phase)
        slow = np.repeat(rng.normal(size=8), length // 8) * 0.0012
        wave = (0.04 * turn + leakage + 1j * turn * slow) * np.exp(-1j * TWO_PI * np.arange(length) / 64)
        frames = np.array(night_01.frames)
        frames[night_01.shots.frame[row]] = np.rint((wave.real + rng.normal(0.0, 0.035, length)) / code)
        campaign = dataclasses.replace(night_01, frames=frames)
        scene = sight(campaign, PRISM)
        degrees = next(i for i in items_of(scene) if i.key == "noise").given.degrees_of_freedom
        seen = inspect_buffers(frames[night_01.shots.frame[[row]]], 64, code).detection.scatter
        white = np.sqrt(_turned(seen.total, np.array([scene.phasor]))[0, 1] / (127 * 128))
        assert (degrees == 127.0) == (scene.u_across == pytest.approx(white, rel=1e-9))
        told.add(degrees)
    assert told == {7.0, 127.0}


def test_effects_missing_in_the_sheet_are_named(night_01, reduced_night_01):
    (note,) = explain_shot(night_01, PRISM, reduction=reduced_night_01, draws=0).notes
    assert note.startswith("not in this budget")
    assert "cyclic terms" in note
    sheet = night_01.mirror_of("ZY116")
    keys = {"u_cyclic_mm": 0.01, "u_amplitude_to_phase_rad": 0.001, "u_second_pass_per_volt": 1e-4}
    said = sheet.model_copy(
        update={**keys, "u_feedback_rad": 1e-3, "detector_radius_mm": 0.1, "detector_lag_rad": 0.01, "u_image_um": 5.0}
    )
    told = dataclasses.replace(night_01, mirrors={**night_01.mirrors, sheet.zp: said})
    told = with_few_targets(told, "DP026")  # that of the shot among them
    assert explain_shot(told, PRISM, draws=0).notes == ()


def sounded(campaign, shot, temperature_c=13.0, u=0.2):
    """The campaign with the temperature of one shot's line by sound."""
    row = list(campaign.shots.shot).index(shot)
    when = np.array([campaign.shots.mjd_utc[row]])
    names = ((campaign.shots.ranger[row],), (campaign.shots.target[row],))
    return dataclasses.replace(
        campaign, path_temperatures=PathTemperatureTable(when, *names, np.array([temperature_c]), np.array([u]))
    )


@pytest.mark.parametrize("shot", [PRISM, HOLLOW])
def test_sound_temperature_replaces_the_thermometers_uncertainty(night_01, sight, shot):
    plain, scene = sight(night_01, shot), sight(sounded(night_01, shot), shot)
    items = items_of(scene)
    slopes = numerical_sensitivity(measurement(scene, items), [item.given for item in items])
    for item, numerical in zip(items, slopes, strict=True):
        off = abs(item.slope - numerical) * item.given.u
        assert off < 2e-9, f"{item.key}: {item.slope} by hand, {numerical} by differences"
    best = np.array([[item.given.value for item in items]])
    assert measurement(scene, items)(best)[0] == pytest.approx(scene.range_, abs=1e-9)
    # what sound reads too warm is taken off the range, 0.9 ppm a degree; thermometers are left with the vapour's part
    assert slope_of(items, "sound") / scene.length == pytest.approx(-0.89e-6, abs=0.03e-6)
    before = sum(slope_of(items_of(plain), item.key) for item in items if item.key.startswith("thermometer "))
    after = sum(item.slope for item in items if item.key.startswith("thermometer "))
    assert abs(after) < 0.06 * abs(before)
    assert "sound" not in {item.key for item in items_of(plain)}


def bent(campaign):
    """The campaign whose prisms bend light by the phase index, as it is."""
    return with_site(campaign, "ranging", bk7_to_air_phase_index_ratio=1.510811)


def test_a_campaign_that_gives_the_phase_index_is_reduced_with_two_indices(night_01, reduced_night_01, sight):
    r, campaign = reduced_night_01, bent(night_01)
    network = build_network(campaign, r.phases, r.electronics, settings=r.settings)
    x = np.array(network.layout.start)
    for row, name in enumerate(r.coordinates.points):
        x[network.layout.columns(name)] = r.coordinates.x[row]
    group, parts = shot_group(network, "ZY116", x)
    ratio = night_01.site.ranging.bk7_to_air_group_index_ratio
    for row, k in enumerate(r.electronics["ZY116"].shots):
        place = network.places[night_01.shots.target[k]]
        if place.normal is not None:
            incidence = float(parts.incidence[row])
            expected = oblique_change(place.height, incidence, group=ratio, phase=1.510811)
            assert parts.obliquity[row] == pytest.approx(float(expected), abs=1e-15)
    distance = (group.observed - group.offset) / group.scale
    found = explain_shot(campaign, int(night_01.shots.shot[r.electronics["ZY116"].shots[0]]), reduction=r)
    assert found.budget.value == pytest.approx(distance[0], abs=1e-9)


def test_with_two_indices_every_slope_is_the_derivative_of_the_chain(night_01, sight):
    scene = sight(bent(night_01), PRISM)
    items = items_of(scene)
    best = np.array([[item.given.value for item in items]])
    assert measurement(scene, items)(best)[0] == pytest.approx(scene.range_, abs=1e-9)
    slopes = numerical_sensitivity(measurement(scene, items), [item.given for item in items])
    for item, numerical in zip(items, slopes, strict=True):
        off = abs(item.slope - numerical) * item.given.u
        assert off < 2e-9, f"{item.key}: {item.slope} by hand, {numerical} by differences"
    assert abs(scene.range_ - sight(night_01, PRISM).range_) < 1e-6  # and it is not the same
    assert scene.range_ != sight(night_01, PRISM).range_
