"""Changes of a running reduction: at their place, repeatable, targets anew."""

import copy

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.reduction.live.changes import LiveChange, placed, without_points
from live_scene import begun, deviations, site


@pytest.fixture(scope="module")
def track():
    """Two epochs of a tracking telescope, and the third round's feed."""
    night, live = begun(seed=5)
    for k in range(2):
        night.round(k).into(live)
        live.solve(night.ticks(k))
    return night, live, night.round(2)


def third(track, change=None, *, under_way=False):
    """Third epoch after a change, or begun before it."""
    night, live, feed = track
    live = copy.deepcopy(live)
    if change is not None and not under_way:
        live.change(change)
    feed.into(live)
    job = live.begin(night.ticks(2))
    if change is not None and under_way:
        live.change(change)
    return live, live.accept(job, job.solve())


def test_text_of_a_change_gives_it_back_and_unknown_keys_are_refused():
    change = LiveChange(filter="random_walk", positions_mm={"ZBM01": (1.5, 2.0, -3.25)}, reference=True)
    assert LiveChange.of(change.text) == change
    assert LiveChange.of(LiveChange().text) == LiveChange()
    for text in ('{"gain": 2}', "[]x", "{"):
        with pytest.raises(InputError):
            LiveChange.of(text)


def test_another_air_model_changes_the_epoch_and_repeats_bit_for_bit(track):
    change = LiveChange(air_model="barrell_sears1963")
    (_, usual), (live, first), (_, second) = (
        third(track),
        third(track, change),
        third(track, LiveChange.of(change.text)),
    )
    assert live.settings.reduction.air_model == "barrell_sears1963"
    assert first.x.tobytes() == second.x.tobytes()
    assert first.covariance.tobytes() == second.covariance.tobytes()
    assert first.x.tobytes() != usual.x.tobytes()


def test_change_waits_for_the_epoch_that_is_being_solved(track):
    (_, usual), (live, found) = third(track), third(track, LiveChange(critical=2.0), under_way=True)
    assert found.x.tobytes() == usual.x.tobytes()
    assert found.rejected == usual.rejected
    assert live.settings.reduction.critical == 2.0


def test_higher_threshold_blocks_weak_returns(track):
    night, live, feed = track
    usual, strict = copy.deepcopy(live), copy.deepcopy(live)
    strict.change(LiveChange(smallest_return=1000.0, critical=2.0))
    blocked = [sum(answer.status == "blocked" for answer in feed.into(each)) for each in (usual, strict)]
    assert blocked[1] > blocked[0]
    assert strict.begin(night.ticks(2)).rules.critical == 2.0


def test_velocities_come_with_their_filter_and_go_with_it(track):
    live, _ = third(track, LiveChange(filter="constant_velocity"))
    assert live.state.points(ParameterKind.VELOCITY)
    live.change(LiveChange(filter="random_walk"))
    assert not live.state.points(ParameterKind.VELOCITY)


def test_moved_target_begins_anew_and_is_found_where_it_is(track):
    """Typed 12 mm off in each coordinate, of u 14 mm with flexure: the ranges say where it is."""
    night, before, _ = track
    name = next(n for n in sorted(before.lasting) if n in site().targets and n in before.state.points())
    old = np.array(before.site.targets[name].position_mm)
    live, found = third(track, LiveChange(positions_mm={name: tuple((old + 12.0).tolist())}))
    assert name not in live.state.points(ParameterKind.REFERENCE_PLACE)
    assert name in before.state.points(ParameterKind.REFERENCE_PLACE)
    assert np.abs(deviations(night, live, found, 2, [name])).max() < 4.0
    u = np.sqrt(np.trace(found.point(name)[1]))
    _, usual = third(track)
    assert u > np.sqrt(np.trace(usual.point(name)[1]))  # little: a body moves by more than u from epoch to epoch
    live.change(LiveChange(positions_mm={}))
    assert live.site.targets[name].position_mm == tuple(old)


def test_reference_is_set_anew(track):
    live, found = third(track, LiveChange(reference=True), under_way=True)
    assert live.reference_number == found.number == 3
    assert track[1].reference_number == 2


def test_position_of_something_else_is_refused_and_changes_nothing(track):
    _, live, _ = track
    with pytest.raises(InputError, match="'TR01' is not a target"):
        live.change(LiveChange(critical=9.0, positions_mm={"TR01": (0.0, 0.0, 0.0)}))
    assert live.settings.reduction.critical == 3.5
    with pytest.raises(InputError):
        placed(live.site, live.site, {"NOBODY": (0.0, 0.0, 0.0)})


def test_state_without_a_point_keeps_the_rest(track):
    _, live, _ = track
    name = sorted(live.state.points())[0]
    bare = without_points(live.state, [name])
    assert Parameter(ParameterKind.POINT, name, "x") not in bare.parameters
    other = [p for p in live.state.parameters if p in bare.parameters]
    np.testing.assert_array_equal(bare.x, live.state.x[live.state.columns(other)])
