"""Laws of polarized light at surfaces and corners."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from catseye.optics.polarization import linear, reflection, retardance, retarder
from catseye.optics.retroreflector.corner_polarization import (
    REVERSED,
    far_field_jones,
    hollow_corner,
    returned_power,
    sector_jones,
    sector_shares,
    solid_corner,
    through_plate,
)

glasses = st.floats(1.43, 2.0)
tilts = st.floats(0.0, 0.2)  # total reflection holds to 0.27 rad in glass of 1.45 at every azimuth, 0.3 from 1.5 on
azimuths = st.floats(-np.pi, np.pi)
metals = st.builds(complex, st.floats(0.05, 5.0), st.floats(0.5, 10.0))
ROUNDING = 1e-12  # of products of a dozen matrices


def bends(a, b):
    return np.max(np.abs(a - b))


@given(glasses, st.floats(0.0, 0.1), azimuths)
def test_total_reflection_loses_nothing(n, tilt, azimuth):
    for j in sector_jones(solid_corner(n), tilt * (n - 1.414), azimuth):
        assert bends(j.conj().T @ j, np.eye(2)) < ROUNDING


@given(metals, st.floats(0.0, 0.55), azimuths)
def test_the_return_path_is_the_transpose(metal, tilt, azimuth):
    jones = sector_jones(hollow_corner(metal), tilt, azimuth)
    assert bends(jones[list(REVERSED)], np.swapaxes(jones, 1, 2)) < ROUNDING


@given(glasses, metals, tilts, azimuths, st.booleans())
def test_the_return_path_through_glass_is_the_transpose(n, metal, tilt, azimuth, bare):
    jones = sector_jones(solid_corner(n, metal, bare_face=bare), tilt, azimuth)
    assert bends(jones[list(REVERSED)], np.swapaxes(jones, 1, 2)) < ROUNDING


@given(glasses, tilts, azimuths, azimuths, azimuths)
def test_light_passed_and_stopped_by_an_analyser_sum_to_one(n, tilt, azimuth, light, analyser):
    jones = sector_jones(solid_corner(n), tilt, azimuth)
    field = retarder(1.0, 0.3) @ linear(light)
    parts = [returned_power(jones, field, analyser=linear(analyser + turn)) for turn in (0.0, np.pi / 2)]
    assert abs(sum(parts) - returned_power(jones, field)) < ROUNDING


@given(metals, st.floats(0.0, 0.5), azimuths, azimuths)
def test_no_metal_gives_light_away(metal, tilt, azimuth, light):
    jones = sector_jones(hollow_corner(metal), tilt, azimuth)
    assert returned_power(jones, linear(light)) <= 1.0 + ROUNDING


@given(glasses, tilts, azimuths, azimuths)
def test_the_axis_of_the_far_field_is_never_brighter_than_a_perfect_corner_s(n, tilt, azimuth, light):
    jones = sector_jones(solid_corner(n), tilt, azimuth)
    bright = np.sum(np.abs(far_field_jones(jones) @ linear(light)) ** 2)
    assert bright <= returned_power(jones, linear(light)) + ROUNDING


@given(glasses, tilts, azimuths)
def test_a_third_of_a_turn_changes_nothing_but_the_axes(n, tilt, azimuth):
    here, there = (sector_jones(solid_corner(n), tilt, azimuth + turn) for turn in (0.0, 2 * np.pi / 3))
    # the same six retardances, in another order
    assert bends(np.sort(retardance(here)), np.sort(retardance(there))) < 1e-6  # arccos near 0 and pi


@given(st.floats(0.01, 1.0), st.floats(1.05, 3.0))
def test_a_surface_reflects_from_behind_with_the_opposite_sign(cosine, n):
    inner = np.sqrt(1 - (1 - cosine**2) / n**2)
    forth, back = reflection(cosine, inside=1.0, outside=n), reflection(inner, inside=n, outside=1.0)
    for a, b in zip(forth, back, strict=True):
        assert abs(a + b) < ROUNDING  # Stokes' relation


@given(st.floats(0.0, np.pi), azimuths)
def test_light_through_a_plate_and_back_from_a_perfect_corner_is_retarded_twice(d, azimuth):
    twice = through_plate(np.eye(2), retarder(d, azimuth))
    assert bends(twice, retarder(2 * d, azimuth)) < ROUNDING


@given(tilts, azimuths, st.floats(0.3, 1.2))
def test_shares_of_the_sectors_sum_to_one_and_are_opposite_alike(tilt, azimuth, slim):
    shares = sector_shares(solid_corner(1.5), tilt, azimuth, aperture=slim * 0.02, height=0.02)
    assert abs(shares.sum() - 1.0) < ROUNDING
    assert bends(shares, shares[list(REVERSED)]) < 2e-3  # a direction or two on a border


@given(metals, st.floats(0.0, 3.0), azimuths, azimuths)
def test_plates_are_met_on_the_way_back_in_the_other_order(metal, d, one, other):
    jones = sector_jones(hollow_corner(metal), 0.2, 1.0)
    first, second = retarder(d, one), retarder(1.0, other)
    assert bends(through_plate(jones, second @ first), first @ second @ jones @ second @ first) < ROUNDING
