from dataclasses import replace

import numpy as np
import pytest

from catseye.coordinator.guard.guard import SafetyGuard, _unforeseen
from catseye.coordinator.visibility.surroundings import KeepClear
from catseye.errors import InputError
from catseye.ranger.initialisation import commands_of_ranger
from catseye.ranger.line import Reply, Request
from catseye.ranger.status import StatusWord
from catseye.records.night.live import TICK_SECONDS, LivePosture
from catseye.records.site.interlock import Interlock, Interlocks
from catseye.reduction.steering.tracking import AZIMUTH_SLEW, ELEVATION_SLEW, SLEW_ACCELERATION
from coordinator.round_scene import DAY, DEGREE, MORNING, NIGHT, angle, beams, gbt, keep_out, posture, stands
from sun_scene import astropy_sun

SECOND = 1.0 / TICK_SECONDS
SUN = astropy_sun(np.array([MORNING / DAY]))[0]


def said(guard, name, line, ticks=MORNING, stamp=None):
    command, _, rest = line.partition(" ")
    return guard.refusal(name, Request(command, tuple(p.strip() for p in rest.split(",") if rest), ticks=stamp), ticks)


def toward(name, vector, frame=None):
    """Counts of a ranger that look along a ground vector."""
    v = stands()[name]
    return v.look(v.station.scan_point + 100.0 * vector)


def aside(degrees):
    """The Sun's direction turned towards the zenith."""
    up = np.array([0, 0, 1]) - SUN[2] * SUN
    return np.cos(degrees * DEGREE) * SUN + np.sin(degrees * DEGREE) * up / np.linalg.norm(up)


def cil(counts):
    return f"CIL 0, {counts[0]:.0f}, {counts[1]:.0f}"


@pytest.fixture
def guard():
    """ZY101 told its records, its mirror resting 40 degrees above the Sun."""
    made = SafetyGuard(gbt())
    for request in commands_of_ranger(gbt(), "ZY101", ["ZBM01", "ZEG41040L"]):
        assert made.refusal("ZY101", request, MORNING) is None
    made.stands("ZY101", tuple(toward("ZY101", aside(40))))
    return made


def test_cube_in_the_sun_is_refused_by_any_command(guard):
    place = stands()["ZY101"].station.scan_point + 80.0 * SUN
    at = ", ".join(f"{v * 1e3:.1f}" for v in place)
    assert said(guard, "ZY101", f"COO 7, {at}, SUNNY") is None
    late = MORNING / DAY + 1e-6
    asked = {
        "CIL 7": "CIL 7",
        "CIL by name": "CIL sunny",
        "CIL of a place": f"CIL 1, {at}",
        "CMEAS 1": "CMEAS 1, 7",
        "TRK": f"TRK 7, {late:.8f}, {at}, {late + 1e-5:.8f}, {at}",
        "counts": cil(toward("ZY101", SUN)),
    }
    for how, line in asked.items():
        assert "of the Sun" in (said(guard, "ZY101", line) or ""), how
    for axis, count in enumerate(toward("ZY101", SUN)):
        assert said(guard, "ZY101", f"ABP {axis}, {count:.0f}") is None
    first, second = said(guard, "ZY101", "STT 0"), said(guard, "ZY101", "STT 1")
    assert "of the Sun" in (first or second or "")


def test_cube_away_from_the_sun_is_allowed_and_any_at_night(guard):
    assert said(guard, "ZY101", cil(toward("ZY101", aside(30)))) is None
    assert said(guard, "ZY101", cil(toward("ZY101", SUN)), NIGHT) is None


def test_the_limit_is_the_cone_and_the_servo_margin(guard):
    """5 degrees and hypot(20 counts of 12.96", 20 of 25.92") = 0.161; 20 s of the Sun's way are 0.04 more."""
    for degrees, free in ((5.25, True), (5.15, False)):
        guard.stands("ZY101", tuple(toward("ZY101", aside(degrees + 1))))
        assert (said(guard, "ZY101", cil(toward("ZY101", aside(degrees)))) is None) is free, degrees


def test_move_past_the_sun_is_refused_with_free_ends(guard):
    here, there = toward("ZY101", aside(10)), toward("ZY101", aside(-10))
    for counts in (here, there):
        assert angle(beams("ZY101", counts, posture(), np.array(MORNING)), SUN) > 9 * DEGREE
    guard.stands("ZY101", tuple(here))
    assert "of the Sun" in said(guard, "ZY101", cil(there))


def test_mirror_in_the_cone_may_leave_but_not_cross(guard):
    guard.stands("ZY101", tuple(toward("ZY101", aside(2))))
    assert "of the Sun" in said(guard, "ZY101", cil(toward("ZY101", aside(-20))))
    assert "of the Sun" in said(guard, "ZY101", cil(toward("ZY101", aside(3))))
    assert said(guard, "ZY101", cil(toward("ZY101", aside(20)))) is None


def test_moving_mirror_may_be_anywhere_on_its_path(guard):
    """Up the left of the Sun, then across above it, then down its right: legs that are free one by one."""
    sun = toward("ZY101", SUN)
    left, right = sun[0] - 3000, sun[0] + 3000
    low, high = sun[1] - 1500, sun[1] + 1500
    guard.stands("ZY101", (left, low))
    assert said(guard, "ZY101", cil((left, high))) is None
    # It may still be at the left below: from there the way to the right above passes the Sun.
    assert "of the Sun" in said(guard, "ZY101", cil((right, high)), MORNING + 10)
    guard.heard("ZY101", Reply("CIL", False, ("axes have not arrived",)))
    assert "of the Sun" in said(guard, "ZY101", cil((right, high)), MORNING + round(30 * SECOND))
    for axis, counts in enumerate((left, high)):
        guard.heard("ZY101", Reply("ACP", True, (str(axis), f"{counts:.0f}")))
    assert said(guard, "ZY101", cil((right, high)), MORNING + round(31 * SECOND)) is None


def test_answered_move_has_ended_and_a_silent_one_times_out(guard):
    sun = toward("ZY101", SUN)
    corner, far = (sun[0] - 3000, sun[1] + 1500), (sun[0] + 3000, sun[1] + 1500)
    for ends in ("answer", "time"):
        guard.stands("ZY101", (sun[0] - 3000, sun[1] - 1500))
        assert said(guard, "ZY101", cil(corner)) is None
        later = MORNING + 10
        if ends == "answer":
            guard.heard("ZY101", Reply("CIL", True, ("0", "ZRG", "0", "0", "0", str(corner[0]), str(corner[1]))))
        else:
            later = MORNING + round(5 * SECOND)
        assert said(guard, "ZY101", cil(far), later) is None


def test_failed_motor_leaves_the_mirror_anywhere_on_its_last_path(guard):
    """It was taken to have arrived, and then its status word says otherwise."""
    sun = toward("ZY101", SUN)
    corner, far = (sun[0] - 3000, sun[1] + 1500), (sun[0] + 3000, sun[1] + 1500)
    word = StatusWord.AUTO | StatusWord.AZIMUTH_HOMED | StatusWord.ELEVATION_HOMED
    for off, free in ((StatusWord(0), True), (StatusWord.AZIMUTH_OFF, False), (StatusWord.ELEVATION_OFF, False)):
        guard.stands("ZY101", (sun[0] - 3000, sun[1] - 1500))
        assert said(guard, "ZY101", cil(corner)) is None
        later = MORNING + round(5 * SECOND)
        assert said(guard, "ZY101", "MOD 1", later) is None
        guard.heard("ZY101", Reply("STW", True, (f"0x{int(word | off):08x}",)))
        assert (said(guard, "ZY101", cil(far), later) is None) is free


def test_unknown_position_and_homing_are_refused(guard):
    fresh = SafetyGuard(gbt())
    assert "ACP" in said(fresh, "ZY102", cil(toward("ZY102", aside(40))))
    assert "PS 0" in said(fresh, "ZY102", "FHM 0")
    assert said(fresh, "ZY102", "FHM 0", NIGHT) is None
    assert said(fresh, "ZY102", "PS 0") is None
    for axis in "01":
        assert said(fresh, "ZY102", f"FHM {axis}") is None
        guard.heard("ZY102", Reply("FHM", True, (axis,)))
    assert "ACP" in said(fresh, "ZY102", "CIL 0, 100, 100")
    for axis in "01":
        fresh.heard("ZY102", Reply("FHM", True, (axis,)))
    assert "ACP" not in (said(fresh, "ZY102", "CIL 0, 100, 100") or "")
    fresh.heard("ZY102", Reply("STW", True, (f"0x{int(StatusWord.AUTO | StatusWord.AZIMUTH_HOMED):08x}",)))
    assert "ACP" in said(fresh, "ZY102", "CIL 0, 100, 100")
    dark = SafetyGuard(gbt())
    dark.heard("ZY102", Reply("STW", True, (f"0x{int(StatusWord.LASER_OFF):08x}",)))
    assert said(dark, "ZY102", "FHM 0") is None


def test_commands_that_cannot_be_checked_are_refused(guard):
    for line, word in {
        "INITZY": "files",
        "AT 0, 1, 0, CIL 0, 1000, 2000": "in advance",
        "AT 0, 1, 0, COO 1, 1000, 1000, 1000": "in advance",
        "CIL 9": "not sent",
        "FROB 1": "not a command",
        "CIL 0, 999999, 2000": "stops",
        "SCN 1": "scan",
        "CIL 0": "",
        "STI 52889.1": "clock",
        "ABP 0": "do not fit",
        "COO 1, x, 2, 3": "could not convert",
    }.items():
        answer = said(guard, "ZY101", line)
        assert (answer is None) if line == "CIL 0" else word in answer, (line, answer)
    assert "away" in said(guard, "ZY101", cil(toward("ZY101", aside(30))), stamp=MORNING + round(60 * SECOND))
    assert "not in the site" in said(guard, "ZY999", "VER")
    assert said(guard, "ZY101", "AT 0, 10, 0.5, CMEAS 2, 1") is None
    assert said(guard, "ZY101", "CMEAS 2, 1") is None
    assert said(guard, "ZY101", "SCN 0") is None


def test_scan_is_checked_for_all_its_cubes(guard):
    assert said(guard, "ZY101", "NUM 2") is None
    numbers = {r.parameters[-1]: r.parameters[0] for r in commands_of_ranger(gbt(), "ZY101") if len(r.parameters) == 5}
    for place, name in enumerate(("ZEG41040L", "ZBM01"), 1):
        assert said(guard, "ZY101", f"ORD {place}, {numbers[name]}") is None
    assert said(guard, "ZY101", "SCN 1, 0, 5", NIGHT) is None
    place = stands()["ZY101"].station.scan_point + 80.0 * SUN
    at = ", ".join(f"{v * 1e3:.1f}" for v in place)
    assert said(guard, "ZY101", f"COO {numbers['ZBM01']}, {at}") is None
    guard.stands("ZY101", tuple(toward("ZY101", aside(40))))
    assert "of the Sun" in said(guard, "ZY101", "SCN 1, 0, 5")
    assert "rounds" in said(guard, "ZY101", "SCN 1, 0, 0", NIGHT)


def test_beam_does_not_pass_boxes_and_is_not_lit_on_them():
    guard = SafetyGuard(gbt(), keep_clear=KeepClear(gbt(), keep_out()))
    box = keep_out().boxes()[1]
    name = "ZY108"
    at = stands()[name].station.scan_point
    way = (box.centre - at) / np.linalg.norm(box.centre - at)
    into, above = toward(name, way), toward(name, np.add(way, [0, 0, 0.5]))
    guard.stands(name, tuple(above))
    assert "visitors-path" in said(guard, name, cil(into), NIGHT)
    assert said(guard, name, "PS 1", NIGHT) is None
    guard.stands(name, tuple(into))
    assert "visitors-path" in said(guard, name, "PS 1", NIGHT)
    assert "ACP" in said(guard, "ZY109", "PS 1", NIGHT)


def test_interlocks_apply_to_their_times_and_rangers(guard):
    from datetime import UTC, datetime

    crane = Interlock(
        name="crane",
        why="people on the arm",
        rangers=("ZY101",),
        begin=datetime(2003, 9, 7, 15, 37, tzinfo=UTC),
        end=datetime(2003, 9, 7, 16, 0, tzinfo=UTC),
    )
    door = Interlock(name="door", why="somebody is inside", rangers=("ZY102",), switch=True, forbids=("shine",))
    locked = SafetyGuard(gbt(), interlocks=Interlocks(interlock=(crane, door)))
    free = tuple(toward("ZY101", aside(40)))
    locked.stands("ZY101", free)
    go = cil(toward("ZY101", aside(30)))
    before, inside, behind = MORNING, MORNING + round(61 * SECOND), MORNING + round(1500 * SECOND)
    assert said(locked, "ZY101", go, before) is None
    locked.stands("ZY101", free)
    assert said(locked, "ZY101", go, MORNING + round(59.5 * SECOND)) is not None  # it would not end before
    answer = said(locked, "ZY101", go, inside)
    assert answer == "interlock crane (people on the arm) forbids to move until 2003-09-07T16:00:00Z"
    assert "shine" in said(locked, "ZY101", "PS 1", inside)
    assert said(locked, "ZY101", "PS 0", inside) is None
    assert "shine" in said(locked, "ZY101", "CMEAS 2, 1", inside)
    assert "shine" in said(locked, "ZY101", f"AT {before / DAY:.8f}, 100, 1, TRG", before)
    assert said(locked, "ZY103", "PS 1", inside) is None
    assert said(locked, "ZY101", "PS 1", behind) is None
    assert "door" in said(locked, "ZY102", "PS 1", behind)
    locked.switch("door", is_open=False)
    assert said(locked, "ZY102", "PS 1", behind) is None
    locked.switch("door", is_open=True)
    assert "door" in said(locked, "ZY102", "PS 1", behind)
    with pytest.raises(InputError, match="not a switch"):
        locked.switch("crane", is_open=True)
    with pytest.raises(InputError, match="ZY999"):
        SafetyGuard(gbt(), interlocks=Interlocks(interlock=(door.model_copy(update={"rangers": ("ZY999",)}),)))


def test_laser_is_switched_off_when_an_interlock_begins():
    door = Interlock(name="door", why="somebody is inside", switch=True)
    guard = SafetyGuard(gbt(), interlocks=Interlocks(interlock=(door,)))
    guard.switch("door", is_open=False)
    assert said(guard, "ZY103", "PS 1", NIGHT) is None
    counts = {"ZY103": stands()["ZY103"].reference}
    assert guard.watch(NIGHT, counts) == []
    guard.switch("door", is_open=True)
    (alarm,) = guard.watch(NIGHT, counts)
    assert (alarm.ranger, alarm.cause, alarm.remedy, alarm.within) == ("ZY103", "interlock", "dark", 0.0)


def test_feed_arm_ranger_is_checked_for_the_present_posture():
    name = "ZY114"
    guard = SafetyGuard(gbt())
    sun_az, sun_el = np.arctan2(SUN[0], SUN[1]), np.arcsin(SUN[2])
    assert "posture" in (said(guard, name, f"SUN {SUN[0]:.7f}, {SUN[1]:.7f}, {SUN[2]:.7f}") or "")
    for off, free in ((0.0, False), (40.0, True)):
        own = LivePosture(MORNING, sun_az, sun_el - off * DEGREE)
        guard.telescope(own)
        # Straight along the telescope's axis, which looks at the Sun, or 40 degrees below it.
        v = stands()[name]
        counts = v.look(np.add(v.station.scan_point, [0.0, 0.0, 100.0]))
        aside_ = v.look(np.add(v.station.scan_point, [0.0, -30.0, 95.0]))
        guard.stands(name, tuple(aside_))
        assert (said(guard, name, cil(counts)) is None) is free
        told = guard.sun_vector(name, MORNING)
        assert np.arccos(told[2]) == pytest.approx(off * DEGREE, abs=0.02 * DEGREE)  # refraction 0.013 deg
    old = MORNING + round(11 * SECOND)
    assert "posture is 11.0 s old" in said(guard, name, cil(counts), old)


def test_longer_moves_of_a_feed_arm_ranger_need_wider_margins():
    """Telescope accelerations of 0.2 deg/s^2: 0.6 degrees in 2 s, 4 in 6 s."""
    name = "ZY114"
    guard = SafetyGuard(gbt())
    guard.telescope(LivePosture(MORNING, np.arctan2(SUN[0], SUN[1]), np.arcsin(SUN[2]) - 40 * DEGREE))
    v = stands()[name]

    def look(degrees):
        way = 100 * np.array([0.0, -np.sin(degrees * DEGREE), np.cos(degrees * DEGREE)])
        return v.look(np.add(v.station.scan_point, way))

    goal = look(40 - 6.5)  # in the plane of the telescope's axis and the Sun, which stands 40 degrees above the axis
    near = look(40 - 12)
    far = np.array([v.stops[0] if goal[0] > np.mean(v.stops) else v.stops[1], near[1]])
    assert abs(far[0] - goal[0]) / v.pace.velocity[0] > 2.5
    for start, free in ((near, True), (far, False)):
        guard.stands(name, tuple(start))
        clear = guard._around(guard._memory[name], MORNING, MORNING + 10)
        low, high = np.minimum(start, goal), np.maximum(start, goal)
        assert float(clear.from_sun(low, high)) > 0.0  # the Sun where it is would let both pass
        assert (said(guard, name, cil(goal)) is None) is free


def test_wrong_sun_vector_is_refused(guard):
    true = guard.sun_vector("ZY101", MORNING)
    assert angle(np.array(true), SUN) < 0.02 * DEGREE  # refraction at 50 degrees: 0.013
    assert said(guard, "ZY101", "SUN " + ", ".join(f"{v:.7f}" for v in true)) is None
    assert "from the Sun" in said(guard, "ZY101", "SUN 0, 0, -1")
    assert guard.sun_vector("ZY101", NIGHT) == (0.0, 0.0, -1.0)
    assert guard.sun_vector("ZY113", NIGHT) == (0.0, 0.0, 1.0)  # up along the telescope's beam: it looks at the dish
    assert said(guard, "ZY101", "SUN 0, 0, -1", NIGHT) is None


def test_sun_vector_is_correct_at_each_time(guard):
    """Straight between two 40 s apart: 1e-6 rad; the Sun goes 7e-5 rad a second."""
    for seconds in np.arange(0.0, 120.0, 7.0):
        now = MORNING + round(seconds * SECOND)
        assert angle(np.array(guard.sun_vector("ZY101", now)), guard.keep_clear.sun(now)) < 2e-6


def test_parked_beam_is_warned_before_the_sun_comes(guard):
    """By astropy's Sun: when it is 5.16 degrees from where the beam rests."""
    when = MORNING / DAY + 1500 / 86_400
    counts = tuple(toward("ZY101", astropy_sun(np.array([when]))[0]))
    u = beams("ZY101", np.array(counts), posture(), np.array(MORNING))
    mjd = MORNING / DAY + np.arange(0, 600, 1.0) / 86_400
    comes = np.flatnonzero(angle(u, astropy_sun(mjd)) < 5.161 * DEGREE)[0]
    (alarm,) = guard.watch(MORNING, {"ZY101": counts})
    assert (alarm.cause, alarm.remedy) == ("sun", "move")
    assert comes - 10 <= alarm.within <= comes  # refraction and the Sun's way within 2 s: never late
    assert "ZY101" in alarm.text
    assert guard.watch(MORNING, {"ZY101": tuple(toward("ZY101", aside(40)))}) == []
    assert guard.watch(MORNING + round((comes + 20) * SECOND), {"ZY101": counts})[0].within == 0.0


def test_thousands_of_cubes_are_processed_quickly():
    import time

    guard = SafetyGuard(gbt())
    requests = commands_of_ranger(gbt(), "ZY113")
    begin = time.process_time()
    for request in requests:
        assert guard.refusal("ZY113", request, MORNING) is None
    assert time.process_time() - begin < 2.0  # 4500 requests; 0.15 s on a free machine
    guard.telescope(replace(posture(), azimuth=np.arctan2(SUN[0], SUN[1]) + np.pi))
    guard.stands("ZY113", stands()["ZY113"].reference)
    assert said(guard, "ZY113", "CIL DP20C") is None


@pytest.mark.parametrize(("seconds", "share"), [(1.0, 0.5), (2.0, 2.0), (0.0, 0.0)])
def test_deviation_of_an_accelerating_telescope_is_half_a_t_squared(seconds, share):
    turned = np.hypot(share * SLEW_ACCELERATION, share * SLEW_ACCELERATION)
    assert _unforeseen(seconds) == pytest.approx(turned, rel=1e-12)


def test_deviation_of_the_telescope_is_limited_by_its_slew_rate():
    most = np.hypot(2.0 * AZIMUTH_SLEW, 2.0 * ELEVATION_SLEW)
    assert _unforeseen(1000.0) == pytest.approx(1000.0 * most, rel=1e-12)


def test_sun_zone_is_the_almanacs_sun_with_the_records_cone(guard):
    zone = guard.sun_zone(MORNING)
    east, north, up = SUN
    assert zone.azimuth == pytest.approx(np.arctan2(east, north) % (2.0 * np.pi), abs=1e-4)
    assert zone.elevation == pytest.approx(np.arcsin(up), abs=1e-3)  # refraction
    assert zone.cone == KeepClear(gbt()).keep_out.sun.half_angle_deg * DEGREE
    assert zone.avoided
    assert not guard.sun_zone(NIGHT).avoided
