"""Figure of the third order: each arrow is the table's vector in its view, each ellipse its uncertainty."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import EllipseCollection
from matplotlib.quiver import Quiver

from catseye.api.reading import with_structure
from catseye.gateways.epoch.figures import COLOURS, figures
from catseye.gateways.epoch.third_order_figure import third_order_figure
from catseye.gateways.writers.drawing import styled, svg
from catseye.records.night.campaign import read_campaign
from catseye.records.site.structural_model import read_structural_model
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.simulator.night.schedule import Schedule
from catseye.simulator.night.sheets import write_night
from catseye.simulator.night.simulate import SimulatedTelescope, simulate_night
from repository import ROOT

AZIMUTH = np.radians(145.3)
AXES = (np.eye(3)[:2], np.array([[np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0], [0.0, 0.0, 1.0]]))


@pytest.fixture(scope="module")
def bent(tmp_path_factory):
    """A small night of a telescope that bends, reduced with its model."""
    model = read_structural_model(ROOT / "examples" / "structural-model" / "telescope.toml")
    simulated = simulate_night(
        7,
        telescope=SimulatedTelescope(145.3, 50.0, dish_prisms=16, triplets=2, structure=model),
        schedule=Schedule(interval_s=14.0, again=0.0),
    )
    campaign = read_campaign(write_night(simulated, tmp_path_factory.mktemp("night") / "bent"))
    return reduce_epoch(with_structure(campaign, model))


def arrows(ax):
    """Places, vectors as drawn, and the ellipses of a panel or None."""
    drawn = [part for part in ax.collections if isinstance(part, Quiver)]
    outlines = [part for part in ax.collections if isinstance(part, EllipseCollection)]
    assert len(drawn) == 1
    return (
        np.stack([drawn[0].X, drawn[0].Y], 1),
        np.stack([drawn[0].U, drawn[0].V], 1),
        outlines[0] if outlines else None,
    )


def names_drawn(order):
    return [name for name in order.names if not name.endswith(("-L", "-R"))]


def test_a_reduction_without_a_model_has_no_such_figure(reduction):
    assert "structure" not in figures(reduction)


def test_arrows_are_the_vectors_of_the_table_and_ellipses_their_covariance(bent):
    order, figure = bent.third_order, figures(bent)["structure"]
    names = names_drawn(order)
    rows = [order.names.index(name) for name in names]
    assert {"ZY113", "ZEG41040L", "TR01-B"} <= set(names)
    places = bent.coordinates.x[bent.coordinates.rows(names)]
    for k, ax in enumerate(figure.axes):
        axes, vectors = AXES[k // 2], (order.displacement, order.residual)[k % 2][rows]
        at, drawn, outlines = arrows(ax)
        np.testing.assert_allclose(at, places @ axes.T, atol=1e-9)
        flat = vectors @ axes.T
        scale = float(drawn.ravel() @ flat.ravel() / (flat.ravel() @ flat.ravel()))
        np.testing.assert_allclose(drawn, scale * flat, atol=1e-9)
        assert scale == pytest.approx(float(f"{scale:.0e}"))  # a round number, as the title says it
        assert f"{scale:,.0f} times".replace(",", "\u2009") in figure.axes[k % 2].get_title(loc="left")
        assert (outlines is not None) == bool(k % 2)
        if outlines is not None:
            radii = np.sqrt(np.linalg.eigvalsh(axes @ order.covariance[rows] @ axes.T))  # 95 % of two dimensions
            np.testing.assert_allclose(0.5 * outlines.get_widths(), scale * 2.447747 * radii[:, 1], rtol=1e-5)
            np.testing.assert_allclose(outlines.get_offsets(), at + drawn, atol=1e-9)


def test_everything_drawn_lies_within_its_panel(bent):
    figure = figures(bent)["structure"]
    svg(figure)
    for ax in figure.axes:
        at, drawn, _ = arrows(ax)
        low, high = np.array([ax.get_xlim(), ax.get_ylim()]).T
        for points in (at, at + drawn):
            assert np.all((points > low) & (points < high))


def test_longest_arrow_of_the_model_takes_a_tenth_to_a_fifth_of_the_view_and_is_named(bent):
    figure = figures(bent)["structure"]
    order, ax = bent.third_order, figure.axes[2]
    at, drawn, _ = arrows(ax)
    longest = np.hypot(*drawn.T).max() / np.ptp(at, axis=0).max()
    assert 0.05 < longest <= 0.2
    names = names_drawn(order)
    named = {text.get_text() for text in ax.texts}
    assert names[int(np.argmax(np.hypot(*drawn.T)))] in named


def test_a_triplet_without_its_ball_is_drawn_by_its_prisms(bent):
    order = bent.third_order
    others = [k for k, name in enumerate(order.names) if name != "TR01-B"]
    fewer = replace(
        order,
        names=tuple(order.names[k] for k in others),
        displacement=order.displacement[others],
        residual=order.residual[others],
        covariance=order.covariance[others],
    )
    at, _, _ = arrows(third_order_figure(replace(bent, third_order=fewer), COLOURS).axes[0])
    assert len(at) == len(names_drawn(order)) + 1  # two prisms for a ball


def test_a_model_that_moves_nothing_draws_no_arrow(bent):
    still = replace(bent.third_order, displacement=np.zeros_like(bent.third_order.displacement))
    with styled():
        figure = third_order_figure(replace(bent, third_order=still), COLOURS)
    assert figure.axes[0].get_title(loc="left").endswith("none")
    assert np.all(arrows(figure.axes[0])[1] == 0.0)
    assert not figure.axes[0].texts
    svg(figure)
