"""Receiving optics: the image against rays drawn in space, focal length and defocus against thin-lens numbers."""

import numpy as np
import pytest

from catseye.constants import ARCSECOND
from catseye.optics.ray_trace import Plane, Rays, SphericalSurface
from catseye.records.files.reading import read_record
from catseye.records.site.beam import BeamTrain
from catseye.reduction.optics.beam import reduce_beam
from catseye.reduction.optics.receiving import traced_image
from repository import ROOT

N_P, N_G = 1.5111833, 1.527472  # N-BK7 at 780 nm in air, by its maker's sheet
R1, THICK = 0.10224, 0.006
TRAIN = ROOT / "examples" / "beams" / "train.toml"


def drawn(beam_radius, aperture, back, *, angle=0.0, rays=200_000):
    """Rays of a Gaussian beam through a plano-convex lens: places (r, 2) on the detector and paths (r,)."""
    xy = np.random.default_rng(8).normal(scale=0.5 * beam_radius, size=(rays, 2))
    xy = np.vstack([np.zeros((1, 2)), xy[np.hypot(*xy.T) < aperture]])
    position = np.column_stack([xy, np.full(len(xy), -1.0)]) - [np.tan(angle), 0.0, 0.0]
    direction = np.broadcast_to([np.sin(angle), 0.0, np.cos(angle)], position.shape)
    front, rear = SphericalSurface((0.0, 0.0, R1), R1), Plane((0.0, 0.0, THICK), (0.0, 0.0, 1.0))
    plate = Plane((0.0, 0.0, THICK + back), (0.0, 0.0, 1.0))
    light = Rays(position, direction, np.zeros(len(xy))).to(front, 1.0).refracted(front, 1.0 / N_P)
    light = light.to(rear, N_P).refracted(rear, N_P).to(plate, 1.0)
    return light.position[1:, :2], light.path[1:] - light.path[0]


@pytest.mark.parametrize(("beam_radius", "aperture", "back"), [(7.8e-3, 25e-3, 0.1962), (12e-3, 14e-3, 0.1955)])
def test_the_image_is_that_of_rays_drawn_in_space(beam_radius, aperture, back):
    places, path = drawn(beam_radius, aperture, back)
    away = np.hypot(*places.T)
    image = traced_image(
        beam_radius,
        aperture=aperture,
        surfaces=(R1, np.inf),
        thickness=THICK,
        indices=(N_P, N_G),
        back=back,
        detector=60e-6,
    )
    assert image.radius == pytest.approx(np.sqrt(np.mean(away**2)), rel=0.02)
    assert image.share == pytest.approx(np.mean(away < 60e-6), abs=0.005)
    assert image.range_error == pytest.approx(0.5 * np.mean(path), rel=0.02)


@pytest.fixture(scope="module")
def train():
    return reduce_beam(read_record(TRAIN, BeamTrain).model_copy(update={"distances_m": (60.0,)}))


def test_light_off_the_axis_has_its_image_f_tan_of_the_angle_away(train):
    focal_length = train.receiving.focal_length
    assert focal_length == pytest.approx([R1 / (N_P - 1.0)] * 2, rel=2e-6)
    for angle in (ARCSECOND, 1e-4):
        places, _ = drawn(
            1e-4, 1.0, 0.1960, angle=angle, rays=100
        )  # near the paraxial focus, where a thin pencil meets
        assert np.mean(places[:, 0]) == pytest.approx(focal_length[0] * np.tan(angle), rel=2e-3)


def test_the_detector_is_out_of_focus_as_the_lens_formula_has_it(train):
    """Light that diverges from 204 m meets f^2/R behind the focus, which lies f - t/n behind the flat face."""
    lens = next(place for place in train.places if place.name == "collecting lens")
    f = R1 / (N_P - 1.0)
    expected = 0.1962 - (f - THICK / N_P) - f**2 * lens.curvature
    assert train.receiving.defocus == pytest.approx(expected, abs=2e-6)  # f^2/R to f^3/R^2 and the waist's own width
    assert train.receiving.traced is not None


@pytest.mark.parametrize("more", [{"kind": "lens", "focal_length_mm": 500.0}, {"kind": "mirror", "radius_mm": 800.0}])
def test_two_elements_that_bend_the_light_are_not_traced(train, more):
    record = train.train.model_dump()
    document = {**record, "inward": [more, *record["inward"]], "distances_m": [60.0]}
    assert reduce_beam(BeamTrain.model_validate(document)).receiving.traced is None


def test_a_train_without_power_has_no_focus(train):
    flat = train.train.model_copy(
        update={"inward": (), "detector": train.train.detector.model_copy(update={"radius_mm": 50.0})}
    )
    found = reduce_beam(flat).receiving
    assert np.all(np.isinf(found.focal_length))
    assert found.traced is None
