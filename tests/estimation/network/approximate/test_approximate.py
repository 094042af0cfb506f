"""Points that have no coordinates are found from whatever ties them; those that cannot be are named with the reason."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.estimation.network.approximate.start import approximate
from catseye.estimation.network.model import NetworkParameter, NetworkPoints, ObservationNetwork
from catseye.estimation.observations.kinds import (
    Azimuths,
    Directions,
    DistanceDifferences,
    Distances,
    FixedDistances,
    FramePoints,
    HeightDifferences,
    HorizontalAngles,
    HorizontalDistances,
    Inclinations,
    Joint,
    LevelPlanes,
    ObservedCoordinates,
    RigidBodies,
    Vectors,
    ZenithAngles,
)
from catseye.geometry.frames.rotation import from_vector
from catseye.records.network.any_file import read_network
from draws import examples
from repository import TESTS

MONITORING = TESTS / "vectors" / "networks" / "monitoring"
ANGLE = 5e-6  # rad, about one arcsecond
LENGTH = 1e-3  # m
FEW = examples(25)


class Survey:
    """A true place for every point and observations with noise; the network is what remains when some are unknown.

    The values are computed here from azimuths and lengths, not by the kinds under test.
    """

    def __init__(self, places, *, seed=0, noise=1.0):
        self.names, self.true = list(places), np.array(list(places.values()), dtype=float)
        self.rng, self.noise = np.random.default_rng(seed), noise
        self.groups, self.parameters, self.expected = [], [], {}

    def at(self, *names):
        return np.array([3 * self.names.index(n) for n in names])

    def along(self, origin, target):
        return self.true[self.names.index(target)] - self.true[self.names.index(origin)]

    def noisy(self, values, sigma):
        return np.array(values) + self.rng.normal(size=len(values)) * sigma * self.noise

    def parameter(self, true, unit="rad", **more):
        self.parameters.append(NetworkParameter(f"parameter {len(self.parameters)}", unit=unit, **more))
        self.expected[len(self.parameters) - 1] = true
        return 3 * len(self.names) + len(self.parameters) - 1

    def pairs(self, kind, value, sigma, origin, targets, **more):
        v = self.noisy([value(self.along(origin, t)) for t in targets], sigma)
        columns = self.at(*[origin] * len(targets)), self.at(*targets)
        self.groups.append(kind(kind.kind, v, np.full(len(v), sigma**2), *columns, **more))
        return self

    def ranges(self, origin, *targets, kind=Distances, **more):
        return self.pairs(kind, np.linalg.norm, LENGTH, origin, targets, **more)

    def levels(self, origin, *targets):
        return self.pairs(HorizontalDistances, lambda a: np.hypot(*a[:2]), LENGTH, origin, targets)

    def zeniths(self, origin, *targets, height=0.0):
        shift = np.array([0, 0, height])
        far = lambda a: np.arctan2(np.hypot(a[0], a[1]), a[2] + height)  # noqa: E731
        return self.pairs(ZenithAngles, far, ANGLE, origin, targets, shift=shift)

    def azimuths(self, origin, *targets):
        return self.pairs(Azimuths, lambda a: np.arctan2(a[0], a[1]), ANGLE, origin, targets)

    def rises(self, origin, *targets):
        return self.pairs(HeightDifferences, lambda a: a[2], LENGTH, origin, targets)

    def directions(self, origin, *targets):
        turn = self.rng.uniform(-np.pi, np.pi)
        column = self.parameter(turn)
        reading = lambda a: (np.arctan2(a[0], a[1]) - turn) % (2 * np.pi)  # noqa: E731
        return self.pairs(Directions, reading, ANGLE, origin, targets, orientation=np.full(len(targets), column))

    def angles(self, at, *triples):
        def clockwise(back, fore):
            a, b = self.along(at, back), self.along(at, fore)
            return (np.arctan2(b[0], b[1]) - np.arctan2(a[0], a[1])) % (2 * np.pi)

        v = self.noisy([clockwise(*pair) for pair in triples], ANGLE)
        back, fore = zip(*triples, strict=True)
        columns = self.at(*[at] * len(v)), self.at(*back), self.at(*fore)
        self.groups.append(HorizontalAngles("angles", v, np.full(len(v), ANGLE**2), *columns))
        return self

    def vectors(self, origin, *targets):
        v = self.noisy(np.concatenate([self.along(origin, t) for t in targets]), LENGTH)
        columns = self.at(*[origin] * len(targets)), self.at(*targets)
        self.groups.append(Vectors("vectors", v, np.full(len(v), LENGTH**2), *columns))
        return self

    def station(self, origin, *targets):
        """Add the observations of a total station."""
        return self.directions(origin, *targets).ranges(origin, *targets).zeniths(origin, *targets)

    def network(self, *unknown, given=None):
        xyz = self.true.copy() if given is None else given.copy()
        for name in unknown:
            xyz[self.names.index(name)] = np.nan
        none = np.zeros(xyz.shape, dtype=bool)
        points = NetworkPoints(tuple(self.names), xyz, none, none)
        return ObservationNetwork(points, tuple(self.parameters), tuple(self.groups))

    def found(self, *unknown, within=0.02):
        """Everything is found, near the truth, and the orientations with it."""
        xyz, parameters, found, missing = approximate(self.network(*unknown))[:4]
        assert missing == {}
        assert sorted(found) == sorted(unknown)
        np.testing.assert_allclose(xyz, self.true, rtol=0.0, atol=within)
        for k, true in self.expected.items():
            turn = 1.0 if self.parameters[k].unit != "rad" else 2 * np.pi
            apart = parameters[k] - true
            apart -= round(apart / turn) * turn if turn > 1.0 else 0.0
            assert abs(apart) < 1e-3
        return xyz

    def missing(self, *unknown):
        return approximate(self.network(*unknown)).missing


KNOWN = {"A": (0, 0, 100), "B": (120, 10, 103), "C": (60, 110, 108), "D": (-30, 90, 96)}
POINT = KNOWN | {"P": (40, 50, 120)}


def test_a_point_given_is_left_where_it_is():
    network = Survey(POINT).ranges("A", "P").network()
    answer = approximate(network)
    assert answer.found == ()
    assert answer.missing == {}
    np.testing.assert_array_equal(answer.xyz, network.points.xyz)


@pytest.mark.parametrize(
    "observe",
    [
        lambda s: s.station("A", "B", "P"),
        lambda s: s.azimuths("A", "P").ranges("A", "P").zeniths("A", "P"),
        lambda s: s.azimuths("P", "A").ranges("P", "A").zeniths("P", "A"),
        lambda s: s.azimuths("A", "P").levels("A", "P").rises("P", "A"),
        lambda s: s.directions("A", "B", "C", "P").levels("P", "A").zeniths("A", "P", height=1.5),
        lambda s: s.angles("A", ("B", "P")).levels("A", "P").rises("A", "P"),
        lambda s: s.angles("A", ("P", "B")).angles("C", ("D", "P")).zeniths("A", "P"),
        lambda s: s.directions("A", "B", "P").directions("C", "D", "P").zeniths("A", "P"),
        lambda s: s.azimuths("P", "A", "C").zeniths("P", "A", "C"),
        lambda s: s.directions("P", "A", "B", "C", "D").rises("P", "B"),
        lambda s: s.directions("P", "A", "B", "C").zeniths("P", "A", "B"),
        lambda s: s.angles("P", ("A", "B"), ("B", "C"), ("D", "A")).rises("B", "P"),
        lambda s: s.station("P", "A", "B"),
        lambda s: s.station("P", "A", "D", "C"),
        lambda s: s.ranges("P", "A", "B", "C").zeniths("A", "P"),
        lambda s: s.ranges("A", "P").ranges("B", "P").ranges("C", "P").ranges("D", "P").rises("A", "P"),
        lambda s: s.levels("P", "A", "B", "C").rises("C", "P"),
        lambda s: s.ranges("P", "A", "B").zeniths("P", "A", "B").angles("P", ("A", "B")),
        lambda s: s.ranges("A", "P").zeniths("A", "P").directions("C", "D", "P").ranges("C", "P"),
        lambda s: s.vectors("B", "P"),
        lambda s: s.vectors("P", "B", "C"),
        lambda s: s.ranges("A", "P", kind=FixedDistances).azimuths("A", "P").zeniths("A", "P"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("seed", range(3))
def test_a_point_is_found_by_every_classical_construction(observe, seed):
    survey = Survey(POINT, seed=seed)
    observe(survey)
    survey.found("P")


@FEW
@given(st.integers(0, 10**6), st.integers(5, 9))
def test_a_point_in_sight_of_any_five_stations_off_a_plane_is_found_from_ranges(seed, number):
    rng = np.random.default_rng(seed)
    places = {f"S{k}": rng.uniform(-100, 100, 3) * (1, 1, 0.4) for k in range(number)}
    survey = Survey(places | {"P": rng.uniform(-50, 50, 3)}, seed=seed)
    for name in places:
        survey.ranges(name, "P")
    answer = approximate(survey.network("P"))
    if answer.missing:  # four of them nearly in a plane with the point decide nothing: it must say so
        assert "two positions fit" in answer.missing["P"]
    else:
        np.testing.assert_allclose(answer.xyz, survey.true, rtol=0.0, atol=0.1)


@FEW
@given(st.floats(-np.pi, np.pi), st.floats(-1e4, 1e4), st.integers(0, 1000))
def test_a_network_that_is_turned_and_moved_is_found_turned_and_moved(angle, shift, seed):
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    places = {k: turn @ v + [shift, -shift, 0.3 * shift] for k, v in POINT.items()} | {
        "Q": turn @ (20, 70, 90) + [shift, -shift, 0.3 * shift]
    }
    survey = Survey(places, seed=seed).station("P", "A", "B", "Q").directions("C", "D", "Q")
    survey.found("P", "Q")


def test_stations_that_see_one_known_point_each_are_joined_through_the_points_they_share():
    places = {"A": (0, 0, 0), "B": (200, 20, 5), "S": (50, 30, 1), "T": (150, -20, 2)}
    shared = {"p": (100, 20, 10), "q": (90, -40, 12), "r": (110, 5, -3)}
    survey = Survey(places | shared, seed=4)
    survey.station("S", "A", *shared).station("T", "B", *shared)
    survey.found("S", "T", "p", "q", "r")


def test_a_traverse_between_two_known_points_is_found_leg_by_leg():
    places = {f"T{k}": (50 * k, 20 * (k % 3), 0.5 * k) for k in range(12)}
    survey = Survey(places, seed=2)
    for k in range(1, 11):
        survey.station(f"T{k}", f"T{k - 1}", f"T{k + 1}")
    survey.found(*[f"T{k}" for k in range(1, 11)], within=0.05)


def test_a_traverse_of_angles_and_distances_alone_is_found():
    places = {f"T{k}": (50 * k, 20 * (k % 3), 0.0) for k in range(8)}
    survey = Survey(places, seed=2)
    for k in range(1, 7):
        survey.angles(f"T{k}", (f"T{k - 1}", f"T{k + 1}")).levels(f"T{k}", f"T{k + 1}").rises(f"T{k}", f"T{k + 1}")
    survey.levels("T0", "T1")
    survey.found(*[f"T{k}" for k in range(2, 7)], within=0.05)


def test_one_known_point_and_an_azimuth_hold_a_free_network():
    places = {"A": (10, 20, 30), "S": (60, -20, 31), "p": (100, 20, 33), "q": (40, 70, 28)}
    Survey(places, seed=1).station("S", "A", "p", "q").azimuths("p", "q").found("S", "p", "q")


def test_a_network_with_nothing_given_keeps_its_shape():
    places = {"S": (60, -20, 31), "T": (0, 40, 20), "p": (100, 20, 33), "q": (40, 70, 28), "r": (10, -60, 25)}
    survey = Survey(places, seed=1).station("S", "T", "p", "q").station("T", "S", "r", "p", "q")
    xyz, _, found, missing = approximate(survey.network(*places))[:4]
    assert missing == {}
    assert sorted(found) == sorted(places)
    level = xyz[:, 2] - survey.true[:, 2]
    assert np.ptp(level) < 0.01
    np.testing.assert_allclose(distances(xyz), distances(survey.true), atol=0.01)


def distances(xyz):
    return np.linalg.norm(xyz[:, None] - xyz, axis=2)


def field(s, t, seed, *, height=20.0):
    rng = np.random.default_rng(seed)
    stations = {f"S{k}": np.append(rng.uniform(-100, 100, 2), rng.uniform(0, height)) for k in range(s)}
    return stations, {f"P{k}": np.array([0, 0, 60]) + rng.uniform(-40, 40, 3) for k in range(t)}


@pytest.mark.parametrize(("s", "t"), [(18, 100), (6, 10)])
@pytest.mark.parametrize("seed", range(2))
def test_a_ranging_network_with_nothing_known_keeps_its_shape(s, t, seed):
    stations, targets = field(s, t, seed)
    survey = Survey(stations | targets, seed=seed)
    for name in stations:
        survey.ranges(name, *targets)
    xyz, _, found, missing = approximate(survey.network(*survey.names))[:4]
    assert missing == {}
    assert len(found) == s + t
    np.testing.assert_allclose(distances(xyz), distances(survey.true), atol=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_ranging_network_is_fitted_to_four_known_points_with_correct_handedness(seed):
    stations, targets = field(8, 30, seed)
    survey = Survey(stations | targets, seed=seed)
    for name in stations:
        seen = [t for t in targets if survey.rng.random() < 0.8]
        survey.ranges(name, *seen)
    known = ["P0", "P1", "P2", "P3"]
    survey.found(*[n for n in survey.names if n not in known], within=0.1)


def test_stations_that_range_each_other_give_the_figure_at_once():
    stations, targets = field(6, 12, 5)
    survey = Survey(stations | targets, seed=5)
    names = list(stations)
    for k, name in enumerate(names):
        survey.ranges(name, *names[k + 1 :], *targets)
    xyz, _, _, missing = approximate(survey.network(*survey.names))[:4]
    assert missing == {}
    np.testing.assert_allclose(distances(xyz), distances(survey.true), atol=0.05)


def test_zenith_angles_choose_the_mirror_image_of_an_unfolded_figure():
    stations, targets = field(8, 20, 3)
    survey = Survey(stations | targets, seed=3)
    for name in stations:
        survey.ranges(name, *targets)
    known = ["S0", "S1", "S2"]
    unknown = [n for n in survey.names if n not in known]
    assert "mirror image" in survey.missing(*unknown)["P0"]
    survey.zeniths("S3", "P4").zeniths("S5", "P7").found(*unknown, within=0.1)


def test_known_points_metres_off_still_give_starts_metres_off():
    stations, targets = field(10, 20, 7)
    survey = Survey(stations | targets, seed=7)
    for name in stations:
        survey.station(name, *targets)
    given = survey.true + survey.rng.normal(size=survey.true.shape) * 1.5
    unknown = [f"P{k}" for k in range(0, 20, 2)] + ["S4"]
    xyz, _, found, missing = approximate(survey.network(*unknown, given=given))[:4]
    assert missing == {}
    assert sorted(found) == sorted(unknown)
    assert np.abs(xyz - survey.true).max() < 8.0


@pytest.mark.parametrize("seed", range(3))
def test_random_visibility_places_all_points_with_three_sights(seed):
    rng = np.random.default_rng(seed)
    stations, targets = field(9, 60, seed, height=40)
    survey = Survey(stations | targets, seed=seed)
    for name in stations:
        survey.station(name, *[t for t in targets if rng.random() < 0.45], *[s for s in stations if s != name][:2])
    known = ["S0", "S1"]
    seen = np.bincount(np.concatenate([g.target for g in survey.groups]) // 3, minlength=len(survey.names))
    unknown = [n for k, n in enumerate(survey.names) if n not in known]
    answer = approximate(survey.network(*unknown))
    for name, why in answer.missing.items():
        assert seen[survey.names.index(name)] == 0, why
    known_now = np.isfinite(answer.xyz).all(axis=1)
    np.testing.assert_allclose(answer.xyz[known_now], survey.true[known_now], rtol=0.0, atol=0.05)


class TestWhatCannotBeFound:
    def test_two_ranges(self):
        survey = Survey(POINT).ranges("A", "P").ranges("B", "P")
        assert survey.missing("P") == {"P": "seen by 2 ranges only"}

    def test_three_ranges_have_two_solutions(self):
        why = Survey(POINT).ranges("P", "A", "B", "C").missing("P")
        assert why == {"P": "seen by 3 ranges only and two positions fit"}

    def test_nothing(self):
        assert Survey(POINT).ranges("A", "B").missing("P") == {"P": "no observation of it"}

    def test_sights_from_points_that_are_lost_too(self):
        places = POINT | {"Q": (10, 20, 30)}
        why = Survey(places).ranges("P", "A", "Q").missing("P", "Q")
        assert why["P"].startswith("seen by 2 ranges, of which 1 range from placed points")
        assert why["Q"].startswith("seen by 1 range, of which none from placed points")

    def test_a_height_that_nothing_holds(self):
        why = Survey(POINT).directions("A", "B", "P").directions("C", "D", "P").missing("P")
        assert why == {"P": "seen by 2 directions only (x, y found)"}

    def test_a_difference_of_distances_alone_does_not_serve(self):
        survey = Survey(POINT)
        survey.groups.append(
            DistanceDifferences("d", np.ones(1), np.ones(1), *(survey.at(n) for n in ("A", "P", "B", "P")))
        )
        assert survey.missing("P") == {"P": "no observation of it"}

    def test_resection_on_the_circle_through_its_three_points(self):
        circle = {n: (50 * np.cos(a), 50 * np.sin(a), 0) for n, a in zip("ABCP", (0.3, 1.2, 2.5, 4.0), strict=True)}
        assert "P" in Survey(circle, noise=0.0).directions("P", "A", "B", "C").rises("A", "P").missing("P")


def test_an_observed_coordinate_places_a_point_and_a_known_height_chooses_between_two_ranges():
    survey = Survey(POINT)
    for column, axis in ((12, 0), (12, 1), (12, 2)):
        observed = np.array([survey.true[4, axis]])
        survey.groups.append(ObservedCoordinates("c", observed, np.full(1, 1e-6), np.array([column]), np.array([axis])))
    survey.found("P")
    survey = Survey(POINT).ranges("A", "P").ranges("B", "P").ranges("C", "P")
    network = survey.network("P")
    network.points.xyz[4, 2] = 120.0
    answer = approximate(network)
    assert answer.found == ("P",)
    np.testing.assert_allclose(answer.xyz[4], survey.true[4], atol=0.02)


def test_inclinations_level_planes_and_joint_groups_are_used_by_their_contents():
    survey = Survey(POINT | {"Q": (10, 30, 99.5)})
    level = survey.parameter(101.2, unit="m")
    heights = survey.true[[0, 1, 5], 2]
    at = survey.at("A", "B", "Q")
    planes = LevelPlanes("level", np.zeros(3), np.full(3, 1e-6), at, np.full(3, level), 101.2 - heights)
    along = survey.along("A", "P")
    tilt = np.array([np.arctan2(along[2], np.hypot(*along[:2]))])
    inclined = Inclinations("i", tilt, np.full(1, ANGLE**2), survey.at("A"), survey.at("P"))
    survey.azimuths("A", "P", "Q").ranges("A", "P", "Q")
    parts = (inclined, *survey.groups)
    survey.groups = [planes, Joint.of("all", parts, np.full(5, 1e-6))]
    survey.found("P", "Q", within=0.05)


def test_ranger_zero_scale_and_heights_of_the_start_values_are_taken_off():
    survey = Survey(POINT)
    zero = survey.parameter(0.5, unit="m", start=0.5)
    scale = survey.parameter(2e-3, unit="1", start=2e-3)
    shift = np.array([0.0, 0.0, -1.2])
    stations = ["A", "B", "C", "D"]
    length = np.array([np.linalg.norm(survey.along(n, "P") + shift) for n in stations])
    survey.groups.append(
        Distances("d", 1.002 * length + 0.5, np.full(4, 1e-6), survey.at(*stations), survey.at(*"PPPP"), shift=shift,
                  nuisance=np.full((4, 1), zero), scaling=np.full((4, 1), scale))
    )  # fmt: skip
    survey.rises("A", "P").found("P")


@pytest.mark.parametrize("frame", [False, True])
def test_a_body_is_posed_on_its_placed_points_and_places_the_rest(frame):
    local = np.array([[0, 0, 0], [1.0, 0, 0], [0, 2.0, 0.5], [0.3, 0.4, 1.5]])
    start, w, t = from_vector([0.1, -0.2, 2.0]), np.array([0.3, 0.4, -0.5]), np.array([20.0, 30.0, 60.0])
    turn = from_vector(w) @ start
    places = KNOWN | {f"p{k}": t + turn @ p for k, p in enumerate(local)}
    survey = Survey(places).station("A", "B", "p0", "p1", "p2")
    pose = np.array([survey.parameter(v, unit="m" if k < 3 else "rad") for k, v in enumerate([*t, *w])])
    at, covariance = survey.at("p0", "p1", "p2", "p3"), np.full(12, 1e-10)
    if frame:
        own = np.array([survey.parameter(0.0, unit="m", start=0.0, sigma=1.0) for _ in range(3)])[[0]]
        own = np.append(np.full(3, -1), own)
        survey.groups.append(FramePoints("f", local.ravel(), covariance, at, pose, start, own))
    else:
        survey.groups.append(RigidBodies("b", local.ravel(), covariance, at, pose, start))
    xyz, parameters, found, missing = approximate(survey.network("p0", "p1", "p2", "p3"))[:4]
    assert missing == {}
    assert len(found) == 4
    np.testing.assert_allclose(xyz, survey.true, atol=0.01)
    turned = from_vector(parameters[pose[3:] - 3 * len(survey.names)]) @ start
    np.testing.assert_allclose(turned, turn, atol=0.01)
    np.testing.assert_allclose(parameters[pose[:3] - 3 * len(survey.names)], t, atol=0.01)


def test_held_and_prior_parameters_keep_their_start():
    survey = Survey(POINT).directions("A", "B", "C")
    held = replace(survey.parameters[0], start=1.0, sigma=0.0)
    network = replace(survey.network(), parameters=(held,))
    assert approximate(network).parameters[0] == 1.0


@pytest.fixture(scope="module")
def tunnel():
    network = read_network(MONITORING / "phase-1-1TK.gkf")
    lines = (MONITORING / "expected-phase-1-1TK.csv").read_text().splitlines()[1:]
    table = {line.split(",")[0]: [float(v) for v in line.split(",")[1:4]] for line in lines}
    return network, table


@pytest.mark.parametrize("also_unknown", ["", "31 41", "31 32 33 34 35 41 42 43 44 45"])
def test_the_set_ups_in_the_metro_tunnel_are_found_to_five_centimetres(tunnel, also_unknown):
    network, table = tunnel
    also_unknown = also_unknown.split()
    xyz = network.points.xyz.copy()
    xyz[[network.points.names.index(n) for n in also_unknown]] = np.nan
    network = replace(network, points=replace(network.points, xyz=xyz))
    answer = approximate(network)
    assert answer.missing == {}
    assert sorted(answer.found) == sorted(["4901", "4902", *also_unknown])
    for name in answer.found:
        expected = network.axes @ table[name]
        assert np.abs(answer.xyz[network.points.names.index(name)] - expected).max() < 0.05


class TestWhatIsAssumed:
    def test_the_whole_of_a_ranging_network_with_nothing_known(self):
        stations, targets = field(8, 20, 1)
        survey = Survey(stations | targets, seed=1)
        for name in stations:
            survey.ranges(name, *targets)
        answer = approximate(survey.network(*survey.names))
        assert answer.assumed == tuple(survey.names)

    def test_a_level_network_with_nothing_known_or_one_point_alone(self):
        places = {"S": (60, -20, 31), "T": (0, 40, 20), "p": (100, 20, 33), "q": (40, 70, 28)}
        survey = Survey(places, seed=1).station("S", "T", "p", "q").station("T", "S", "p", "q")
        assert approximate(survey.network(*places)).assumed == tuple(places)
        one = approximate(survey.network("T", "p", "q"))
        assert one.missing == {}
        assert one.assumed == ("T", "p", "q")

    def test_an_azimuth_and_a_known_point_leave_nothing_to_assume(self):
        places = {"A": (10, 20, 30), "S": (60, -20, 31), "p": (100, 20, 33), "q": (40, 70, 28)}
        survey = Survey(places, seed=1).station("S", "A", "p", "q").azimuths("p", "q")
        answer = approximate(survey.network("S", "p", "q"))
        assert answer.found == ("S", "p", "q")
        assert answer.assumed == ()

    @pytest.mark.parametrize("height", [0.0, 20.0])
    def test_the_sides_of_targets_that_stations_in_one_plane_see_but_not_of_those_given(self, height):
        stations, targets = field(9, 20, 2, height=height)
        survey = Survey(stations | targets, seed=2)
        for name in stations:
            survey.ranges(name, *targets)
        known = ["S0", "S1", "S2", "S3", "P0"]
        answer = approximate(survey.network(*[n for n in survey.names if n not in known]))
        assert answer.missing == {}
        np.testing.assert_allclose(answer.xyz, survey.true, rtol=0.0, atol=0.5)  # flat stations, heights are weak
        assert answer.assumed == (tuple(n for n in targets if n != "P0") if height == 0.0 else ())


def test_four_stations_in_one_plane_leave_two_positions():
    survey = Survey({"A": (0, 0, 0), "B": (120, 10, 0), "C": (60, 110, 0.0), "D": (-30, 90, 0), "P": (40, 50, 20)})
    for name in "ABCD":
        survey.ranges(name, "P")
    assert "two positions fit" in survey.missing("P")["P"]


def test_a_level_plane_of_known_height_gives_a_height():
    survey = Survey(POINT).azimuths("A", "P").levels("A", "P")
    held, one = np.array([-1]), np.full(1, 1e-6)
    survey.groups.append(LevelPlanes("level", np.array([121.0]), one, survey.at("P"), held, np.array([1.0])))
    survey.found("P")


def test_unknown_ranger_zero_of_thirty_sigma_does_not_refuse_the_figure():
    stations, targets = field(10, 30, 1)
    survey = Survey(stations | targets, seed=1)
    zero = survey.parameter(0.03, unit="m", start=0.0)
    for name in stations:
        survey.ranges(name, *targets, nuisance=np.full((30, 1), zero))
        survey.groups[-1].observed[:] += 0.03
    answer = approximate(survey.network(*survey.names))
    assert answer.missing == {}
    np.testing.assert_allclose(distances(answer.xyz), distances(survey.true), atol=1.0)


def test_figure_with_too_few_placed_points_gives_their_number():
    stations, targets = field(8, 12, 1)
    survey = Survey(stations | targets | {"Z": (500, 500, 0)}, seed=1)
    for name in stations:
        survey.ranges(name, *targets)
    why = survey.missing(*[n for n in survey.names if n not in ("S0", "Z")])
    assert "of 20 points that ranges tie together 1 are placed, 3 are needed" in why["P3"]


def test_a_local_network_that_shares_one_point_with_the_placed_ones_is_not_turned_at_will():
    places = KNOWN | {"p": (10, 10, 101), "q": (20, -10, 99), "S": (15, 3, 100)}
    survey = Survey(places).station("S", "A", "p", "q")
    why = survey.missing("S", "p", "q")
    assert set(why) == {"S", "p", "q"}
    survey = Survey(places).station("S", "p", "q")
    assert set(survey.missing("S", "p", "q")) == {"S", "p", "q"}
