"""`track`: nodes are the counts of `point` in that posture, errors those of the chord; feed arm, stars, refusals."""

from dataclasses import replace

import numpy as np
import pytest

import catseye
from catseye.errors import ArgumentError
from catseye.geometry.mirror.encoder import COUNTS_PER_RADIAN
from catseye.geometry.mirror.pointing import in_mirror_axes
from catseye.records.files.reading import read_record
from catseye.records.site.mirror import MirrorGeometry
from catseye.records.site.monument import MonumentGeometry
from mirror_scene import sent, steered
from repository import ROOT

MONUMENT, OFF_AXIS = "night-01/monuments/ZY103.toml", "mirrors/ZP103.toml"
OFFSETS = (0.31e-3, -0.12e-3, 0.5e-3, -0.2e-3)  # m, of that record
SLEW = {"start_deg": (145.0, 30.0), "end_deg": (146.0, 31.0)}


def posture_at(found, seconds):
    path = found.track.track.begin  # the times are those of the track
    assert len(path.day) == len(found.seconds) - 1
    rates, acceleration = (35.2 / 60.0, 17.6 / 60.0), 0.2  # deg/s, deg/s^2

    def angle(start, end, rate):
        ramp, length = rate / acceleration, end - start
        total = length / rate + ramp
        t = min(max(seconds, 0.0), total)
        if t < ramp:
            return start + 0.5 * acceleration * t**2
        if t > total - ramp:
            return end - 0.5 * acceleration * (total - t) ** 2
        return start + rate * (t - 0.5 * ramp)

    return angle(145.0, 147.0, rates[0]), angle(30.0, 31.0, rates[1])


@pytest.mark.parametrize(
    ("ranger", "frame", "to"),
    [("ZY103", "reflector", [2.0, 54.0, 12.2]), ("ZY115", "ground", [0.0, 0.0, 10.0]),
     ("ZY103", "alidade", [-21.3, 2.8, -37.0]),  # in the prime pointing
     ("ZY115", "elevation", [1.0, 5.0, 3.0]), ("ZY103", "prime_focus", [0.0, -3.0, 2.0])],
)  # fmt: skip
def test_counts_at_t0_and_t1_and_between_are_those_of_the_posture(ranger, frame, to):
    found = catseye.track(
        site="gbt", ranger=ranger, frame=frame, points=to, start_deg=(145.0, 30.0), end_deg=(147.0, 31.0)
    )
    assert found.status == ("followed",)
    kind = "prime" if found.track.track.prime[0, 0] else "counts"
    for k in (0, 3, 20, len(found.seconds) - 1):
        still = catseye.point(site="gbt", ranger=ranger, frame=frame, to=to,
                              posture_deg=posture_at(found, found.seconds[k]))  # fmt: skip
        off = getattr(still, kind)[0] - found.counts[k, 0]
        off[0] -= 1e5 * np.rint(off[0] / 1e5)
        np.testing.assert_allclose(off, 0.0, atol=1e-6)  # counts
    k, share = 5, 7  # eighth of fifteen instants: the middle
    middle = 0.5 * (found.seconds[k] + found.seconds[k + 1])
    still = getattr(
        catseye.point(site="gbt", ranger=ranger, frame=frame, to=to, posture_deg=posture_at(found, middle)), kind
    )[0]
    chord = 0.5 * (found.counts[k, 0] + found.counts[k + 1, 0])
    exact = chord - still
    exact[0] -= 1e5 * np.rint(exact[0] / 1e5)
    np.testing.assert_allclose(found.errors[k, share, 0], exact, atol=1e-6)


def test_a_ranger_that_rides_with_its_target_stands_still():
    found = catseye.track(site="gbt", ranger="ZY115", points=[2.0, 54.0, 12.2], **SLEW)
    assert np.ptp(found.counts, axis=0).max() < 1e-6
    assert found.worst[0] < 1e-9


def test_a_star_s_track_is_slow_and_straight():
    found = catseye.track(
        site="gbt", ranger="ZY103", points=[2.0, 54.0, 12.2], star_deg=(83.63, 22.01), duration_s=30.0, interval_s=1.0,
        start_mjd="2003-09-07T09:00:00Z",
    )  # fmt: skip
    assert found.seconds[-1] == 30.0
    # 15"/s at 100 m is 7 mm/s; the chord of 1 s of a circle at 7e-5 rad/s is off by R w^2/8: 60 nm
    moved = np.linalg.norm(np.diff(found.counts[:, 0], axis=0), axis=1)
    assert 0.01 < moved.max() < 5.0
    assert found.worst[0] < 1e-6


def test_the_largest_error_is_the_chord_s_and_scales_with_the_square_of_the_interval():
    worst = [
        catseye.track(site="gbt", ranger="ZY103", points=[2.0, 54.0, 12.2], interval_s=h, **SLEW).worst_counts[0]
        for h in (0.064, 0.128)
    ]
    np.testing.assert_allclose(worst[1] / worst[0], 4.0, rtol=0.05)


def test_tables_and_files_have_a_row_a_node(tmp_path):
    found = catseye.track(site="gbt", ranger="ZY103", points=[[2.0, 54.0, 12.2], [20.0, 60.0, 18.0]], **SLEW)
    nodes = found.to_table("nodes")
    assert len(nodes) == 2 * (len(found.seconds) - 1)
    assert nodes["azimuth_t1_counts"][0] == nodes["azimuth_t0_counts"][2] == found.counts[1, 0, 0]
    counts = found.to_table("counts")
    assert (len(counts), counts["point"][:3].tolist()) == (2 * len(found.seconds), [0, 1, 0])
    assert counts["azimuth_counts"][3] == found.counts[1, 1, 0]
    assert nodes["miss"].max().to_value("m") == found.worst.max()
    where = catseye.save(found, tmp_path / "slew")
    assert {"nodes.csv", "errors.svg", "misses.svg"} <= {path.name for path in where.iterdir()}
    said = found.to_object()
    assert (said["ranger"], said["frame"], said["prime"].tolist()) == ("ZY103", "reflector", [False, False])


@pytest.mark.parametrize(("frame", "to", "prime"), [("reflector", [20.0, 60.0, 18.0], False),
                                                    ("alidade", [-21.3, 2.8, -37.0], True)])  # fmt: skip
def test_offsets_of_the_mirror_are_those_of_rays_traced_at_a_body_on_two_shafts(frame, to, prime):
    found = catseye.track(MONUMENT, OFF_AXIS, to, frame=frame, **SLEW)
    track = found.track.track
    assert bool(track.prime[0, 0]) is prime
    record = read_record(ROOT / "examples" / OFF_AXIS, MirrorGeometry)
    station = found.track.ranger.station()
    zeros = np.array([record.na0, record.ne0])
    for k in (0, 4, len(found.seconds) - 1):
        at = catseye.convert(to, from_frame=frame, to_frame="ground", posture_deg=slewed(found.seconds[k])).points[0]
        target = in_mirror_axes(station, at)
        off = steered(target, OFFSETS, prime) * COUNTS_PER_RADIAN + zeros - found.counts[k, 0]
        off[0] -= 1e5 * np.rint(off[0] / 1e5)
        np.testing.assert_allclose(off, 0.0, atol=2e-7)  # counts
    assert np.abs(found.mirror_counts).max() > 0.1
    k, share = 4, 7  # the middle of an interval: the beam at the mean of its ends' counts
    middle = 0.5 * (found.seconds[k] + found.seconds[k + 1])
    at = catseye.convert(to, from_frame=frame, to_frame="ground", posture_deg=slewed(middle)).points[0]
    target = in_mirror_axes(station, at)
    for counts, miss in ((found.counts, found.misses), (found.counts - found.mirror_counts, found.ideal_misses)):
        mount, shaft = (0.5 * (counts[k, 0] + counts[k + 1, 0]) - zeros) / COUNTS_PER_RADIAN
        origin, direction, _ = sent(mount, shaft, OFFSETS)
        passed = np.linalg.norm(np.cross(target - origin, direction))
        assert miss[k, share, 0] == pytest.approx(passed, abs=1e-9)
    assert found.worst_ideal[0] > 2 * found.worst[0] > 0.0


def slewed(seconds):
    """Azimuth and elevation, deg, of SLEW: 1 degree of each from rest to rest."""
    return tuple(
        start + ramped(seconds, rate) for start, rate in ((145.0, 35.2 / 60.0), (30.0, 17.6 / 60.0))
    )  # fmt: skip


def ramped(seconds, rate, acceleration=0.2, length=1.0):
    peak = min(rate, np.sqrt(length * acceleration))
    ramp = peak / acceleration
    total = length / peak + ramp
    t = min(seconds, total)
    if t > total - ramp:
        return length - 0.5 * acceleration * (total - t) ** 2
    return 0.5 * acceleration * t**2 if t < ramp else peak * (t - 0.5 * ramp)


def test_an_ideal_mirror_has_no_counts_by_offsets_and_no_figure_of_them():
    found = catseye.track(MONUMENT, "night-01/mirrors/ZP103.toml", [0.0, 54.0, 12.0], **SLEW)
    assert np.all(found.mirror_counts == 0.0)
    assert found.ideal_misses is not None
    np.testing.assert_array_equal(found.ideal_misses, found.misses)
    assert set(found.figures()) == {"misses", "errors"}
    assert set(catseye.track(MONUMENT, OFF_AXIS, [0.0, 54.0, 12.0], **SLEW).figures()) == {"misses", "errors", "mirror"}


def test_counts_with_offsets_are_those_of_point():
    found = catseye.track(MONUMENT, OFF_AXIS, [0.0, 54.0, 12.0], frame="ground", **SLEW)
    still = catseye.point(MONUMENT, OFF_AXIS, [0.0, 54.0, 12.0])
    np.testing.assert_allclose(found.counts[0, 0], still.counts[0], atol=1e-9)
    assert found.worst[0] < 1e-9
    assert found.worst_ideal[0] > 1e-4


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ({}, {"start_deg", "end_deg", "star_deg"}),
        ({"start_deg": (0.0, 30.0)}, {"start_deg", "end_deg", "star_deg"}),
        ({"start_deg": (0.0, 99.0), "end_deg": (0.0, 30.0)}, {"start_deg"}),
        ({**SLEW, "star_deg": (10.0, 20.0)}, {"start_deg", "star_deg"}),
        ({"star_deg": (10.0, 20.0)}, {"duration_s", "star_deg"}),
        ({"star_deg": (400.0, 20.0), "duration_s": 1.0}, {"star_deg"}),
        ({**SLEW, "duration_s": 1.0}, {"duration_s", "star_deg"}),
        ({**SLEW, "interval_s": 0.0}, {"interval_s"}),
        ({**SLEW, "azimuth_rate_deg_per_s": -1.0}, {"azimuth_rate_deg_per_s"}),
        ({**SLEW, "frame": "dish"}, {"frame"}),
        ({**SLEW, "points": None}, {"points"}),
        ({"start_deg": (0.0, 30.0), "end_deg": (500.0, 30.0), "interval_s": 0.001}, {"interval_s"}),
    ],
)
def test_what_does_not_fit_is_refused_by_name(arguments, names):
    with pytest.raises(ArgumentError) as refused:
        catseye.track(**{"site": "gbt", "ranger": "ZY103", "points": [0.0, 54.0, 12.0], **arguments})
    assert set(refused.value.names) == names


SHORT = {"start_deg": (145.0, 30.0), "end_deg": (145.2, 30.1), "interval_s": 1.0}
U_KEYS = {  # key: the uncertainty of each of these numbers of the two records
    "monument": {"u_x_mm": ("x_mm",), "u_y_mm": ("y_mm",), "u_z_mm": ("z_mm",), "u_alpha1_rad": ("alpha1_rad",),
                 "u_alpha2_rad": ("alpha2_rad",), "u_alpha3_rad": ("alpha3_rad",)},
    "mirror": {"u_offset_mm": ("dx_mm", "dy_mm", "dz_mm"), "u_beta_rad": ("beta1_rad", "beta2_rad"),
               "u_zero_counts": ("na0", "ne0"),
               "u_axis_mm": ("axis_offset_mm", "mirror_offset_mm", "beam_x_mm", "beam_y_mm")},
}  # fmt: skip


def drawn(record, keys, rng):
    return record.model_copy(
        update={name: getattr(record, name) + getattr(record, key) * rng.standard_normal()
                for key, names in keys.items() for name in names}
    )  # fmt: skip


@pytest.mark.parametrize(("frame", "to", "prime"), [("reflector", [20.0, 60.0, 18.0], False),
                                                    ("alidade", [-21.3, 2.8, -37.0], True)])  # fmt: skip
def test_the_uncertainty_of_the_counts_is_the_scatter_of_tracks_of_drawn_records(frame, to, prime):
    monument = read_record(ROOT / "examples/monuments/ZY103.toml", MonumentGeometry)
    mirror = read_record(ROOT / "examples" / OFF_AXIS, MirrorGeometry)
    found = catseye.track(monument, mirror, to, frame=frame, **SHORT)
    assert found.to_object()["uncertainties_lacking"] == []
    assert bool(found.track.track.prime[0, 0]) is prime
    rng, draws = np.random.default_rng(20031126), 400
    counts = np.array([
        catseye.track(drawn(monument, U_KEYS["monument"], rng), drawn(mirror, U_KEYS["mirror"], rng), to, frame=frame,
                      **SHORT).counts for _ in range(draws)
    ])  # fmt: skip
    scatter = counts.std(axis=0, ddof=1)
    np.testing.assert_allclose(scatter / found.u_counts, 1.0, atol=4.0 / np.sqrt(2.0 * draws))  # four sigma of it
    apart = (counts[:, 1:] - counts[:, :-1]).std(axis=0)
    assert np.all(apart < 0.05 * found.u_counts[:-1])  # all but common to both ends of an interval


def test_nodes_have_the_uncertainty_of_point_in_that_posture():
    monument = "monuments/ZY103.toml"
    found = catseye.track(monument, OFF_AXIS, [[0.0, 54.0, 12.2], [20.0, 60.0, 18.0]], **SLEW)
    for k in (0, 4, len(found.seconds) - 1):
        for i, to in enumerate(([0.0, 54.0, 12.2], [20.0, 60.0, 18.0])):
            at = catseye.convert(to, from_frame="reflector", to_frame="ground", posture_deg=slewed(found.seconds[k]))
            still = catseye.point(monument, OFF_AXIS, at.points[0])
            np.testing.assert_allclose(found.u_counts[k, i], still.u[0], rtol=1e-6)
    nodes, counts = found.to_table("nodes"), found.to_table("counts")
    assert nodes["u_azimuth_t1_counts"][1] == counts["u_azimuth_counts"][3] == found.u_counts[1, 1, 0]
    assert nodes["u_elevation_t0_counts"][1] == counts["u_elevation_counts"][1] == found.u_counts[0, 1, 1]
    assert "u of the counts is at most 0.9 in azimuth, 0.52 in elevation" in str(found)


def test_a_feed_arm_ranger_s_nodes_have_the_uncertainty_of_point():
    site = catseye.load("gbt")
    arm = [ranger.model_copy(update={"u_mount_rad": 2e-4}) for ranger in site.feedarm.ranger]
    mirrors = {name: mirror.model_copy(update={"u_beta_rad": 1e-5, "u_zero_counts": 0.5})
               for name, mirror in site.mirrors.items()}  # fmt: skip
    known = replace(site, feedarm=site.feedarm.model_copy(update={"ranger": tuple(arm)}), mirrors=mirrors)
    found = catseye.track(site=known, ranger="ZY115", frame="ground", points=[0.0, 0.0, 10.0], **SLEW)
    for k in (0, 4, len(found.seconds) - 1):
        still = catseye.point(site=known, ranger="ZY115", to=[0.0, 0.0, 10.0], posture_deg=slewed(found.seconds[k]))
        np.testing.assert_allclose(found.u_counts[k, 0], still.u[0], rtol=1e-6)
    assert np.all(found.u_counts > 1.0)


def test_counts_of_incomplete_records_have_no_uncertainty_and_the_missing_keys():
    found = catseye.track(MONUMENT, "night-01/mirrors/ZP103.toml", [0.0, 54.0, 12.0], **SLEW)
    assert np.all(np.isnan(found.u_counts))
    lacking = ["u_alpha1_rad", "u_alpha2_rad", "u_alpha3_rad", "u_beta_rad", "u_zero_counts"]
    assert found.to_object()["uncertainties_lacking"] == lacking
    assert f"u of the counts is unknown: the records lack {', '.join(lacking)}" in " ".join(str(found).split())
