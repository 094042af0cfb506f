"""A ranger told things in lines: the sources' examples, refusals that change nothing, caches, schedule, scan, Sun."""

import base64
import zlib

import numpy as np
import pytest

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.geometry.pointing import beam
from catseye.ranger.handlers import replace_file
from catseye.ranger.line import TICK_NS, format_reply, nanoseconds_of, stamp_text, ticks_of
from catseye.ranger.ranging import HALF_WAVE_MM, distance_mm, group_index
from catseye.ranger.status import Status
from ranger.ranger_scene import CUBES, GEOMETRY, PLACES, READY, REFERENCE_PHASE, Told, phase_of, ready


def test_the_greeting_is_that_of_the_sources():
    ranger = ready().ranger
    ranger.name = "ZY11"
    lines = [format_reply(out.reply).split("\t")[2] for out in ranger.greeting(5240)]
    assert lines == ["HELLO This is ZY11 ver. 2.20", "CONNECT 1, 5240", "STW 1, 0x00013007"]


def test_an_unknown_command_is_named():
    told = Told()
    assert format_reply(told.one("1000\txyz 1, 2")) == "1000\t52889.00000000\tUNKNOWN command XYZ"
    assert told.say("") == []


@pytest.mark.parametrize(
    ("lines", "said", "asked", "is_still"),
    [
        (["CYC 1200"], "76800 words", "CYC", "128"),
        (["CYC 10", "IFF 2000"], "128000 samples", "IFF", "1000"),
        (["SFQ 101"], "101000 samples", "SFQ", "64"),
        (["CYC 1024", "SFQ 65"], "66560 words", "SFQ", "64"),
        (["ABV 0, 1000"], "below acceleration", "ABV 0", "0, 400000"),
        (["ERL 1, 25001"], "25001", "ERL 1", "1, 5000"),
        (["FLT 0, 1, 2, 3, 4, 256"], "256", "FLT 0", "0, 0, 0, 0, 0, 0"),
        (["BP 1, 2"], "2 parameters", "BP", "0.000, 0.000, 0.000"),
        (["INI 2", "COO 3, 0, 1, 2, ZG3"], "not allocated", "NUM", "0"),
        (["INI 2", "COO 1, 0, 1, 2"], "cube 1 is not known", "NUM", "0"),
    ],
)
def test_a_refused_command_leaves_the_state_as_it_was(lines, said, asked, is_still):
    told = Told()
    reply = told.say(*lines)[-1]
    assert reply.ok is False
    assert said in reply.text
    assert told.one(asked).text == is_still


def test_values_set_are_the_values_told():
    told = Told()
    assert told.one("BP 123.4, 645.2, 52332").text == "123.400, 645.200, 52332.000"
    assert told.one("FKD 1, 77").text == "1, 77"
    assert told.one("FLT 1").text == "1, 0, 0, 77, 0, 0"
    assert told.one("D0 0").text == "0.0000"
    assert told.one("WTOL 0").text == "0"
    assert told.one("ENTEMP").text == "0.00"


def test_phase_to_distance_and_index_undo_the_notes_forward_equation():
    """Forward by eq. 5.12 in metres and hertz, back by `ranging`; 1 nm, 1e-14 are a double's rounding of 1e3 cycles."""
    rng = np.random.default_rng(3)
    for distance in rng.uniform(300.0, 2e5, 200):
        coarse = distance + rng.uniform(-49.0, 49.0)
        phase = phase_of(distance) % (2 * np.pi)
        found = distance_mm(phase, REFERENCE_PHASE, coarse, index=1.000253247, d0_mm=181.2)
        assert found == pytest.approx(distance, abs=1e-6)
    for ppm in (200.0, 253.0, 300.0):
        phase = phase_of(100_000.0, index=1 + ppm * 1e-6) % (2 * np.pi)
        found = group_index(phase, REFERENCE_PHASE, 100_000.0, index=1.000253, d0_mm=181.2)
        assert found - 1 == pytest.approx(ppm * 1e-6, abs=1e-12)
    assert pytest.approx(99.93081933, abs=5e-9) == HALF_WAVE_MM  # Goldman's HWLV


def test_a_larger_phase_is_a_shorter_distance_and_a_smaller_index():
    near = distance_mm(1.0, 0.0, 50_000.0, index=1.00025, d0_mm=180.0)
    assert distance_mm(1.001, 0.0, near, index=1.00025, d0_mm=180.0) < near
    index = group_index(1.0, 0.0, 50_000.0, index=1.00025, d0_mm=180.0)
    assert group_index(1.001, 0.0, 50_000.0, index=index, d0_mm=180.0) < index
    long = distance_mm(1.0, 0.0, 50_000.0, index=1.00025, d0_mm=180.0, constant_mm=-33.5)
    assert long == pytest.approx(near - 33.5, abs=1e-6)


def test_measuring_a_cube_gives_the_distance_that_its_phase_says():
    told = ready()
    assert told.one("DST 1").ok is False
    assert told.one("CMEAS 1, 1").values[-1] == "none"  # no reference yet
    assert told.one("CMEAS 1, zrg").values[-1] == "181.200"
    reply = told.one("1000\tCMEAS 1, ZG11")
    true = np.linalg.norm(np.array(PLACES[1][1]) - [0.0, 0.0, 250.0]) + 1.234
    assert reply.tid == 1000
    assert reply.values[:3] == ("1", "1", "ZG11")
    assert float(reply.values[3]) == pytest.approx(2.67, abs=2e-3)
    assert float(reply.values[5]) == pytest.approx(true, abs=5e-3)  # noise 2 mV of 2.67 V over 8192 samples: 0.2 um
    assert told.one("DST ZG11").values == ("1", reply.values[5])
    assert float(told.one("PHI 1").values[1]) == pytest.approx(phase_of(true) % (2 * np.pi), abs=1e-3)
    assert told.one("AMP 1").values[1] == reply.values[3]


def test_a_prism_s_constant_and_a_benchmark_s_certificate():
    told = ready()
    plain = float(told.say("CMEAS 1, 0", "CMEAS 1, 1")[-1].values[-1])
    told.say("KND 1, S, -33.5")
    assert float(told.one("CMEAS 2, 1").values[-1]) == pytest.approx(plain - 33.5, abs=5e-3)
    assert told.one(f"KND 1, B, {plain}").values == ("1", "B", f"{plain:.4f}")
    assert float(told.one("CMEAS 2, 1").values[-1]) == pytest.approx(1.000253247, abs=3e-8)


def test_the_long_way_round_is_what_cmeas_does():
    told = ready()
    short = told.one("CMEAS 1, ZG11")
    azimuth, elevation = (round(float(told.one(f"{axis} 1").values[1])) for axis in ("AZM", "ELV"))
    told.say("CIL 2")
    lines = f"ABP 0,{azimuth}; ABP 1,{elevation}; STT 0; STT 1; WAI 0; WAI 1; TRG; MPC; RAD".split("; ")
    replies = told.say(*lines)
    assert all(r.ok for r in replies)
    assert float(replies[-1].values[0]) == pytest.approx(float(short.values[4]), abs=1e-3)


def test_the_stamp_of_a_measurement_is_its_trigger_s_and_of_a_command_its_completion():
    told = ready()
    told.say("CIL 1")
    before = told.ranger.now_ticks()
    first = told.say("TRG", "MPC", "RAD")
    assert {r.ticks for r in first} == {before}
    assert told.one("ACP 0").ticks >= before + round(0.128e9 / TICK_NS)


def test_cmeas_2_fails_when_the_beam_is_on_another_cube_and_cil_says_what_is_missing():
    told = ready()
    told.say("CIL 1")
    assert "on cube 1, not on 2" in told.one("CMEAS 2, 2").text
    told.say("MOD 0")
    assert "Auto" in told.one("CIL 1").text
    assert "not known" in told.one("CIL 99").text
    fresh = Told()
    fresh.say(*CUBES)
    assert "not homed" in fresh.one("CIL 1").text
    fresh.say("AXIS 0,1", "AXIS 1,1", "FHM 0", "FHM 1")
    assert "not initialised" in fresh.one("CIL 1").text
    assert "amplifier" in Told().one("STT 0").text


def test_encoder_values_are_computed_when_asked_and_dropped_when_something_changes():
    told = ready()
    cubes = told.ranger.cubes
    before = cubes.computed
    first = told.one("AZM 1").values, told.one("ELV 1").values
    assert cubes.computed == before  # the scene asked already
    for change in (
        "BP 0, 0, 100",
        "ALPHA 0.01, 0, 0",
        "BETA 0, 1e-3",
        "MO 1, 250, 0",
        "EZ 10, 0",
        "COO 1, 1, 2e4, 3e3",
    ):
        before = cubes.computed
        told.say(change)
        assert cubes.computed == before
        second = told.one("AZM 1").values, told.one("ELV 1").values
        assert cubes.computed == before + 1
        assert second != first
        first = second
    assert told.one("AZM 1, 1234").values == ("1", "1234.000")
    told.say("EZ 0, 0")
    assert told.one("AZM 1").values != ("1", "1234.000")
    assert told.one("AZM 0").values == ("0", "-900.000")  # ZRG's stay


def test_a_cube_s_counts_are_where_the_beam_meets_it():
    """`beam`, the way from counts to a direction, is not what `look` uses; 1e-3 counts are printed: 2e-7 rad."""
    told = ready()
    told.say("ALPHA 0.9, 1e-3, -2e-3", "BETA 1e-3, 2e-3", "EZ 12.5, -7", "BP 100, 200, 300")
    station = told.ranger.cubes.station
    for number, (_, place) in PLACES.items():
        counts = [float(told.one(f"{axis} {number}").values[1]) for axis in ("AZM", "ELV")]
        looks = station.mirror_from_ground.T @ beam(station, counts)
        way = np.array(place) * 1e-3 - station.scan_point
        assert np.allclose(looks, way / np.linalg.norm(way), atol=3e-7)


def test_a_buffer_travels_whole_to_the_one_who_asks():
    told = ready()
    told.say("CMEAS 1, 1")
    told.ranger.receive(7, "1000\tBUF")
    (out,) = told.turns()
    assert out.client == 7
    cube, cycles, samples, hertz, volts, check, text = out.reply.values
    raw = base64.b64decode(text)
    assert (cube, cycles, samples, hertz) == ("1", "128", "64", "1000")
    assert int(check, 16) == zlib.crc32(raw)
    assert np.array_equal(np.frombuffer(raw, "<i2"), told.head.last.samples)
    assert float(volts) == told.head.last.volts_per_code
    assert out.reply.ticks == ticks_of(told.head.last.triggered)


def test_seq_gives_a_line_a_cycle_and_coo_a_line_a_cube():
    told = ready()
    rad = float(told.say("CMEAS 1, 1", "RAD")[-1].values[0])
    lines = told.say("SEQ")
    assert [r.values[0] for r in lines] == [str(k) for k in range(1, 129)]
    assert np.mean([float(r.values[2]) for r in lines]) == pytest.approx(rad, abs=1e-4)
    assert [r.values[:2] for r in told.say("COO")] == [("0", "ZRG"), ("1", "ZG11"), ("2", "ZG12")]


def test_commands_of_two_clients_run_in_the_order_received():
    told = ready()
    told.ranger.receive(1, "1\tCIL 1")
    told.ranger.receive(2, "2\tACP 0")
    told.ranger.receive(1, "3\tD0")
    assert [o.reply.tid for o in told.turns(60) if o.reply.command != "STW"] == [1, 2, 3]


def test_the_status_word_is_pushed_on_any_change_and_only_then():
    told = Told()
    told.turns(1)
    told.ranger.receive(1, "AXIS 0, 1")
    heard = told.turns(5)
    words = [o.reply.text for o in heard if o.reply.command == "STW"]
    assert words == [f"0x{Status.AUTO | Status.AZIMUTH_ENABLED:08x}"]
    told.head.locked = False
    assert [o.reply.tid for o in told.turns(3) if o.reply.command == "STW"] == [0]


def test_updates_are_pushed_each_half_second_when_on():
    told = Told()
    assert told.say("ACU 1")[0].text == "1"
    told.turns(12)
    told.ranger.receive(1, "D0 200")
    heard = [o.reply for o in told.turns(12) if o.reply.tid == 0 and o.reply.command == "D0"]
    assert [r.text for r in heard] == ["200.0000", "200.0000"]  # the reply, then the update
    told.say("ACU 0", "D0 201")
    assert not [o for o in told.turns(20) if o.reply.command == "D0"]


def test_the_schedule_is_never_early_one_a_turn_and_takes_turns():
    told = Told()
    begin = told.ranger.now_ns()
    start = stamp_text(told.ranger.now_ticks() + round(1e9 / TICK_NS))
    told.say(f"1000\tAT {start}, 3, 0.2, ACP 0", f"1001\tAT {start}, 3, 0.2, ACP 1", client=4)
    done = []
    for _ in range(60):
        now = told.ranger.now_ns()
        replies = [o.reply for o in told.turns(1) if o.reply.command == "ACP"]
        assert len(replies) <= 1
        done += [(r.tid, now - begin) for r in replies]
    assert [tid for tid, _ in done] == [1000, 1001] * 3
    for k, (_, at) in enumerate(done):
        assert at >= (1.0 + 0.2 * (k // 2)) * 1e9 - TICK_NS


def test_a_request_with_a_stamp_to_come_waits_for_it_and_a_disconnect_clears():
    told = Told()
    later = stamp_text(told.ranger.now_ticks() + round(2e9 / TICK_NS))
    assert told.say(f"1000\t{later}\tACP 0") == []
    assert told.one("LST").values == ("1", f"{later} 1 ACP")
    assert [o.reply.tid for o in told.turns(60) if o.reply.command == "ACP"] == [1000]
    told.say(f"1000\t{stamp_text(told.ranger.now_ticks() + 10**6)}\tACP 0")
    told.ranger.disconnect(1)
    assert told.one("LST").values == ("0",)
    told.say("AT 60000, 9, 1, TRG")
    assert told.one("CLR").values == ("1",)


def test_a_scan_measures_its_list_in_order_and_holds_off_the_schedule():
    told = ready()
    told.say("NUM 3", "ORD 1, 0", "ORD 2, ZG12", "ORD 3, 1", "AT 0, 1, 0, VER")
    told.say("AT 0, 1, 0, VER", "SCN 1, 0, 2")
    assert "scan" in told.one("CIL 1").text
    assert told.one("D0").ok
    told.heard.clear()
    for _ in range(2000):
        told.turns(1)
        if not told.ranger.scanning:
            break
    cubes = [o.reply.values[1] for o in told.heard if o.reply.command == "CMEAS"]
    assert cubes == ["0", "2", "1"] * 2
    assert all(o.reply.ok and o.reply.tid == 0 for o in told.heard if o.reply.command == "CMEAS")


def test_a_stuck_axis_fails_in_words_and_the_ranger_goes_on():
    told = ready()
    told.say("WTMO 0.5")
    told.head.stuck = True
    assert "have not arrived" in told.one("CIL 1").text
    told.head.stuck = False
    assert told.one("CIL 1").ok
    assert "laser is off" in told.say("PS 0", "TRG")[-1].text


def test_initialisation_files_run_in_order_and_name_what_fails(tmp_path):
    told = Told(files=tmp_path, mirror="zp103")
    assert "CUBES.INI cannot be read" in told.one("INITZY").text
    (tmp_path / "CUBES.INI").write_text("; shared\n" + "\n".join(CUBES))
    (tmp_path / "ZY101.INI").write_text("\n".join(GEOMETRY[:-1]) + " ; monument\n")
    (tmp_path / "zp103.INI").write_text("D0 181.2\n")
    replies = told.say("1000\tINITZY")
    assert format_reply(replies[-1]).endswith("INITZY 1")
    assert [r.command for r in replies] == ["INI", "COO", "COO", "BP", "ALPHA", "BETA", "MO", "EZ", "D0", "INITZY"]
    assert {r.tid for r in replies} == {1000}
    assert told.ranger.initialised
    (tmp_path / "zp103.INI").write_text("D0 181.2\nERL 0, 30000\n")
    reply = told.say("INITZY")[-1]
    assert reply.ok is False
    assert reply.text.startswith("zp103.INI line 2: ERL")


def test_a_replaced_file_is_kept_as_bak_and_a_bad_one_replaces_nothing(tmp_path):
    replace_file(tmp_path, "ZY101.INI", "D0 1")
    replace_file(tmp_path, "ZY101.INI", "D0 2 ; newer")
    with pytest.raises(InputError, match=r"ZY101\.INI line 2: D0: d0_mm -1"):
        replace_file(tmp_path, "ZY101.INI", "D0 3\nD0 -1")
    with pytest.raises(InputError, match="cannot be written"):
        replace_file(tmp_path / "none", "ZY101.INI", "D0 3")
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"ZY101.INI": "D0 2 ; newer", "ZY101.BAK": "D0 1"}


def test_the_ranger_refuses_the_sun_by_vector_and_by_its_own_knowledge():
    told = ready()
    at = np.array(PLACES[1][1]) - [0, 0, 250.0]
    sun = at / np.linalg.norm(at)
    assert told.say("SUN " + ", ".join(f"{v:.9f}" for v in sun), "CIL 1")[-1].text.endswith("or wait")
    assert Status.SUN_REFUSED in told.ranger.status()
    assert told.say("SUN 0, 0, -1", "CIL 1")[-1].ok
    alone = ready(sun=lambda mjd: sun)
    assert alone.say("SUN 0, 0, -1", "CIL 1")[-1].ok is False  # a lying vector adds a cone and takes none away
    told.say("CIL 2")
    told.say("SUN " + ", ".join(f"{v:.9f}" for v in sun))
    told.say(
        f"ABP 0, {told.one('AZM 1').values[1].split('.')[0]}", f"ABP 1, {told.one('ELV 1').values[1].split('.')[0]}"
    )
    allowed = [r for r in told.say("STT 0", "WAI 0", "STT 1") if r.command == "STT"]
    assert not all(r.ok for r in allowed)


def test_no_move_that_is_allowed_comes_near_the_sun():
    """Exact angle of the beam to the Sun along both axes' independent ways, by dense sampling."""
    from catseye.ranger.sun_watch import HALF_ANGLE, refusal

    station = ready().ranger.cubes.station
    rng = np.random.default_rng(5)
    allowed = refused = 0
    for _ in range(300):
        start, end = rng.uniform([-25_000, -2_000], [75_000, 20_000], (2, 2))
        sun = rng.normal(size=3)
        sun /= np.linalg.norm(sun)
        share = rng.uniform(size=(400, 2))
        looks = beam(station, start + share * (end - start)) @ station.mirror_from_ground
        least = np.arccos(np.clip(looks @ sun, -1, 1)).min()
        if refusal(station, start, end, [sun]) is None:
            allowed += 1
            assert least >= HALF_ANGLE
        else:
            refused += 1
            assert least < HALF_ANGLE + 8 * DEGREE  # a look every 400 counts, and what 400 random looks miss
    assert allowed > 50
    assert refused > 30


def test_tracking_gives_the_head_the_counts_at_both_times():
    told = ready()
    told.say("CIL 1")
    t0, t1 = (told.ranger.now_ticks() + round(s * 1e9 / TICK_NS) for s in (0.5, 1.5))
    reply = told.one(f"TRK 1, {stamp_text(t0)}, 0, 80000, 12000, {stamp_text(t1)}, 100, 80000, 12050")
    assert reply.ok, reply
    (n0, n1), (a, b) = told.head.track
    assert np.allclose(n0, [float(v) for v in reply.values[1:3]], atol=1e-3)
    assert np.allclose(n1, [float(v) for v in reply.values[3:]], atol=1e-3)
    assert nanoseconds_of(a) == t0 * TICK_NS
    assert nanoseconds_of(b) == t1 * TICK_NS
    told.turns(60)
    later = [stamp_text(told.ranger.now_ticks() + round(s * 1e9 / TICK_NS)) for s in (0.5, 1.5)]
    wide = f"TRK 1, {later[0]}, -30000, 80000, 12000, {later[1]}, 30000, 80000, 12000"
    counts = np.array([float(v) for v in told.one(wide).values[1:]]).reshape(2, 2)
    station = told.ranger.cubes.station
    sun = beam(station, counts.mean(axis=0)) @ station.mirror_from_ground  # half-way, 20 deg from both ends
    told.say("SUN " + ", ".join(f"{v:.9f}" for v in sun))
    told.head.at[:] = counts[0]
    assert "deg of the Sun" in told.one(wide).text
    assert "t0 before t1" in told.one(f"TRK 1, {stamp_text(t1)}, 0, 8e4, 1e4, {stamp_text(t0)}, 0, 8e4, 1e4").text


def test_reset_is_a_cold_boot():
    told = ready()
    told.say("CYC 10", "RST")
    assert told.one("CYC").text == "128"
    assert told.ranger.status() == Status.AUTO
    assert told.say(*READY)[-1].ok
