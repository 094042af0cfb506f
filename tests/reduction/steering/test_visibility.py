"""Which ranger sees what, on the example night, with solids chosen for the test."""

import numpy as np
import pytest

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.geometry.frames.frame import Transform
from catseye.geometry.frames.rotation import from_vector
from catseye.optics.retroreflector.kinds.registry import BALL, HOLLOW, KINDS, PRISM
from catseye.optics.retroreflector.prism import clear_share
from catseye.records.site.solids import Solids, read_solids
from catseye.reduction.site.places import places_of
from catseye.reduction.steering.visibility import (
    BEAM_RADIUS,
    CLEAR_END,
    CLEAR_START,
    RangeLimits,
    Retroreflectors,
    Sight,
    frames_at,
    retroreflectors_of,
    visibility,
)
from repository import ROOT

TEXT = (ROOT / "examples" / "solids.toml").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def solids():
    return read_solids(ROOT / "examples" / "solids.toml")


@pytest.fixture(scope="module")
def scene(night_01):
    posture = night_01.site.campaign
    frames = frames_at(posture.azimuth_deg * DEGREE, posture.elevation_deg * DEGREE)
    rangers = {n: p.start for n, p in places_of(night_01).items() if p.kind is None}
    return rangers, retroreflectors_of(night_01), frames


def inside_any(solids, frames, x, margin):
    """Names of solids that hold points x (n, 3), ground, by plain words; grown by a margin where that is easy."""
    found = {}
    for s in solids.all:
        own = frames[s.frame].inverse().points(x) * 1e3  # mm, as the file
        if s.name == "alidade tower":
            hit = np.all(np.abs(own - s.centre_mm) <= np.array(s.size_mm) / 2 + margin, axis=-1)
        elif s.name == "receiver room":
            hit = np.linalg.norm(own - s.centre_mm, axis=-1) <= s.radius_mm + margin
        elif s.name == "weather tower":
            off = np.hypot(own[:, 0] - 60_000, own[:, 1] - 60_000)
            hit = (off <= 1500 + margin) & (own[:, 2] <= 45_000 + margin) & (own[:, 2] >= -margin)
        elif s.name == "feed arm":
            foot, top = np.array(s.from_mm), np.array(s.to_mm)
            length = np.linalg.norm(top - foot)
            height = (own - foot) @ (top - foot) / length
            off = np.sqrt(np.maximum(np.sum((own - foot) ** 2, axis=-1) - height**2, 0.0))
            wide = 5000 - 2500 * height / length
            hit = (height >= 0) & (height <= length) & (off <= wide)
        else:
            g = own[:, 2] - (own[:, 0] ** 2 + own[:, 1] ** 2) / 240_000.0
            hit = (np.hypot(own[:, 0], own[:, 1] - 54_000) <= 50_000) & (g <= 0) & (g >= -300)
        found[s.name] = hit
    return found


def test_every_pair_of_the_night_agrees_with_points_taken_along_its_path(solids, scene):
    rangers, targets, frames = scene
    found = visibility(rangers, targets, solids, frames=frames, beam_radius=0.0)
    every = slice(0, None, 29)
    seen_names = set()
    for i, name in enumerate(rangers):
        for j in range(len(targets.names))[every]:
            length = found.range[i, j]
            along = np.arange(CLEAR_START, length - CLEAR_END, 0.02)
            x = rangers[name] + along[:, None] * (targets.points[j] - rangers[name]) / length
            inside = inside_any(solids, frames, x, 0.0)
            first = {n: along[np.argmax(h)] for n, h in inside.items() if h.any()}
            if first:
                where = min(first, key=first.get)
                assert found.solids[found.obstacle[i, j]] == where
                assert found.obstacle_at[i, j] == pytest.approx(first[where], abs=0.0201)
                seen_names.add(where)
            elif found.obstacle[i, j] >= 0:  # an edge, shorter than two points are apart
                near = found.obstacle_at[i, j] + np.linspace(0.0, 0.02, 2001)
                x = rangers[name] + near[:, None] * (targets.points[j] - rangers[name]) / length
                assert any(h.any() for h in inside_any(solids, frames, x, 1e-6).values())
    assert len(seen_names) >= 3


def test_reasons_are_lines_that_a_person_reads(solids, scene):
    rangers, targets, frames = scene
    found = visibility(rangers, targets, solids, frames=frames)
    reasons = {found.reason(i, j) for i in range(len(rangers)) for j in range(len(targets.names))}
    assert "seen" in reasons
    assert any(r.startswith("obstructed by 'reflector' at ") for r in reasons)
    assert any(r.startswith("incidence ") and r.endswith(" deg above 45") for r in reasons)
    assert found.seen.sum() == sum(found.reason(i, j) == "seen" for i, j in np.ndindex(found.seen.shape))
    prisms = [k for k, kind in enumerate(targets.kinds) if kind is PRISM]
    feed_arm = [i for i, n in enumerate(rangers) if n >= "ZY113"]
    ground = [i for i, n in enumerate(rangers) if n < "ZY113"]
    # what the campaign did: feed-arm rangers look at the dish's prisms, ground rangers cannot
    assert found.seen[np.ix_(feed_arm, prisms)].mean() > 0.3
    assert found.seen[np.ix_(ground, prisms)].mean() < 0.1


def test_targets_ranged_that_night_are_visible(night_01, scene):
    """Shots of the night, with nothing in the way: every one lies within the acceptance of its retroreflector."""
    rangers, targets, frames = scene
    found = visibility(rangers, targets, Solids(), frames=frames)
    row, column = list(rangers), {name: k for k, name in enumerate(targets.names)}
    pairs = {(r, t) for r, t in zip(night_01.shots.ranger, night_01.shots.target, strict=True) if t in column}
    assert len(pairs) > 50
    refused = {
        (r, t, found.reason(row.index(r), column[t])) for r, t in pairs if not found.seen[row.index(r), column[t]]
    }
    assert not refused


def test_the_order_of_reasons_and_the_limits():
    rangers = {"A": np.array([0.0, 0.0, 0.0])}
    points = np.array([[1.0, 0, 0], [600.0, 0, 0], [100.0, 0, 0], [100.0, 0, 0], [100.0, 0, 0], [100.0, 0, 0]])
    back = np.array([-1.0, 0.0, 0.0])
    axes = np.array(
        [back, back, [-np.cos(1.1), np.sin(1.1), 0.0], back, [np.nan] * 3, [-np.cos(1.1), np.sin(1.1), 0.0]]
    )
    kinds = (PRISM, PRISM, PRISM, HOLLOW, HOLLOW, BALL)
    targets = Retroreflectors(tuple("abcdef"), kinds, points, axes)
    frames = frames_at(0.3, 0.7)
    found = visibility(
        rangers, targets, Solids(), frames=frames, reachable=np.array([[True] * 3 + [False] + [True] * 2])
    )
    assert found.code[0].tolist() == [
        Sight.TOO_NEAR,
        Sight.TOO_FAR,
        Sight.INCIDENCE,
        Sight.BEYOND_STOPS,
        Sight.SEEN,
        Sight.SEEN,
    ]
    assert found.reason(0, 0) == "too near: 1.0 m under 2"
    assert found.reason(0, 1) == "too far: 600.0 m above 500"
    assert found.reason(0, 2) == "incidence 63 deg above 45"
    assert found.reason(0, 3) == "beyond the azimuth stops"
    wide = visibility(rangers, targets, Solids(), frames=frames, limits=RangeLimits(0.5, 1000.0))
    assert wide.seen[0, :2].all()


def test_a_beam_is_not_a_line():
    rangers = {"A": np.array([0.0, 0.0, 0.0])}
    targets = Retroreflectors(("t",), (BALL,), np.array([[100.0, 0, 0]]), np.array([[-1.0, 0, 0]]))
    near = Solids.model_validate(
        {"sphere": [{"name": "s", "frame": "ground", "centre_mm": [50_000.0, 1005.0, 0.0], "radius_mm": 1000.0}]}
    )
    assert visibility(rangers, targets, near, frames=frames_at(0, 1), beam_radius=0.0).seen[0, 0]
    assert not visibility(rangers, targets, near, frames=frames_at(0, 1), beam_radius=BEAM_RADIUS).seen[0, 0]


def test_solids_move_with_their_frame():
    """A target behind a box of the alidade is hidden at one azimuth and free a quarter turn on."""
    rangers = {"A": np.array([0.0, 100.0, 10.0])}
    targets = Retroreflectors(("t",), (BALL,), np.array([[0.0, -50.0, 10.0]]), np.array([[0.0, 1.0, 0.0]]))
    box = Solids.model_validate(
        {"box": [{"name": "b", "frame": "alidade", "centre_mm": [0.0, 20_000.0, 10_000.0], "size_mm": [2000.0] * 3}]}
    )
    assert visibility(rangers, targets, box, frames=frames_at(0.0, 1.0)).reason(0, 0) == "obstructed by 'b' at 79.0 m"
    assert visibility(rangers, targets, box, frames=frames_at(np.pi / 2, 1.0)).seen[0, 0]
    assert (
        visibility(rangers, targets, box, frames=frames_at(np.pi, 1.0)).reason(0, 0) == "obstructed by 'b' at 119.0 m"
    )
    better = Transform("ground", "reflector", from_vector([0.1, 0.0, 0.0]), np.zeros(3))
    assert frames_at(0.0, 1.0, better)["reflector"] is better


def test_the_acceptance_follows_from_the_face():
    for kind in (PRISM, HOLLOW):
        face = kind.acceptance
        share = clear_share(face.limit, aperture=face.aperture, height=face.height, index=face.index)
        assert share == pytest.approx(face.least_share, abs=1e-9)
    assert PRISM.acceptance.limit / DEGREE == pytest.approx(45.0, abs=0.3)
    assert HOLLOW.acceptance.limit / DEGREE == pytest.approx(30.2, abs=0.1)
    assert BALL.acceptance.limit / DEGREE == pytest.approx(80.0)
    assert all(kind.acceptance.why for kind in KINDS.values())


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("radius_mm = 4000.0", "radius_mm = 4.0", r"radius_mm = 4.0 looks like metres"),
        ("radius_mm = 4000.0", "radius_mm = -4000.0", r"radius_mm = -4000.0"),
        ("size_mm = [30000.0, 10000.0, 44000.0]", "size_mm = [30.0, 10.0, 44.0]", "size_mm"),
        ('frame = "alidade"', 'frame = "feed"', "frame = 'feed'"),
        ("to_mm = [60000.0, 60000.0, 45000.0]", "to_mm = [60000.0, 60000.0, 0.0]", "weather tower: from_mm"),
        ("centre_mm = [0.0, 0.0, 24000.0]", "centre_mm = [0.0, 0.0, 24000000.0]", "alidade tower: centre_mm holds"),
        ('name = "feed arm"', 'name = "reflector"', "solid 'reflector' is given twice"),
        (
            "from_radius_mm = 5000.0\nto_radius_mm = 2500.0",
            "from_radius_mm = 5.0\nto_radius_mm = 0.0",
            "larger radius is 5 mm",
        ),
        ('name = "feed arm"', 'name = "a\\nb"', "expected up to 60 letters"),
        ("below_mm = 300.0", "thick_mm = 300.0", "thick_mm = 300.0 is not a known key"),
        ('format = "catseye-solids-1"', 'format = "catseye-solids-9"', "format"),
    ],
)
def test_bad_solids_are_refused_in_one_line(tmp_path, old, new, message):
    assert old in TEXT
    path = tmp_path / "solids.toml"
    path.write_text(TEXT.replace(old, new))
    with pytest.raises(InputError, match=message) as caught:
        read_solids(path)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("solids.toml: ")
