"""The commands' answers to where the dish is: one truth, different questions; the signs by a dish that is turned."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.constants import ARCSECOND
from catseye.geometry.frames.rotation import from_vector
from catseye.reduction.epoch.surface import fit_surface
from catseye.reduction.pose.dish_ways import dish_ways, solved_points
from catseye.reduction.site.places import nominal_frame


@pytest.fixture(scope="module")
def ways(reduced_night_01):
    return {way.command: way for way in dish_ways(reduced_night_01)}


def test_reduce_estimate_equals_the_reduction(ways, reduced_night_01):
    way, pose = ways["catseye reduce"], reduced_night_01.surface.pose()
    np.testing.assert_array_equal(way.translation, pose["translation"])
    np.testing.assert_array_equal(way.rotation, pose["rotation"])


def test_the_axis_leans_as_the_fitted_axis_does(ways, reduced_night_01):
    """The lean from the rotation vector, against the angles of the fitted unit vector itself."""
    posture = reduced_night_01.campaign.site.campaign
    x, y, z = reduced_night_01.surface.pose()["axis"]
    turn = np.arctan2(x, y) - np.radians(posture.azimuth_deg)
    across = ((turn + np.pi) % (2.0 * np.pi) - np.pi) * np.cos(np.radians(posture.elevation_deg))
    up = np.arcsin(z) - np.radians(posture.elevation_deg)
    np.testing.assert_allclose(ways["catseye reduce"].axis, [across, up], rtol=0, atol=0.005 * ARCSECOND)


def test_they_agree_within_their_uncertainties_while_the_focal_length_is_held(ways):
    reduced, held, pose = (ways[f"catseye {name}"] for name in ("reduce", "surface --free vertex,axis", "pose"))
    assert np.all(np.abs(held.axis - reduced.axis) < 0.5 * reduced.u_axis)  # weights alone differ
    assert np.all(np.abs(pose.axis - reduced.axis) < 2.5 * np.hypot(pose.u_axis, reduced.u_axis))


def test_a_free_focal_length_takes_ten_arc_seconds_of_the_offset_dish(ways):
    free, held = ways["catseye surface"], ways["catseye surface --free vertex,axis"]
    assert 5.0 < abs(free.axis - held.axis)[1] / ARCSECOND < 15.0
    assert abs(free.axis - held.axis)[0] / ARCSECOND < 1.0


def test_every_estimate_follows_a_known_turn_of_the_dish(ways, reduced_night_01):
    """The dish's points turned about the nominal vertex by hand: each way moves by that turn, signs and all."""
    turn = np.array([6.0, -4.0, 3.0]) * ARCSECOND
    coordinates = reduced_night_01.coordinates
    vertex, rotation = nominal_frame(reduced_night_01.campaign).translation, from_vector(turn)
    moved = replace(coordinates, x=vertex + (coordinates.x - vertex) @ rotation.T)
    surface, _ = fit_surface(reduced_night_01.campaign, moved, u_surface=1e-3)
    after = {way.command: way for way in dish_ways(replace(reduced_night_01, coordinates=moved, surface=surface))}
    posture = np.radians(
        [getattr(reduced_night_01.campaign.site.campaign, f"{n}_deg") for n in ("azimuth", "elevation")]
    )
    axis = np.array(
        [np.sin(posture[0]) * np.cos(posture[1]), np.cos(posture[0]) * np.cos(posture[1]), np.sin(posture[1])]
    )
    leant = rotation @ axis
    up = np.arcsin(leant[2]) - posture[1]
    across = (np.arctan2(leant[0], leant[1]) - np.arctan2(axis[0], axis[1])) * np.cos(posture[1])
    for command, before in ways.items():
        change = after[command].axis - before.axis
        np.testing.assert_allclose(change, [across, up], rtol=0, atol=0.05 * ARCSECOND, err_msg=command)
    body = after["catseye pose"].rotation - ways["catseye pose"].rotation
    np.testing.assert_allclose(body, turn, rtol=0, atol=0.05 * ARCSECOND)


def test_points_in_memory_are_those_that_are_written(reduced_night_01):
    solved = solved_points(reduced_night_01)
    assert solved.names == tuple(reduced_night_01.coordinates.points)
    assert solved.posture[0] == pytest.approx(np.radians(reduced_night_01.campaign.site.campaign.azimuth_deg))
