"""`catseye frequencies`: the notes' plan, its timing diagram, and one line for what no converter can do."""

import json

import pytest

import catseye as package


def test_the_usual_plan_has_the_notes_numbers(catseye):
    status, out, err = catseye("frequencies", "--json")
    assert (status, err) == (0, "")
    found = json.loads(out, parse_constant=pytest.fail)
    assert found["modulation_hz"] == 1.5e9
    assert found["disturbance"]["range_error"] == pytest.approx(15.9e-6, abs=0.05e-6)
    assert round(found["carrier_hz"] / 1e9, 1) == 384349.3
    assert found["beat_index"] == pytest.approx(found["group_index"], abs=1e-12)
    assert (found["multipath"], found["motion"]) == (None, None)
    assert found["folding_harmonics"][:2] == [63, 65]
    assert {line["frequency_hz"] for line in found["lines"]} >= {50.0, 57.0, 60.0}


def test_people_see_each_effect_and_get_files(catseye, tmp_path):
    status, out, err = catseye(
        "frequencies", "--range-rate", 0.01, "--excess-path", 0.05, "--cycles", 1000, "--out", tmp_path / "plan"
    )
    assert (status, err) == (0, "")
    words = " ".join(out.split())
    for text in ("384349.3 GHz", "1500.001000 MHz", "15.900 µm", "as a second path", "of a moving target"):
        assert text in words
    assert "line of 57 Hz in the phase 0.0000" in words  # a whole second of whole periods
    written = {path.name for path in (tmp_path / "plan").iterdir()}
    assert written == {"frequencies.csv", "lines.csv", "provenance.json", "result.json", "timing.svg"}


def test_the_timing_diagram_has_a_pulse_a_sample():
    (figure,) = package.show(package.frequencies(cycles=2, samples_per_cycle=8)).values()
    (ax,) = figure.axes
    assert "gate of 2 ms, a pulse every 125 µs" in ax.get_title("left")
    counts = sorted(len(group.get_segments()) for group in ax.collections)
    assert counts[-1] == 16  # 2 cycles of 8 within the gate
    samples = next(line for line in ax.lines if line.get_marker() == "o")
    assert samples.get_xdata().tolist() == pytest.approx([0.125 * k for k in range(16)])


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["--cycles", 2000], 2, "the buffer holds 65536"),
        (["--oscillator", "beside"], 2, "above, below"),
        (["--temperature-c", 300], 1, "temperature 300"),
        (["--disturbance", 2], 2, "--disturbance = 2.0 is not within 0 to below 1"),
    ],
)
def test_what_cannot_be_is_one_line(catseye, arguments, status, said):
    ended, _, err = catseye("frequencies", *arguments)
    assert ended == status
    assert said in " ".join(err.split())


def test_python_refuses_an_unknown_word():
    with pytest.raises(package.ArgumentError, match="oscillator"):
        package.frequencies(oscillator="beside")
    with pytest.raises(package.ArgumentError, match="air_model"):
        package.frequencies(air_model="none")
