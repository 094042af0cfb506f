"""The bundled Green Bank site: found by name, all its prisms where the design has them."""

import importlib.util
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.gateways.examples import copy_example
from catseye.records.files import examples
from catseye.records.files.examples import example_campaign, located
from catseye.records.site.folder import read_site, site_files
from catseye.reduction.site.places import places_of
from repository import ROOT

SITES = examples.examples_directory() / "sites"  # of the package, where it is installed
TARGETS_OF_NIGHT = {"ZEG41040L", "ZEG20440L", "ZAG731P", "ZAG731D", *(f"ZBM{n:02d}" for n in range(1, 7))}
FOCAL_LENGTH_MM, APERTURE_MM, RIM_MM = 60_000.0, 54_000.0, 50_000.0  # 100 m that begin 4 m from the vertex
ROUNDING_MM = 0.001  # of each coordinate as written


@pytest.fixture(scope="module")
def gbt():
    return read_site(examples.example("gbt"))


@pytest.fixture(scope="module")
def generator():
    spec = importlib.util.spec_from_file_location("make_gbt", SITES / "make_gbt.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def dish(gbt):
    return {name: target for name, target in gbt.targets.items() if name.startswith("DP")}


@pytest.fixture(scope="module")
def points(dish):
    return np.array([target.position_mm for target in dish.values()])


def test_examples_are_found_by_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert examples.example("gbt") == located("gbt") == SITES / "gbt"
    assert example_campaign() == located("night-01") == SITES.parent / "night-01"
    assert located("./gbt") == SITES / "gbt"  # a path is what it means: here is no such folder
    assert located("elsewhere/gbt") == Path("elsewhere/gbt")
    assert located("networks/feed-arm.toml") == located("examples/networks/feed-arm.toml")
    assert located("networks/feed-arm.toml").is_file()
    for name in ("", "..", "../sites", "/etc", "vla"):
        with pytest.raises(InputError, match=r"^example .* not found"):
            examples.example(name)


def test_local_site_takes_precedence_over_an_example(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("night-01").mkdir()
    Path("night-01", "coordinates.json").touch()  # what catseye reduce wrote
    assert located("night-01") == SITES.parent / "night-01"
    Path("night-01", "site.toml").touch()
    assert located("night-01") == Path("night-01")
    Path("networks").mkdir()
    Path("networks", "feed-arm.toml").touch()
    assert located("networks/feed-arm.toml") == Path("networks/feed-arm.toml")


def test_every_listed_example_is_there_and_can_be_copied(tmp_path):
    names = examples.example_names()
    assert {"night-01", "sites/gbt", "networks/ground-ring", "networks/feed-arm.toml"} <= set(names)
    assert all(examples.example(name).exists() for name in names)
    count = len(copy_example("", tmp_path / "mine"))
    assert count > 200
    assert (tmp_path / "mine/night-01/frames.npy").stat().st_size == (
        ROOT / "examples/night-01/frames.npy"
    ).stat().st_size
    with pytest.raises(InputError, match="exists and is not empty"):
        copy_example("", tmp_path / "mine")


def test_full_disk_is_reported_by_the_first_file_without_output(tmp_path):
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, before[1]))  # of the night only its samples are larger
        with pytest.raises(InputError, match=r"^[^\n]+/mine/frames\.npy: cannot be written: File too large$"):
            copy_example("night-01", tmp_path / "mine")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not list(tmp_path.iterdir())


def test_examples_that_were_not_installed_are_refused_in_one_line(monkeypatch, tmp_path):
    package = tmp_path / "lib" / "catseye"
    monkeypatch.setattr(examples, "__file__", str(package / "records" / "files" / "examples.py"))
    with pytest.raises(InputError, match=r"^the examples are missing: neither [^\n]+ nor [^\n]+$"):
        examples.example("gbt")
    (package / "examples" / "night-01").mkdir(parents=True)
    (package / "examples" / "sites" / "gbt").mkdir(parents=True)
    assert examples.example("gbt") == package / "examples" / "sites" / "gbt"


def test_the_site_holds_all_rangers_triplets_and_prisms(gbt, dish):
    assert gbt.rangers == tuple(f"ZY{n}" for n in range(101, 119))
    assert len(gbt.monuments) == 12
    assert len(gbt.feedarm.ranger) == 6
    assert sorted(gbt.triplets) == [f"TR{n:02d}" for n in range(1, 11)]
    assert len(dish) == 2209
    assert set(gbt.targets) - set(dish) == TARGETS_OF_NIGHT
    assert len(gbt.target_names) == 2209 + 10 + 30 + 18 + 1
    assert gbt.site.campaign.name == "gbt"


def test_points_off_the_dish_equal_those_of_night_01(gbt, night_01):
    for name in ("monuments", "mirrors", "triplets", "benchmarks"):
        assert getattr(gbt, name) == getattr(night_01, name)
    still = {name for name in TARGETS_OF_NIGHT if not name.startswith("ZAG")}
    assert {name: gbt.targets[name] for name in still} == {name: night_01.targets[name] for name in still}
    bare = tuple(r.model_copy(update={"mount_z": None, "mount_y": None}) for r in gbt.feedarm.ranger)
    assert gbt.feedarm.model_copy(update={"ranger": bare}) == night_01.feedarm
    posture = night_01.site.campaign.model_copy(update={"name": "gbt"})
    assert gbt.site == night_01.site.model_copy(update={"campaign": posture})


def test_targets_of_the_alidade_are_where_night_01_has_them_in_its_posture(gbt, night_01):
    here, there = places_of(gbt), places_of(night_01)
    for name in ("ZAG731P", "ZAG731D"):
        assert gbt.targets[name].frame == "alidade"
        assert gbt.targets[name].position_mm[0] == pytest.approx({"P": -22_320, "D": 22_360}[name[-1]], abs=25)
        np.testing.assert_allclose(here[name].start, there[name].start, rtol=0, atol=1e-4)  # both written to 0.1 mm


def test_mounts_of_the_feed_arm_look_at_the_dish(gbt):
    middle = np.array([0.0, 54.0, 54.0**2 / (4 * 60.0)]) * 1e3
    for ranger in gbt.feedarm.ranger:
        way = middle - np.array(ranger.nominal_scan_point_mm)
        assert np.dot(ranger.mount_y, way / np.linalg.norm(way)) > 0.9999
        assert abs(np.dot(ranger.mount_y, ranger.mount_z)) < 1e-5


def test_the_site_lies_where_the_observatory_says(gbt):
    """38°25'59.236" N, 79°50'23.406" W (NAD83), to the digits of the record; the track is at 807.43 m."""
    assert gbt.site.site.latitude_deg == pytest.approx(38 + 25 / 60 + 59.236 / 3600, abs=5e-7)
    assert gbt.site.site.longitude_deg == pytest.approx(-(79 + 50 / 60 + 23.406 / 3600), abs=5e-7)
    assert gbt.site.site.elevation_of_z0_m == pytest.approx(807.43, abs=2.0)  # the track's top is above ZY103's ball


def test_every_prism_lies_on_the_design_paraboloid(points):
    sag = np.sum(points[:, :2] ** 2, axis=1) / (4.0 * FOCAL_LENGTH_MM)
    np.testing.assert_allclose(points[:, 2], sag, rtol=0, atol=ROUNDING_MM)


def test_the_dish_is_symmetric_and_fills_the_aperture(points):
    mirrored = {(round(-x, 3) + 0.0, round(y, 3)) for x, y, _ in points}
    assert mirrored == {(round(x, 3) + 0.0, round(y, 3)) for x, y, _ in points}
    radius = np.hypot(points[:, 0], points[:, 1] - APERTURE_MM)
    assert radius.max() < RIM_MM + 1_900.0  # a panel whose middle is on the rim reaches half its diagonal out
    assert points[:, 1].max() == pytest.approx(104_000.0, abs=1.0)
    assert np.hypot(points[:, 0], points[:, 1]).min() == pytest.approx(4_000.0, abs=1.0)
    along_rim = np.linspace(0, 2 * np.pi, 360, endpoint=False)
    rim = np.column_stack([RIM_MM * np.sin(along_rim), APERTURE_MM + RIM_MM * np.cos(along_rim)])
    gap = np.linalg.norm(points[None, :, :2] - rim[:, None], axis=2).min(axis=1)
    assert gap.max() < 2_000.0  # a panel's width or less: no part of the rim is bare


def test_the_names_say_hoop_side_and_place(dish, points):
    hoop = np.array([int(name[2:4]) for name in dish])
    side = np.array([name[4] for name in dish])
    assert set(hoop) == set(range(1, 46))
    r = np.hypot(points[:, 0], points[:, 1])
    for h in range(1, 46):
        assert np.ptp(r[hoop == h]) < 2 * ROUNDING_MM
    assert (np.diff([r[hoop == h][0] for h in range(1, 46)]) > 1_500.0).all()
    assert (points[side == "P", 0] > 0).all()
    assert (points[side == "N", 0] < 0).all()
    assert (points[side == "C", 0] == 0).all()
    assert Counter(side)["C"] == 45
    assert Counter(side)["P"] == Counter(side)["N"] == (2209 - 45) // 2
    for h in range(1, 46):  # nn counts outwards from the plane of symmetry
        names = [name for name in dish if name.startswith(f"DP{h:02d}P")]
        assert names == [f"DP{h:02d}P{n:02d}" for n in range(1, len(names) + 1)]
        x = [dish[name].position_mm[0] for name in names]
        assert (np.diff(x) > 0).all()


def test_no_two_prisms_are_nearer_than_a_panels_corner_may_be(gbt, points):
    order = np.argsort(points[:, 1])
    p = points[order]
    nearest = np.inf
    for shift in range(1, 300):
        nearest = min(nearest, np.linalg.norm(p[shift:] - p[:-shift], axis=1).min())
    assert 300.0 < nearest < 1_500.0
    triplets = np.array([t.nominal_position_mm for t in gbt.triplets.values()])
    assert np.linalg.norm(points[:, None] - triplets, axis=2).min() > 200.0


def test_every_prism_looks_at_the_aim_point_from_the_front_of_the_dish(gbt, dish, points):
    normal = np.array([target.normal for target in dish.values()])
    towards = np.array(gbt.feedarm.aim_point.nominal_mm) - points
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    assert np.linalg.norm(normal - towards, axis=1).max() < 2e-5  # five digits are written
    surface = np.column_stack([-points[:, :2] / (2.0 * FOCAL_LENGTH_MM), np.ones(len(points))])
    assert (np.sum(surface * normal, axis=1) > 0.0).all()
    assert len({target.normal for target in dish.values()}) == 2209


def test_the_glass_is_that_of_the_prism_equations(gbt, dish):
    """P_c = -(n - 1/n) h and the reference point h/n deep, night-01's README; so are its own sixty prisms."""
    n = gbt.site.ranging.bk7_to_air_group_index_ratio
    h = np.array([target.height_mm for target in dish.values()])
    np.testing.assert_allclose([target.pc_mm for target in dish.values()], -(n - 1 / n) * h, rtol=0, atol=6e-5)
    np.testing.assert_allclose([target.hrp_mm for target in dish.values()], h / n, rtol=0, atol=6e-4)
    assert h.mean() == pytest.approx(38.1, abs=0.01)
    assert h.std() == pytest.approx(0.09, rel=0.1)


def test_the_layout_has_2004_panels_and_their_corners_are_the_2209(generator, points):
    """Counted again, panel by panel, from the middles and by an index of places, not by the generator's own sets."""
    r, found, panels = generator.hoops(), set(), 0
    for tier in range(44):
        step = generator.STEP * 1.5 ** sum(tier < w for w in generator.WIDER)
        for left in range(-400, 400):
            angle, middle = (left + 0.5) * step, (r[tier] + r[tier + 1]) / 2
            if abs(angle) > np.pi / 2 or np.hypot(middle * np.sin(angle), middle * np.cos(angle) - 54.0) > 50.0:
                continue
            panels += 1
            for rho in r[tier : tier + 2]:
                for a in (left * step, (left + 1) * step):
                    found.add((round(rho * np.sin(a) * 100) + 0, round(rho * np.cos(a) * 100)))  # centimetres
    assert (panels, len(found)) == (2004, 2209)
    assert found == {(round(x / 10) + 0, round(y / 10)) for x, y, _ in points}


def test_the_rows_are_equally_deep_along_the_surface(generator):
    """Arc lengths by Simpson's rule against the closed form, which made them."""
    from scipy.integrate import quad

    r = generator.hoops()
    depth = [quad(lambda q: np.hypot(1.0, q / 120.0), a, b)[0] for a, b in pairwise(r)]
    np.testing.assert_allclose(depth, np.mean(depth), rtol=1e-6)
    assert 2.5 < depth[0] < 2.6


def test_the_generator_gives_the_files_that_are_bundled(generator, dish):
    assert {target.name: target for target in generator.prisms()} == dish


def test_no_panel_is_counted_in_or_out_by_rounding(generator):
    """The rim passes no panel's middle within a hundredth of a millimetre, so every machine counts the same."""
    r = generator.hoops()
    nearest = np.inf
    for tier, half in enumerate(generator.half_panels()):
        step = generator.STEP * 1.5 ** sum(tier < w for w in generator.WIDER)
        middle = (r[tier] + r[tier + 1]) / 2
        for k in (half - 0.5, half + 0.5):
            angle = k * step
            off = np.hypot(middle * np.sin(angle), middle * np.cos(angle) - 54.0) - 50.0
            nearest = min(nearest, abs(off))
    assert nearest > 1e-5


def test_the_whole_site_is_equal_after_writing_and_reading(gbt, tmp_path):
    for file, text in site_files(gbt).items():
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text(text, encoding="utf-8")
    again = read_site(tmp_path)
    for name in ("site", "monuments", "mirrors", "feedarm", "targets", "triplets", "benchmarks"):
        assert getattr(again, name) == getattr(gbt, name)
