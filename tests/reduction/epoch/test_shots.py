"""A ranger's shots as observations: every derivative against finite differences, every correction by hand."""

import dataclasses

import numpy as np
import pytest

from catseye.constants import SPEED_OF_LIGHT
from catseye.estimation.least_squares.rows import full_jacobian
from catseye.optics.retroreflector.kinds.registry import PRISM
from catseye.optics.retroreflector.prism import obliquity_correction
from catseye.reduction.epoch.parameter import AIR_KINDS, Parameter, ParameterKind
from catseye.reduction.epoch.ranges import follow_electronics, measure_phases
from catseye.reduction.epoch.shots import _obliquity, shot_group
from catseye.reduction.site.places import RangedPoint

F = 1.5e9
N_GLASS = 1.527077


@pytest.fixture(scope="module")
def state(network_01, reduced_night_01):
    """Parameters near the answer, every nuisance away from zero."""
    layout, c = network_01.layout, reduced_night_01.coordinates
    x = np.array(layout.start)
    for row, name in enumerate(c.points):
        x[layout.columns(name)] = c.x[row]
    rng = np.random.default_rng(7)
    for quantity in layout.at:
        if quantity.kind is ParameterKind.NORMAL:
            x[layout.columns(quantity, 2)] = rng.normal(0, 2e-3, 2)
        elif quantity.kind is ParameterKind.ZERO:
            x[layout.at[quantity]] = rng.normal(0, 1e-5)
        elif quantity.kind is ParameterKind.LEAKAGE:
            x[layout.columns(quantity, 2)] = rng.normal(0, 8e-4, 2)
    x[layout.air[:3]] = [0.2, -0.1, 0.02]
    sizes = {"level": 0.1, "slope": 0.05, "east": 2e-3, "north": 2e-3}
    for parameter, column in zip(network_01.field.parameters, layout.air, strict=True):
        if parameter.kind is ParameterKind.AIR:
            x[column] = rng.normal(0, sizes[parameter.of])
        elif parameter.kind is ParameterKind.LAG:
            x[column] = rng.normal(0, 30.0)
    for column, parameter in enumerate(layout.parameters):
        if parameter.kind is ParameterKind.TELESCOPE:
            x[column] = rng.normal(0, 1.0 if "scale" in parameter.of else 0.05)
    return x


STEPS = {  # of the difference quotient, in a parameter's own unit; of any other 1e-4
    ParameterKind.THERMOMETER: 1e-2,  # °C
    ParameterKind.PROFILE: 1e-2,  # °C
    ParameterKind.LAG: 10.0,  # s
    ParameterKind.AIR: 1e-2,  # °C; °C/m of east and north: 1e-4
    ParameterKind.TELESCOPE: 0.1,  # ppm, mm
}


@pytest.mark.parametrize("name", ["ZY104", "ZY116"])
def test_every_derivative_of_a_rangers_shots_is_a_finite_difference(network_01, state, name):
    """Misclosure (predicted minus observed) recomputed from scratch at x + h and x - h, cycles and all.

    Tolerances are what one pass holds and the next renews: air, glass and incidence along a moved path, 5e-5 of the
    step; the air along the optical length of glass and D0, up to 0.45 m; the slope by a tilt is the typed
    normal's, 2 mrad from the tilted one.
    """
    group, _ = shot_group(network_01, name, state)
    ends = (state[at[:, None] + np.arange(3)] for at in (group.origin, group.target))
    distance = np.linalg.norm(np.subtract(*ends), axis=1)
    jacobian, columns = full_jacobian(group, state), np.unique(group.columns)

    def misclosure(x):
        renewed, _ = shot_group(network_01, name, x)
        return renewed.predict(x)[0] - renewed.observed

    every = network_01.layout.parameters  # a feed-arm ranger has 500: a dozen of every kind
    by_kind = {kind: [c for c in columns if every[c].kind is kind] for kind in ParameterKind}
    some = [c for own in by_kind.values() for c in own[:: len(own) // 12 + 1]]
    assert {ParameterKind.AIR, ParameterKind.TELESCOPE, ParameterKind.LAG} <= {every[c].kind for c in some}
    for column in some:
        kind = every[column].kind
        h = 1e-4 if every[column].of in ("east", "north") and kind is ParameterKind.AIR else STEPS.get(kind, 1e-4)
        step = np.zeros(len(state))
        step[column] = h
        slope = (misclosure(state + step) - misclosure(state - step)) / (2 * h)
        size = np.abs(jacobian[:, column])
        air = 0.45 * np.max(size / distance)
        # a ppm of 100 m is 1e-4 m; rounding of an optical length, 3e-14 m, over twice the step
        special = {ParameterKind.LEAKAGE: 1e-9, ParameterKind.NORMAL: 1e-5, ParameterKind.TELESCOPE: 1e-12}
        tolerance = air if kind in AIR_KINDS else special.get(kind, 5e-5)
        np.testing.assert_allclose(jacobian[:, column], slope, atol=tolerance, rtol=0, err_msg=str(every[column]))


def test_the_slope_of_obliquity_by_tilt_is_a_finite_difference(network_01, state):
    targets = [t for t in sorted(network_01.places) if network_01.places[t].normal is not None][:12]
    rng = np.random.default_rng(2)
    towards = []
    for t in targets:
        normal = network_01.places[t].normal
        aside = np.linalg.svd(normal[None])[2][1:]
        v = normal + rng.uniform(-1, 1, 2) @ aside
        towards.append(v / np.linalg.norm(v))
    towards = np.array(towards)
    _, _, columns, slopes = _obliquity(network_01, targets, towards, state)
    for k in range(2):
        step = np.zeros(len(state))
        step[np.unique(columns[:, k])] = 1e-5
        up = _obliquity(network_01, targets, towards, state + step)[1]
        down = _obliquity(network_01, targets, towards, state - step)[1]
        # relative 1e-3: `across` belongs to the typed normal, the slope to the tilted one, 2 mrad apart
        np.testing.assert_allclose(slopes[:, k], (up - down) / 2e-5, rtol=2e-2, atol=1e-6)


def test_a_prism_seen_straight_has_no_obliquity_and_from_behind_a_finite_one(network_01, state):
    name = "DP001"
    x = np.array(state)
    x[network_01.layout.columns(Parameter(ParameterKind.NORMAL, name), 2)] = 0.0
    normal = network_01.places[name].normal
    for towards, cosine in ((normal, 1.0), (-normal, 0.0)):
        incidence, correction, _, slopes = _obliquity(network_01, [name], towards[None], x)
        assert correction[0] == pytest.approx(
            float(obliquity_correction(network_01.places[name].height, N_GLASS, cosine)), abs=1e-12
        )
        assert np.isfinite(slopes).all()
    assert incidence[0] == pytest.approx(np.pi, abs=1e-6)


def test_a_faces_two_directions_lie_across_its_normal():
    for normal in np.array([[0, 0, 1.0], [0.6, 0.8, 0], [0.48, 0.6, 0.64]]):
        across = RangedPoint("DP001", PRISM, np.zeros(3), normal).across
        np.testing.assert_allclose(across @ across.T, np.eye(2), atol=1e-15)
        np.testing.assert_allclose(across @ normal, 0.0, atol=1e-15)


def test_a_range_is_the_readmes_formula(night_01, reduced_night_01):
    """D = c/(2 n f) (N - phi/2 pi) + D0 + Pc + dPc, with the reduction's index and normal, and its own rest terms."""
    r = reduced_night_01.coordinates.ranges
    mirror = {n: night_01.mirror_of(n) for n in night_01.rangers}
    n = 1.0 + r.refractivity
    d0 = np.array([mirror[name].d0_mm for name in r.ranger]) * 1e-3
    plain = SPEED_OF_LIGHT / (2 * n * F) * (r.cycles - r.phase / (2 * np.pi)) + d0 + r.glass + r.obliquity
    corrected = plain + r.zero + r.leakage + r.moved
    # 1 um: the air's offsets are linearised about their start, the normals about the last pass
    np.testing.assert_allclose(r.range_, corrected, atol=1e-6)


def test_incidence_and_obliquity_of_a_shot_follow_from_its_points(night_01, reduced_night_01, network_01):
    """Against the typed normal: the estimated one is some 0.1 degree from it."""
    c = reduced_night_01.coordinates
    r = c.ranges
    for k in range(0, len(r.shot), 37):
        place = c.places[r.target[k]]
        if place.normal is None:
            assert r.incidence[k] == r.obliquity[k] == 0.0
            continue
        towards = c.x[c.index(r.ranger[k])] - c.x[c.index(r.target[k])]
        angle = np.arccos(place.normal @ towards / np.linalg.norm(towards))
        assert r.incidence[k] == pytest.approx(angle, abs=np.radians(1.0))
        h, i = place.height, r.incidence[k]
        readme = N_GLASS * h * (1 - np.sqrt(1 - (np.sin(i) / N_GLASS) ** 2)) - h / N_GLASS * (1 - np.cos(i))
        assert r.obliquity[k] == pytest.approx(readme, abs=1e-9)
        assert r.obliquity[k] <= 0.0


def test_shots_of_one_path_share_the_fluctuation_of_the_air_and_of_two_paths_do_not(network_01, state):
    group, parts = shot_group(network_01, "ZY102", state)
    distance = np.linalg.norm(
        state[group.target[:, None] + np.arange(3)] - state[group.origin[:, None] + np.arange(3)], axis=1
    )
    quiet = 1e-9  # ppm
    ranging = network_01.campaign.site.ranging.model_copy(update={"path_index_fluctuation_ppm": quiet})
    site = network_01.campaign.site.model_copy(update={"ranging": ranging})
    still = dataclasses.replace(network_01, campaign=dataclasses.replace(network_01.campaign, site=site))
    share = group.covariance - shot_group(still, "ZY102", state)[0].covariance
    same = np.array(parts.target)[:, None] == np.array(parts.target)
    assert (same.sum(axis=1) > 1).any()
    np.testing.assert_allclose(share, np.where(same, np.outer(distance, distance) * (0.15e-6) ** 2, 0.0), atol=1e-18)


@pytest.mark.parametrize("name", ["ZY103", "ZY116"])
@pytest.mark.parametrize("more", [1e-4, 1e-4j])
def test_a_sheet_with_other_leakage_changes_the_ranges_as_the_derivative_says(night_01, network_01, name, more):
    """References and targets turn both; what the sheet takes away too much is leakage of the other sign left over."""
    mirror = night_01.mirror_of(name)
    leakage = mirror.leakage_amplitude_volt * np.exp(1j * mirror.leakage_phase_rad) + more
    sheet = mirror.model_copy(
        update={"leakage_amplitude_volt": float(abs(leakage)), "leakage_phase_rad": float(np.angle(leakage))}
    )
    other = dataclasses.replace(night_01, mirrors={**night_01.mirrors, mirror.zp: sheet})
    phases = measure_phases(other, network_01.settings)
    electronics, _ = follow_electronics(other, phases)
    assert np.array_equal(electronics[name].shots, network_01.electronics[name].shots)
    x = np.array(network_01.layout.start)
    group, parts = shot_group(network_01, name, x)
    changed, _ = shot_group(dataclasses.replace(network_01, phases=phases, electronics=electronics), name, x)
    half = 0.5 * SPEED_OF_LIGHT / night_01.site.ranging.modulation_hz
    difference = (changed.observed - group.observed + half / 2) % half - half / 2  # cycles apart
    expected = -parts.leakage_slope @ [np.real(more), np.imag(more)]
    assert np.max(np.abs(expected)) > 0.3e-6
    np.testing.assert_allclose(difference, expected, atol=0.05 * np.max(np.abs(expected)))


def test_the_rest_of_a_glass_constant_acts_as_a_change_of_the_constant(network_01, state):
    """A parameter of 5 um on a prism and a sheet that says 5 um more predict the same ranges, and shorter ones."""
    rest = 5e-6
    at = network_01.layout.at
    seen = shot_group(network_01, "ZY113", state)[1].target
    target = next(t for t in seen if Parameter(ParameterKind.GLASS, t) in at)
    mine = np.array([t == target for t in shot_group(network_01, "ZY113", state)[1].target])
    moved = state.copy()
    moved[at[Parameter(ParameterKind.GLASS, target)]] += rest
    place = network_01.places[target]
    places = {**network_01.places, target: dataclasses.replace(place, constant=place.constant + rest)}
    plain = shot_group(network_01, "ZY113", state)[0]
    by_sheet = shot_group(dataclasses.replace(network_01, places=places), "ZY113", state)[0].predict(state)[0]
    by_parameter = plain.predict(moved)[0]
    np.testing.assert_allclose(by_parameter, by_sheet, rtol=0, atol=1e-12)
    # eq. 5.19: a constant nearer to zero is less glass, less optical path
    np.testing.assert_allclose((by_parameter - plain.predict(state)[0])[mine], -rest, rtol=1e-3)
    assert np.array_equal(by_parameter[~mine], plain.predict(state)[0][~mine])
