"""The prism against rays traced through a solid cube corner, face by face."""

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.optics.glass import group_index, phase_index
from catseye.optics.retroreflector.prism import (
    oblique_change,
    obliquity_correction,
    obliquity_slope,
    range_constant,
    reference_depth,
)

AIR = 1.000253246815
H, N = 0.0384, 1.527077
# Three mutually perpendicular mirrors (rows: unit normals, into the glass) that meet in a corner below the face.
AROUND = 0.1 + np.array([0.0, 2.0, 4.0]) * np.pi / 3
MIRRORS = np.stack(
    [np.sqrt(2 / 3) * np.cos(AROUND), np.sqrt(2 / 3) * np.sin(AROUND), np.full(3, np.sqrt(1 / 3))], axis=1
)


def refracted(direction, normal, ratio):
    """Snell's law for vectors; `ratio` is the index before over the index behind, `normal` faces the light."""
    cosine = -direction @ normal
    return ratio * direction + (ratio * cosine - np.sqrt(1 - ratio**2 * (1 - cosine**2))) * normal


def traced_half_path(incidence, turn, entry, *, bend, weigh):
    """Half the path, in air, from the wavefront through the reference point's height and back, for one real ray.

    The face is z = 0, the corner at z = -H. Beyond some 55 degrees a ray may miss one of the mirrors.
    `bend` is the index that refracts, `weigh` the one that delays.
    """
    up = np.array([0.0, 0.0, 1.0])
    to_ranger = np.array([np.sin(incidence) * np.cos(turn), np.sin(incidence) * np.sin(turn), np.cos(incidence)])
    corner, reference = np.array([0.0, 0.0, -H]), np.array([0.0, 0.0, -H / weigh])
    inside = refracted(-to_ranger, up, 1.0 / bend)
    point = corner - inside * (H / -inside[2]) + entry
    # the wavefront lies 1 m from the reference point, square to the direction of the ranger
    path = (reference + to_ranger - point) @ to_ranger
    direction = inside
    for _ in range(3):
        speed = MIRRORS @ direction
        steps = np.where(speed < -1e-12, -(MIRRORS @ (point - corner)) / np.where(speed < -1e-12, speed, 1.0), np.inf)
        hit = int(np.argmin(np.where(steps > 1e-12, steps, np.inf)))
        path += weigh * steps[hit]
        point = point + steps[hit] * direction
        direction = direction - 2 * (direction @ MIRRORS[hit]) * MIRRORS[hit]
    leave = -point[2] / direction[2]
    point, path = point + leave * direction, path + weigh * leave
    out = refracted(direction, -up, bend)
    np.testing.assert_allclose(out, to_ranger, rtol=0, atol=1e-12)  # a cube corner sends light back where it came from
    return (path + (reference + to_ranger - point) @ to_ranger) / 2


@pytest.mark.parametrize("incidence_deg", [0.0, 2.0, 10.0, 30.0, 45.0, 50.0])
@pytest.mark.parametrize("turn", [0.0, 1.0, 4.0])
@pytest.mark.parametrize("entry", [(0.002, 0.001, 0.0), (-0.003, 0.004, 0.0)])
def test_a_ray_traced_through_the_cube_corner_has_the_range_of_the_formulas(incidence_deg, turn, entry):
    incidence = np.radians(incidence_deg)
    half_path = traced_half_path(incidence, turn, np.array(entry), bend=N, weigh=N)
    expected = 1.0 - range_constant(H, N) - obliquity_correction(H, N, np.cos(incidence))
    assert half_path == pytest.approx(float(expected), abs=1e-13)  # m, rounding


def test_appendix_b_is_within_a_micrometre_of_the_rigorous_group_delay_up_to_43_degrees():
    n_g, n_p = float(group_index(0.780)) / AIR, float(phase_index(0.780)) / AIR
    # each number stands in the module's docstring, um
    for degrees, printed in ((10, 0.05), (30, 0.43), (43, 0.95), (45, 1.05), (50, 1.33)):
        incidence = np.radians(degrees)
        half_path = traced_half_path(incidence, 0.7, np.array([0.002, 0.001, 0.0]), bend=n_p, weigh=n_g)
        by_b1 = 1.0 - range_constant(H, n_g) - obliquity_correction(H, n_g, np.cos(incidence))
        assert (half_path - by_b1) * 1e6 == pytest.approx(printed, abs=0.01)


def test_the_rigorous_formula_gives_the_sizes_that_the_docstring_states():
    n_g, n_p = float(group_index(0.780)) / AIR, float(phase_index(0.780)) / AIR
    for degrees, printed in ((10, 0.05), (30, 0.43), (45, 1.05), (60, 2.0), (90, 3.4)):
        s2 = np.sin(np.radians(degrees)) ** 2
        rigorous = H * (n_g * n_p - s2) / np.sqrt(n_p**2 - s2)
        assert (rigorous - H * np.sqrt(n_g**2 - s2)) * 1e6 == pytest.approx(printed, abs=0.05)


def test_the_memo_bound_holds_in_the_calibration_set_up():
    assert abs(float(obliquity_correction(0.0381, N, np.cos(0.0353)))) < 0.1e-6  # [GOLDMAN00] appendix B


def test_a_face_that_looks_away_is_nan_and_spoils_no_other_shot():
    correction = obliquity_correction(H, N, [1.0, -0.2, 0.5, np.nan])
    assert np.isnan(correction).tolist() == [False, True, False, True]
    assert np.isnan(obliquity_slope(H, N, -0.2))


def test_rounding_above_one_counts_as_normal_incidence():
    assert float(obliquity_correction(H, N, 1.0 + 2e-16)) == 0.0


def test_invalid_cosines_and_indices_are_refused():
    with pytest.raises(ValidityError, match=r"cosine of incidence 1\.5 is outside -1 to 1"):
        obliquity_correction(H, N, [0.3, 1.5])
    with pytest.raises(ValidityError, match=r"index ratio 1\.0 is not above 1"):
        obliquity_slope(H, 1.0, 0.5)


def test_the_reference_depth_makes_the_range_flat_at_normal_incidence():
    tilt = 0.01
    other_depth = reference_depth(H, N) + 0.001

    def length(depth, incidence):  # path to the corner less the air path to a point at that depth
        return N * H * np.sqrt(1 - (np.sin(incidence) / N) ** 2) - depth * np.cos(incidence)

    assert abs(length(reference_depth(H, N), tilt) - length(reference_depth(H, N), 0.0)) < 1e-10
    assert abs(length(other_depth, tilt) - length(other_depth, 0.0)) > 4e-8  # 0.001 x tilt^2 / 2


def test_with_a_phase_index_the_correction_is_the_oblique_change_and_its_slope_the_derivative():
    angles, given = np.radians([0.0, 5.0, 20.0, 45.0, 80.0]), {"phase": 1.510811}
    change = oblique_change(0.0381, angles, group=1.527077, phase=1.510811)
    np.testing.assert_allclose(
        obliquity_correction(0.0381, 1.527077, np.cos(angles), **given), change, rtol=1e-12, atol=1e-18
    )
    step = 1e-5
    up, down = (oblique_change(0.0381, angles[1:] + s, group=1.527077, phase=1.510811) for s in (step, -step))
    slope = obliquity_slope(0.0381, 1.527077, np.cos(angles[1:]), **given)
    np.testing.assert_allclose(slope, (up - down) / (2 * step), rtol=1e-6, atol=1e-11)
    assert np.isnan(obliquity_correction(0.0381, 1.527077, -0.1, **given))
