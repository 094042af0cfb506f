"""Recordings, travel times and their sheet: read exactly, or refused in one line."""

import io
import struct
import wave

import numpy as np
import pytest
from scipy.io import wavfile

from catseye.errors import InputError
from catseye.records.night.recording import read_recording, read_sheet, wav_bytes, wav_samples
from repository import ROOT

EXAMPLE = ROOT / "examples" / "acoustic"
CODES = np.random.default_rng(1).integers(-30_000, 30_000, (3, 500)).astype(np.int16)


@pytest.fixture(scope="module")
def sheet():
    return read_sheet(EXAMPLE / "evening.toml")[0]


def test_a_wave_file_written_is_read_by_others_and_by_us():
    raw = wav_bytes(CODES, 16_000)
    with wave.open(io.BytesIO(raw)) as other:
        assert (other.getnchannels(), other.getframerate(), other.getsampwidth()) == (3, 16_000, 2)
    rate, samples = wavfile.read(io.BytesIO(raw))
    assert rate == 16_000
    assert np.array_equal(samples.T, CODES)
    ours, hertz, full_scale = wav_samples(raw, "x.wav")
    assert (hertz, full_scale) == (16_000.0, 32_767.0)
    assert np.array_equal(ours, CODES)


@pytest.mark.parametrize("kind", [np.int16, np.int32, np.float32, np.float64])
def test_files_written_by_scipy_are_read(kind):
    samples = CODES.T.astype(kind)
    stream = io.BytesIO()
    wavfile.write(stream, 44_100, samples)
    found, hertz, _ = wav_samples(stream.getvalue(), "x.wav")
    assert hertz == 44_100.0
    assert np.array_equal(found.T, samples)


def test_24_bits_are_read_with_their_sign():
    values = np.array([0, 1, -1, 8_388_607, -8_388_608, 65_537])
    stream = io.BytesIO()
    with wave.open(stream, "wb") as other:
        other.setnchannels(1)
        other.setsampwidth(3)
        other.setframerate(48_000)
        other.writeframes(b"".join(int(v).to_bytes(3, "little", signed=True) for v in values))
    found, _, full_scale = wav_samples(stream.getvalue(), "x.wav")
    assert found[0].tolist() == values.tolist()
    assert full_scale == 8_388_607.0


def test_other_chunks_are_skipped():
    raw = wav_bytes(CODES, 16_000)
    odd = raw[:12] + b"LIST" + struct.pack("<I", 3) + b"abc\0" + raw[12:]
    assert np.array_equal(wav_samples(odd, "x.wav")[0], CODES)


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (b"RIFFxxxxAVI ", "expected a RIFF WAVE file"),
        (wav_bytes(CODES, 16_000)[:-10], "is truncated: 2990 of 3000 bytes"),
        (wav_bytes(CODES, 16_000)[:30], "is truncated"),
        (wav_bytes(CODES, 16_000)[:36], "has no samples"),
        (wav_bytes(CODES[:, :0], 16_000), "0 samples"),
        (
            wav_bytes(CODES, 16_000).replace(struct.pack("<HHI", 1, 3, 16_000), struct.pack("<HHI", 6, 3, 16_000)),
            "kind 6",
        ),
    ],
)
def test_other_files_than_wave_are_refused(raw, said):
    with pytest.raises(InputError, match=said):
        wav_samples(raw, "x.wav")


def test_a_table_of_samples_is_read_by_its_header(tmp_path, sheet):
    (tmp_path / "x.csv").write_text("ba,ab\n0.5,1\n-0.25,2\n")
    found = read_recording(tmp_path / "x.csv", sheet)
    assert found.samples["ab"].tolist() == [1.0, 2.0]
    assert found.samples["ba"].tolist() == [0.5, -0.25]
    assert found.sampling_hz is None


def test_a_table_of_travel_times_may_have_gaps_and_weather(tmp_path, sheet):
    (tmp_path / "x.csv").write_text("mjd_utc,time_ab_s,time_ba_s,humidity_percent\n61365.1,0.2,,0\n61365.2,,0.3,5\n")
    found = read_recording(tmp_path / "x.csv", sheet)
    assert found.time_ab == pytest.approx([0.2, np.nan], nan_ok=True)
    assert found.time_ba == pytest.approx([np.nan, 0.3], nan_ok=True)
    assert found.u_time is None
    assert found.weather["humidity_percent"].tolist() == [0.0, 5.0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        ("left,right\n1,2\n", "neither a WAVE file nor a table"),
        ("ab,extra\n1,2\n", "'extra' is unknown"),
        ("ab,ba\n1,two\n", "line 2, ba = 'two'"),
        ("loop\n1\n", "no channel 'ab' or 'ba'"),
        ("mjd_utc,time_ba_s\n61365.1,0.2\n", "'time_ab_s' is missing"),
        ("mjd_utc,time_ab_s\n2461365.6,0.2\n", "mjd_utc = '2461365.6'"),
        ("mjd_utc,time_ab_s\n61365.1,200\n", "time_ab_s = '200'"),
        ("mjd_utc,time_ab_s,humidity_percent\n61365.1,0.2,120\n", "humidity_percent = '120'"),
    ],
)
def test_invalid_table_is_refused(text, said, tmp_path, sheet):
    (tmp_path / "x.csv").write_text(text)
    with pytest.raises(InputError, match=said) as refused:
        read_recording(tmp_path / "x.csv", sheet)
    assert str(refused.value).startswith("x.csv: ")


def changed(tmp_path, before, after):
    text = (EXAMPLE / "evening.toml").read_text()
    assert before in text
    (tmp_path / "s.toml").write_text(text.replace(before, after, 1))
    return tmp_path / "s.toml"


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ('target = "ZEG41040L"', 'target = "ZY103"', "is also the ranger"),
        ("length_m = 62.417", "length_m = 62417.0", "length_m = 62417.0"),
        ("interval_s = 0.3\n", "", "interval_s is missing"),
        ('["ab", "ba", "loop"]', '["ab", "ab"]', "names 'ab' 2 times"),
        ('["ab", "ba", "loop"]', '["left"]', "channels"),
        ("mjd_utc = 61365.15", "mjd_utc = 61365.01", "not in order"),
        ("stop_hz = 5000.0\n", "", "stop_hz is missing"),
        ("stop_hz = 5000.0", "stop_hz = 5000.0\norder = 5", "order is not a value of kind = 'chirp'"),
        ("pressure_hpa = 930.4", "pressure_hpa = 93040.0", "pressure_hpa = 93040.0"),
        ("u_length_mm", "u_lenght_mm", "u_lenght_mm"),
        ("[signal]", "wind_m_per_s = 1.0\n\n[signal]", "belong together"),
    ],
)
def test_inconsistent_sheet_is_refused(before, after, said, tmp_path):
    with pytest.raises(InputError, match=said) as refused:
        read_sheet(changed(tmp_path, before, after))
    assert "\n" not in str(refused.value)


def test_channels_and_sampling_must_be_the_sheets(tmp_path, sheet):
    (tmp_path / "x.wav").write_bytes(wav_bytes(CODES[:1], 16_000))
    with pytest.raises(InputError, match=r"has 1 channels \(expected 3: ab, ba, loop"):
        read_recording(tmp_path / "x.wav", sheet)
    (tmp_path / "x.wav").write_bytes(wav_bytes(CODES, 44_100))
    with pytest.raises(InputError, match=r"sampled at 44100 Hz \(expected sampling_hz = 16000"):
        read_recording(tmp_path / "x.wav", sheet)
    with pytest.raises(InputError, match="missing"):
        read_recording(tmp_path / "none.wav", sheet)
