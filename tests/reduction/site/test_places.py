"""Approximate places from the records: scan points, triplets, frames."""

import dataclasses

import numpy as np
import pytest

from catseye.optics.retroreflector.kinds.registry import BALL, HOLLOW, PRISM
from catseye.reduction.site.places import nominal_frame, places_of, sheet_notes


def readme_ground(campaign, reflector_mm):
    """The README's formula, term by term: eq. 2.44."""
    a, e = np.radians(campaign.site.campaign.azimuth_deg), np.radians(campaign.site.campaign.elevation_deg)
    rag = np.array([[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0], [0, 0, 1]])
    rea = np.array([[1, 0, 0], [0, np.sin(e), np.cos(e)], [0, -np.cos(e), np.sin(e)]])
    lifted = rea @ np.add(reflector_mm, [0.0, -54839.108, 4999.990]) + [0.0, 0.0, 48260.0]
    return rag @ lifted * 1e-3


def test_the_nominal_frame_is_the_readmes(night_01):
    frame = nominal_frame(night_01)
    for p in ([0.0, 0.0, 0.0], [1e4, 5e4, 2e4], [-4e4, 9e4, 6e4]):
        np.testing.assert_allclose(frame.points(np.array(p) * 1e-3), readme_ground(night_01, p), atol=1e-11)


def test_a_scan_point_is_the_fixed_point_and_the_mirrors_offset_turned_by_gamma(night_01):
    places = places_of(night_01)
    for name, m in night_01.monuments.items():
        zp = night_01.mirror_of(name)
        c, s = np.cos([m.alpha1_rad, m.alpha2_rad, m.alpha3_rad]), np.sin([m.alpha1_rad, m.alpha2_rad, m.alpha3_rad])
        ry = np.array([[c[0], 0, -s[0]], [0, 1, 0], [s[0], 0, c[0]]])
        rz = np.array([[c[1], s[1], 0], [-s[1], c[1], 0], [0, 0, 1]])
        rx = np.array([[1, 0, 0], [0, c[2], s[2]], [0, -s[2], c[2]]])
        gamma = rx @ rz @ ry @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
        expected = np.array([m.x_mm, m.y_mm, m.z_mm]) + gamma.T @ [zp.dx_mm, zp.dy_mm, zp.dz_mm]
        np.testing.assert_allclose(places[name].start, expected * 1e-3, atol=1e-12)
        # the README's words: y^ is up, z^ points from the fixed point along the survey azimuth to the v-block
        azimuth = np.radians(m.azimuth_deg)
        np.testing.assert_allclose(gamma.T @ [0, 1, 0], [0, 0, 1], atol=1e-3)
        np.testing.assert_allclose(gamma.T @ [0, 0, 1], [np.sin(azimuth), np.cos(azimuth), 0], atol=1e-3)
        assert not places[name].typed


def test_in_a_triplet_the_ball_stands_h_corr_above_the_prisms_mid_point_along_the_normal(night_01):
    places = places_of(night_01)
    for t in night_01.triplets.values():
        left, right, ball = (places[n] for n in t.targets)
        normal = left.normal
        np.testing.assert_array_equal(normal, right.normal)
        above = ball.start - 0.5 * (left.start + right.start)
        np.testing.assert_allclose(above, t.h_corr_mm * 1e-3 * normal, atol=1e-12)
        assert np.linalg.norm(right.start - left.start) == pytest.approx(t.d12_mm * 1e-3, abs=1e-12)
        np.testing.assert_allclose(ball.start, readme_ground(night_01, t.nominal_position_mm), atol=1e-11)
        end = np.array(t.nominal_position_mm) + 1e3 * np.array(t.axis)
        along = readme_ground(night_01, end) - ball.start
        assert (right.start - left.start) @ along > 0.999 * t.d12_mm * 1e-3
        assert left.group == right.group == t.triplet
        assert ball.group == ""
        assert ball.kind is BALL


def test_a_triplets_normal_looks_at_the_aim_point(night_01):
    places = places_of(night_01)
    aim = readme_ground(night_01, night_01.feedarm.aim_point.nominal_mm)
    for t in night_01.triplets.values():
        left = places[t.left_prism.target]
        towards = aim - left.start
        assert left.normal @ towards / np.linalg.norm(towards) > np.cos(np.radians(2.0))


def test_places_have_kind_and_body(night_01):
    places = places_of(night_01)
    assert set(places) | {"ZRG"} == set(night_01.target_names)
    for name, place in places.items():
        assert np.isfinite(place.start).all()
        assert place.constant <= 0.0
        assert (place.kind is PRISM) == (place.normal is not None) == (place.group != "") == (place.height > 0)
        if place.kind in (HOLLOW, None):
            assert place.constant == 0.0, name
    assert {p.kind for p in places.values()} == {None, PRISM, BALL, HOLLOW}


def test_a_target_of_the_ground_frame_stays_where_it_was_typed(night_01):
    places = places_of(night_01)
    ground = [t for t in night_01.targets.values() if t.frame == "ground"]
    assert ground
    for t in ground:
        np.testing.assert_allclose(places[t.name].start, np.array(t.position_mm) * 1e-3, atol=1e-12)


def test_a_mistyped_glass_constant_is_named_because_no_residual_shows_it(night_01):
    assert sheet_notes(night_01) == []
    mistyped = night_01.targets["DP007"].model_copy(update={"pc_mm": night_01.targets["DP007"].pc_mm - 1.0})
    notes = sheet_notes(dataclasses.replace(night_01, targets={**night_01.targets, "DP007": mistyped}))
    assert [n.partition(":")[0] for n in notes] == ["DP007"]


def test_constants_are_as_uncertain_as_their_dimensions(night_01):
    """Every dimension moved by its standard uncertainty, by the closed forms 3.8 and 3.14 written out here."""
    n, places = night_01.site.ranging.bk7_to_air_group_index_ratio, places_of(night_01)
    unit = night_01.triplets["TR01"]
    ball, prism = unit.ball, unit.left_prism

    def ball_mm(r1, r2):
        return -(n * (r1 + r2) - r1)

    u = ball.u_r_mm
    by_r1 = ball_mm(ball.r1_mm + u, ball.r2_mm) - ball_mm(ball.r1_mm, ball.r2_mm)
    by_r2 = ball_mm(ball.r1_mm, ball.r2_mm + u) - ball_mm(ball.r1_mm, ball.r2_mm)
    assert places[ball.target].u_constant == pytest.approx(np.hypot(by_r1, by_r2) * 1e-3, rel=1e-6)

    def prism_mm(height):  # optical path to the corner, less the air down to a reference point that stays
        return -(n * height - prism.hrp_mm)

    by_height = prism_mm(prism.height_mm + prism.u_height_mm) - prism_mm(prism.height_mm)
    assert places[prism.target].u_constant == pytest.approx(abs(by_height) * 1e-3, rel=1e-6)
    assert places["ZEG41040L"].u_constant == 0.0


def test_cubes_at_the_elevation_bearings_ride_on_the_alidade_though_typed_in_the_grounds_frame(night_01):
    bodies = {name: place.body for name, place in places_of(night_01).items() if place.kind is HOLLOW}
    assert {bodies[n] for n in ("ZAG731P", "ZAG731D")} == {"alidade"}
    assert {bodies[b.target] for b in night_01.benchmarks} == {""}
    mast = night_01.targets["ZAG731P"].model_copy(update={"name": "MAST", "position_mm": (90e3, 70e3, 46.9e3)})
    beside = dataclasses.replace(night_01, targets={**night_01.targets, "MAST": mast})
    assert places_of(beside)["MAST"].body == ""
