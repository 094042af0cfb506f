"""A beam train: power is accounted for, and each effect on a range is its own formula's."""

import numpy as np
import pytest

from catseye.constants import SPEED_OF_LIGHT
from catseye.errors import InputError
from catseye.optics import coating, gaussian_beam
from catseye.optics.detector import Photodiode, spot_range
from catseye.records.files.reading import read_record
from catseye.records.site.beam import BeamTrain
from catseye.records.site.mirror import MirrorGeometry
from catseye.reduction.epoch.head import image_of
from catseye.reduction.optics.beam import beam_profile, reduce_beam
from repository import ROOT

EXAMPLE = ROOT / "examples" / "beams" / "head.toml"
LIGHT = 0.78e-6


def plain(**changes) -> BeamTrain:
    """A round beam of 10 mm, a reflector, a lens, a detector: nothing else."""
    document = {
        "format": "catseye-beam-1",
        "name": "plain",
        "distance_m": 120.0,
        "distances_m": [120.0],
        "laser": {"power_mw": 1.0, "waist_x_um": 10_000.0, "waist_y_um": 10_000.0},
        "outward": [],
        "reflector": {"radius_mm": 25.4},
        "inward": [{"kind": "lens", "focal_length_mm": 100.0, "aperture_radius_mm": 50.0}],
        "detector": {"radius_mm": 60.0},
    }
    return BeamTrain.model_validate({**document, **changes})


@pytest.fixture(scope="module")
def head():
    return reduce_beam(read_record(EXAMPLE, BeamTrain).model_copy(update={"distances_m": (20.0, 100.0)}))


def test_the_return_agrees_with_the_link_budgets_round_formula():
    for aperture_mm in (25.4, 8.0):
        found = reduce_beam(plain(reflector={"radius_mm": aperture_mm}))
        known = gaussian_beam.returned_share(
            120.0, aperture=aperture_mm * 1e-3, receiver=0.05, waist=0.010, wavelength=LIGHT
        )
        row = found.returned[0]
        assert row.status == "ok"
        assert row.hit * row.collected == pytest.approx(known, abs=2e-5)  # UNCLIPPED and the quadrature's 1e-6
        assert found.places[-1].power == pytest.approx(1e-3 * known, abs=2e-8)


def test_a_wider_detector_takes_more_light_and_never_none():
    """Up to half a metre: what passes the lens is all there is, and the last of it falls off as the rings do."""
    train = read_record(EXAMPLE, BeamTrain).model_copy(update={"distances_m": (20.0, 120.0, 300.0, 400.0)})
    before = np.zeros(4)
    for radius_mm in (0.05, 0.1, 0.3, 0.5, 2.0, 20.0, 500.0):
        plate = train.detector.model_copy(update={"radius_mm": radius_mm})
        found = reduce_beam(train.model_copy(update={"detector": plate}))
        assert [row.status for row in found.returned] == ["ok"] * 4
        power = np.array([row.power for row in found.returned])
        assert np.all(power >= before * (1.0 - 1e-6))
        before = power
    # 0.1 mm was followed before; 99.99 % of its light at 300 m lies within 2 mm by Airy's 2/(pi v) at a dim edge
    assert [row.collected for row in found.returned][2] == pytest.approx(0.9742, abs=2e-3)
    unfocused = train.detector.model_copy(update={"radius_mm": 50.0})
    inward = (*train.inward[:-1], train.inward[-1].model_copy(update={"length_mm": 230.0}))
    found = reduce_beam(train.model_copy(update={"detector": unfocused, "inward": inward}))
    assert [row.status for row in found.returned] == ["ok"] * 4


def test_power_is_the_product_of_the_shares(head):
    power = head.train.laser.power_mw * 1e-3
    for place in head.places:
        assert 0.0 < place.power <= power * (1.0 + 1e-12)
        power = place.power
    mirror = next(p for p in head.places if p.name == "steering mirror, out")
    before = head.places[head.places.index(mirror) - 1]
    made = coating.named("protected-aluminium", 0.78, np.pi / 4)
    # the isolator's second polarizer stands at 45 degrees: half of the light is s, half p
    shown = np.mean([coating.response(made, 0.78, np.pi / 4, polarization=p).reflectance for p in "sp"])
    assert mirror.power / before.power == pytest.approx(shown * (1.0 - mirror.clipped))
    isolator = next(p for p in head.places if p.name == "isolator")
    before = head.places[head.places.index(isolator) - 1]
    assert isolator.power / before.power == pytest.approx(0.92 * np.cos(np.radians(0.5)) ** 2, rel=1e-6)


def test_the_same_aperture_twice_takes_its_share_once():
    stop = {"kind": "aperture", "aperture_radius_mm": 8.0}
    once, twice = (reduce_beam(plain(outward=[stop] * n)).places for n in (1, 2))
    assert twice[1].clipped == 0.0
    assert twice[1].power == once[0].power == pytest.approx(1e-3 * -np.expm1(-2 * 0.64))


def test_the_collimated_beams_width_follows_from_the_divergence(head):
    collimator = head.places[0]
    half = np.radians([10.0, 28.0]) * np.sqrt(2.0 / np.log(2.0)) / 2.0
    # half maximum to 1/e^2 of a Gaussian angle; tan, and the waist's own size is nothing at 20 mm
    assert collimator.radius == pytest.approx(20e-3 * np.tan(half), rel=1e-3)
    assert collimator.curvature == pytest.approx([1 / 20.005e-3, 1 / 20e-3], rel=1e-5)  # 5 um of astigmatism
    isolator = next(p for p in head.places if p.name == "isolator")
    assert isolator.radius[0] / collimator.radius[0] == pytest.approx(
        140.0 / 50.0, rel=1e-3
    )  # the cylinders' telescope


def test_the_detector_stands_in_the_focus(head):
    image = head.places[-1]
    lens = head.places[-2]
    assert np.all(image.radius < 1e-5)
    smallest = LIGHT * 0.2 / np.pi / lens.radius  # focal length 200 mm
    away = 0.2**2 * lens.curvature  # the reflector is not at infinity: its image lies behind the focus
    expected = smallest * np.hypot(1.0, away * LIGHT / (np.pi * smallest**2))
    assert image.radius == pytest.approx(expected, rel=0.05)  # the lens in the file is rounded: 6 um of the focus


def test_a_mirror_that_is_met_twice_adds_its_group_path(head):
    made = coating.named("protected-aluminium", 0.78, np.pi / 4)
    paths = [float(coating.group_path(made, 0.78, np.pi / 4, polarization=p)) for p in "sp"]
    weights = [float(coating.response(made, 0.78, np.pi / 4, polarization=p).reflectance) for p in "sp"]
    path = np.average(paths, weights=weights)
    both = [v for name, v in head.range_effects.items() if name.startswith("coating")]
    assert sum(both) == pytest.approx(path)
    assert 0.3e-6 < path < 1e-6


def test_without_an_isolator_the_field_stays_where_the_laser_has_it_and_two_turn_it_right_across():
    mirror = {"kind": "mirror", "coating": "protected-aluminium", "incidence_deg": 45.0, "plane": "x"}
    made = coating.named("protected-aluminium", 0.78, np.pi / 4)
    for number, polarization in ((0, "p"), (2, "s")):
        found = reduce_beam(plain(outward=[{"kind": "isolator"}] * number + [mirror], distances_m=[120.0]))
        path = float(coating.group_path(made, 0.78, np.pi / 4, polarization=polarization))
        assert found.range_effects["coating of mirror"] == pytest.approx(0.5 * path, rel=1e-9)


def test_the_lens_reads_short_and_more_so_for_a_wider_beam(head):
    def lag(distance):
        train = head.train.model_copy(update={"distance_m": distance, "distances_m": (distance,)})
        found = reduce_beam(train)
        light = next(place.radius for place in found.places if place.name == "receiving lens")
        return found.range_effects["group lag of receiving lens"], np.mean(light**2)

    (near, narrow), (far, wide) = lag(30.0), lag(150.0)
    assert far < near < 0.0
    # half of h^2/2 power (n_g - n_p)/(n_p - 1) with a mean h^2 of w^2/2; N-BK7 by its maker's sheet
    assert near - far == pytest.approx(5.0 * 0.0162886 / 0.5111837 / 8.0 * (wide - narrow), rel=0.005)


def test_an_image_off_the_middle_reads_short(head):
    off = head.range_effects["image off the middle"]
    k = 0.5 * SPEED_OF_LIGHT * 50.0 * 0.5e-12 / (4.0 * np.pi * 1e-4**2)
    # the mean of the squared distance of a place known to u is d^2 + 2 u^2
    assert off == pytest.approx(-k * (10e-6**2 + 2.0 * 5e-6**2), rel=0.01)
    assert head.u_image == pytest.approx(2.0 * k * 5e-6 * np.hypot(10e-6, 5e-6), rel=1e-9)


def test_an_uncertain_place_shifts_the_range_like_drawn_places(head):
    diode = Photodiode(radius=1e-4, sheet_resistance=50.0, capacitance=0.5e-12)
    places = np.hypot(*(np.random.default_rng(6).normal(scale=5e-6, size=(2, 20_000)) + np.array([[10e-6], [0.0]])))
    spot = float(np.sqrt(np.mean(head.places[-1].radius ** 2)))
    drawn = np.mean(spot_range(places, spot, diode)) - spot_range(0.0, spot, diode)
    assert head.range_effects["image off the middle"] == pytest.approx(drawn, rel=0.02)


def test_a_mirrors_sheet_with_the_trains_detector_has_the_same_uncertainty(head):
    """The record in rad and µm against the train's ohm and pF: 3.334 µm, and a mean of 298 µm times 2 (5/100)^2."""
    plate = head.train.detector
    sheet = MirrorGeometry.model_construct(
        detector_radius_mm=plate.radius_mm,
        detector_lag_rad=head.detector_lag,
        image_offset_um=plate.offset_um,
        u_image_um=plate.u_offset_um,
    )
    metres = SPEED_OF_LIGHT / (4.0 * np.pi * 1500e6)
    lead = image_of(sheet)
    assert metres * lead.u == pytest.approx(head.u_image, rel=1e-3)
    assert metres * lead.mean == pytest.approx(1.49e-6, rel=5e-3)
    assert np.isnan(reduce_beam(plain()).detector_lag)


def test_two_isolators_multiply(head):
    one, two = (reduce_beam(plain(outward=[{"kind": "isolator", "turn_deg": 44.0}] * n)).laser for n in (1, 2))
    for key in ("isolation_db", "worst_isolation_db"):
        assert two[key] == pytest.approx(2.0 * one[key])


def test_a_lens_that_stops_most_of_the_light_makes_an_airy_disc_on_the_detector():
    from scipy.special import j0, j1

    inward = [
        {"kind": "lens", "focal_length_mm": 200.0, "aperture_radius_mm": 2.0},
        {"kind": "space", "length_mm": 200.0},
    ]
    wide = {"power_mw": 1.0, "waist_x_um": 40_000.0, "waist_y_um": 40_000.0}
    small = {"radius_mm": 0.02}
    row = reduce_beam(plain(laser=wide, reflector={"radius_mm": 200.0}, inward=inward, detector=small)).returned[0]
    x = 2.0 * np.pi / LIGHT * 0.002 * 20e-6 / 0.2
    lit = -np.expm1(-2.0 * (2.0 / 40.0) ** 2)
    assert row.status == "ok"
    assert row.collected == pytest.approx(lit * (1.0 - j0(x) ** 2 - j1(x) ** 2), rel=2e-3)


def test_less_isolation_moves_a_range_more(head):
    element = head.train.outward[5]
    assert element.kind == "isolator"
    leaky = element.model_copy(update={"leak": 1e-2})
    outward = (*head.train.outward[:5], leaky, *head.train.outward[6:])
    worse = reduce_beam(head.train.model_copy(update={"outward": outward})).laser
    assert worse["worst_isolation_db"] < head.laser["worst_isolation_db"] - 10.0
    grown = np.sqrt(worse["share_into_laser"] / head.laser["share_into_laser"])  # fields, not powers
    assert worse["range_bound_by_interference"] / head.laser["range_bound_by_interference"] == pytest.approx(grown)
    share = head.laser["share_into_laser"]
    bound = np.sqrt(share) * SPEED_OF_LIGHT / 1500e6 / (4.0 * np.pi)
    assert head.laser["range_bound_by_interference"] == pytest.approx(bound)


def test_failed_diffraction_is_a_status_not_an_exception():
    found = reduce_beam(plain(reflector={"radius_mm": 18.0}, distances_m=[2.0, 120.0]))
    near, far = found.returned
    assert found.status == "ok"
    here = reduce_beam(plain(reflector={"radius_mm": 18.0}, distance_m=2.0))
    assert here.status == near.status
    assert np.isnan(here.places[-1].clipped)
    assert "too much to integrate" in near.status
    assert np.isnan(near.power)
    assert far.status == "ok"


def test_behind_a_reflector_that_clips_nothing_claims_to_be_gaussian():
    lens = {"kind": "thick_lens", "r1_mm": 102.24, "thickness_mm": 6.0, "glass": "N-BK7", "aperture_radius_mm": 20.0}
    inward = [lens, {"kind": "space", "length_mm": 196.1}]
    found = reduce_beam(plain(reflector={"radius_mm": 8.0}, inward=inward, detector={"radius_mm": 0.1}))
    assert np.isnan(found.places[-1].radius).all()
    assert np.isnan(found.range_effects["group lag of thick lens"])
    assert np.isfinite(found.places[-1].power)


def test_the_profile_meets_the_places(head):
    profile = beam_profile(head.train)
    way, radii = profile["inward"]
    assert way[-1] == pytest.approx(head.places[-1].way)
    assert radii[-1] == pytest.approx(head.places[-1].radius)
    assert profile["range"][1][-1] == pytest.approx(next(p for p in head.places if p.leg == "reflector").radius)


def test_an_unknown_glass_or_coating_is_refused():
    for element, text in (
        ({"kind": "plate", "thickness_mm": 3.0, "glass": "ice"}, "glass 'ice' is unknown"),
        ({"kind": "mirror", "coating": "paint"}, "coating 'paint' is unknown"),
    ):
        with pytest.raises(InputError, match=text):
            reduce_beam(plain(outward=[element]))
