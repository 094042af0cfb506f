"""Errors in common: what they do to the answer, beside adjusting again; their sizes, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.atmosphere.index.air import group_refractivity
from catseye.constants import MILLIMETRE, PPM
from catseye.estimation.least_squares.adjustment import adjust
from catseye.optics.retroreflector.kinds.registry import PRISM
from catseye.reduction.epoch import coordinates
from catseye.reduction.epoch.common_errors import ALIKE_M, CommonError, _smooth, common_errors, considered, reach_of
from catseye.reduction.epoch.lines.cycles import resolve_cycles
from catseye.reduction.epoch.prior_names import BENCHMARKS, MONUMENTS, OFFSETS, TRIPLET_BALLS, ZEROS
from catseye.reduction.epoch.ranges import follow_electronics, measure_phases
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.settling import iterate_adjustment
from catseye.reduction.epoch.unknowns import build_network


@pytest.fixture(scope="module")
def settled(night_01):
    settings = ReductionSettings()
    electronics, _ = follow_electronics(night_01, phases := measure_phases(night_01, settings), settings.dense_shots)
    network = build_network(night_01, phases, electronics, settings=settings)
    found = iterate_adjustment(network, resolve_cycles(network).starts)
    # Once more with the rows as last seen: of 18 zeros' common error little is left, and that to 6 % only otherwise.
    groups = [*(group for group, _ in found.shots), *found.network.priors]
    active, free = [f.active for f in found.solution.fits], np.array(found.network.layout.free)
    return found._replace(solution=adjust(found.solution.x, groups, free=free, active=active))


def errors_of(settled, **in_common):
    network = settled.network
    site = network.campaign.site
    changed = site.model_copy(update={"in_common": site.in_common.model_copy(update=in_common)})
    network = replace(network, campaign=replace(network.campaign, site=changed))
    return {e.name: e for e in common_errors(network, settled.solution.x, [part for _, part in settled.shots])}


def moved(settled, error):
    """What all parameters move by where perfect observations get an error and are adjusted again."""
    network, solution, shots = settled
    groups, nth = [], {}
    for k, group in enumerate([*(g for g, _ in shots), *network.priors]):
        change = 0.0
        if k < len(shots) and group.name in error.shots:
            change = error.shots[group.name]
        elif k >= len(shots) and group.name in error.priors:
            change = error.priors[group.name][nth.get(group.name, 0)]
            nth[group.name] = nth.get(group.name, 0) + 1
        groups.append(replace(group, observed=group.predict(solution.x)[0] + change))
    free, active = np.array(network.layout.free), [f.active for f in solution.fits]
    return adjust(solution.x, groups, free=free, active=active).x - solution.x


@pytest.mark.parametrize(
    "name",
    [
        "D0 of one bench",
        "wavelength of ZY105",
        "certificates of one laboratory",
        "scale of the survey",
        "heights of triplets",
        "steel of the heads",
        "vapour even with height, not relative humidity",
        "air of neighbouring lines of ZY113 3",
        "glass of batch 1",
    ],
)
def test_an_error_moves_the_result_like_a_new_adjustment_with_it(settled, name):
    error = errors_of(settled, survey_scale_ppm=0.5, certificate_scale_ppm=0.1, sheets_at_c=20.0)[name]
    large = CommonError(  # beside what counts as settled; what is beyond the first order is a thousandth of it
        name,
        {r: 10.0 * d for r, d in error.shots.items()},
        {n: [10.0 * d for d in each] for n, each in error.priors.items()},
    )
    found = 0.1 * moved(settled, large)
    expected = reach_of(settled.network, settled.solution, settled.shots, [error])[:, 0]
    u = np.sqrt(settled.solution.q.diagonal())
    free = u > 0.0
    assert np.abs(expected[free] / u[free]).max() > 0.01  # it does something
    np.testing.assert_allclose(found[free] / u[free], expected[free] / u[free], atol=1e-3)


def test_the_answer_stays_and_its_covariance_takes_every_error_in(settled):
    network, solution, shots = settled
    errors = list(common_errors(network, solution.x, [part for _, part in shots]))
    wide = considered(network, solution, shots)
    assert wide.x is solution.x
    reach = reach_of(network, solution, shots, errors)
    np.testing.assert_allclose(wide.q.matrix(), solution.q.matrix() + reach @ reach.T, rtol=1e-12, atol=1e-20)
    assert {e.name for e in errors}.isdisjoint(
        {"scale of the survey", "steel of the heads", "temperature of the glass"}
    )


def test_coordinates_carry_the_wider_covariance(settled, night_01):
    alone = settled.solution.q.diagonal()
    found = coordinates.coordinates_of(settled, resolved=resolve_cycles(settled.network))
    columns = np.array([settled.network.layout.columns(n) for n in found.points])
    ratio = found.u[found.u > 0.0] / np.sqrt(alone[columns])[found.u > 0.0]
    assert np.all(ratio > 1.0)
    assert np.median(ratio) < 1.15  # of few shots they are little


def test_sizes_by_hand(settled):
    network, site = settled.network, settled.network.campaign.site
    errors = errors_of(
        settled, survey_scale_ppm=0.5, certificate_scale_ppm=0.1, sheets_at_c=20.0, glass_index_ratio=4e-4
    )
    part = next(p for _, p in settled.shots if p.name == "ZY105")
    index = 1.0 + part.refractivity
    np.testing.assert_allclose(errors["D0 of one bench"].priors[ZEROS], 7.07e-6, rtol=1e-3)  # 10 µm of all sheets
    marks = [b.certified_distance_mm * MILLIMETRE for b in network.campaign.benchmarks]
    found = np.concatenate(errors["certificates of one laboratory"].priors[BENCHMARKS])
    assert sorted(found) == pytest.approx(sorted(1e-7 * np.array(marks)))
    (survey,) = errors["scale of the survey"].priors[MONUMENTS]
    (observed,) = [p.observed for p in network.priors if p.name == MONUMENTS]
    np.testing.assert_allclose(survey, 0.5 * PPM * observed)
    heights = errors["heights of triplets"].priors[TRIPLET_BALLS]
    unit = next(iter(network.campaign.triplets.values()))
    assert np.linalg.norm(heights[0]) == pytest.approx(unit.u_h_corr_mm * MILLIMETRE)
    from_arm = next(p for _, p in settled.shots if p.name == "ZY113")
    at = next(k for k, t in enumerate(from_arm.target) if network.places[t].kind is PRISM)
    glass = errors["group index of the glass"].shots["ZY113"]
    assert glass[at] == pytest.approx(4e-4 * network.places[from_arm.target[at]].height)
    # the night is some 11 °C: steel of 180.6 mm is 9 K * 12e-6 shorter than at 20 °C
    steel = errors["steel of the heads"]
    d0 = network.campaign.mirror_of("ZY105").d0_mm * MILLIMETRE
    warmth = network.field.smoothed(network.campaign.shots.mjd_utc[part.electronics.shots])[:, :, 0].mean(axis=1)
    np.testing.assert_allclose(steel.shots["ZY105"], index * d0 * 12e-6 * (warmth - 20.0))
    assert np.all(steel.shots["ZY105"] < 0.0)
    assert all(len(each) == 3 for each in steel.priors[OFFSETS])
    more = group_refractivity(11.0, 930.0, 70.0, wavelength_um=site.ranging.wavelength_um + 1e-3)
    less = group_refractivity(11.0, 930.0, 70.0, wavelength_um=site.ranging.wavelength_um)
    red = errors["wavelength of ZY105"].shots["ZY105"] / part.distance
    np.testing.assert_allclose(red, more - less, rtol=0.05)  # -0.02 ppm, a little more in colder air
    assert np.all(red < 0.0)


def test_smooth_shapes_have_the_variance_that_an_exponential_correlation_gives_them():
    rng = np.random.default_rng(3)
    ends = np.column_stack([50.0 * rng.uniform(-1, 1, 900), 50.0 * rng.uniform(-1, 1, 900), np.zeros(900)])
    shapes = _smooth(ends)
    apart = np.linalg.norm(ends[:, None] - ends, axis=2)
    alike = np.exp(-apart / ALIKE_M)
    np.fill_diagonal(alike, 0.0)  # what a line has by itself is there already
    basis = shapes / np.sqrt(np.sum(shapes**2, axis=0))
    variance = np.sum(shapes**2, axis=0)
    # of a shape over points whose correlation is known: u'Cu; at an edge half of a point's neighbours are missing
    expected = np.array([u @ alike @ u for u in basis.T])
    assert np.all((0.6 * variance < expected) & (expected < variance))
    assert shapes.shape[1] == 6


def test_lines_that_end_in_one_place_have_no_field_between_them():
    assert _smooth(np.tile([1.0, 2.0, 3.0], (8, 1)) + 0.1 * np.eye(8, 3)).shape == (8, 0)
    assert _smooth(np.array([[0.0, 0.0, 0.0], [90.0, 0.0, 0.0]])).shape == (2, 0)
