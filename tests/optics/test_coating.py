"""Films against closed forms, conservation of energy, tabulated metals and another program."""

import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import ValidityError
from catseye.optics.coating import (
    Coating,
    group_path,
    index,
    named,
    quarter_wave,
    quarter_wave_mirror,
    response,
)
from catseye.optics.glass import group_index, phase_index
from repository import TESTS

VECTORS = tomllib.loads((TESTS / "vectors" / "coating.toml").read_text())
indices = st.builds(complex, st.floats(1.2, 3.0), st.floats(-4.0, 0.0))
layers = st.lists(st.tuples(indices, st.floats(0.0, 0.5)), max_size=4).map(tuple)
angles = st.floats(0.0, 1.5)
polarizations = st.sampled_from("sp")


@pytest.mark.parametrize(
    "case", VECTORS["stack"], ids=lambda c: f"{c['name']} {c['polarization']} {c['incidence_deg']}"
)
def test_a_stack_does_what_another_program_computes(case):
    made = Coating(
        tuple((complex(n, -k), thickness) for n, k, thickness in case["layers"]),
        complex(case["substrate"][0], -case["substrate"][1]),
    )
    angle, polarization = np.radians(case["incidence_deg"]), case["polarization"]
    found = response(made, case["wavelength_um"], angle, polarization=polarization)
    tolerance = VECTORS["tolerance"]
    assert found.reflectance == pytest.approx(case["reflectance"], abs=tolerance)
    assert found.transmittance == pytest.approx(case["transmittance"], abs=tolerance)
    theirs = np.exp(-1j * case["phase"]) * (1.0 if polarization == "s" else -1.0)
    assert complex(found.r / np.abs(found.r)) == pytest.approx(theirs, abs=1e-8)


@given(layers, indices, angles, polarizations, st.floats(0.5, 1.1))
def test_reflectance_absorptance_and_transmittance_sum_to_one(films, substrate, angle, polarization, wavelength):
    found = response(Coating(films, substrate), wavelength, angle, polarization=polarization)
    assert found.reflectance + found.transmittance + found.absorptance == pytest.approx(1.0, abs=1e-9)
    assert found.absorptance >= -1e-9
    assert 0.0 <= found.reflectance <= 1.0 + 1e-12


@given(st.floats(1.3, 2.5), st.floats(1.3, 2.5), st.floats(0.1, 1.4), polarizations)
def test_a_face_lets_through_the_same_from_either_side(before, behind, angle, polarization):
    there = response(Coating((), behind), 0.78, angle, polarization=polarization, medium=before)
    sine = before * np.sin(angle) / behind
    if sine >= 0.999:
        return
    back = response(Coating((), before), 0.78, np.arcsin(sine), polarization=polarization, medium=behind)
    assert there.transmittance == pytest.approx(float(back.transmittance), rel=1e-9)
    assert complex(there.r) == pytest.approx(-complex(back.r), abs=1e-12)


def test_at_brewsters_angle_glass_reflects_no_light_that_is_polarized_in_the_plane():
    n = float(phase_index(0.78, "N-BK7"))
    found = response(named("uncoated", 0.78), 0.78, np.arctan(n), polarization="p")
    assert found.reflectance == pytest.approx(0.0, abs=1e-25)
    across = response(named("uncoated", 0.78), 0.78, np.arctan(n), polarization="s").reflectance
    assert across == pytest.approx(((n**2 - 1.0) / (n**2 + 1.0)) ** 2)


def test_total_reflection_keeps_all_light_and_turns_the_phases_as_fresnel_has_it():
    n, angle = 1.511187, np.radians(54.7356)  # a cube corner in glass, looked into straight
    root = np.sqrt((n * np.sin(angle)) ** 2 - 1.0)
    phases = {}
    for polarization in "sp":
        found = response(Coating((), "air"), 0.78, angle, polarization=polarization, medium=n)
        assert found.reflectance == pytest.approx(1.0, abs=1e-12)
        phases[polarization] = np.angle(complex(found.r))
    assert phases["s"] == pytest.approx(2.0 * np.arctan(root / (n * np.cos(angle))))  # exp(i(wt - kz))
    # of the tangential field: pi beyond that of the magnetic one
    magnetic = 2.0 * np.arctan(n * root / np.cos(angle))
    assert np.cos(phases["p"] - magnetic + np.pi) == pytest.approx(1.0, abs=1e-12)


def test_a_quarter_wave_mirror_has_the_reflectance_of_the_closed_form():
    high, low, glass = 2.1143, 1.4537, 1.5112
    for pairs in (1, 4, 8):
        made = quarter_wave_mirror(pairs, high=high, low=low, substrate=glass)
        admittance = (high / low) ** (2 * pairs) * high**2 / glass
        expected = ((1.0 - admittance) / (1.0 + admittance)) ** 2
        assert response(made, 0.780).reflectance == pytest.approx(expected, abs=1e-12)


def test_a_quarter_wave_of_the_root_of_the_glass_reflects_nothing():
    film = quarter_wave(np.sqrt(1.5112), 0.78)
    assert response(Coating((film,), 1.5112), 0.78).reflectance == pytest.approx(0.0, abs=1e-25)
    plain, coated = (float(response(named(name, 0.78), 0.78).reflectance) for name in ("uncoated", "ar"))
    assert (plain, coated) == pytest.approx((0.0414, 0.0125), abs=3e-4)  # of the trade: 4.2 % and 1.3 %


def endless_mirror(wavelength, high, low):
    """Group path, m, of endless quarter waves at the centre of their band, from the phase and group index of each.

    Each layer turned by e = (pi/2)(n_g/n)(dw/w) off a quarter wave maps the impedance z in front to
    z L^2/H^2 + i e_H/H + i e_L L/H^2; its fixed point in r = -(1 - 2 z), the high index H outside. Babic and Corzine
    (1992) have it without dispersion.
    """
    (n_h, g_h), (n_l, g_l) = high, low
    return 0.5 * wavelength * (g_h + g_l) / (n_h**2 - n_l**2)


def test_a_many_layered_mirror_delays_as_the_closed_form_says():
    plain = group_path(quarter_wave_mirror(25, high=2.1143, low=1.4537), 0.780)
    assert plain == pytest.approx(endless_mirror(0.78e-6, (2.1143,) * 2, (1.4537,) * 2), rel=1e-6)
    step = 1e-4
    slope = float((index("Ta2O5", 0.78 + step) - index("Ta2O5", 0.78 - step)).real) / (2.0 * step)
    n_h = float(index("Ta2O5", 0.78).real)
    high = (n_h, n_h - 0.78 * slope)
    low = (float(phase_index(0.78, "fused-silica")), float(group_index(0.78, "fused-silica")))
    dispersive = group_path(quarter_wave_mirror(25), 0.780)
    assert dispersive == pytest.approx(endless_mirror(0.78e-6, high, low), rel=1e-5)
    assert dispersive == pytest.approx(0.61e-6, abs=0.01e-6)


def test_a_thick_plate_of_matched_glass_delays_by_its_group_index_there_and_back():
    film = Coating((("N-BK7", 50.0),), complex(float(phase_index(0.78, "N-BK7")), -1e-5))
    face = Coating((("N-BK7", 50.0), ("N-BK7", 0.0)), "gold")
    # with the outer face matched too only the gold reflects: 2 n_g d, and the gold's own
    medium = float(phase_index(0.78, "N-BK7"))
    bare = group_path(Coating((), "gold"), 0.78, medium=medium)
    whole = group_path(face, 0.78, medium="N-BK7")
    assert whole - bare == pytest.approx(100e-6 * float(group_index(0.78, "N-BK7")), abs=0.02e-6)  # medium's dispersion
    assert response(film, 0.78, medium="N-BK7").reflectance < 1e-9


def test_a_metal_without_loss_delays_by_twice_its_skin():
    plasma = 0.15  # um: n = -i k, k = sqrt((l/plasma)^2 - 1), by the closed form of arg((1 + ik)/(1 - ik))
    wavelength = 0.78

    def at(light):
        return Coating((), complex(0.0, -np.sqrt((light / plasma) ** 2 - 1.0)))

    step = 1e-5
    above, below = (
        np.angle(complex(response(at(wavelength / (1.0 + s)), wavelength / (1.0 + s)).r)) for s in (step, -step)
    )
    k = np.sqrt((wavelength / plasma) ** 2 - 1.0)
    closed = 2.0 / (1.0 + k**2) * (k + 1.0 / k) * wavelength / (2.0 * np.pi)  # -d(2 arctan k)/dk0
    assert -(above - below) / (2.0 * step) * wavelength / (2.0 * np.pi) == pytest.approx(closed, rel=1e-6)


def test_metals_reflect_at_780_nm_what_the_notes_choose_between():
    shown = {name: float(response(named(name, 0.78), 0.78).reflectance) for name in ("gold", "silver", "aluminium")}
    assert shown["silver"] > shown["gold"] > shown["aluminium"]
    assert shown == pytest.approx({"gold": 0.975, "silver": 0.996, "aluminium": 0.875}, abs=0.003)
    # [RAKIC98]'s oscillators fitted to other data: 0.955, 0.973, 0.880
    assert shown == pytest.approx({"gold": 0.955, "silver": 0.973, "aluminium": 0.880}, abs=0.025)


def test_indices_are_the_tables_they_come_from():
    assert complex(index("silver", 0.8211)) == pytest.approx(0.04 - 5.727j)
    assert complex(index("aluminium", 0.77491)) == pytest.approx(2.6154 - 8.4914j)
    gao = {0.60: 2.143086, 0.70: 2.124149, 0.78: 2.114331, 0.90: 2.104484, 1.10: 2.094918}
    assert index("Ta2O5", list(gao)).real == pytest.approx(list(gao.values()), abs=1e-6)
    assert complex(index("MgF2", 0.5876)).real == pytest.approx(1.37774, abs=2e-5)  # n_d of the data sheets


def test_meaningless_input_is_refused():
    for call, text in (
        (lambda: response(named("gold", 0.78), 0.78, 1.6), "right angle"),
        (lambda: response(named("gold", 0.78), 0.5), "outside 0.6168-1.088 um"),
        (lambda: named("copper", 0.78), "expected one of gold"),
        (lambda: index("unobtainium", 0.78), "is unknown"),
        (lambda: response(named("gold", 0.78), 0.78, medium=1.5 - 0.1j), "absorbs"),
        (lambda: response(Coating(((1.5, -0.1),), 1.5), 0.78), "thickness"),
        (lambda: response(named("gold", 0.78), 0.78, polarization="x"), "not 's' or 'p'"),
    ):
        with pytest.raises(ValidityError, match=text):
            call()
