"""Where things truly rest: as the files say when nothing is drawn, and off by the stated sizes when it is."""

from dataclasses import replace

import numpy as np
import pytest

from catseye.records.site.folder import REFERENCE
from catseye.reduction.site.places import places_of
from catseye.simulator.twin.conditions import STILL
from catseye.simulator.twin.telescope import low_orders
from simulator.living_scene import only, rms, site, twin, whole_site


def test_with_nothing_drawn_all_stands_where_the_reduction_expects_it():
    made, expected = twin(planted=only("h_corr", "mirror_offset")), places_of(site())
    names = [n for n in site().target_names if n != REFERENCE and not n.startswith("ZBM")]
    found = made.points(names, 0.0)[0]
    for name, at in zip(names, found, strict=True):
        # directions are written with five digits: a data sheet's axis is square to its normal to 1e-5 of 318 mm; dish
        # prisms keep their x and y, and z is written to the micrometre
        assert at == pytest.approx(expected[name].start, abs=5e-6), name


def test_certified_distances_hold_within_their_uncertainty():
    z = []
    for seed in range(10):
        made = twin(seed=seed)
        for row in site().benchmarks:
            way = made.point(row.ranger, 0.0) - made.point(row.target, 0.0)
            z.append((np.linalg.norm(way) * 1e3 - row.certified_distance_mm) / row.u_mm)
    assert rms(z) == pytest.approx(1.0, abs=0.25)  # 60 draws: 9 %


def test_typing_and_surface_errors_have_their_stated_size():
    true, typed = twin(at=whole_site()), twin(at=whole_site(), planted=STILL)
    names = [n for n in whole_site().targets if n.startswith("DP")]
    away = np.array([true.scene.retros[n].rest_place - typed.scene.retros[n].rest_place for n in names])
    rest = np.array([typed.scene.retros[n].rest_place for n in names])
    surface = true.scene._surface
    assert rms(away[:, :2]) == pytest.approx(8e-3 * 0.96, rel=0.03)  # a normal clipped at two sigma
    off = np.array([true.scene.retros[n].rest_place for n in names])
    normal = (off[:, 2] - surface.height(off[:, :2])) * surface.up(off[:, :2])[:, 2]
    assert rms(normal) == pytest.approx(0.29e-3, rel=0.4)  # six low orders of one draw: 30 %
    low = low_orders(off[:, :2], surface.centre, surface.radius) @ surface.orders
    assert rms(normal - low) == pytest.approx(0.15e-3, rel=0.06)  # outwards is up
    smooth = normal - np.convolve(normal, np.ones(25) / 25, "same")
    assert 0.1e-3 < rms(smooth) < 0.25e-3  # from prism to prism
    assert np.abs(rest[:, 2] - surface.height(rest[:, :2])).max() < 1e-6


def test_a_triplet_is_its_data_sheet_within_the_sheets_uncertainties():
    z = []
    for seed in range(6):
        made = twin(seed=seed)
        for sheet in site().triplets.values():
            left, right, ball = (made.scene.retros[n] for n in sheet.targets)
            z.append((np.linalg.norm(right.rest_place - left.rest_place) * 1e3 - sheet.d12_mm) / sheet.u_d12_mm)
            high = (ball.rest_place - (left.rest_place + right.rest_place) / 2) @ left.facing * 1e3
            z.append((high - sheet.h_corr_mm) / sheet.u_h_corr_mm)
            z.append((left.sizes[0] * 1e3 - sheet.left_prism.height_mm) / sheet.left_prism.u_height_mm)
            assert ball.facing == pytest.approx(-left.facing, abs=1e-12)
    assert rms(z) == pytest.approx(1.0, abs=0.2)  # 180 draws: 5 %


def test_each_thing_rides_on_its_body():
    retros = twin().scene.retros
    bodies = {
        name: retros[name].body for name in ("DP20C", "TR03-B", "ZEG41040L", "ZEG20440L", "ZAG731P", "ZBM01", "ZY115")
    }
    assert bodies == {
        "DP20C": "dish",
        "TR03-B": "dish",
        "ZEG41040L": "arm",
        "ZEG20440L": "arm",
        "ZAG731P": "alidade",
        "ZBM01": "ground",
        "ZY115": "arm",
    }


def test_the_alidades_targets_turn_with_azimuth_only():
    at_site, turned, lifted = (
        twin(f"fixed {a} {e}", planted=STILL).point("ZAG731P", 0.0)[0]
        for a, e in ((145.3, 30), (235.3, 30), (145.3, 70))
    )
    x, y, z = at_site
    assert turned == pytest.approx([y, -x, z], abs=1e-9)  # clockwise by a right angle
    assert lifted == pytest.approx(at_site, abs=1e-12)


def test_a_draw_moves_no_other():
    few = replace(site(), targets={n: t for n, t in site().targets.items() if n not in ("DP20C", "ZAG731P")})
    names = [n for n in few.target_names if n != REFERENCE]
    whole, less = (twin("track 145 40", at=s).points(names, [12.0]) for s in (site(), few))
    assert np.array_equal(whole, less)
