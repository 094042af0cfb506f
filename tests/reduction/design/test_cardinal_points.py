"""Cardinal points: their information is that of the joint covariance, and the search finds the best set."""

from itertools import combinations

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.records.site.folder import read_site
from catseye.records.site.structural_model import read_structural_model
from catseye.reduction.design.cardinal_points import Candidates, ChoiceSettings, candidates_of, chosen_points
from catseye.reduction.structure.antenna import antenna_of
from catseye.reduction.structure.displacement import site_points
from repository import ROOT

FREE = {"alidade": ("turn_x", "turn_y"), "reflector": ("turn_x",), "feed_arm": ("turn_x", "shift_y")}
POSTURE = TelescopePosture(np.radians([0.0, 130.0, 250.0]), np.radians([20.0, 50.0, 80.0]), np.array([0.0, 10.0, 30.0]))
SETTINGS = ChoiceSettings()


@pytest.fixture(scope="module")
def antenna():
    return antenna_of(read_structural_model(ROOT / "examples" / "structural-model" / "telescope.toml"))


@pytest.fixture(scope="module")
def site():
    return read_site(ROOT / "examples" / "sites" / "gbt")


@pytest.fixture(scope="module")
def targets(antenna, site):
    return [point for point in site_points(antenna, site)[0] if point.kind == "target"]


@pytest.fixture(scope="module")
def found(antenna, site, targets):
    return candidates_of(antenna, site, targets, POSTURE, free=FREE, settings=SETTINGS)


def test_the_search_finds_the_best_of_all_sets(found):
    candidates, _ = found
    for count in (2, 3):
        choice = chosen_points(candidates, count)
        best = max(combinations(range(len(candidates.names)), count), key=candidates.gain)
        assert set(choice.order) == set(best)
        assert choice.gains[-1] == pytest.approx(candidates.gain(best), rel=1e-12)


def test_an_exchange_mends_what_taking_one_by_one_misses():
    """Three unknowns: A tells a little of all, B much of one, C and D together most."""
    directions = np.array([[1.2, 1.2, 0.0], [1.5, 0.0, 0.1], [0.0, 1.5, 0.1]])
    each = np.array([np.outer(row, row) for row in directions])
    candidates = Candidates(("A", "B", "C"), ("x", "y", "z"), np.eye(3), each, np.ones(3, dtype=int))
    choice = chosen_points(candidates, 2)
    assert max(range(3), key=lambda i: candidates.gain([i])) == 0  # A comes first
    assert set(choice.names) == {"B", "C"}
    assert choice.exchanges == 1


def test_information_is_that_of_the_joint_covariance_of_all_ranges(antenna, site, found):
    """Half the log ratio of the ranges' covariance with and without the coefficients' prior: another formula.

    By differences of ranges, with each motion, place and coefficient moved by hand.
    """
    candidates, _ = found
    names = ["ZEG41040L", "ZAG731P"]
    points = [point for point in site_points(antenna, site)[0] if point.name in names]
    rangers = {}
    postures = [
        TelescopePosture(*row) for row in zip(POSTURE.azimuth, POSTURE.elevation, POSTURE.temperature_c, strict=True)
    ]
    from catseye.records.site.solids import Solids
    from catseye.reduction.design.scene import scene_of_site

    scene = scene_of_site(site, Solids(), postures=[(float(p.azimuth), float(p.elevation)) for p in postures])
    for k in range(len(postures)):
        for ranger, row in scene.network(k).pairs:
            at = scene.rangers[ranger]
            if scene.points[at].name in site.monuments and scene.points[row].name in names:
                rangers.setdefault((k, scene.points[row].name), []).append(scene.on_ground(k)[at])
    rows = [(k, point, stand) for k in range(len(postures)) for point in points for stand in rangers[k, point.name]]

    def ranges(added=None, off=None, posture=None):
        values = []
        for k, point, stand in rows:
            more = (added or {}) if posture in (None, k) else None
            if more:
                more = {name: six(k) if callable(six) else six for name, six in more.items()}
            ground = antenna.ground_from(point.frame, postures[k], added=more)
            place = point.position + (off[1] if off is not None and off[0] == point.name else 0.0)
            values.append(np.linalg.norm(ground.points(place) - stand))
        return np.array(values)

    def slope(step, **moved):
        up, down = ({key: scaled(value, sign) for key, value in moved.items()} for sign in (step, -step))
        return (ranges(**up) - ranges(**down)) / (2.0 * step)

    def scaled(value, sign):
        if isinstance(value, dict):
            return {name: (lambda k, six=six: sign * six(k)) for name, six in value.items()}
        return (value[0], sign * value[1]) if isinstance(value, tuple) else value

    unit, components = np.eye(6), ("shift_x", "shift_y", "shift_z", "turn_x", "turn_y", "turn_z")
    coefficients, prior = [], []
    for name, free in FREE.items():
        basis = antenna.motions[name].basis
        for c in sorted(map(components.index, free)):
            for n in range(len(basis)):
                six = {name: lambda k, b=basis, n=n, c=c: unit[c] * b.rows(postures[k])[n]}
                coefficients.append(slope(1e-6, added=six))
                prior.append(SETTINGS.u_turn if c > 2 else SETTINGS.u_shift)
    length = ranges()
    noise = np.diag(SETTINGS.u_range**2 + (SETTINGS.u_scale * length) ** 2)
    for k in range(len(postures)):
        for name, motion in antenna.motions.items():
            if name == "subreflector":
                continue
            for c in range(6):
                column = slope(1e-6, added={name: lambda _, c=c: unit[c]}, posture=k)
                noise += motion.u[c] ** 2 * np.outer(column, column)
    for point in points:
        for axis in np.eye(3):
            column = slope(1e-6, off=(point.name, axis))
            noise += 1e-3**2 * np.outer(column, column)
    design = np.array(coefficients).T
    total = noise + design @ np.diag(np.square(prior)) @ design.T
    expected = 0.5 * (np.linalg.slogdet(total)[1] - np.linalg.slogdet(noise)[1])
    chosen = [candidates.names.index(name) for name in names]
    # the library's slopes are at the model's posture without the group's own shifts: 1e-4 of some 60
    assert candidates.gain(chosen) == pytest.approx(expected, abs=0.01)


def test_more_points_tell_more_and_no_more_than_all(found):
    candidates, _ = found
    choice = chosen_points(candidates, 5)
    assert np.all(np.diff(choice.gains) > 0.0)
    assert choice.gains[-1] < choice.of_all
    before, after = candidates.u([]), candidates.u(choice.order)
    assert np.all(after < before)


def test_what_ranges_do_not_determine_is_told(antenna, site, targets):
    arm = [point for point in targets if point.name == "ZEG41040L"]
    candidates, _ = candidates_of(antenna, site, arm, POSTURE, free={"reflector": ("shift_x",)}, settings=SETTINGS)
    choice = chosen_points(candidates, 1)
    assert choice.verdict.word == "doubtful"
    assert any(label.startswith("reflector shift_x") for label in choice.undetermined)


def test_too_many_points_and_strangers_are_refused(antenna, site, targets, found):
    with pytest.raises(InputError, match=r"count = 99 of 14 targets"):
        chosen_points(found[0], 99)
    with pytest.raises(InputError, match="'boom' has no motion"):
        candidates_of(antenna, site, targets, POSTURE, free={"boom": ("turn_x",)}, settings=SETTINGS)
    with pytest.raises(InputError, match="'twist' is not a component"):
        candidates_of(antenna, site, targets, POSTURE, free={"feed_arm": ("twist",)}, settings=SETTINGS)
    with pytest.raises(InputError, match="too many to choose from"):
        candidates_of(antenna, site, targets * 20, POSTURE, free=FREE, settings=SETTINGS)
