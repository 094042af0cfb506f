"""What the heads add to ranges, planted into night-01's phases and known, unknown or mistaken by the mirror sheets.

Planted with rays traced at a rigid mirror, another writing of the mount's rotation and plain sums; night-01 itself,
whose axes meet and whose phases are free of coupling and cyclic deviation, is the truth. Mostly with fewer targets.
"""

import dataclasses

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from catseye.constants import SPEED_OF_LIGHT
from catseye.errors import InputError, ValidityError
from catseye.estimation.least_squares.adjustment import adjust
from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.coordinates import adjust_coordinates
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.head import _axes, head_unknowns
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.epoch.ranges import follow_electronics
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.epoch.shots import shot_group
from catseye.reduction.epoch.unknowns import build_network
from catseye.reduction.site.stations import station_in
from catseye.simulator.night.faults import Faults
from catseye.simulator.night.sheets import write_night
from catseye.simulator.night.simulate import simulate_night
from catseye.simulator.night.world import kelvin_from_ground
from mirror_scene import START, sent, traced_change

KAPPA = 4 * np.pi * 1.5e9 / SPEED_OF_LIGHT  # rad a metre of range, in vacuum
HEAD_KINDS = (ParameterKind.AXES, ParameterKind.AMPLITUDE, ParameterKind.CYCLIC, ParameterKind.SECOND_PASS)
AXES = ("axis_offset_mm", "mirror_offset_mm", "beam_x_mm", "beam_y_mm")
PASS = ("second_pass_cosine_per_volt", "second_pass_sine_per_volt")
KEYS = {
    ParameterKind.AXES: AXES,
    ParameterKind.AMPLITUDE: ("amplitude_to_phase_rad",),
    ParameterKind.CYCLIC: ("cyclic_cosine_mm", "cyclic_sine_mm"),
    ParameterKind.SECOND_PASS: PASS,
}
UNITS = {ParameterKind.AXES: 1e-3, ParameterKind.CYCLIC: 1e-3}  # of the sheet, of the others 1
TIGHT = {"u_axis_mm": 5e-4, "u_amplitude_to_phase_rad": 1e-5, "u_cyclic_mm": 5e-4, "u_second_pass_per_volt": 2e-6}
LOOSE = {"u_axis_mm": 0.1, "u_amplitude_to_phase_rad": 4e-3, "u_cyclic_mm": 0.02, "u_second_pass_per_volt": 2e-4}
NARROW = {"ZY104": (-24_000, 27_000), "ZY109": (25_000, 75_000)}  # azimuth limits after na0: some need the prime


def is_ground(campaign, name):
    return name in campaign.monuments


def drawn_effects(campaign, rng, axis=0.25, coupling=8e-3, cyclic=0.03, second=3e-4):
    """Effects of every head, as keys of its sheet; axes of ground rangers only."""
    found = {}
    for name in campaign.rangers:
        axes = dict(zip(AXES, rng.normal(0, axis, 4), strict=True)) if is_ground(campaign, name) else {}
        found[name] = axes | {
            "amplitude_to_phase_rad": rng.normal(0, coupling),
            "cyclic_cosine_mm": tuple(rng.normal(0, cyclic, 2)),
            "cyclic_sine_mm": tuple(rng.normal(0, cyclic, 2)),
            **dict(zip(PASS, rng.normal(0, second, 2), strict=True)),
        }
    return found


def scaled(effects, factor):
    def times(value):
        return tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value

    return {name: {key: times(value) for key, value in each.items()} for name, each in effects.items()}


def told(campaign, effects, u, limits=NARROW):
    """The campaign whose sheets say so, with these uncertainties; of the axes nothing on the feed arm."""
    mirrors = dict(campaign.mirrors)
    for name, said in effects.items():
        mirror = campaign.mirror_of(name)
        own = {k: v for k, v in u.items() if k != "u_axis_mm" or is_ground(campaign, name)}
        low, high = limits.get(name, (mirror.az_low_limit - mirror.na0, mirror.az_high_limit - mirror.na0))
        text = mirror.model_dump() | said | own
        text |= {"az_low_limit": mirror.na0 + low, "az_high_limit": mirror.na0 + high}
        mirrors[mirror.zp] = type(mirror).model_validate(text)
    return dataclasses.replace(campaign, mirrors=mirrors)


def mirror_axes(campaign, name):
    """Ground axes to mirror axes, written out. Source: [PARKER04] eq. 2.5 as the twin writes it, and 2.11."""
    monument, mirror = campaign.monuments[name], campaign.mirror_of(name)
    (c1, s1), (c2, s2) = ((np.cos(b), np.sin(b)) for b in (mirror.beta1_rad, mirror.beta2_rad))
    turned = np.array([[c2, 0, -s2], [s1 * s2, c1, s1 * c2], [c1 * s2, -s1, c1 * c2]])
    return turned @ kelvin_from_ground([monument.alpha1_rad, monument.alpha2_rad, monument.alpha3_rad])


def longer(campaign, name, effects, sight):
    """What axes and beam add to the range of a target in sight (ground frame), by a traced ray."""
    mirror = campaign.mirror_of(name)
    target = mirror_axes(campaign, name) @ sight
    count = 1e5 * np.degrees(np.arctan2(target[1], target[0])) / 360
    count += 1e5 if count < -25_000 else 0
    low, high = mirror.az_low_limit - mirror.na0, mirror.az_high_limit - mirror.na0
    prime = not low <= count <= high
    assert not prime or low <= count + 50_000 <= high or low <= count - 50_000 <= high
    return traced_change(target, [effects[key] * 1e-3 for key in AXES], prime)[0], prime


def longer_to_cube(campaign, name, effects):
    """The same of the cube, D0 from the scan point where the mirror at azm_zrg and elv_zrg sends the beam's middle."""
    mirror = campaign.mirror_of(name)
    d0 = mirror.d0_mm * 1e-3
    turn, shaft = (2 * np.pi / 1e5 * c for c in (mirror.azm_zrg - mirror.na0, mirror.elv_zrg - mirror.ne0))
    point, direction, way = sent(turn, shaft, [effects[key] * 1e-3 for key in AXES])
    onward = -point @ direction + np.sqrt((point @ direction) ** 2 + d0**2 - point @ point)
    return way + onward - START - d0


def planted(campaign, reduced, effects):
    """Night-01's phases with the effects in them, and in how many shots the mirror stood in the prime pointing."""
    c, phases, shots = reduced.coordinates, reduced.phases, campaign.shots
    ranger, n = np.array(shots.ranger), 1.0 + c.refractivity_ppm * 1e-6
    # A range read too long is a phase that fell; a stronger return has a higher phase.
    turn = np.zeros(len(ranger))
    primes = 0
    for k, (name, target) in enumerate(zip(shots.ranger, shots.target, strict=True)):
        own = effects[name]
        if phases.amplitude[k] > 0.1:
            turn[k] += own["amplitude_to_phase_rad"] * np.log(phases.amplitude[k] / 6.5)
        if "axis_offset_mm" not in own:
            continue
        if target == "ZRG":
            turn[k] -= KAPPA * n * longer_to_cube(campaign, name, own)
        elif target in c.points:
            sight = c.x[c.index(target)] - c.x[c.index(name)]
            change, prime = longer(campaign, name, own, sight)
            turn[k] -= KAPPA * n * change
            primes += prime
    turned = dataclasses.replace(phases, phasor=phases.phasor * np.exp(1j * turn))
    electronics, _ = follow_electronics(campaign, turned)
    phasor = turned.phasor.copy()
    for name, e in electronics.items():
        own = effects[name]
        plain = np.angle(phasor[e.shots]) - e.phase
        x = plain
        for _ in range(20):  # the deviation is a wave of the phase as measured
            wave = sum(
                a * np.cos(k * x) + b * np.sin(k * x)
                for k, (a, b) in enumerate(zip(own["cyclic_cosine_mm"], own["cyclic_sine_mm"], strict=True), start=1)
            )
            x = plain - KAPPA * n * wave * 1e-3
        # and light that the detector sends out again, a whole geometric series of passes, the share that of the return
        share = np.abs(phasor[e.shots]) * (own[PASS[1]] * -1.0 + 1j * own[PASS[0]])
        phasor[e.shots] *= np.exp(1j * (x - plain)) / (1.0 - share.conj() * np.exp(1j * x))
    return dataclasses.replace(turned, phasor=phasor), primes


def solved(campaign, phases):
    electronics, _ = follow_electronics(campaign, phases)
    with threadpool_limits(limits=1, user_api="blas"):
        return adjust_coordinates(campaign, phases, electronics, settings=ReductionSettings())


@pytest.fixture(scope="module")
def effects(few_01):
    return drawn_effects(few_01, np.random.default_rng(53))


@pytest.fixture(scope="module")
def measured(few_01, reduced_few_01, effects):
    """Phases with the effects of `effects`."""
    phases, primes = planted(told(few_01, effects, TIGHT), reduced_few_01, effects)
    assert 5 < primes < 60
    return phases


@pytest.fixture(scope="module")
def knowing(few_01, effects, measured):
    """Coordinates by sheets that know the effects."""
    return solved(told(few_01, effects, TIGHT), measured)


def moved(night, found):
    """Distance of each ranged point from where night-01 puts it, m; only of points that three shots place."""
    base = night.coordinates
    names = [p for p in base.points if base.shots[base.index(p)] >= 3]
    return np.array([np.linalg.norm(found[p] - base.x[base.index(p)]) for p in names])


def test_sheets_that_know_their_heads_restore_the_coordinates(reduced_few_01, knowing):
    far = moved(reduced_few_01, dict(zip(knowing.points, knowing.x, strict=True)))
    assert far.max() < 2e-6
    assert knowing.variance_factor == pytest.approx(reduced_few_01.coordinates.variance_factor, abs=5e-3)
    assert np.array_equal(knowing.ranges.used, reduced_few_01.coordinates.ranges.used)


@pytest.mark.parametrize("which", ["axes", "amplitude", "cyclic", "second pass"])
def test_each_effect_unknown_or_of_the_wrong_sign_spoils_the_coordinates(
    few_01, reduced_few_01, effects, measured, which
):
    """With the shots that the night uses, so that a search for wrong ones hides nothing."""
    keys = dict(zip(("axes", "amplitude", "cyclic", "second pass"), KEYS.values(), strict=True))

    def with_factor(factor):
        wrong = scaled(effects, factor)
        said = {n: {k: (wrong if k in keys[which] else effects)[n][k] for k in effects[n]} for n in effects}
        network, answer = linear(told(few_01, said, TIGHT), measured, reduced_few_01.coordinates)
        found = {p: answer.x[network.layout.columns(p)] for p in reduced_few_01.coordinates.points}
        return np.sqrt(np.mean(moved(reduced_few_01, found) ** 2))

    known, unknown, reversed_ = with_factor(1.0), with_factor(0.0), with_factor(-1.0)
    assert known < 1e-6
    assert unknown > (4e-6 if which == "second pass" else 10e-6)
    assert reversed_ == pytest.approx(2.0 * unknown, rel=0.1)


def test_night_01_has_no_head_effects_and_no_parameters(network_01, reduced_night_01):
    assert not any(quantity.kind in HEAD_KINDS for quantity in network_01.layout.at)
    for name in network_01.rangers:
        _, parts = shot_group(network_01, name, np.array(network_01.layout.start))
        assert parts.head.slopes.shape == (len(parts.target), 0)
        assert not parts.head.value.any()


@pytest.fixture(scope="module")
def open_minded(few_01, reduced_few_01, effects):
    """Sheets that say nothing but uncertainties, the phases of a night within them, and what was planted."""
    none = scaled(effects, 0.0)
    campaign = told(few_01, none, LOOSE)
    within = drawn_effects(few_01, np.random.default_rng(54), axis=0.1, coupling=4e-3, cyclic=0.02, second=2e-4)
    return campaign, planted(campaign, reduced_few_01, within)[0], within


def linear(campaign, phases, start):
    """Adjustment about given coordinates with every usable shot of night-01: layout, answer."""
    electronics, _ = follow_electronics(campaign, phases)
    network = build_network(campaign, phases, electronics, settings=ReductionSettings()).with_strength(start.strength)
    x = np.array(network.layout.start)
    for row, name in enumerate(start.points):
        x[network.layout.columns(name)] = start.x[row]
    used = dict(zip(start.ranges.shot.tolist(), start.ranges.used.tolist(), strict=True))
    with threadpool_limits(limits=1, user_api="blas"):
        for _ in range(2):
            groups = [shot_group(network, name, x)[0] for name in network.rangers]
            active = [np.array([used[k] for k in electronics[name].shots]) for name in network.rangers]
            active += [np.ones(len(g.observed), bool) for g in network.priors]
            answer = adjust(
                x,
                groups + network.priors,
                free=np.array(network.layout.free),
                active=active,
                names=network.layout.names,
            )
            x = answer.require_converged().x
    return network, answer


def test_planted_effects_within_the_priors_are_recovered_within_the_covariance(few_01, reduced_few_01, open_minded):
    """Linear theory: parameters p of prior u^2 answer with p - C p/u^2, and coordinates x with -C_xp p/u^2.

    Both sides are independent: p goes in by traced rays and sums, C is the covariance that the reduction claims.
    """
    campaign, phases, within = open_minded
    before, plain = linear(campaign, reduced_few_01.phases, reduced_few_01.coordinates)
    _, answer = linear(campaign, phases, reduced_few_01.coordinates)
    columns, p, u = [], [], []
    for name in before.rangers:
        for unknown in head_unknowns(campaign, name):
            count = len(unknown.parts)
            keys, unit = KEYS[unknown.quantity.kind], UNITS.get(unknown.quantity.kind, 1.0)
            p.extend(np.ravel([within[name][key] for key in keys]) * unit)
            columns.extend(before.layout.columns(unknown.quantity, count))
            u.extend([unknown.u] * count)
    p, u, columns = np.array(p), np.array(u), np.array(columns)
    assert len(p) == 12 * 4 + 18 + 18 * 4 + 18 * 2
    expected = -answer.covariance[:, columns] @ (p / u**2)
    expected[columns] += p
    found = answer.x - plain.x
    share = (found[columns] - expected[columns]) / u
    # of u: the way to the cube bends with the square of the offsets, (2 x 0.25 mm)^2 / 360 mm = 0.7 um
    np.testing.assert_allclose(share, 0.0, atol=0.05)
    assert np.sqrt(np.mean((found[columns] / u) ** 2)) > 0.3  # something was found
    for point in ("TR03-B", "DP010", "ZY104", "ZY115"):
        at = before.layout.columns(point)
        np.testing.assert_allclose(found[at], expected[at], atol=1.5e-6)
        assert np.abs(expected[at]).max() > 3e-6


def test_priors_of_the_heads_show_in_the_covariance_and_grow_with_it(few_01, reduced_few_01, open_minded):
    base = reduced_few_01.coordinates
    c = solved(open_minded[0], reduced_few_01.phases)
    names = [p for p in base.points if p.endswith("-B") and base.shots[base.index(p)] >= 3]
    ratio = [np.trace(c.block([p])) / np.trace(base.block([p])) for p in names]
    assert min(ratio) > 1.001  # more unknowns can only know less
    assert max(ratio) > 1.1
    assert len(c.heads) == 12 * 4 + 18 + 18 * 4 + 18 * 2
    value, u = c.heads["cyclic ZY116 sine 2"]
    assert abs(value) < 5 * u
    assert 0.0 < u < 0.02e-3 * (1 + 1e-9)  # never more than its prior
    assert base.heads == {}


@pytest.mark.parametrize("name", ["ZY104", "ZY116"])
def test_every_derivative_by_a_heads_parameter_is_a_finite_difference(few_01, reduced_few_01, effects, name):
    campaign = told(few_01, effects, LOOSE)
    electronics, _ = follow_electronics(campaign, reduced_few_01.phases)
    network = build_network(campaign, reduced_few_01.phases, electronics, settings=ReductionSettings())
    x = np.array(network.layout.start)
    plain = shot_group(network, name, x)[1].head
    for unknown in head_unknowns(campaign, name):
        for i in range(len(unknown.parts)):
            column = network.layout.at[unknown.quantity] + i
            # the sheet says more by h, instead of the parameter
            keys, per = KEYS[unknown.quantity.kind], len(unknown.parts) // len(KEYS[unknown.quantity.kind])
            unit = 1.0 / UNITS.get(unknown.quantity.kind, 1.0)
            key, part, h = keys[i // per], i % per, 1e-6
            value = effects[name][key]
            more = tuple(v + unit * h * (j == part) for j, v in enumerate(value)) if per > 1 else value + unit * h
            other = told(few_01, effects | {name: effects[name] | {key: more}}, LOOSE)
            changed = shot_group(dataclasses.replace(network, campaign=other), name, x)[1].head
            slope = np.sum(plain.slopes * (plain.columns == column), axis=1)
            # 2e-3: a beam held still against one steered onto the target, offsets over the shortest distance
            np.testing.assert_allclose((changed.value - plain.value) / h, slope, atol=2e-3, err_msg=unknown.parts[i])


def test_a_parameter_shifts_the_prediction_as_the_same_number_on_the_sheet(few_01, reduced_few_01, effects):
    """Distances with the sheet's value plus h, and with the parameter h, are predicted alike."""
    electronics, _ = follow_electronics(few_01, reduced_few_01.phases)
    more = {
        n: e | {"cyclic_sine_mm": (e["cyclic_sine_mm"][0] + 0.01, e["cyclic_sine_mm"][1])} for n, e in effects.items()
    }
    networks = [
        build_network(told(few_01, said, LOOSE), reduced_few_01.phases, electronics, settings=ReductionSettings())
        for said in (effects, more)
    ]
    x = np.array(networks[0].layout.start)
    shifted = x.copy()
    shifted[networks[0].layout.at[Parameter(ParameterKind.CYCLIC, "ZY115")] + 2] += 1e-5  # cosine 1, cosine 2, sine 1
    by_sheet = shot_group(networks[1], "ZY115", x)[0].predict(x)[0]
    by_parameter = shot_group(networks[0], "ZY115", x)[0].predict(shifted)[0]
    np.testing.assert_allclose(by_parameter, by_sheet, atol=1e-12, rtol=0)


def test_whole_cycles_are_counted_after_the_heads_corrections(few_01, reduced_few_01, effects):
    """A face 8 mm forward takes 15 mm off the ranges, of 50 mm that the coarse length may be off: no margin is lost."""
    large = scaled(effects, 0.0)
    large["ZY104"]["mirror_offset_mm"] = 8.0
    campaign = told(few_01, large, TIGHT)
    margins = []
    for known, phases in (
        (few_01, reduced_few_01.phases),
        (campaign, planted(campaign, reduced_few_01, large)[0]),
    ):
        electronics, _ = follow_electronics(known, phases)
        network = build_network(known, phases, electronics, settings=ReductionSettings())
        _, parts = shot_group(network, "ZY104", np.array(network.layout.start))
        margins.append(parts.margin)
    assert np.abs(parts.head.value).min() > 10e-3
    np.testing.assert_allclose(margins[1], margins[0], atol=0.1e-3)  # typed positions: 10 mm along 15 mm / 60 m


def changed(campaign, name, **said):
    mirror = campaign.mirror_of(name)
    return dataclasses.replace(
        campaign, mirrors={**campaign.mirrors, mirror.zp: type(mirror).model_validate(mirror.model_dump() | said)}
    )


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ({"axis_offset_mm": 0.3, "u_axis_mm": 0.01}, "axis_offset_mm = 0.3"),
        ({"beam_y_mm": -0.1, "u_axis_mm": 0.01}, "beam_y_mm = -0.1"),
        ({"u_axis_mm": 0.01}, "u_axis_mm = 0.01"),
    ],
)
def test_axes_on_the_feed_arm_are_refused_without_the_mounts_orientation(few_01, reduced_few_01, said, shown):
    r = reduced_few_01
    with pytest.raises(InputError) as caught:
        build_network(changed(few_01, "ZY115", **said), r.phases, r.electronics, settings=r.settings)
    assert str(caught.value).startswith(f"mirrors/ZP115.toml: {shown} cannot be applied: ZY115 is on the feed arm and")
    assert "\n" not in str(caught.value)


def test_axes_on_the_feed_arm_are_applied_with_the_mounts_orientation(few_01, reduced_few_01):
    """The mount's z^ along the reflector's -z, y^ along its y: x^ is then -x, and at az 145.3, el 30 all is turned."""
    r = reduced_few_01
    turned = [
        ranger.model_copy(update={"mount_z": (0.0, 0.0, -1.0), "mount_y": (0.0, 1.0, 0.0)})
        for ranger in few_01.feedarm.ranger
    ]
    arm = few_01.feedarm.model_copy(update={"ranger": tuple(turned)})
    campaign = changed(dataclasses.replace(few_01, feedarm=arm), "ZY115", mirror_offset_mm=0.2, u_axis_mm=0.01)
    network = build_network(campaign, r.phases, r.electronics, settings=r.settings)
    mirror = campaign.mirror_of("ZY115")
    assert Parameter(ParameterKind.AXES, "ZY115") in {unknown.quantity for unknown in head_unknowns(campaign, "ZY115")}
    station = station_in(campaign, "ZY115")
    a, e = np.radians([145.3, 30.0])
    down = -np.array([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), np.sin(e)])  # against the antenna's axis
    np.testing.assert_allclose(station.gamma[2], down, atol=1e-12)
    np.testing.assert_allclose(station.scan_point, network.places["ZY115"].start, atol=1e-9)
    correction, _ = _axes(campaign, "ZY115", np.array([80.0 * down + [0.0, 0.0, 1.0]]))
    # the face stands 0.2 mm forward: 2 s cos(Phi/2) shorter, seen nearly straight on, and the cube's own is put back
    cube = 2 * 0.2e-3 * np.cos(2 * np.pi * (mirror.elv_zrg - mirror.ne0) / 1e5)
    assert correction[0] == pytest.approx(0.4e-3 - cube, abs=1e-6)


def test_a_cube_behind_the_mirror_has_no_axis_correction_and_is_reported(few_01, reduced_few_01):
    r = reduced_few_01
    ne0 = few_01.mirror_of("ZY104").ne0
    campaign = changed(few_01, "ZY104", u_axis_mm=0.01, elv_zrg=ne0 + 26_000)
    network = build_network(campaign, r.phases, r.electronics, settings=r.settings)
    said = r"^mirrors/ZP104\.toml: elv_zrg = \d+ turns the mirror's face from the beam, 93\.6 degrees"
    with pytest.raises(InputError, match=said):
        shot_group(network, "ZY104", np.array(network.layout.start))


def test_a_target_straight_behind_a_mirror_that_stands_forward_is_refused(few_01, reduced_few_01):
    r = reduced_few_01
    campaign = changed(few_01, "ZY104", mirror_offset_mm=5.0, u_axis_mm=0.01)
    network = build_network(campaign, r.phases, r.electronics, settings=r.settings)
    x = np.array(network.layout.start)
    target = network.campaign.shots.target[r.electronics["ZY104"].shots[0]]
    behind = mirror_axes(campaign, "ZY104").T @ [0.0, 1e-4, -50.0]
    x[network.layout.columns(target)] = x[network.layout.columns("ZY104")] + behind
    with pytest.raises(ValidityError, match=r"^ZY104: a target lies straight behind its mirror"):
        shot_group(network, "ZY104", x)


def test_an_uncertainty_alone_makes_parameters_with_that_prior(few_01, reduced_few_01):
    r = reduced_few_01
    campaign = changed(few_01, "ZY104", u_axis_mm=0.02, u_amplitude_to_phase_rad=1e-3, u_cyclic_mm=0.004)
    network = build_network(campaign, r.phases, r.electronics, settings=r.settings)
    (group,) = (p for p in network.priors if p.name == "head effects")
    np.testing.assert_allclose(np.sqrt(group.covariance), [*[2e-5] * 4, 1e-3, *[4e-6] * 4])
    assert not group.observed.any()
    names = [network.layout.names[c] for c in group.columns]
    assert names[:5] == [
        "axes ZY104 axis offset",
        "axes ZY104 mirror offset",
        "axes ZY104 beam x",
        "axes ZY104 beam y",
        "amplitude ZY104",
    ]
    assert names[5:] == [f"cyclic ZY104 {wave} {k}" for wave in ("cosine", "sine") for k in (1, 2)]


@pytest.mark.parametrize("key", ["u_axis_mm", "u_amplitude_to_phase_rad", "u_cyclic_mm"])
def test_a_zero_uncertainty_of_a_head_is_refused_where_it_stands(few_01, reduced_few_01, key):
    r = reduced_few_01
    zp = few_01.mirror_of("ZY104").zp
    mirror = few_01.mirrors[zp].model_copy(update={key: 0.0})
    campaign = dataclasses.replace(few_01, mirrors={**few_01.mirrors, zp: mirror})
    with pytest.raises(InputError, match=rf"^mirrors/ZP104\.toml: {key} = 0 \(expected above 0"):
        build_network(campaign, r.phases, r.electronics, settings=r.settings)


@pytest.mark.slow
def test_coordinates_of_nights_whose_heads_are_off_their_sheets_scatter_as_claimed(tmp_path):
    """Five clear nights of the twin against its truth; sheets that deny the effects claim too little."""
    clear = Faults(fraction_blocked=0.0, fraction_reflected=0.0, weak_ranger=None, wrong_position_mm=0.0)
    ratios: dict[str, list[np.ndarray]] = {"admitted": [], "denied": []}
    for seed in range(5):
        night = simulate_night(7000 + seed, faults=clear)
        campaign = read_campaign(write_night(night, tmp_path / str(seed)))
        within = drawn_effects(campaign, np.random.default_rng(seed), axis=0.1, coupling=4e-3, cyclic=0.02)
        admitting = told(campaign, scaled(within, 0.0), LOOSE, limits={})
        plain = reduce_epoch(campaign)
        phases, _ = planted(admitting, plain, within)
        for key, known in (("admitted", admitting), ("denied", campaign)):
            network, answer = linear(known, phases, plain.coordinates)
            for point, true in night.truth.points.items():
                if point in network.layout.points and plain.coordinates.shots[plain.coordinates.index(point)] >= 3:
                    at = network.layout.columns(point)
                    ratios[key].append((answer.x[at] - true) / np.sqrt(np.diag(answer.covariance)[at]))
    rms = {key: np.sqrt(np.mean(np.square(found))) for key, found in ratios.items()}
    # points of a night share air, scale and survey: some 40 independent directions a night
    assert 0.85 < rms["admitted"] < 1.15
    assert rms["denied"] > 1.15 * rms["admitted"]


def test_a_sheet_that_the_ranges_contradict_is_named(few_01, reduced_few_01):
    # 2 mm of an axis offset that is not there, to 10 um as claimed: no shot is rejected for it
    r, zp = reduced_few_01, few_01.mirror_of("ZY101").zp
    mirror = few_01.mirrors[zp].model_copy(update={"axis_offset_mm": 2.0, "u_axis_mm": 0.01})
    campaign = dataclasses.replace(few_01, mirrors=few_01.mirrors | {zp: mirror})
    notes = adjust_coordinates(campaign, r.phases, r.electronics, settings=r.settings).notes
    assert any(n.startswith("axes ZY101 axis offset: not the mirror sheet's") for n in notes)
    assert not any("not the mirror sheet's" in n for n in r.notes)


def test_light_back_into_the_laser_is_noise_of_each_shot_by_itself(few_01, reduced_few_01):
    """0.8 mrad in 62.9 rad a metre of optical length: 12.7 µm more in the root of the variance, of no other ranger."""
    r = reduced_few_01
    noisy = changed(few_01, "ZY104", u_feedback_rad=0.8e-3)
    parts = {}
    for name, campaign in (("plain", few_01), ("noisy", noisy)):
        network = build_network(campaign, r.phases, r.electronics, settings=r.settings)
        x = np.array(network.layout.start)
        parts[name] = [shot_group(network, ranger, x)[1].variance for ranger in ("ZY104", "ZY105")]
    added = parts["noisy"][0] - parts["plain"][0]
    np.testing.assert_allclose(np.sqrt(added), 0.8e-3 / KAPPA, rtol=1e-6)
    np.testing.assert_array_equal(parts["noisy"][1], parts["plain"][1])


def test_images_on_a_late_detector_are_noise_of_each_shot_and_a_mean(few_01, reduced_few_01):
    """Lag 20 mrad, image 10 µm off and to 5 µm in 100: 0.224 mrad are 3.56 µm of noise, 0.1 mrad are 1.59 µm too short.

    By hand: 2 x 0.02 x 5 x 11.18/100^2, 2 x 0.02 x 5^2/100^2, and 62.88 rad a metre.
    """
    r = reduced_few_01
    detector = {"detector_radius_mm": 0.1, "detector_lag_rad": 0.02, "image_offset_um": 10.0, "u_image_um": 5.0}
    found = {}
    for name, campaign in (("plain", few_01), ("late", changed(few_01, "ZY104", **detector))):
        network = build_network(campaign, r.phases, r.electronics, settings=r.settings)
        x = np.array(network.layout.start)
        group, part = shot_group(network, "ZY104", x)
        found[name] = part.variance, (group.observed - group.offset) / group.scale
    (noise, plain), (more, long) = found["plain"], found["late"]
    np.testing.assert_allclose(np.sqrt(more - noise), 3.556e-6, rtol=1e-3)
    np.testing.assert_allclose(long - plain, 1.590e-6, rtol=2e-3)
