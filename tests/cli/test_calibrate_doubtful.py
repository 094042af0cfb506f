"""Readings that agree with themselves and not with their instrument: named, with the column where a cure is found."""

import json

import numpy as np
import pytest

from repository import ROOT
from spoiled_scene import table_of

EXAMPLES = ROOT / "examples" / "calibrations"
HALF = 0.5 * 299_792_458.0 / (1.0002525 * 1.5e9)  # m, of the modulation in this air
LEAKAGE = 0.030 * np.exp(4.36j)  # V
SHEET = """kind = "leakage-lit"
instrument = "ZP103"
serial = "x"
measured_on = 2026-09-01
valid_until = 2028-09-01
by = "a"
report = "r"
u_session_volt = 0.0004
group_index = 1.0002525
"""


def write(folder, head, rows, sheet):
    path = folder / "readings.csv"
    path.write_text("\n".join(",".join(map(str, row)) for row in (head, *rows)) + "\n", encoding="utf-8")
    path.with_suffix(".toml").write_text(sheet, encoding="utf-8")
    return path


def verdict_of(catseye, kind, path, *options):
    status, out, err = catseye("calibrate", kind, path, "--json", *options)
    assert (status, err) == (0, "")
    return json.loads(out, parse_constant=pytest.fail)


@pytest.mark.parametrize(
    ("kind", "column", "factor", "cure"),
    [
        ("plate-levels", "orientation_deg", 2.0, "orientation_deg halved"),
        ("height-gauge", "height_mm", -1.0, "height_mm negated"),
        ("hydrostatic-level", "reading_to_mm", -1.0, "reading_to_mm negated"),
    ],
)
@pytest.mark.parametrize("options", [(), ("--reject",)])
def test_a_column_of_another_sign_or_size_is_failed_and_named(catseye, tmp_path, kind, column, factor, cure, options):
    head, rows, sheet = table_of(EXAMPLES, kind)
    at = head.index(column)
    changed = [[*row[:at], repr(factor * float(row[at])), *row[at + 1 :]] for row in rows]
    found = verdict_of(catseye, kind, write(tmp_path, head, changed, sheet), *options)
    assert found["verdict"]["word"] == "failed"
    assert cure in found["verdict"]["why"]
    honest = verdict_of(catseye, kind, write(tmp_path, head, rows, sheet), *options)
    assert honest["verdict"]["word"] == "good", honest["verdict"]


@pytest.mark.parametrize(
    ("kind", "column", "value"), [("leakage-lit", "distance_m", "5.0"), ("detector-focus", "position_mm", "0.3")]
)
def test_a_column_that_holds_one_value_is_named_or_refused(catseye, tmp_path, kind, column, value):
    head, rows, sheet = table_of(EXAMPLES, kind)
    at = head.index(column)
    path = write(tmp_path, head, [[*row[:at], value, *row[at + 1 :]] for row in rows], sheet)
    status, out, err = catseye("calibrate", kind, path, "--json")
    if status:
        assert len(err.splitlines()) == 1
    else:
        verdict = json.loads(out)["verdict"]
        assert (verdict["word"], column in verdict["why"]) == ("failed", True)


def rail(seed=5, *, count=59, light=2.0, step=0.0061, gain=1.0):
    """Distances (m), and phasors (V) of a retroreflector on a rail; a still one has step 0."""
    rng = np.random.default_rng(seed)
    distance = 5.0 + step * np.arange(count)
    noise = 4e-4 * (rng.standard_normal(count) + 1j * rng.standard_normal(count))
    z = LEAKAGE + light * np.exp(1j * (0.7 - 2 * np.pi * distance / HALF)) + noise
    return distance, z.real + 1j * gain * z.imag


def lit(folder, z, distance=None):
    names, columns = ["real_volt", "imaginary_volt"], [z.real, z.imag]
    if distance is not None:
        names, columns = ["distance_m", *names], [distance, *columns]
    return write(folder, names, [[f"{v:.6f}" for v in row] for row in np.transpose(columns)], SHEET)


@pytest.mark.parametrize("known", [False, True])
def test_a_target_on_a_rail_tells_the_leakage_and_one_that_stands_still_does_not(catseye, tmp_path, known):
    distance, z = rail()
    found = verdict_of(catseye, "leakage-lit", lit(tmp_path, z, distance if known else None))
    assert found["verdict"]["word"] == "good", found["verdict"]
    amplitude, phase = found["quantities"]["leakage_amplitude_volt"], found["quantities"]["leakage_phase_rad"]
    assert abs(amplitude["value"] - 0.030) < 4.0 * amplitude["u"]
    assert abs(phase["value"] - 4.36) < 4.0 * phase["u"]
    _, still = rail(step=0.0)
    found = verdict_of(catseye, "leakage-lit", lit(tmp_path, still, distance if known else None))
    assert found["verdict"]["word"] == "failed"
    assert "of the readings' variance" in found["verdict"]["why"]


def test_distances_in_reverse_order_are_failed_and_the_column_named(catseye, tmp_path):
    distance, z = rail()
    found = verdict_of(catseye, "leakage-lit", lit(tmp_path, z, distance[::-1]))
    assert found["verdict"]["word"] == "failed"
    assert "distance_m in reverse order" in found["verdict"]["why"]


@pytest.mark.parametrize("known", [False, True])
def test_an_ellipse_is_named_as_quadratures_out_of_balance(catseye, tmp_path, known):
    distance, z = rail(gain=1.004)  # axes 1 : 0.996
    found = verdict_of(catseye, "leakage-lit", lit(tmp_path, z, distance if known else None), "--reject")
    assert found["verdict"]["word"] == "doubtful"
    assert "ellipse of axes 1 : 0.99" in found["verdict"]["why"]
    assert "out of balance" in found["verdict"]["why"]


def test_a_quadrature_of_another_gain_is_named_where_the_beam_is_blocked(catseye, tmp_path):
    head, rows, sheet = table_of(EXAMPLES, "leakage")
    at = head.index("imaginary_volt")
    path = write(tmp_path, head, [[*row[:at], repr(2 * float(row[at])), *row[at + 1 :]] for row in rows], sheet)
    found = verdict_of(catseye, "leakage", path)
    assert found["verdict"]["word"] == "failed"
    failed = [d["text"] for d in found["decisions"] if d["passed"] is False]
    assert any("the imaginary part scatters" in text for text in failed), failed


@pytest.mark.parametrize("name", sorted(path.stem for path in EXAMPLES.glob("*.toml")))
def test_a_line_of_a_test_does_not_contradict_itself(catseye, name):
    kind = name.removesuffix("-planted")
    found = verdict_of(catseye, kind, EXAMPLES / f"{name}.csv")
    compared = [d for d in found["decisions"] + found["plausible"] if d["passed"] is not None]
    assert compared
    for d in compared:
        inside = d["statistic"] >= d["limit"] if d["least"] else d["statistic"] <= d["limit"]
        assert d["passed"] == inside, d
    _, out, _ = catseye("calibrate", kind, EXAMPLES / f"{name}.csv")
    text = " ".join(out.split())
    assert ": not judged, significant" not in text
    assert "not judged; significant" not in text
