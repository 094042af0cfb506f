"""A ranger driven by lines: examples, refusals, caches, schedule, scan, Sun."""

import base64
import zlib

import numpy as np
import pytest

from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.geometry.mirror.pointing import beam
from catseye.ranger.handlers.table import replace_file
from catseye.ranger.line import TICK_NS, format_reply, nanoseconds_of, stamp_text, ticks_of
from catseye.ranger.ranging import HALF_WAVE_MM, distance_mm, group_index
from catseye.ranger.status import StatusWord
from ranger.ranger_scene import CUBES, GEOMETRY, PLACES, READY, REFERENCE_PHASE, Told, phase_of, ready


def test_greeting_agrees_with_the_sources():
    ranger = ready().ranger
    ranger.name = "ZY11"
    lines = [format_reply(out.reply).split("\t")[2] for out in ranger.greeting(5240)]
    assert lines == ["HELLO This is ZY11 ver. 2.20", "CONNECT 1, 5240", "STW 1, 0x00013007"]


def test_unknown_command_is_named():
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
        (["INI 2", "COO 1, 0, 1, 2"], "unknown cube 1", "NUM", "0"),
    ],
)
def test_refused_command_leaves_the_state_unchanged(lines, said, asked, is_still):
    told = Told()
    reply = told.say(*lines)[-1]
    assert reply.ok is False
    assert said in reply.text
    assert told.one(asked).text == is_still


def test_set_values_are_returned():
    told = Told()
    assert told.one("BP 123.4, 645.2, 52332").text == "123.400, 645.200, 52332.000"
    assert told.one("FKD 1, 77").text == "1, 77"
    assert told.one("FLT 1").text == "1, 0, 0, 77, 0, 0"
    assert told.one("D0 0").text == "0.0000"
    assert told.one("WTOL 0").text == "0"
    assert told.one("ENTEMP").text == "0.00"


def test_distance_and_index_invert_the_notes_forward_equation():
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


def test_larger_phase_means_shorter_distance_and_smaller_index():
    near = distance_mm(1.0, 0.0, 50_000.0, index=1.00025, d0_mm=180.0)
    assert distance_mm(1.001, 0.0, near, index=1.00025, d0_mm=180.0) < near
    index = group_index(1.0, 0.0, 50_000.0, index=1.00025, d0_mm=180.0)
    assert group_index(1.001, 0.0, 50_000.0, index=index, d0_mm=180.0) < index
    long = distance_mm(1.0, 0.0, 50_000.0, index=1.00025, d0_mm=180.0, constant_mm=-33.5)
    assert long == pytest.approx(near - 33.5, abs=1e-6)


def test_measured_distance_agrees_with_the_phase():
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


def test_prism_constant_and_benchmark_distance_are_used():
    told = ready()
    plain = float(told.say("CMEAS 1, 0", "CMEAS 1, 1")[-1].values[-1])
    told.say("KND 1, S, -33.5")
    assert float(told.one("CMEAS 2, 1").values[-1]) == pytest.approx(plain - 33.5, abs=5e-3)
    assert told.one(f"KND 1, B, {plain}").values == ("1", "B", f"{plain:.4f}")
    assert float(told.one("CMEAS 2, 1").values[-1]) == pytest.approx(1.000253247, abs=3e-8)


def test_single_steps_agree_with_cmeas():
    told = ready()
    short = told.one("CMEAS 1, ZG11")
    azimuth, elevation = (round(float(told.one(f"{axis} 1").values[1])) for axis in ("AZM", "ELV"))
    told.say("CIL 2")
    lines = f"ABP 0,{azimuth}; ABP 1,{elevation}; STT 0; STT 1; WAI 0; WAI 1; TRG; MPC; RAD".split("; ")
    replies = told.say(*lines)
    assert all(r.ok for r in replies)
    assert float(replies[-1].values[0]) == pytest.approx(float(short.values[4]), abs=1e-3)


def test_stamps_are_trigger_times_of_measurements_and_else_completion():
    told = ready()
    told.say("CIL 1")
    before = told.ranger.now_ticks()
    first = told.say("TRG", "MPC", "RAD")
    assert {r.ticks for r in first} == {before}
    assert told.one("ACP 0").ticks >= before + round(0.128e9 / TICK_NS)


def test_cmeas_2_needs_the_beam_on_its_cube():
    told = ready()
    told.say("CIL 1")
    assert "on cube 1, not on 2" in told.one("CMEAS 2, 2").text
    told.say("MOD 0")
    assert "Auto" in told.one("CIL 1").text
    assert "unknown cube" in told.one("CIL 99").text
    fresh = Told()
    fresh.say(*CUBES)
    assert "not homed" in fresh.one("CIL 1").text
    fresh.say("AXIS 0,1", "AXIS 1,1", "FHM 0", "FHM 1")
    assert "not initialised" in fresh.one("CIL 1").text
    assert "amplifier" in Told().one("STT 0").text


def test_encoder_values_are_computed_on_demand_and_dropped_after_changes():
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


def test_beam_at_a_cubes_counts_meets_it():
    """`beam`, the way from counts to a direction, is not what `look` uses; 1e-3 counts are printed: 2e-7 rad."""
    told = ready()
    told.say("ALPHA 0.9, 1e-3, -2e-3", "BETA 1e-3, 2e-3", "EZ 12.5, -7", "BP 100, 200, 300")
    station = told.ranger.cubes.station
    for number, (_, place) in PLACES.items():
        counts = [float(told.one(f"{axis} {number}").values[1]) for axis in ("AZM", "ELV")]
        looks = station.mirror_from_ground.T @ beam(station, counts)
        way = np.array(place) * 1e-3 - station.scan_point
        assert np.allclose(looks, way / np.linalg.norm(way), atol=3e-7)


def test_buffer_is_sent_complete_to_its_client():
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


def test_seq_has_a_line_per_cycle_and_coo_per_cube():
    told = ready()
    rad = float(told.say("CMEAS 1, 1", "RAD")[-1].values[0])
    lines = told.say("SEQ")
    assert [r.values[0] for r in lines] == [str(k) for k in range(1, 129)]
    assert np.mean([float(r.values[2]) for r in lines]) == pytest.approx(rad, abs=1e-4)
    assert [r.values[:2] for r in told.say("COO")] == [("0", "ZRG"), ("1", "ZG11"), ("2", "ZG12")]


def test_commands_run_in_order_and_other_clients_queries_pass_them():
    told = ready()
    told.ranger.receive(1, "1\tCIL 1")
    told.ranger.receive(2, "2\tACP 0")
    told.ranger.receive(1, "3\tD0")
    assert [o.reply.tid for o in told.turns(60) if o.reply.command != "STW"] == [2, 1, 3]


def test_status_word_is_pushed_only_on_changes():
    told = Told()
    told.turns(1)
    told.ranger.receive(1, "AXIS 0, 1")
    heard = told.turns(5)
    words = [o.reply.text for o in heard if o.reply.command == "STW"]
    assert words == [f"0x{StatusWord.AUTO | StatusWord.LASER_OFF | StatusWord.AZIMUTH_ENABLED:08x}"]
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


def test_schedule_is_never_early_and_round_robin():
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


def test_request_with_a_future_stamp_waits_and_is_cleared_by_disconnection():
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


def test_scan_measures_its_list_in_order_and_delays_the_schedule():
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


def test_stuck_axis_is_reported_and_the_ranger_continues():
    told = ready()
    told.say("WTMO 0.5")
    told.head.stuck = True
    assert "have not arrived" in told.one("CIL 1").text
    told.head.stuck = False
    assert told.one("CIL 1").ok
    assert "laser is off" in told.say("PS 0", "TRG")[-1].text


def test_initialisation_files_run_in_order_and_name_the_failed_line(tmp_path):
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


def test_replaced_file_becomes_bak_and_an_invalid_one_replaces_nothing(tmp_path):
    replace_file(tmp_path, "ZY101.INI", "D0 1")
    replace_file(tmp_path, "ZY101.INI", "D0 2 ; newer")
    with pytest.raises(InputError, match=r"ZY101\.INI line 2: D0: d0_mm -1"):
        replace_file(tmp_path, "ZY101.INI", "D0 3\nD0 -1")
    with pytest.raises(InputError, match="cannot be written"):
        replace_file(tmp_path / "none", "ZY101.INI", "D0 3")
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"ZY101.INI": "D0 2 ; newer", "ZY101.BAK": "D0 1"}


def test_lines_known_to_be_valid_are_not_read_again(tmp_path):
    valid = set()
    replace_file(tmp_path, "ZY101.INI", "D0 1\nD0 2", valid)
    assert valid == {"D0 1", "D0 2"}
    with pytest.raises(InputError, match=r"ZY101\.INI line 2: "):
        replace_file(tmp_path, "ZY101.INI", "D0 1\nD0 -1", valid)
    assert valid == {"D0 1", "D0 2"}
    assert (tmp_path / "ZY101.INI").read_text() == "D0 1\nD0 2"


def test_sun_is_refused_by_vector_and_by_own_computation():
    told = ready()
    at = np.array(PLACES[1][1]) - [0, 0, 250.0]
    sun = at / np.linalg.norm(at)
    assert told.say("SUN " + ", ".join(f"{v:.9f}" for v in sun), "CIL 1")[-1].text.endswith("or wait")
    assert StatusWord.SUN_REFUSED in told.ranger.status()
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


def test_allowed_moves_do_not_come_near_the_sun():
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
        if refusal(station, start, end, suns=[sun]) is None:
            allowed += 1
            assert least >= HALF_ANGLE
        else:
            refused += 1
            assert least < HALF_ANGLE + 8 * DEGREE  # a look every 400 counts, and what 400 random looks miss
    assert allowed > 50
    assert refused > 30


def test_tracking_sends_the_counts_at_both_times():
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


def test_reset_is_a_cold_boot_of_everything():
    told = ready()
    told.say("CYC 10", "RST")
    assert told.one("CYC").text == "128"
    assert told.ranger.status() == StatusWord.AUTO | StatusWord.LASER_OFF
    assert told.say(*READY)[-1].ok


def answer(told, line):
    """The reply to a line while a stream speaks between."""
    (reply,) = [r for r in told.say(f"77\t{line}") if r.tid == 77 and r.command == line.split(" ")[0]]
    return reply


DOWN = [0.0, 0.0, -1.0]  # a Sun that no beam here looks at


def heard(told, command):
    return [o.reply for o in told.heard if o.reply.command == command]


def test_stream_triggers_the_next_buffer_before_sending_the_last():
    told = ready()
    told.say("CIL 1")
    told.heard.clear()
    fired = told.head.fired
    told.ranger.receive(1, "1000\tSTM 1, 4")
    lines = []
    for _ in range(200):
        for out in told.turns(1, 0.002):
            if out.reply.command in ("CMEAS", "BUF"):
                lines.append(out)
                taking = told.head.taking is not None
                assert taking == (told.head.fired - fired < 4 or len(lines) <= 6)
        if len(lines) == 4:
            assert StatusWord.STREAMING in told.ranger.status()
    told.turns(100)
    lines += [o for o in told.heard if o.reply.command in ("CMEAS", "BUF") and o not in lines]
    assert [o.reply.command for o in lines] == ["CMEAS", "BUF"] * 4
    assert {o.reply.tid for o in lines} == {1000}
    assert {o.client for o in lines if o.reply.command == "BUF"} == {1}
    assert {o.client for o in lines if o.reply.command == "CMEAS"} == {None}
    assert told.head.fired - fired == 4
    stamps = [o.reply.ticks for o in lines if o.reply.command == "CMEAS"]
    assert [o.reply.ticks for o in lines if o.reply.command == "BUF"] == stamps
    gaps = np.diff(stamps) * TICK_NS * 1e-9
    assert np.all((gaps >= 0.127) & (gaps < 0.128 + 2 * 0.002 + 0.001))  # two strides of the test's time, a tick
    assert StatusWord.STREAMING not in told.ranger.status()
    assert told.ranger.idle


def test_during_a_stream_moves_and_triggers_are_refused_but_tracking_works():
    told = ready()
    told.say("CIL 1")
    assert told.one("STM 1, 1000").values == ("1", "1000")
    for line in ("CIL 1", "CMEAS 2, 1", "TRG", "STT 0", "FHM 0", "CYC 10", "STM 1, 5", "SCN 1"):
        reply = answer(told, line)
        assert not reply.ok, line
        assert "stream" in reply.text or "scan list" in reply.text, reply
    t0, t1 = (stamp_text(told.ranger.now_ticks() + round(s * 1e9 / TICK_NS)) for s in (0.5, 1.5))
    assert answer(told, f"TRK 1, {t0}, 0, 80000, 12000, {t1}, 1, 80000, 12000").ok
    assert answer(told, "D0").ok
    assert answer(told, "CYC").ok
    told.heard.clear()
    told.turns(20)
    assert len(heard(told, "BUF")) >= 4
    assert answer(told, "STM 1, 0").ok
    told.heard.clear()
    told.turns(20)
    assert heard(told, "CMEAS") == []
    told.say("CIL 2")
    assert "not on 1" in told.one("STM 1, 9").text
    assert "unknown cube" in told.one("STM 99, 1").text


def test_stream_ends_with_its_connection_or_with_a_reason():
    told = ready()
    told.say("CIL 1", "STM 1, 1000", client=3)
    told.ranger.disconnect(1)
    assert told.ranger.stream is not None
    told.ranger.disconnect(3)
    assert told.ranger.idle
    told.say("STM 1, 1000", "PS 0")
    told.turns(10)
    assert "the laser went off" in heard(told, "CMEAS")[-1].text
    assert told.ranger.idle
    told.say("PS 1", "STM 1, 1000")
    told.ranger.reset()
    assert told.ranger.idle


def rested(told, seconds, strides):
    """Replies while time passes by the strides that `strides` gives, and how many turns that took."""
    begin, replies, count = told.ranger.now_ns(), [], 0
    while told.ranger.now_ns() - begin < seconds * 1e9:
        replies += [(o.reply.command, o.reply.ok, o.reply.ticks) for o in told.turns(1, 0.0)]
        told.head.advance(strides())
        count += 1
    return replies, count


def test_idle_ranger_answers_as_one_polled_each_half_millisecond():
    """Everything within the poll of 5 ms and the watch of 100 ms; what has a time of its own within a nanosecond."""
    answers, counts = [], []
    for quick in (True, False):
        told = ready()
        later = stamp_text(told.ranger.now_ticks() + round(3e9 / TICK_NS))
        for line in ("CIL 1", "CMEAS 2, 1", "BUF", "CMEAS 1, 2", f"AT {later}, 3, 0.25, VER", "STM 2, 5"):
            told.ranger.receive(1, line)
        strides = (lambda: 5e-4) if quick else (lambda told=told: max(told.ranger.rest(), 1e-9))
        replies, count = rested(told, 6.0, strides)
        answers.append(replies)
        counts.append(count)
    fast, slow = answers
    assert [each[:2] for each in fast] == [each[:2] for each in slow]
    assert [c for c, _, _ in slow].count("VER") == 3
    assert [c for c, _, _ in slow].count("CMEAS") == 7
    late = np.array([b[2] - a[2] for a, b in zip(fast, slow, strict=True)]) * TICK_NS * 1e-9
    assert np.all(np.abs(late) < 0.1)  # nine waits of 5 ms at most lie one behind the other
    timed = [ticks for command, _, ticks in slow if command == "VER"]
    assert np.all(np.abs(np.diff(timed) * TICK_NS * 1e-9 - 0.25) < 1e-3)  # a tick
    assert counts[1] < 0.05 * counts[0]


def test_idle_ranger_takes_ten_turns_a_second_and_one_without_clients():
    told = ready()
    told.turns(1)
    assert told.ranger.rest() == 0.1
    assert told.ranger.rest(heard=False) == 1.0
    told.ranger.receive(1, "VER")
    assert told.ranger.rest() == 0.0
    told.turns(1, 0.0)
    told.say("ACU 1")
    told.turns(1, 0.0)
    assert 0.0 < told.ranger.rest() <= 0.5
    told.say("ACU 0", "CIL 1")
    told.ranger.receive(1, "CMEAS 2, 1")
    told.turns(1, 0.0)
    assert told.ranger.rest() == 0.1
    told.head.advance(0.1)
    assert told.ranger.rest() == pytest.approx(0.028, abs=1e-9)
    told.head.taking = None  # a buffer that does not come
    told.head.advance(0.0281)
    assert told.ranger.rest() == pytest.approx(1e-3)
    told.head.advance(0.02)
    assert told.ranger.rest() == pytest.approx(5e-3)


def test_clock_set_back_stops_neither_updates_nor_the_sun_watch():
    sun = np.array(DOWN)
    told = ready(sun=lambda mjd: sun)
    told.say("ACU 1", "STI 52880")
    told.turns(30)
    told.heard.clear()
    told.ranger.receive(1, "D0 200")
    told.turns(30)
    assert len(heard(told, "D0")) == 2
    sun[:] = beam_of(told)
    told.turns(30)
    assert StatusWord.LASER_OFF in told.ranger.status()


def test_amplitude_and_phase_agree_with_the_detection():
    from catseye.signal.detection.phase import detect

    told = ready()
    told.say("CIL 1")
    for sampling in ("SFQ 64", "SFQ 16", "CYC 1", "SFQ 3"):
        told.say(sampling, "TRG", "MPC")
        buffer = told.head.last
        found = detect(buffer.samples, buffer.sampling.samples, buffer.volts_per_code, harmonics=())
        assert told.ranger.measured.amplitude == pytest.approx(float(found.amplitude), rel=1e-12)
        assert told.ranger.measured.phase == pytest.approx(float(found.phase), abs=1e-12)
    for ends, clipped in (((-32767, 32766), False), ((-32768, 0), True), ((0, 32767), True)):
        told.say("TRG")
        told.head.last.samples[:2] = ends
        told.say("MPC")
        assert (StatusWord.CLIPPED in told.ranger.status()) == clipped


def test_status_bits_agree_with_the_documentation():
    told = Told()
    assert told.ranger.status() == StatusWord.AUTO | StatusWord.LASER_OFF
    head, z = told.head, told.ranger
    z.auto, head.laser = False, True
    changes = {
        1: (head.homes, 0, "home"),
        2: (head.homes, 1, "home"),
        8: (head.off, 0, True),
        9: (head.off, 1, True),
        12: (head.on, 0, True),
        13: (head.on, 1, True),
    }
    for bit, (where, axis, value) in changes.items():
        before, where[axis] = where[axis], value
        assert int(z.status()) == 1 << bit
        where[axis] = before
    for bit, (whose, name, value) in {
        0: (z, "auto", True),
        3: (z, "updates", True),
        4: (z, "scanning", True),
        6: (z, "stream", object()),
        10: (head, "laser", False),
        11: (head, "locked", False),
        14: (z, "sun_refused", True),
        15: (z, "latch", object()),
        16: (z, "given", {"BP", "ALPHA", "BETA", "MO", "EZ", "D0"}),
    }.items():
        before = getattr(whose, name)
        setattr(whose, name, value)
        assert int(z.status()) == 1 << bit
        setattr(whose, name, before)
    z.in_sun = True
    assert z.status() == StatusWord.SUN_REFUSED


def beam_of(told):
    station = told.ranger.cubes.station
    return beam(station, told.ranger.here) @ station.mirror_from_ground


def test_cube_is_found_by_its_current_name():
    told = ready()
    assert told.one("COO 1, 0, 80000, 12000, OTHER").ok
    assert not told.one("COO ZG11").ok
    assert told.one("COO other").values[0] == "1"
    assert told.one("COO 3, 1, 1, 1, ZG11").ok
    assert "belongs to cube 3" in told.one("COO 2, 1, 1, 1, zg11").text
    assert told.one("INI 2").ok
    assert told.one("COO 1, 0, 80000, 12000, ZG12").ok
    assert told.one("COO ZRG").values[0] == "0"


def test_index_search_with_the_laser_on_is_refused_near_the_sun():
    told = ready()
    told.say("CIL 1")
    station = told.ranger.cubes.station
    here = np.array(told.ranger.here)
    for axis in (0, 1):
        for away in (20_000.0, 49_000.0, -30_000.0):
            on_the_way = beam(station, here + away * np.eye(2)[axis]) @ station.mirror_from_ground
            told.say("PS 1", "SUN " + ", ".join(f"{v:.9f}" for v in on_the_way))
            said = told.one(f"FHM {axis}")
            assert "PS 0" in said.text
            assert "Sun" in said.text
            assert told.head.homing(axis) == "home"
    assert told.say("PS 0", "FHM 1")[-1].ok
    told.say("PS 1", "CIL 1")
    off_the_way = told.ranger.cubes.station.mirror_from_ground[2]  # the azimuth axis: its beam keeps off it
    told.say("SUN " + ", ".join(f"{v:.9f}" for v in off_the_way))
    assert told.one("FHM 0").ok


def test_allowed_index_searches_do_not_come_near_the_sun():
    """Exact angles all round, densely, of what `refuse_sun` let pass."""
    told = ready()
    told.say("CIL 1")
    z = told.ranger
    rng = np.random.default_rng(11)
    passed = 0
    for _ in range(200):
        axis, here = int(rng.integers(2)), rng.uniform([-25_000, -20_000], [75_000, 20_000])
        told.head.at[:] = told.head.goal[:] = here
        sun = rng.normal(size=3)
        sun /= np.linalg.norm(sun)
        z.sun_vector = tuple(sun)
        z.next_sun_ns = z.now_ns() + 10**9  # the watch shall not speak first
        turn = np.rint(here) + np.linspace(0.0, 1e5, 4001)[:, None] * np.eye(2)[axis]
        looks = beam(z.cubes.station, turn) @ z.cubes.station.mirror_from_ground
        least = np.arccos(np.clip(looks @ sun, -1, 1)).min()
        z.receive(1, f"FHM {axis}")
        (first, *_) = [o.reply for o in told.turns(1, 0.0) if o.reply.command == "FHM"] or [None]
        if first is None:
            passed += 1
            assert least >= 5.0 * DEGREE
            told.head.homes[:] = ["home", "home"]
            told.turns(3)
        else:
            assert least < 8.0 * DEGREE
        told.ranger.switch_laser(True)
    assert 40 < passed < 190


def test_beam_approached_by_the_sun_goes_dark_reports_once_and_moves_away():
    sun = np.array(DOWN)
    told = ready(sun=lambda mjd: sun)
    told.say("CIL 1")
    rest = beam_of(told)
    side = np.cross(rest, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)

    def comes(degrees):
        sun[:] = np.cos(degrees * DEGREE) * rest + np.sin(degrees * DEGREE) * side
        told.turns(25)  # 1.25 s

    comes(5.1)
    assert told.head.laser
    assert heard(told, "SUN") == []
    before = told.ranger.here
    comes(4.9)
    (line,) = heard(told, "SUN")
    assert (line.ok, line.tid) == (False, 0)
    assert "4.9 deg" in line.text
    assert "driving away" in line.text
    assert not told.head.laser
    assert {StatusWord.LASER_OFF, StatusWord.SUN_REFUSED} <= set(told.ranger.status())
    told.turns(60)
    after = told.ranger.here
    assert sum(a != b for a, b in zip(before, after, strict=True)) == 1
    assert np.arccos(beam_of(told) @ sun) >= 20.0 * DEGREE
    assert len(heard(told, "SUN")) == 1
    told.turns(30)
    assert StatusWord.SUN_REFUSED not in told.ranger.status()
    assert told.say("PS 1", "CMEAS 1, 2")[-1].ok
    assert "of the Sun" in told.one("CIL 1").text


def test_ranger_that_cannot_leave_the_sun_stays_dark():
    sun = np.array(DOWN)
    told = ready(sun=lambda mjd: sun)
    told.say("CIL 1", "AXIS 0, 0")
    sun[:] = beam_of(told)
    told.turns(60)
    (line,) = heard(told, "SUN")
    assert "amplifiers are off" in line.text
    assert not told.one("PS 1").ok
    assert "into the Sun" in told.one("CMEAS 2, 1").text
    assert not told.head.laser
    told.say("AXIS 0, 1")
    told.turns(60)  # it tries again each second
    assert np.arccos(np.clip(beam_of(told) @ sun, -1, 1)) >= 20.0 * DEGREE
    assert told.one("PS 1").ok


def test_move_out_of_the_cone_continues_and_a_track_inside_is_stopped():
    sun = np.array(DOWN)
    for slow, stays in ((True, False), (False, True)):
        told = ready(sun=lambda mjd: sun)
        told.say("CIL 1")
        sun[:] = -beam_of(told)
        end = 100.0 if stays else 50_000.0
        t0, t1 = (stamp_text(told.ranger.now_ticks() + round(s * 1e9 / TICK_NS)) for s in (0.1, 100.0))
        assert told.one(f"TRK 1, {t0}, 0, 80000, 12000, {t1}, {end}, 80000, 12000").ok
        told.turns(10)
        calls, stop = [], told.head.stop
        told.head.stop = lambda calls=calls, stop=stop: (calls.append("stop"), stop())
        sun[:] = beam_of(told)
        told.turns(25)
        assert bool(calls) != slow
        assert not told.head.laser
        assert (told.head.track is not None) == slow
        assert ("leads out" in heard(told, "SUN")[-1].text) == slow
        sun[:] = DOWN


def test_ranger_on_the_telescope_needs_a_recent_sun_vector_to_move():
    told = ready(turning=True)
    assert "no Sun vector received for 60 s" in told.one("CIL 1").text
    assert StatusWord.SUN_REFUSED in told.ranger.status()
    assert told.say("SUN 0, 0, -1", "CIL 1")[-1].ok
    told.head.advance(50.0)
    assert told.one("CIL 2").ok
    told.head.advance(55.0)
    assert "no Sun vector" in told.one("CIL 1").text
    assert told.say("SUN 0, 0, -1", "CIL 1")[-1].ok
    assert ready().one("CIL 1").ok  # one on the ground needs none


def test_way_out_is_a_safe_single_axis_move_ending_20_degrees_off():
    """Exact angles along the whole way; the first 1.6 deg of it may come nearer, as `refusal` says."""
    from catseye.ranger.sun_watch import HALF_ANGLE, PARKED, way_out

    station = ready().ranger.cubes.station
    rng = np.random.default_rng(6)
    for _ in range(100):
        here = rng.uniform([-25_000, -20_000], [75_000, 20_000])
        sun = beam(station, here) @ station.mirror_from_ground + rng.normal(size=3) * 0.05
        sun /= np.linalg.norm(sun)
        begin = np.arccos(beam(station, here) @ station.mirror_from_ground @ sun)
        if begin >= HALF_ANGLE:
            continue
        end = way_out(station, here, [sun], limits=(-30_000, 80_000))
        assert end is not None
        assert min(abs(np.array(end) - here)) <= 0.5
        assert -30_000 <= end[0] <= 80_000
        assert abs(end[1]) <= 25_000
        way = here + np.linspace(0.0, 1.0, 3000)[:, None] * (np.array(end) - here)
        angles = np.arccos(np.clip(beam(station, way) @ station.mirror_from_ground @ sun, -1, 1))
        assert angles[-1] >= PARKED - 0.01 * DEGREE  # counts are whole
        assert angles.min() >= begin - 1.7 * DEGREE
        assert angles[len(angles) // 2 :].min() >= HALF_ANGLE


def test_way_out_avoids_other_suns():
    from catseye.ranger.sun_watch import HALF_ANGLE, way_out

    station = ready().ranger.cubes.station
    rng = np.random.default_rng(7)
    found = 0
    for _ in range(150):
        here = rng.uniform([-25_000, -20_000], [75_000, 20_000])
        suns = beam(station, here) @ station.mirror_from_ground + rng.normal(size=(5, 3)) * [[0.04], *[[0.5]] * 4]
        suns /= np.linalg.norm(suns, axis=1, keepdims=True)
        begin = np.arccos(suns @ (beam(station, here) @ station.mirror_from_ground))
        if begin[0] >= HALF_ANGLE or begin[1:].min() < 6.0 * DEGREE:
            continue
        end = way_out(station, here, list(suns), limits=(-30_000, 80_000))
        if end is None:
            continue
        found += 1
        way = here + np.linspace(0.0, 1.0, 3000)[:, None] * (np.array(end) - here)
        angles = np.arccos(np.clip(beam(station, way) @ station.mirror_from_ground @ suns.T, -1, 1))
        assert angles[:, 1:].min() >= HALF_ANGLE
    assert found > 50


def test_own_sun_agrees_with_the_almanac_and_sets():
    from catseye.ranger.sun_watch import sun_of_site
    from catseye.records.site.site import Location
    from catseye.reduction.site.earth_rotation import sun_at

    place = Location(latitude_deg=38.433, longitude_deg=-79.84, elevation_of_z0_m=806.0)
    source = sun_of_site(place)
    seen = set()
    for mjd in 52_889.0 + np.random.default_rng(2).uniform(0.0, 365.0, 100):
        towards, true = source(mjd), sun_at(mjd, place).direction
        seen.add(towards is None)
        if towards is None:
            assert true[2] < np.sin(-1.49 * DEGREE)
        else:
            assert true[2] > np.sin(-1.51 * DEGREE)
            assert np.linalg.norm(towards - true) < 8.0 / 3600 * DEGREE  # 15" a second, half a second
    assert seen == {True, False}
    assert source(52_889.7) is source(52_889.7 + 1e-6)


def test_help_equals_hlp():
    told = ready()
    told.turns(1)
    listed, same = told.say("HLP")[-1], told.say("help")[-1]
    assert same.command == "HELP"
    assert same.values == listed.values
    assert {"HLP", "HELP", "CMEAS"} <= set(listed.values[0].split())
    assert told.say("HELP ABV")[-1].values == told.say("HLP ABV")[-1].values


# Commands with a lease -----------------------------------------------------------------------------------------------


def at_once(told, *lines, client=1):
    """What is answered to lines that come together, as from a pipe."""
    heard = [out for line in lines for out in told.ranger.receive(client, line)]
    return [(out.reply.command, out.reply.ok, out.client) for out in heard + told.turns(20)]


def test_lines_sent_with_a_lease_request_are_judged_in_turn():
    told = ready()
    told.ranger.guarded = True
    said = at_once(told, "LEASE anna", "CYC 64", "CYC")
    told_all = ("LEASE", True, None)  # but who took it, which has been answered
    assert said == [("LEASE", True, 1), ("CYC", True, None), told_all, ("CYC", True, 1)]
    said = at_once(told, "LEASE none", "CYC 32")
    assert said == [("LEASE", True, 1), told_all, ("CYC", False, 1)]
    assert at_once(told, "CYC 32", "LEASE ben", client=2) == [("CYC", False, 2), ("LEASE", True, 2), told_all]
    assert at_once(told, "LEASE none", "CYC 32", client=1) == [("CYC", False, 1), ("LEASE", False, 1)]
    assert told.one("CYC").text == "64"


def test_scheduled_command_of_a_former_holder_is_refused_when_due():
    told = ready()
    told.ranger.guarded = True
    soon = stamp_text(told.ranger.now_ticks() + 20_000)
    assert at_once(told, "LEASE anna", f"AT {soon}, 1, 0, CYC 64")[1] == ("AT", True, None)
    at_once(told, "LEASE ben", client=2)
    said = []
    for _ in range(2000):
        said += [out.reply for out in told.turns() if out.reply.command == "CYC"]
    assert [(reply.ok, reply.text) for reply in said] == [
        (False, "CYC needs the lease: ben has it (expected LEASE and a name first)")
    ]
