"""Figure of the frames: each frame is named once, at its origin, and the points stand where they are."""

import numpy as np

from catseye.gateways.steering.frame_figures import frames_figure
from catseye.gateways.writers.drawing import BAD, svg
from catseye.geometry.antenna.rigid_telescope import FRAMES, RigidTelescope
from catseye.reduction.steering.conversion import converted

POINT = np.array([[0.0, 0.0, 60.0]])


def figure(elevation_deg=45.0):
    telescope = RigidTelescope(np.radians(90.0), np.radians(elevation_deg))
    return frames_figure(converted(POINT, telescope, to="ground", from_="reflector"))


def test_every_frame_is_named_in_each_view_and_the_same_bytes_come_again():
    drawn = figure()
    for ax in drawn.axes:
        names = ", ".join(text.get_text() for text in ax.texts).split(", ")
        assert sorted(name for name in names if name not in ("", "1")) == sorted(f.replace("_", " ") for f in FRAMES)
    assert svg(drawn) == svg(figure())


def test_the_focus_is_drawn_where_equation_2_44_has_it():
    dots = [line for ax in figure().axes for line in ax.lines if line.get_color() == BAD and len(line.get_xdata())]
    side, above = (np.ravel(line.get_data()) for line in dots)
    np.testing.assert_allclose(side, [7.184829, 132.999039], atol=1e-6)  # along azimuth 90: east
    np.testing.assert_allclose(above, [7.184829, 0.0], atol=1e-6)
