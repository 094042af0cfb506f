"""Lines, not repeats, check each other; what nothing checks is listed, what was not measured is no result."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from catseye.estimation.least_squares.adjustment import adjust
from catseye.reduction.epoch.coordinates import settled_network
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.lines.line_tests import line_tests
from catseye.reduction.epoch.surface import fit_surface, surface_notes
from few_scene import with_shots


def without_lines(campaign, target, *rangers):
    """The campaign without the shots of some rangers on a target."""
    pairs = zip(campaign.shots.ranger, campaign.shots.target, strict=True)
    return with_shots(campaign, [not (t == target and r in rangers) for r, t in pairs])


def rangers_of(reduction, target):
    """Rangers of the used shots on a target."""
    ranges = reduction.coordinates.ranges
    rows = zip(ranges.ranger, ranges.target, ranges.used, strict=True)
    return sorted({ranger for ranger, name, used in rows if used and name == target})


def test_benchmarks_with_a_second_line_and_a_ranger_in_one_plane_are_unchecked_in_night_01(reduced_night_01):
    # the certificates are those of the other line; the ranger's lines leave one direction untested; 4 of 130 points
    coordinates = reduced_night_01.coordinates
    *marks, ranger = coordinates.unchecked
    assert marks == ["ZBM01", "ZBM03", "ZBM05"]
    assert ranger == "ZY105"
    assert coordinates.unmeasured == ()
    assert len(coordinates.lines) == len(coordinates.points)
    assert coordinates.lines[coordinates.rows(marks)].tolist() == [2, 2, 2]
    assert set(reduced_night_01.surface.names).isdisjoint(coordinates.unchecked)
    assert reduced_night_01.surface.unchecked == ()


@pytest.mark.parametrize("side", [[1.0, 0.0], [0.0, -1.0], [1.0, 1.0]])
def test_the_pose_of_half_of_a_dish_allows_for_the_other_half(reduced_night_01, side):
    """Half of night-01's prisms unchecked, against all: the vertex is up to 12 mm off, over 15 mean squares before."""
    r, whole = reduced_night_01, reduced_night_01.surface
    assert whole.missing == ()
    far = whole.fit.local[:, :2] @ np.array(side)
    hidden = tuple(np.array(whole.names)[far > np.median(far)].tolist())
    coordinates = replace(r.coordinates, unchecked=(*r.coordinates.unchecked, *hidden))
    half, _ = fit_surface(r.campaign, coordinates, u_surface=r.settings.u_surface)
    assert set(half.missing) == set(hidden)
    error = half.fit.translation - whole.fit.translation
    square = error @ np.linalg.solve(half.fit.covariance[:3, :3], error)
    assert square < chi2.isf(0.01, 3)
    deviations = half.fit.deviation - whole.fit.deviation[[whole.names.index(n) for n in half.names]]
    assert np.mean((deviations / half.u_deviation) ** 2) < chi2.isf(0.01, 3) / 3.0
    assert surface_notes(half)[0].startswith(f"surface and pose follow from {len(half.names)} of 60 prisms")


def test_a_line_moves_its_ends_by_as_much_as_a_new_adjustment_says(few_01, reduced_few_01):
    r = reduced_few_01
    (network, solution, shots), _ = settled_network(few_01, r.phases, r.electronics, settings=r.settings)
    number = network.rangers.index("ZY101")
    group, part = shots[number]
    tests = line_tests(group, part.target, solution.fits[number], solution=solution)
    k = tests.targets.index("ZAG731P")
    mine = tests.line == k
    assert mine.sum() == 2  # repeats
    groups = [g for g, _ in shots] + list(network.priors)
    groups[number] = replace(group, observed=group.observed + tests.u[k] * mine)
    active = [f.active for f in solution.fits]
    moved = adjust(solution.x, groups, free=np.array(network.layout.free), active=active).x - solution.x
    for name, expected in zip(("ZY101", "ZAG731P"), tests.moved[k], strict=True):
        # the solution to begin with has settled to a thousandth of its u
        np.testing.assert_allclose(moved[network.layout.columns(name)], expected, rtol=1e-3, atol=1e-9)
    again = adjust(solution.x, groups, free=np.array(network.layout.free), active=active)
    error = line_tests(group, part.target, again.fits[number], solution=again).error[k]
    assert error - tests.error[k] == pytest.approx(tests.u[k], rel=1e-3)  # the error that was made


def test_repeats_on_three_lines_check_nothing(few_01, reduced_few_01):
    rangers = rangers_of(reduced_few_01, "ZEG41040L")
    reduction = reduce_epoch(without_lines(few_01, "ZEG41040L", *rangers[3:]))
    coordinates = reduction.coordinates
    row = coordinates.index("ZEG41040L")
    assert (coordinates.lines[row], coordinates.shots[row]) == (3, 6)
    assert "ZEG41040L" in coordinates.unchecked
    assert "ZEG41040L" not in reduced_few_01.coordinates.unchecked


@pytest.mark.parametrize(("lines", "said"), [(3, "either may be wrong"), (9, "its typed position is")])
def test_lines_that_check_each_other_alone_accuse_a_typed_position(few_01, reduced_few_01, lines, said):
    rangers, target = rangers_of(reduced_few_01, "ZEG41040L"), few_01.targets["ZEG41040L"]
    typed = target.model_copy(update={"position_mm": tuple(np.add(target.position_mm, [0.0, 60.0, 0.0]))})
    wrong = replace(few_01, targets={**few_01.targets, "ZEG41040L": typed})
    coordinates = reduce_epoch(without_lines(wrong, "ZEG41040L", *rangers[lines:])).coordinates
    (note,) = [n for n in coordinates.notes if n.startswith("ZEG41040L: ") and "typed position" in n]
    assert said in note
    assert ("ZEG41040L" in coordinates.unchecked) == (lines == 3)


def test_an_unchecked_prism_shapes_no_surface_while_there_are_others(night_01, reduced_night_01):
    rangers = rangers_of(reduced_night_01, "DP012")
    reduction = reduce_epoch(without_lines(night_01, "DP012", *rangers[3:]))
    assert "DP012" in reduction.coordinates.unchecked
    assert set(reduced_night_01.surface.names) - set(reduction.surface.names) == {"DP012"}
    assert reduction.surface.unchecked == ()
