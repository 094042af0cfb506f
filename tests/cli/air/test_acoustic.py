"""`catseye acoustic`: the shipped example gives its truth back; what is bad is a status or one line."""

import importlib.util
import json

import numpy as np
import pytest

from catseye.records.files.reading import Folder
from catseye.records.night.path_temperature import PathTemperature
from catseye.records.night.recording import read_sheet, wav_bytes, wav_samples
from catseye.signal.delay.arrival import DelayPlan
from catseye.signal.delay.waveform import sampled
from gateways.report_scene import column, read
from repository import ROOT

EXAMPLE = ROOT / "examples" / "acoustic"
FILES = [EXAMPLE / f"evening-{i}.wav" for i in (1, 2, 3, 4)]
SHEET = EXAMPLE / "evening.toml"
SECONDS = 86_400.0


@pytest.fixture(scope="module")
def truth():
    """MJD, temperature, wind, times of every shot, from the generator that ships with the example."""
    spec = importlib.util.spec_from_file_location("make_example", EXAMPLE / "make_example.py")
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    return np.array(maker.truth()), maker


def run(catseye, *arguments):
    status, said, complained = catseye("acoustic", *arguments)
    assert (status, complained) == (0, "")
    return said


def answer(catseye, *arguments):
    return json.loads(run(catseye, *arguments, "--json"), parse_constant=pytest.fail)


def columns(path, *names):
    return (np.array([m[name] for m in path["measurements"]], float) for name in names)


def test_the_shipped_files_are_what_their_generator_makes(truth):
    values, maker = truth
    for i, file in enumerate(FILES):
        codes, _, _ = wav_samples(file.read_bytes(), file.name)
        made = maker.recording(i, [tuple(row) for row in values[2 * i : 2 * i + 2]])
        assert np.abs(codes.astype(int) - made).max() <= 1  # the last digit of a sine differs between machines
    assert sum(file.stat().st_size for file in EXAMPLE.iterdir() if file.is_file()) < 400_000


def test_recordings_give_the_truth_back(catseye, truth):
    """Times to 1 us (the ground echo), temperature to 0.1 °C: the twin's formula of sound is another, 0.04 °C off."""
    (path,) = answer(catseye, *FILES, "--sheet", SHEET)["paths"]
    true = truth[0][:8]
    ab, ba, t, u, wind, mjd = columns(path, "time_ab", "time_ba", "temperature_c", "u_temperature_c", "wind", "mjd_utc")
    assert np.abs(ab - 85e-6 - true[:, 3]).max() < 1e-6
    assert np.abs(ba - 85e-6 - true[:, 4]).max() < 1e-6
    assert np.abs(t - true[:, 1]).max() < 0.1
    assert (np.abs(t - true[:, 1]) < 2 * u).all()
    assert np.abs(wind - true[:, 2]).max() < 0.01
    assert np.std(t - true[:, 1]) < 0.005  # what differs is common to all
    assert np.abs(mjd - true[:, 0]).max() * SECONDS < 0.03
    assert path["used"] == 8
    assert path["u_temperature_c"] == pytest.approx(u.mean(), rel=0.02)  # common: a mean does not shrink it


def test_travel_times_without_recordings_give_the_truth_back(catseye, truth):
    (path,) = answer(catseye, EXAMPLE / "night.csv")["paths"]
    true = truth[0][8:]
    t, u, wind, u_wind = columns(path, "temperature_c", "u_temperature_c", "wind", "u_wind")
    assert np.abs(t - true[:, 1]).max() < 0.12
    assert (np.abs(t - true[:, 1]) < 3 * u).all()
    assert np.std(t - true[:, 1]) == pytest.approx(path["parts_c"]["time"], rel=0.5)  # 24 draws: 15 % is a sigma
    assert np.abs((wind - true[:, 2]) / u_wind).max() < 4.0
    assert path["length"] == 62.417


def test_out_and_write_appear_whole(catseye, tmp_path):
    out, table = tmp_path / "out", tmp_path / "path_temperatures.csv"
    said = run(catseye, *FILES[:2], "--sheet", SHEET, "--out", out, "--write", table)
    assert "Temperature" in said
    names = ["acoustic.json", "path_temperatures.csv", "provenance.json", "report.html", "shots.csv"]
    assert sorted(p.name for p in out.iterdir()) == names
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out", "path_temperatures.csv"]
    rows = table.read_text().splitlines()
    assert rows[0] == "mjd_utc,ranger,target,temperature_c,u_temperature_c"
    assert len(rows) == 5
    assert rows[1].startswith("61365.1000002")
    assert ",ZY103,ZEG41040L,14.96" in rows[1]
    listed = Folder(tmp_path).table(table.name, PathTemperature)  # as a campaign does
    assert [row.u_temperature_c for row in listed] == pytest.approx([0.0747, 0.0747, 0.0742, 0.0742], abs=2e-3)
    report = read((out / "report.html").read_text())
    assert {key.partition("-")[0] for key in report["charts"]} == {
        "recording", "correlation", "peak", "temperature", "wind",
    }  # fmt: skip
    assert "evening-1.wav" in column(report, "shots-0", "file")
    temperatures = [float(row.split(",")[3]) for row in rows[1:]]
    assert column(report, "shots-0", "temperature") == pytest.approx(temperatures, abs=6e-4)
    kept = json.loads((out / "acoustic.json").read_text())
    covariance = np.array(kept["paths"][0]["covariance_c2"])
    assert covariance.shape == (4, 4)
    assert np.linalg.eigvalsh(covariance).min() > 0.0
    run(catseye, *FILES[:1], "--sheet", SHEET, "--write", table)  # ours may be replaced
    assert len(table.read_text().splitlines()) == 3


def made(tmp_path, codes, *changes, hertz=16_000):
    """A recording x.wav of its own with a sheet x.toml, the example's but for changes."""
    text = SHEET.read_text().replace("evening-1.wav", "x.wav")
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    (tmp_path / "x.toml").write_text(text)
    (tmp_path / "x.wav").write_bytes(wav_bytes(codes, hertz))
    return tmp_path / "x.wav"


@pytest.fixture(scope="module")
def codes():
    return wav_samples(FILES[0].read_bytes(), "x")[0].copy()


def statuses(path):
    return [m["status"] for m in path["measurements"]]


def test_a_clipped_shot_and_a_silent_one_are_statuses(catseye, tmp_path, codes):
    loud = codes.copy()
    loud[0, 3000:4500] = np.clip(9 * loud[0, 3000:4500].astype(int), -32768, 32767)
    loud[1, 7500:] = 5
    (path,) = answer(catseye, made(tmp_path, loud))["paths"]
    first, second = statuses(path)
    assert "ab: clipped" in first
    assert "ba: good" in first
    assert "ba: silent" in second
    assert path["used"] == 0
    assert path["temperature_c"] is None
    assert path["measurements"][0]["temperature_c"] is None
    assert "No shot" in run(catseye, tmp_path / "x.wav")
    table = tmp_path / "t.csv"
    run(catseye, tmp_path / "x.wav", "--write", table, "--out", tmp_path / "out")
    assert table.read_text().count("\n") == 1


def test_noise_instead_of_a_signal_is_a_status(catseye, tmp_path, codes):
    noise = codes.copy()
    noise[0] = np.random.default_rng(1).normal(0, 300, codes.shape[1]).astype(np.int16)
    (path,) = answer(catseye, made(tmp_path, noise))["paths"]
    assert all("ab: too weak" in s or "ab: two peaks" in s for s in statuses(path))


def test_without_the_loop_back_the_amplifiers_delay_is_the_sheets(catseye, tmp_path, codes):
    changes = [('["ab", "ba", "loop"]', '["ab", "ba"]'), ("delay_us = 85.0", "delay_us = 1335.0")]
    (with_loop,) = answer(catseye, FILES[0], "--sheet", SHEET)["paths"]
    (path,) = answer(catseye, made(tmp_path, codes[:2], *changes))["paths"]
    assert path["temperature_c"] == pytest.approx(with_loop["temperature_c"], abs=5e-3)  # 1 us is 3 mK


def test_one_direction_needs_a_wind_and_takes_it_off(catseye, tmp_path, codes):
    one = [('["ab", "ba", "loop"]', '["ab", "unused", "loop"]')]
    status, _, complained = catseye("acoustic", made(tmp_path, codes, *one))
    assert status == 1
    assert "u_wind_m_per_s is missing" in complained
    prior = [
        *one,
        ("u_crosswind_m_per_s = 2.0", "u_crosswind_m_per_s = 2.0\nwind_m_per_s = 3.69\nu_wind_m_per_s = 0.5"),
    ]
    (path,) = answer(catseye, made(tmp_path, codes, *prior))["paths"]
    (pair,) = answer(catseye, FILES[0], "--sheet", SHEET)["paths"]
    assert path["temperature_c"] == pytest.approx(pair["temperature_c"], abs=0.05)
    assert path["u_temperature_c"] == pytest.approx(0.5 / 0.6, rel=0.1)  # 0.6 m/s a degree


def test_a_clock_offset_goes_into_the_wind_and_hardly_into_the_temperature(catseye, tmp_path, codes):
    """300 us are c^2/L 300 us = 0.55 m/s of wind; the sign: a clock ahead at the target makes "ab" late."""
    moved = codes.copy()
    shift = 5  # samples of 62.5 us
    moved[0] = np.roll(codes[0], shift)
    moved[1] = np.roll(codes[1], -shift)
    known = [("delay_us = 85.0", "delay_us = 85.0\nclock_offset_us = 312.5\nu_clock_offset_us = 20.0")]
    (true,) = answer(catseye, FILES[0], "--sheet", SHEET)["paths"]
    (mended,) = answer(catseye, made(tmp_path, moved, *known))["paths"]
    (wrong,) = answer(catseye, made(tmp_path, moved))["paths"]
    assert mended["wind"] == pytest.approx(true["wind"], abs=2e-3)
    assert mended["temperature_c"] == pytest.approx(true["temperature_c"], abs=2e-3)
    assert wrong["wind"] - true["wind"] == pytest.approx(-(341.0**2) / 62.417 * 312.5e-6, rel=0.02)
    u = mended["measurements"][0]["u_wind"]
    assert u == pytest.approx(341.0**2 / 62.417 * 20e-6, rel=0.05)


@pytest.mark.parametrize("weighting", ["phat", "whitened"])
def test_other_weights_give_the_same_temperature(catseye, tmp_path, codes, weighting):
    change = ("emission_s = 0.02", f'emission_s = 0.02\nweighting = "{weighting}"\nwindow_ms = 8.0')
    (path,) = answer(catseye, made(tmp_path, codes, change))["paths"]
    (plain,) = answer(catseye, FILES[0], "--sheet", SHEET)["paths"]
    assert path["temperature_c"] == pytest.approx(plain["temperature_c"], abs=0.01)


def test_a_table_of_samples_is_as_good_as_a_wave_file(catseye, tmp_path, codes):
    made(tmp_path, codes, ("x.wav", "x.csv"))
    lines = ["ab,ba,loop", *(",".join(map(str, row)) for row in codes.T.tolist())]
    (tmp_path / "x.csv").write_text("\n".join(lines) + "\n")
    (path,) = answer(catseye, tmp_path / "x.csv")["paths"]
    (same,) = answer(catseye, FILES[0], "--sheet", SHEET)["paths"]
    assert path["temperature_c"] == pytest.approx(same["temperature_c"], abs=1e-9)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([EXAMPLE / "none.wav"], "none.toml: missing"),
        ([EXAMPLE / "none.wav", "--sheet", SHEET], "none.wav: missing"),
        ([FILES[0], FILES[0], "--sheet", SHEET], "evening-1.wav: appears twice"),
        ([FILES[0], "--sheet", EXAMPLE / "night.toml"], "has no channels"),
        ([EXAMPLE / "night.csv", "--write", EXAMPLE / "night.csv"], "is an input"),
        ([EXAMPLE / "night.csv", "--out", EXAMPLE], "is, holds or lies in the input"),
        ([EXAMPLE / "night.toml"], "is both recording and sheet"),
    ],
)
def test_what_cannot_be_done_is_1_in_one_line(catseye, arguments, said):
    status, out, complained = catseye("acoustic", *arguments)
    assert (status, out) == (1, "")
    assert said in complained
    assert complained.count("\n") == 1


@pytest.mark.parametrize(
    ("changes", "hertz", "said"),
    [
        ([], 44_100, "sampled at 44100 Hz"),
        ([('["ab", "ba", "loop"]', '["ab", "ba"]')], 16_000, "has 3 channels (expected 2: ab, ba)"),
        ([("duration_s = 0.02", "duration_s = 0.9")], 16_000, "arrivals are sought from"),
        ([("stop_hz = 5000.0", "stop_hz = 9000.0")], 16_000, "not below half of 16000 samples"),
        ([("shots = 2", "shots = 3")], 16_000, "arrivals are sought from"),
        ([("interval_s = 0.3", "interval_s = 0.001")], 16_000, "one arrival would count as several shots"),
        ([('file = "x.wav"', 'file = "y.wav"')], 16_000, "does not name 'x.wav'"),
        ([("[signal]\n", "[[weather]]\nmjd_utc=61365.0\n\n[signal]\n")], 16_000, "weather"),
        ([("emission_s = 0.02", 'emission_s = 0.02\nweighting = "whitened"\nwindow_ms = 40.0')], 16_000, "too few"),
    ],
)
def test_a_recording_that_does_not_fit_its_sheet_is_1_in_one_line(catseye, tmp_path, codes, changes, hertz, said):
    status, out, complained = catseye("acoustic", made(tmp_path, codes, *changes, hertz=hertz))
    assert (status, out) == (1, "")
    assert said in complained
    assert complained.count("\n") == 1


def test_the_weather_of_0_percent_and_0_degrees_is_legal(catseye, tmp_path, codes):
    dry = [("humidity_percent = 71.0", "humidity_percent = 0.0"), ("temperature_c = 13.9", "temperature_c = 0.0")]
    (path,) = answer(catseye, made(tmp_path, codes, *dry))["paths"]
    assert path["used"] == 2


def test_weather_of_a_logger_and_of_options(catseye):
    """The station's sensors scatter by 0.4 % about the sheet's humidity: 0.01 °C at most."""
    night = EXAMPLE / "night.csv"
    (sheet,), (logger,), (held,) = (
        answer(catseye, night, *options)["paths"]
        for options in (
            (),
            ("--weather", EXAMPLE / "station.csv"),
            ("--temperature-c", 14, "--pressure-hpa", 930.4, "--humidity-percent", 71, "--u-humidity-percent", 5),
        )
    )
    assert [path["weather_of"] for path in (sheet, logger, held)] == ["night.toml", "station.csv", "one reading"]
    assert logger["temperature_c"] == pytest.approx(sheet["temperature_c"], abs=0.01)
    assert logger["temperature_c"] != sheet["temperature_c"]
    assert held["temperature_c"] == pytest.approx(sheet["temperature_c"], abs=1e-9)
    assert (logger["u_humidity_percent"], held["u_humidity_percent"]) == pytest.approx((2.0, 5.0))
    assert held["u_temperature_c"] > sheet["u_temperature_c"] > logger["u_temperature_c"]
    assert "of station.csv; u 0.3 hPa, 2 %" in run(catseye, night, "--weather", EXAMPLE / "station.csv")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--temperature-c", 14], "the weather lacks --pressure-hpa, --humidity-percent"),
        (["--station", "WX1"], "--station is one of the table --weather"),
        (["--weather", EXAMPLE / "station.csv", "--temperature-c", 1, "--pressure-hpa", 930, "--humidity-percent", 1],
         "give --weather, or one reading"),
    ],
)  # fmt: skip
def test_weather_options_that_do_not_fit_are_2(catseye, arguments, said):
    status, out, complained = catseye("acoustic", EXAMPLE / "night.csv", *arguments)
    assert (status, out) == (2, "")
    assert said in complained


@pytest.mark.parametrize("arguments", [[], [FILES[0], "--model", "bogus"], [FILES[0], "--bogus"]])
def test_wrong_usage_is_2(catseye, arguments):
    assert catseye("acoustic", *arguments)[0] == 2


def test_the_sheet_reads_as_documented():
    sheet, digest = read_sheet(SHEET)
    assert len(digest) == 64
    assert sheet.start_of("evening-2.wav") == 61365.10694444
    assert sheet.start_of("other.wav") is None


def test_a_file_by_two_of_its_names_is_given_twice(catseye):
    same = EXAMPLE.parent / "acoustic" / ".." / "acoustic" / "night.csv"
    status, out, complained = catseye("acoustic", EXAMPLE / "night.csv", same)
    assert (status, out) == (1, "")
    assert "night.csv: appears twice" in complained


def test_times_of_a_sound_of_unknown_frequency_are_refused(catseye, tmp_path):
    text = (EXAMPLE / "night.toml").read_text()
    signal = text[text.index("[signal]") : text.index("[[weather]]")]
    (tmp_path / "night.csv").write_text((EXAMPLE / "night.csv").read_text())
    (tmp_path / "night.toml").write_text(text.replace(signal, ""))
    status, out, complained = catseye("acoustic", tmp_path / "night.csv")
    assert (status, out) == (1, "")
    assert "night.toml: frequency_hz is missing" in complained


@pytest.mark.parametrize("place", ["mine.csv", "nowhere/t.csv", "out/t.csv", "out"])
def test_a_table_that_cannot_be_written_leaves_nothing_written(catseye, tmp_path, place):
    (tmp_path / "mine.csv").write_text("mine")
    out = tmp_path / "out"
    status, said, complained = catseye("acoustic", EXAMPLE / "night.csv", "--out", out, "--write", tmp_path / place)
    assert (status, said) == (1, "")
    assert f"table {tmp_path / place}" in complained
    assert [item.name for item in tmp_path.iterdir()] == ["mine.csv"]


def test_the_loops_noise_moves_both_directions_at_once(catseye, tmp_path, codes):
    """What it does to the temperature is what a delay of that size does; taken as two noises it would be 1/sqrt(2)."""
    still = ("u_time_us = 4.0", "u_time_us = 0.0")
    noisy = codes.astype(float)
    noisy[2] += 3000.0 * np.random.default_rng(5).standard_normal(codes.shape[1])
    noisy = np.clip(np.rint(noisy), -32000, 32000).astype(np.int16)
    (clean,), (path,) = (answer(catseye, made(tmp_path, c, still))["paths"] for c in (codes, noisy))
    sheet, _ = read_sheet(tmp_path / "x.toml")
    template = sampled("chirp", 16e3, **sheet.signal.values)
    u_loop = float(DelayPlan(template, sampling_hz=16e3, window=5e-3)(noisy[2], 0.02125).u_delay)
    parts, per_second = path["parts_c"], path["parts_c"]["delay"] / 3e-6
    assert u_loop > 5e-7
    # the correlation is as the reduction makes it but for the stretch's start: the noise's estimate differs a little
    assert parts["time"] == pytest.approx(np.hypot(clean["parts_c"]["time"], per_second * u_loop), rel=0.05)


def test_a_sheet_that_ended_before_the_shots_is_doubtful(catseye, tmp_path):
    (tmp_path / "night.csv").write_bytes((EXAMPLE / "night.csv").read_bytes())
    (tmp_path / "night.toml").write_text("valid_until = 2003-09-01\n" + (EXAMPLE / "night.toml").read_text())
    now, ended = (answer(catseye, place / "night.csv")["verdict"] for place in (EXAMPLE, tmp_path))
    assert now["word"] == "good"
    assert ended["word"] == "doubtful"
    assert "ended on 2003-09-01" in ended["why"]
