"""The figures of retroreflectors: what they show, what they say in numbers, what they refuse."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from catseye.errors import ValidityError
from catseye.gateways.optics.retroreflector_figures import Dimensions, aberration_plot, return_plot
from catseye.optics.retroreflector.kinds.ball import silvered
from catseye.optics.retroreflector.kinds.prism import bare
from catseye.optics.retroreflector.prism import obliquity_correction


@pytest.fixture(scope="module")
def returned():
    return return_plot()


@pytest.fixture(scope="module")
def aberration():
    return aberration_plot()


def test_the_figures_are_well_formed_and_the_same_again(returned, aberration):
    for drawn, words in (
        (returned[0], ("hollow cube", "between two edges", "silvered", "appendix B", "Returned light")),
        (aberration[0], ("R2 96.49 mm, actual", "beam power", "at 120 m", "Deviation")),
    ):
        ElementTree.fromstring(drawn)
        assert all(word in drawn for word in words)
    assert return_plot()[0] == returned[0]


def test_return_figure_agrees_with_the_formulas(returned):
    told = returned[1]
    half = told["half_of_normal_at_deg"]
    solid = bare(Dimensions().sizes())
    for name, azimuth in (
        ("bare_prism_ranger_on_the_side_of_an_edge", 0.0),
        ("bare_prism_between_two_edges", np.pi / 3),
    ):
        # half lies between two of the figure's angles, 0.25 deg apart
        before, after = (float(solid.return_share(np.radians(half[name] + step), azimuth)) for step in (-0.25, 0.25))
        assert before > 0.5 * float(solid.return_share(0.0)) > after
    assert told["total_reflection_to_deg"] == pytest.approx(20.35, abs=0.01)
    by_b = float(obliquity_correction(0.0381, solid.group, np.cos(np.radians(30.0))))
    difference = by_b - float(solid.range_change(np.radians(30.0)))
    assert told["appendix_b_less_two_indices_at_30_deg"] == pytest.approx(difference, abs=1e-15)
    assert difference * 1e6 == pytest.approx(0.43, abs=0.005)


def test_aberration_figure_agrees_with_the_ball(aberration):
    told, ball = aberration[1], silvered(Dimensions().sizes())
    assert told["range_constant"] == ball.range_constant
    assert told["mean_path_change"] == ball.mean_path_change(0.010)
    assert replace(ball, r2=told["best_r2"]).blur(0.010) < told["blur"] < replace(ball, r2=told["focal_r2"]).blur(0.010)
    shares = [told["collected_share"][key] for key in ("at_18_m", "at_50_m", "at_120_m")]
    assert shares[0] == pytest.approx(1.0)
    assert shares[0] > shares[1] > shares[2] > 0.0


def test_other_targets_are_drawn_and_nonsense_is_refused():
    other = return_plot(Dimensions(height=0.0254, aperture=0.0125, glass="fused-silica"))[1]
    assert other["total_reflection_to_deg"] == pytest.approx(16.5, abs=0.05)
    with pytest.raises(ValidityError, match="beam_radius = 0 m"):
        aberration_plot(beam_radius=0.0)
    with pytest.raises(ValidityError, match="glass 'oak' is unknown"):
        return_plot(Dimensions(glass="oak"))
    with pytest.raises(ValidityError, match="height = -1 m"):
        return_plot(Dimensions(height=-1.0))
