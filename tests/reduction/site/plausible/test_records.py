"""Lengths, posture, clocks and gains that no site has."""

import dataclasses
import re

import numpy as np
import pytest

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.reduction.site.places import nominal_frame
from catseye.reduction.site.plausible.campaign import plausible_campaign
from catseye.reduction.site.plausible.gain import implausible_gains
from reduction.site.plausible.record_scene import implausible_records


def edited(campaign, part, name, **values):
    """The campaign with keys of one record replaced."""
    table = dict(getattr(campaign, part))
    table[name] = table[name].model_copy(update=values)
    return dataclasses.replace(campaign, **{part: table})


def of_site(campaign, table, **values):
    new = getattr(campaign.site, table).model_copy(update=values)
    return dataclasses.replace(campaign, site=campaign.site.model_copy(update={table: new}))


def test_night_01_is_plausible_and_stays_as_it_is(night_01):
    campaign, found = plausible_campaign(night_01)
    assert found == ()
    assert campaign.weather is night_01.weather
    assert campaign.shots is night_01.shots


# Positions


@pytest.mark.parametrize(("key", "factor", "unit"), [("y_mm", 1.0 / 25.4, "inches"), ("y_mm", 0.1, "centimetres")])
def test_a_monument_in_another_unit_is_named_by_its_latitude(night_01, key, factor, unit):
    wrong = edited(night_01, "monuments", "ZY103", **{key: getattr(night_01.monuments["ZY103"], key) * factor})
    (found,) = implausible_records(wrong)
    assert found.where == f"monuments/ZY103.toml: {key}"
    assert f"looks like {unit}" in found.text


def test_a_monument_by_another_height_is_named_by_its_elevation(night_01):
    (found,) = implausible_records(edited(night_01, "monuments", "ZY103", z_mm=25_000.0))
    assert found.where == "monuments/ZY103.toml: z_mm"
    assert "25 m from its elevation_m" in found.text


def test_monuments_with_rough_latitudes_are_not_accused(night_01):
    """All of the site's own latitude, as somebody types who does not know them: 120 m off, and nothing stands out."""
    here = night_01.site.site.latitude_deg
    rough = {n: m.model_copy(update={"latitude_deg": here}) for n, m in night_01.monuments.items()}
    assert implausible_records(dataclasses.replace(night_01, monuments=rough)) == ()


def test_an_elevation_of_z0_in_feet_is_named(night_01):
    (found,) = implausible_records(of_site(night_01, "site", elevation_of_z0_m=806.42 / 0.3048))
    assert found.where == "site.toml: site.elevation_of_z0_m"


def test_a_latitude_in_radians_is_named(night_01):
    wrong = of_site(night_01, "site", latitude_deg=38.433121 * DEGREE)
    (found,) = implausible_records(wrong)
    assert "looks like radians, 38.43" in found.text
    radians = {
        n: m.model_copy(update={"latitude_deg": round(m.latitude_deg * DEGREE, 6)}) for n, m in wrong.monuments.items()
    }
    (found,) = implausible_records(dataclasses.replace(wrong, monuments=radians))
    assert "looks like radians, 38.43" in found.text


def test_a_site_at_the_equator_is_plausible(night_01):
    """Night-01's monuments about latitude 0.67 degrees: they rise by 2.1e-3 degrees as degrees do."""
    down = 38.433121 - 0.67
    there = {n: m.model_copy(update={"latitude_deg": m.latitude_deg - down}) for n, m in night_01.monuments.items()}
    assert implausible_records(dataclasses.replace(of_site(night_01, "site", latitude_deg=0.67), monuments=there)) == ()


def test_a_prism_in_inches_is_named_and_its_shots_are_left_out(night_01):
    x, y, z = night_01.targets["DP010"].position_mm
    wrong = edited(night_01, "targets", "DP010", position_mm=(x / 25.4, y / 25.4, z / 25.4))
    campaign, (found,) = plausible_campaign(wrong)
    assert "DP010" in found.text
    assert "looks like inches" in found.text
    own = [s for s, t in zip(campaign.shots.shot, campaign.shots.target, strict=True) if t == "DP010"]
    assert sorted(campaign.doubted) == sorted(own)


def test_a_prism_off_the_dish_in_no_unit_is_named_without_one(night_01):
    """Any place, taken for micrometres, is at the vertex and so on the paraboloid."""
    x, y, z = night_01.targets["DP010"].position_mm
    _, (found,) = plausible_campaign(edited(night_01, "targets", "DP010", position_mm=(x, y, z + 1000.0)))
    assert found.text == "DP010 is 1 m off the dish's paraboloid; its shots are left out"
    _, (found,) = plausible_campaign(edited(night_01, "targets", "DP010", position_mm=(1e3 * x, 1e3 * y, 1e3 * z)))
    assert "looks like micrometres" in found.text


def test_many_prisms_off_the_dish_are_one_record_for_each_unit(night_01):
    campaign = night_01
    for k in range(10, 20):
        x, y, z = campaign.targets[f"DP0{k}"].position_mm
        off = (x, y, z + 100.0 * k) if k < 18 else (x / 25.4, y / 25.4, z / 25.4)
        campaign = edited(campaign, "targets", f"DP0{k}", position_mm=off)
    doubted, found = plausible_campaign(campaign)
    assert [record.text for record in found] == [
        "DP010, DP011, DP012, DP013, DP014, DP015 and 2 more are up to 1.7 m off the dish's paraboloid; their shots "
        "are left out",
        "DP018 and DP019 are up to 0.45 m off the dish's paraboloid: looks like inches; their shots are left out",
    ]
    shots = zip(campaign.shots.shot, campaign.shots.target, strict=True)
    assert sorted(doubted.doubted) == sorted(s for s, t in shots if t in {f"DP0{k}" for k in range(10, 20)})


def test_another_focal_length_is_no_other_unit(night_01):
    with pytest.raises(InputError, match=r"focal length 54000 mm; set positions or paraboloid right"):
        plausible_campaign(of_site(night_01, "paraboloid", focal_length_mm=54_000.0))


def test_a_prism_typed_100_mm_off_is_left_to_the_ranges(night_01):
    x, y, z = night_01.targets["DP010"].position_mm
    assert implausible_records(edited(night_01, "targets", "DP010", position_mm=(x, y, z + 100.0))) == ()


def test_a_dish_in_inches_is_refused(night_01):
    inches = {
        n: t.model_copy(update={"position_mm": tuple(v / 25.4 for v in t.position_mm)})
        for n, t in night_01.targets.items()
    }
    with pytest.raises(InputError, match=r"^targets.toml: position_mm: .*looks like inches"):
        plausible_campaign(dataclasses.replace(night_01, targets=inches))


@pytest.mark.parametrize(("factor", "unit"), [(25.4, "inches"), (304.8, "feet"), (10.0, "centimetres")])
def test_a_certificate_in_another_unit_is_left_out(night_01, factor, unit):
    first, *others = night_01.benchmarks
    wrong = first.model_copy(update={"certified_distance_mm": first.certified_distance_mm / factor})
    campaign, (found,) = plausible_campaign(dataclasses.replace(night_01, benchmarks=(wrong, *others)))
    assert f"looks like {unit}; left out" in found.text
    assert campaign.benchmarks == tuple(others)


def test_exchanged_certificates_are_left_out(night_01):
    """Each is 15 m and more from its ends' coordinates, and is the other's."""
    a, b, *others = night_01.benchmarks
    swapped = [
        one.model_copy(update={"certified_distance_mm": other.certified_distance_mm}) for one, other in ((a, b), (b, a))
    ]
    campaign, found = plausible_campaign(dataclasses.replace(night_01, benchmarks=(*swapped, *others)))
    assert campaign.benchmarks == tuple(others)
    for record, other in zip(found, (b, a), strict=True):
        assert f"looks like that of {other.target}; left out" in record.text


def test_a_certificate_off_by_metres_is_left_out(night_01):
    first, *others = night_01.benchmarks
    longer = first.model_copy(update={"certified_distance_mm": first.certified_distance_mm + 400.0})
    campaign, (found,) = plausible_campaign(dataclasses.replace(night_01, benchmarks=(longer, *others)))
    assert campaign.benchmarks == tuple(others)
    assert "undecided which is wrong" in found.text


# Posture


@pytest.mark.parametrize(
    ("azimuth", "elevation", "cause"),
    [
        (145.3 * DEGREE, 30.0 * DEGREE, "both in radians"),
        (145.3, 30.0 * DEGREE, "elevation_deg in radians"),
        (145.3 * DEGREE, 30.0, "azimuth_deg in radians"),
        (30.0, 145.3, "azimuth and elevation exchanged"),
        (325.3, 30.0, "an azimuth counted from south"),
        (-145.3, 30.0, "an azimuth counted anticlockwise"),
    ],
)
def test_a_posture_that_turns_faces_away_is_refused_with_its_cause(night_01, azimuth, elevation, cause):
    wrong = of_site(night_01, "campaign", azimuth_deg=azimuth, elevation_deg=elevation)
    with pytest.raises(InputError, match=f"would come from behind: looks like .*{cause}"):
        plausible_campaign(wrong)


def test_one_wrong_normal_accuses_no_posture(night_01):
    first = night_01.triplets["TR01"]
    turned = edited(night_01, "triplets", "TR01", normal=tuple(-v for v in first.normal))
    (found,) = implausible_records(turned)
    assert (found.owners, found.fatal) == (("TR01-B",), False)
    assert "see the signs of its normal" in found.text


def with_prisms_in_the_ground_frame(campaign, seed=1, scatter_mm=15.0):
    """The campaign's dish prisms typed where they are in the ground frame, as a survey would give them."""
    frame, rng = nominal_frame(campaign), np.random.default_rng(seed)
    targets = dict(campaign.targets)
    for name, target in campaign.targets.items():
        if target.shapes_dish:
            place = frame.points(np.array(target.position_mm) / 1e3) * 1e3 + scatter_mm * rng.normal(size=3)
            normal = tuple(frame.directions(np.array(target.normal)).tolist())
            typed = {"frame": "ground", "position_mm": tuple(place.tolist()), "normal": normal}
            targets[name] = target.model_copy(update=typed)
    return dataclasses.replace(campaign, targets=targets)


@pytest.mark.parametrize("off", [0.2, -0.2, 1.0])
def test_an_elevation_that_prisms_in_the_ground_frame_contradict_is_named_with_its_size(night_01, off):
    """The dish is where it is: a record that says 0.2 degrees more is off by that, and its prisms by -0.2."""
    surveyed = with_prisms_in_the_ground_frame(night_01)
    assert implausible_records(surveyed) == ()
    (record,) = implausible_records(of_site(surveyed, "campaign", elevation_deg=30.0 + off))
    size = re.search(r"by ([+-][0-9.]+) degrees in elevation", record.text)
    assert float(size[1]) == pytest.approx(-off, abs=0.02)


@pytest.mark.parametrize("seed", range(20))
def test_surveyed_prisms_raise_no_alarm_within_the_pointing_correction(night_01, seed):
    surveyed = with_prisms_in_the_ground_frame(night_01, seed)
    assert implausible_records(of_site(surveyed, "campaign", elevation_deg=30.05)) == ()


# Clocks


def with_times(campaign, late):
    mjd = campaign.shots.mjd_utc + np.array([late.get(name, 0.0) for name in campaign.shots.ranger]) / 86_400.0
    return dataclasses.replace(campaign, shots=dataclasses.replace(campaign.shots, mjd_utc=mjd))


@pytest.mark.parametrize("late", [600.0, -600.0, 3600.0, 120.0])
@pytest.mark.parametrize("ranger", ["ZY103", "ZY116"])
def test_a_late_clock_is_named_and_put_back(night_01, ranger, late):
    campaign, (found,) = plausible_campaign(with_times(night_01, {ranger: late}))
    assert found.owners == (ranger,)
    assert ("later" if late > 0.0 else "earlier") in found.text
    assert np.abs(campaign.shots.mjd_utc - night_01.shots.mjd_utc).max() * 86_400.0 < 30.0


def test_two_late_clocks_are_named(night_01):
    found = implausible_records(with_times(night_01, {"ZY103": 600.0, "ZY115": -900.0}))
    assert sorted(record.owners for record in found) == [("ZY103",), ("ZY115",)]


def test_numbers_that_do_not_follow_time_accuse_no_clock(night_01):
    """Each ranger with numbers of its own: 1 to 97, then 98 to 194."""
    order = np.argsort(np.array(night_01.shots.ranger), kind="stable")
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.arange(1, len(order) + 1)
    own = dataclasses.replace(night_01, shots=dataclasses.replace(night_01.shots, shot=number))
    assert implausible_records(own) == ()


@pytest.mark.parametrize("ranger", ["ZY103", "ZY116"])
def test_a_ranger_with_numbers_of_its_own_has_no_late_clock(night_01, ranger):
    """Its shots are 1 to n, wherever in the night they were; the others follow in the order of time."""
    order = np.argsort(np.array(night_01.shots.ranger) != ranger, kind="stable")
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.arange(1, len(order) + 1)
    of_ranger = dataclasses.replace(night_01, shots=dataclasses.replace(night_01.shots, shot=number))
    assert implausible_records(of_ranger) == ()


def test_half_of_the_clocks_apart_accuse_neither_half(night_01):
    assert implausible_records(with_times(night_01, dict.fromkeys(night_01.rangers[::2], 600.0))) == ()


def test_more_than_a_quarter_of_the_clocks_apart_accuse_none(night_01):
    """Five of eighteen, each by another amount: the numbers are as likely not in the order of time."""
    late = dict(zip(["ZY103", "ZY115", "ZY116", "ZY117", "ZY118"], [600.0, 700.0, 800.0, 900.0, 1000.0], strict=True))
    assert implausible_records(with_times(night_01, late)) == ()


def test_a_clock_that_runs_fast_is_not_put_back_by_one_amount(night_01):
    mjd, of_ranger = night_01.shots.mjd_utc.copy(), np.array(night_01.shots.ranger) == "ZY116"
    mjd[of_ranger] += 0.5 * (mjd[of_ranger] - mjd[of_ranger][0])
    fast = dataclasses.replace(night_01, shots=dataclasses.replace(night_01.shots, mjd_utc=mjd))
    assert implausible_records(fast) == ()


# Gains


def test_shots_that_are_all_clipped_are_refused_for_the_gain(night_01):
    n = len(night_01.shots)
    (found,) = implausible_gains(night_01, np.ones(n, dtype=bool), np.full(n, 10.0))
    assert found.fatal
    assert "lower the gain" in found.text


def test_a_ranger_that_clips_is_named_and_a_few_clipped_shots_are_not(night_01):
    n, mine = len(night_01.shots), np.array(night_01.shots.ranger) == "ZY105"
    (found,) = implausible_gains(night_01, mine, np.full(n, 10.0))
    assert (found.owners, found.fatal) == (("ZY105",), False)
    some = np.arange(n) % 5 == 0
    assert implausible_gains(night_01, some, np.full(n, 10.0)) == []
