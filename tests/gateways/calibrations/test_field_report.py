"""The notes' two reports: every field in its order, the printed matrices, digits that u allows, signs as drawn."""

import re
from datetime import UTC, date, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.constants import ARCSECOND, DEGREE
from catseye.gateways.calibrations.field_report import MATRIX_CELLS, field_report, mark, sketches
from catseye.gateways.calibrations.field_report_fields import (
    report_object,
    written_aid,
    written_matrix,
    written_u,
    written_value,
)
from catseye.geometry.mirror.mount import gamma, lambda_
from catseye.reduction.calibrations.field_report import (
    FORMS,
    ReportEntry,
    ReportField,
    blank_report,
    read_report,
)
from repository import ROOT

EXAMPLES = ROOT / "examples"
ZY3, ZP3 = EXAMPLES / "monuments" / "ZY3.toml", EXAMPLES / "mirrors" / "ZP3.toml"
WHEN = datetime(2026, 9, 2, 10, 0, tzinfo=UTC)

# [PARKER04] Figures 2.2 and 2.4, read off the notes; the leakage signal is a phasor and has two lines here.
FIGURE_2_2 = (
    "ZY|DATE|INITIALS|ZP NUMBER|CONTROL PANEL|ETHERNET ADDRESS|IP ADDRESS|x|y|z|azimuth|α₁ (π − azimuth)|"
    "α₂ (rotation about ẑ)|α₃ (rotation about x̂)|LATITUDE|LONGITUDE|ELEVATION|WV X|WV Y|WV Z|"
    "γ₁₁|γ₁₂|γ₁₃|γ₂₁|γ₂₂|γ₂₃|γ₃₁|γ₃₂|γ₃₃"
)
FIGURE_2_4 = (
    "ZP|DATE|INITIALS|LASER NUMBER|DETECTOR NUMBER|HEAD NUMBER|OSCILLATOR NUMBER|LEAKAGE SIGNAL|LEAKAGE SIGNAL|D₀|"
    "Δx|Δy|Δz|β₁ rotation about x (θ)|β₂ rotation about y (ϕ)|Nₐ₀|Nₑ₀|AZ LOW LIMIT|AZ HIGH LIMIT|"
    "AZM ZRG|ABV 0|ABA 0|FKP 0|FKI 0|FKD 0|FIL 0|FSI 0|ERL 0|ELV ZRG|ABV 1|ABA 1|FKP 1|FKI 1|FKD 1|FIL 1|FSI 1|ERL 1|"
    "λ₁₁|λ₁₂|λ₁₃|λ₂₁|λ₂₂|λ₂₃|λ₃₁|λ₃₂|λ₃₃"
)

SAID = 'serial = "S-3"\nmeasured_on = 2026-09-01\nvalid_until = 2028-09-01\nby = "M. E."\nreport = "Book 4, p. 91"\n'
MONUMENT = f"""{SAID}monument = "ZY200"\nzp = "ZP9"\ncontrol_panel = "CP-9"\nethernet_address = "00:60:97:1A:2B:3C"
ip_address = "192.0.2.9"\nx_mm = 29503.7431\ny_mm = 115941.7812\nz_mm = 148.752\nu_x_mm = 0.1\nu_y_mm = 0.0123
u_z_mm = 0.0\nazimuth_deg = 194.28258\nalpha1_rad = -0.249278\nalpha2_rad = 0.0000009\nalpha3_rad = 0.0000531
u_alpha1_rad = 5e-6\nu_alpha2_rad = 2.4e-6\nu_alpha3_rad = 2.4e-6\nlatitude_deg = 38.434166
longitude_deg = -79.839834\nelevation_m = 806.569\nwv_x_m = 600123.4567\nwv_y_m = 102345.6789\nwv_z_m = 806.5694
"""
SETTINGS = {"abv": 446_956, "aba": 15, "fkp": 60, "fki": 12, "fkd": 900, "fil": 1000, "fsi": 4, "erl": 21}
CHIP = "".join(f"{key}_{axis} = {value}\n" for axis in (0, 1) for key, value in SETTINGS.items())
MIRROR = f"""{SAID}{CHIP}zp = "ZP9"\nlaser_number = 17\ndetector_number = "APD-22"\nhead_number = 9
oscillator_number = "OSC-5"\nleakage_amplitude_volt = 0.032\nleakage_phase_rad = 4.3574\nu_leakage_volt = 0.0008
d0_mm = 180.685\nu_d0_mm = 0.01\ndx_mm = -0.075\ndy_mm = 247.425\ndz_mm = -0.851\nu_offset_mm = 0.005
beta1_rad = -0.000637\nbeta2_rad = 0.000121\nu_beta_rad = 3e-6\nna0 = 5931.25\nne0 = 3062\nu_zero_counts = 0.4
az_low_limit = -18069\naz_high_limit = 78931\nazm_zrg = 43431\nelv_zrg = 27662
"""


@pytest.fixture
def full(tmp_path):
    """Function kind -> report of a record that has every field."""

    def of(kind, change=lambda text: text):
        path = tmp_path / f"{kind}.toml"
        path.write_text(change(MONUMENT if kind == "monument" else MIRROR), encoding="utf-8")
        return read_report(kind, path)

    return of


def by_key(report):
    return {field.entry.key: field for field in report.fields}


@pytest.mark.parametrize(("kind", "figure"), [("monument", FIGURE_2_2), ("mirror", FIGURE_2_4)])
def test_a_form_has_every_field_of_the_notes_in_their_order(kind, figure):
    assert [field.entry.name for field in blank_report(kind).fields] == figure.split("|")


def test_every_field_has_its_value(full):
    """All values differ, those of axis 1 by a 2 in front."""
    said = [written_value(f) for f in full("monument").fields[:20]]
    assert "|".join(said) == (
        "ZY200|2026-09-01|M. E.|ZP9|CP-9|00:60:97:1A:2B:3C|192.0.2.9|29503.74|115941.781|148.752|194.28258|-0.2492780|"
        "0.0000009|0.0000531|38.434166|-79.839834|806.569|600123.4567|102345.6789|806.5694"
    )
    said = [written_value(f) for f in full("mirror", lambda text: text.replace("_1 = ", "_1 = 2")).fields[:37]]
    assert "|".join(said) == (
        "ZP9|2026-09-01|M. E.|17|APD-22|9|OSC-5|0.03200|4.357|180.685|-0.0750|247.4250|-0.8510|-0.0006370|0.0001210|"
        "5931.25|3062|-18069|78931|43431|446956|15|60|12|900|1000|4|21|27662|2446956|215|260|212|2900|21000|24|221"
    )


@pytest.mark.parametrize("kind", FORMS)
def test_complete_record_fills_all_fields(full, kind):
    report = full(kind)
    assert report.missing == ()
    text = field_report(report, WHEN)
    for field in report.fields[:-MATRIX_CELLS]:
        assert f">{written_value(field)}<" in text, field
    for cell in written_matrix(report.fields[-MATRIX_CELLS:]):
        assert f"<b>{cell}</b>" in text
    assert "left blank" not in text
    for word in (report.sha256, report.file, "S-3", "2026-09-01", "2028-09-01", "Book 4, p. 91", "2026-09-02 10:00:00"):
        assert word in text
    assert text.count(": initials, date</div>") == 3
    assert mark(kind) in text[:4096]
    assert field_report(report, WHEN) == text


@pytest.mark.parametrize(("kind", "key"), [("monument", "ip_address"), ("mirror", "fkd_1")])
def test_missing_values_are_blank_and_counted(full, kind, key):
    report = full(kind, lambda text: re.sub(f"{key} = .*\n", "", text))
    assert [entry.key for entry in report.missing] == [key]
    assert f"1 field missing in the record and left blank: {report.missing[0].name}." in field_report(report, WHEN)
    assert report_object(report, None)["missing"] == [key]


@pytest.mark.parametrize("kind", FORMS)
def test_notes_of_a_record_appear_in_the_report(full, kind):
    report = full(kind, lambda text: text + 'notes = "shims <new>\\nsecond line"\n')
    assert '<div class="notes">shims &lt;new&gt;<br>second line</div>' in field_report(report, WHEN)
    assert report_object(report, None)["notes"] == "shims <new>\nsecond line"
    assert report.missing == ()
    assert report_object(full(kind), None)["notes"] is None


@pytest.mark.parametrize("kind", FORMS)
def test_blank_form_has_only_units(kind):
    report = blank_report(kind)
    text = field_report(report, WHEN)
    assert report.missing == ()
    assert set(re.findall(r'<td class="v">(.*?)</td>', text)) == {""}
    assert set(re.findall(r"<b>(.*?)</b>", text)) == {""}
    for field in report.fields:
        assert field.entry.name in text
        assert not field.entry.unit or f'<td class="unit">{field.entry.unit}</td>' in text
    assert "SHA-256" not in text
    assert "left blank" not in text


@pytest.mark.parametrize("kind", FORMS)
def test_page_is_self_contained_and_well_formed(full, kind):
    text = field_report(full(kind), WHEN)
    assert "http" not in text.replace("http://www.w3.org/2000/svg", "")
    assert not re.search(r"\b(src|href)=|@import|url\(", text)

    open_tags = []
    for end, tag, empty in re.findall(r"<(/?)([a-z0-9]+)[^>]*?(/?)>", text):
        if end:
            assert open_tags.pop() == tag
        elif not empty and tag != "meta":
            open_tags.append(tag)
    assert open_tags == []


@pytest.mark.parametrize("kind", FORMS)
def test_user_text_is_escaped(full, kind):
    text = field_report(full(kind, lambda text: text.replace("M. E.", "<script>&")), WHEN)
    assert "<script>" not in text
    assert "&lt;script&gt;&amp;" in text


def test_numbers_have_the_digits_of_their_own_u(full):
    said = {k: (written_value(f), written_u(f)) for k, f in by_key(full("monument")).items()}
    assert said["x_mm"] == ("29503.74", "0.10")
    assert said["y_mm"] == ("115941.781", "0.012")
    assert said["z_mm"] == ("148.752", "held")
    assert said["azimuth_deg"] == ("194.28258", "0.00029")  # 5e-6 rad are 2.9e-4 degrees
    assert said["alpha1_rad"] == ("-0.2492780", "0.0000050")
    assert said["latitude_deg"] == ("38.434166", "")
    assert said["measured_on"] == ("2026-09-01", "")
    said = {k: (written_value(f), written_u(f)) for k, f in by_key(full("mirror")).items()}
    assert said["leakage_phase_rad"] == ("4.357", "0.025")  # 0.8 mV in 32 mV
    assert said["leakage_amplitude_volt"] == ("0.03200", "0.00080")
    assert said["na0"] == ("5931.25", "0.40")
    assert said["ne0"] == ("3062", "0.40")
    assert said["dx_mm"] == ("-0.0750", "0.0050")
    assert said["abv_0"] == ("446956", "")


def test_a_leakage_lost_in_its_u_has_any_phase(full):
    """Uniform over a turn: pi/sqrt(3)."""
    for amplitude in ("0.0", "0.0001"):
        report = full("mirror", lambda text, a=amplitude: text.replace("volt = 0.032", f"volt = {a}"))
        assert by_key(report)["leakage_phase_rad"].u == pytest.approx(np.pi / np.sqrt(3))


@given(st.floats(-1e6, 1e6), st.floats(1e-7, 1e3))
def test_a_printed_number_is_off_by_a_twentieth_of_its_u_at_most(value, u):
    text = written_value(ReportField(ReportEntry("x", "x_mm", "mm"), value, u))
    # Two digits of u leave half a unit of the second: 0.05 u at 0.10; 0.0996 is printed 0.10. Floats add 1e-16.
    assert abs(float(text) - value) <= 0.0503 * u + 1e-15 * abs(value)


@given(st.floats(-359.0, 359.0))
def test_degrees_minutes_seconds_read_back(value):
    text = written_aid(ReportField(ReportEntry("azimuth", "azimuth_deg", "deg", aid="dms"), value))
    sign, d, m, s = re.fullmatch(r"(-?)(\d+)° (\d\d)′ (\d\d\.\d)″", text).groups()
    assert int(m) < 60
    assert float(s) < 60.0
    seconds = (int(d) * 3600 + int(m) * 60 + float(s)) * (-1 if sign else 1)
    assert seconds == pytest.approx(value * 3600, abs=0.0501)


@pytest.mark.parametrize(("value", "said"), [(-5 * ARCSECOND, "-5.0″"), (30 * ARCSECOND, "+30.0″"), (-1e-9, "+0.0″")])
def test_small_rotations_are_also_in_arc_seconds_with_sign(value, said):
    assert written_aid(ReportField(ReportEntry("α₂", "alpha2_rad", "rad", aid="arcsec"), value)) == said


def test_a_matrix_has_one_number_of_decimals_and_no_minus_zero():
    cells = tuple(ReportField(ReportEntry("γ", "g"), v, u) for v, u in ((-4e-9, 3e-6), (-0.249278, 5e-7), (1.0, 0.0)))
    assert written_matrix(cells) == ["0.0000000", "-0.2492780", "1.0000000"]
    assert written_matrix(tuple(ReportField(ReportEntry("γ", "g"), f.value) for f in cells)) == [
        "0.000000",
        "-0.249278",
        "1.000000",
    ]
    assert written_matrix((ReportField(ReportEntry("γ", "g"), 0.5, 0.01),)) == ["0.500000"]


def ways(kind):
    """(start, middle, end) of each positive turn in the sketches: right and up, relative to nothing."""
    found = re.findall(r'data-angle="(.+?)" d="M(.+?)"', sketches(kind))
    steps = {name: np.array([[float(c) for c in p.split()] for p in way.split("L")]) for name, way in found}
    return {name: way[[0, len(way) // 2, -1]] * (1, -1) for name, way in steps.items()}


def test_the_monument_s_sketch_turns_as_the_notes_say():
    """Azimuth clockwise from north; alpha1 from south about y^, counter-clockwise from above: eq. 2.6 and below."""
    found = ways("monument")
    north, east, v_block = found["azimuth"]
    assert north[1] > v_block[1]
    assert east[0] > north[0] + 5  # clockwise: by way of east
    south, _, end = found["α₁"]
    assert end[0] > south[0] + 5
    assert end[1] > south[1]
    right, _, risen = found["α₂"]  # about z^, which comes towards the reader: x^ rises
    assert risen[1] > right[1] + 5
    level, _, sunk = found["α₃"]  # about x^, which goes away: the v-block on the right sinks
    assert sunk[1] < level[1] - 5


def test_the_mirror_s_sketch_turns_as_the_notes_say():
    """ZP3's z~ was turned up by 2' 30", beta1 negative, and towards x by 25", beta2 positive: eqs. 2.35, 2.36."""
    found = ways("mirror")
    start, _, end = found["β₂"]  # x^ is drawn up
    assert end[1] > start[1] + 5
    start, _, end = found["β₁"]
    assert end[1] < start[1] - 5
    start, _, end = found["Θ"]  # about z~, towards the reader: from x~, right, to y~, up
    assert end[1] > start[1] + 5
    assert end[0] < start[0]


def test_the_senses_in_words_are_those_of_the_matrices():
    """East, north, up are columns of gamma; x^, y^, z^ of lambda."""
    senses = {entry.key: entry.sense for form in FORMS.values() for entry in form.entries}
    t = 0.01
    assert "x̂ rises" in senses["alpha2_rad"]
    assert gamma(0.7, t, 0.0)[0, 2] > 0.0
    assert "ẑ (v-block) sinks" in senses["alpha3_rad"]
    assert gamma(0.7, 0.0, t)[2, 2] < 0.0
    assert "ẑ from south towards east" in senses["alpha1_rad"]
    np.testing.assert_allclose(gamma(0.0, 0.0, 0.0)[2], [0.0, -1.0, 0.0], atol=1e-15)
    assert gamma(t, 0.0, 0.0)[2, 0] > 0.0
    assert "z̃ sinks" in senses["beta1_rad"]
    assert lambda_(t, 0.0)[2, 1] < 0.0
    assert "z̃ to x̂" in senses["beta2_rad"]
    assert lambda_(0.0, t)[2, 0] > 0.0


def test_an_object_has_every_value_as_the_record_has_it(full):
    found = report_object(full("monument"), "page.html")
    assert (found["kind"], found["record"], found["written"]) == ("monument", "monument.toml", "page.html")
    values = {f["key"]: (f["value"], f["unit"]) for f in found["fields"]}
    assert values["x_mm"] == (29503.7431, "mm")
    assert values["measured_on"] == (date(2026, 9, 1), None)
    assert values["gamma_23"][0] == gamma(-0.249278, 0.0000009, 0.0000531)[1, 2]
    u = {f["key"]: f["u"] for f in found["fields"]}
    assert u["azimuth_deg"] == pytest.approx(5e-6 / DEGREE)
    assert u["gamma_13"] == pytest.approx(2.4e-6)  # sin alpha2
    assert u["z_mm"] == 0.0
