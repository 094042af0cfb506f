"""Initialisation commands of rangers against the records' own pointing."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.constants import MILLIMETRE
from catseye.errors import InputError
from catseye.geometry.mirror.pointing import aim, ray
from catseye.ranger.addresses import feed_address, ranger_addresses
from catseye.ranger.initialisation import (
    SiteCommands,
    commands_of_ranger,
    cube_numbers,
    dish_centre,
    frame_of,
    head_commands,
    local_station,
    mount_from_reflector,
)
from catseye.ranger.line import format_request
from catseye.ranger.ranger import Ranger
from catseye.ranger.status import StatusWord
from catseye.records.site.folder import read_site
from catseye.reduction.site.places import nominal_frame, places_of
from catseye.reduction.site.stations import station_in
from ranger.ranger_scene import Told
from ranger.scripted_head import ScriptedHead
from repository import ROOT

GBT = ROOT / "examples" / "sites" / "gbt"


@pytest.fixture(scope="module")
def gbt():
    return read_site(GBT)


def told_everything(site, name, targets=None):
    """A ranger that was told its commands as lines; each must be accepted."""
    told = Told()
    mirror = site.mirror_of(name)
    told.ranger = Ranger(name, ScriptedHead(), limits=(mirror.az_low_limit, mirror.az_high_limit))
    told.head = told.ranger.head
    for request in commands_of_ranger(site, name, targets):
        told.ranger.receive(1, format_request(request))
        replies = [o.reply for o in told.turns(1, 0.0) if o.reply.command == request.command]
        assert len(replies) == 1
        assert replies[0].ok, replies[0].text
    return told.ranger


@pytest.mark.parametrize("name", ["ZY105", "ZY101", "ZY113", "ZY118"])
def test_initialised_ranger_points_at_the_recorded_targets(gbt, name):
    """Ground coordinates and the campaign's own station are the other way to the same counts.

    Base point, places and angles travel with 0.1 um, 1 um and 1e-9 rad: 2e-7 rad and 3e-3 counts at 5 m and more.
    """
    ranger = told_everything(gbt, name)
    assert StatusWord.INITIALISED in ranger.status()
    assert len(ranger.cubes.by_number) == len(gbt.target_names) - 1  # all but itself, ZRG included
    station, places = station_in(gbt, name), places_of(gbt)
    mirror = gbt.mirror_of(name)
    assert ranger.cubes.counts(ranger.cubes.find(0)) == (mirror.azm_zrg, mirror.elv_zrg)
    assert ranger.d0_mm == mirror.d0_mm
    checked = 0
    for target in list(places)[::37]:
        if target == name:
            continue
        cube = ranger.cubes.find(target)
        true = aim(station, places[target].start)
        if float(true.range) < 5.0:
            continue
        checked += 1
        assert cube.number == cube_numbers(gbt)[target]
        found = aim(ranger.cubes.station, np.array(cube.place_mm) * MILLIMETRE)
        assert float(found.range) == pytest.approx(float(true.range), abs=3e-6)
        assert ranger.cubes.coarse_mm(cube) == pytest.approx(float(true.range) * 1e3, abs=3e-3)
        assert float(found.elevation_counts) == pytest.approx(float(true.elevation_counts), abs=3e-3)
        turn = abs(np.sin(float(true.phi))) * (float(found.azimuth_counts) - float(true.azimuth_counts))
        assert abs(turn) < 3e-3
    assert checked > 40


def test_feed_arm_ranger_uses_the_reflector_frame(gbt):
    frame = nominal_frame(gbt)
    for record in gbt.feedarm.ranger:
        assert frame_of(gbt, record.name) == "reflector"
        station = local_station(gbt, record.name)
        assert np.allclose(station.scan_point / MILLIMETRE, record.nominal_scan_point_mm, atol=1e-6)
        commands = SiteCommands(gbt).of_cubes(record.name, ["DP20C"])
        place = np.array([float(v) for v in next(c for c in commands if c.command == "COO").parameters[1:4]])
        assert np.allclose(place, gbt.targets["DP20C"].position_mm, atol=1e-6)
        found = aim(station, place * MILLIMETRE)
        line = ray(station, [float(found.azimuth_counts), float(found.elevation_counts)])
        hit = frame.points(line.origin + float(found.range) * line.direction)
        assert np.allclose(hit, places_of(gbt)["DP20C"].start, atol=1e-9)
    assert frame_of(gbt, "ZY101") == "ground"
    with pytest.raises(InputError, match="unknown ranger ZY999 at gbt"):
        frame_of(gbt, "ZY999")


def test_mount_without_a_record_faces_the_dish(gbt):
    bare = tuple(r.model_copy(update={"mount_z": None, "mount_y": None}) for r in gbt.feedarm.ranger)
    unsaid = replace(gbt, feedarm=gbt.feedarm.model_copy(update={"ranger": bare}))
    focal = gbt.site.paraboloid.focal_length_mm * MILLIMETRE
    centre = dish_centre(gbt)
    assert centre[2] == pytest.approx((centre[0] ** 2 + centre[1] ** 2) / (4 * focal))
    dish = np.array([t.position_mm for t in gbt.targets.values() if t.name.startswith("DP")]) * MILLIMETRE
    for record in bare:
        mount = mount_from_reflector(unsaid, record.name)
        assert np.allclose(mount @ mount.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(mount) == pytest.approx(1.0)
        way = centre - np.array(record.nominal_scan_point_mm) * MILLIMETRE
        assert np.allclose(mount @ way, [0.0, np.linalg.norm(way), 0.0], atol=1e-9)
        phi = np.degrees(aim(local_station(unsaid, record.name), dish).phi)
        assert np.all((phi > 44.0) & (phi < 136.0))
        assert np.allclose(mount, mount_from_reflector(gbt, record.name), atol=1e-5)  # gbt's records say the same


def test_cube_numbers_are_common_and_a_ranger_is_not_its_own_target(gbt):
    numbers = cube_numbers(gbt)
    assert numbers["ZRG"] == 0
    assert sorted(numbers.values()) == list(range(len(gbt.target_names)))
    for name in ("ZY101", "ZY113"):
        told = SiteCommands(gbt).of_cubes(name)
        assert told[0].parameters == (str(len(numbers) - 1),)
        placed = {r.parameters[4]: int(r.parameters[0]) for r in told if r.command == "COO"}
        assert placed == {n: k for n, k in numbers.items() if n not in ("ZRG", name)}


def test_prisms_have_constants_and_benchmarks_distances_on_their_ranger_only(gbt):
    benchmark, numbers = gbt.benchmarks[0], cube_numbers(gbt)
    other = next(r for r in gbt.rangers if r != benchmark.ranger)

    def kinds(ranger):
        return {
            int(r.parameters[0]): r.parameters[1:] for r in SiteCommands(gbt).of_cubes(ranger) if r.command == "KND"
        }

    assert kinds(benchmark.ranger)[numbers[benchmark.target]] == ("B", f"{benchmark.certified_distance_mm:.4f}")
    assert kinds(other).get(numbers[benchmark.target], ("S",))[0] == "S"
    prism = gbt.targets["DP20C"]
    assert kinds(other)[numbers["DP20C"]] == ("S", f"{prism.pc_mm:.4f}")
    ball = next(iter(gbt.triplets.values())).ball
    assert kinds(other)[numbers[ball.target]] == ("S", f"{ball.pc_b_mm:.4f}")
    hollow = next(t.name for t in gbt.targets.values() if t.type == "hollow" and t.name != benchmark.target)
    assert numbers[hollow] not in {n for n, kind in kinds(other).items() if kind[0] == "S"}


def test_only_requested_targets_are_sent_and_unknown_ones_refused(gbt):
    told = SiteCommands(gbt).of_cubes("ZY101", ["ZRG", "DP20C", "ZY101", "ZY102"])
    assert [r.parameters[4] for r in told if r.command == "COO"] == ["DP20C", "ZY102"]
    with pytest.raises(InputError, match="unknown target DP99X"):
        SiteCommands(gbt).of_cubes("ZY101", ["DP99X"])


def test_motion_settings_are_sent_in_a_valid_order(gbt):
    for abv, aba in ((900, 50), (300_000, 5_000), (None, 3), (1_000, None), (50_000_000, 1_000_000)):
        keys = {"abv_0": abv, "aba_0": aba, "fkp_0": 12, "fsi_0": 3, "erl_0": 400}
        mirror = gbt.mirror_of("ZY101").model_copy(update=keys)
        site = replace(gbt, mirrors={**gbt.mirrors, mirror.zp: mirror})
        ranger = told_everything(site, "ZY101", ["DP20C"])
        axis = ranger.axes[0]
        assert axis.velocity == (abv or 400_000)
        assert axis.acceleration == (aba or 1_000)
        assert axis.filter == (12, 0, 0, 0, 3)
        assert axis.error_limit == 400
        assert all(r.parameters[0] == "0" for r in head_commands(site, "ZY101") if r.command in ("ABV", "ABA"))


def test_files_agree_with_the_commands(gbt, tmp_path):
    files = SiteCommands(gbt).files("ZY113")
    assert list(files) == ["CUBES.INI", "ZY113.INI", "zp113.INI"]
    for name, text in files.items():
        (tmp_path / name).write_text(text, "ascii")
    mirror = gbt.mirror_of("ZY113")
    told = Told(files=tmp_path, mirror=mirror.zp)
    told.ranger.name = "ZY113"
    told.ranger.receive(1, "INITZY")
    replies = [o.reply for o in told.turns(300, 0.0)]
    assert "STW" in {r.command for r in replies}
    assert (replies[-1].command, replies[-1].ok) == ("INITZY", True)
    assert [r.ok for r in replies if r.command == "INITZY"] == [True]
    direct = told_everything(gbt, "ZY113")
    assert told.ranger.cubes.geometry == direct.cubes.geometry
    assert told.ranger.cubes.by_number == direct.cubes.by_number
    assert told.ranger.given == direct.given


def test_addresses_agree_with_the_specification(gbt):
    loopback = ranger_addresses(gbt, "loopback")
    assert loopback["ZY101"] == ("127.0.8.1", 5240, 5241)
    assert loopback["ZY118"] == ("127.0.8.18", 5240, 5241)
    assert ranger_addresses(gbt)["ZY102"] == ("127.0.0.1", 24_120, 24_121)
    assert feed_address("loopback") == ("127.0.0.1", 5250)
    assert feed_address() == ("127.0.0.1", 24_100)
    with pytest.raises(InputError, match="port base 65500 gives ports up to 65681"):
        ranger_addresses(gbt, 65_500)
