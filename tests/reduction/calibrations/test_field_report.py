"""The notes' two reports: the printed matrices, and what a record lacks."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.geometry.mirror.mount import gamma, lambda_
from catseye.reduction.calibrations.field_report import blank_report, matrix_slopes, read_report
from repository import ROOT

EXAMPLES = ROOT / "examples"
ZY3, ZP3 = EXAMPLES / "monuments" / "ZY3.toml", EXAMPLES / "mirrors" / "ZP3.toml"

# [PARKER04] eqs. 2.31 and 2.37, millionths; the notes cut the last digit off instead of rounding it.
GAMMA_ZY3 = [532_835, 846_218, -24, 135, -56, 999_999, 846_218, -532_835, -145]
LAMBDA_ZP3 = [999_999, 0, -121, 0, 999_999, -727, 121, 727, 999_999]


def by_key(report):
    return {field.entry.key: field for field in report.fields}


@pytest.mark.parametrize(("kind", "path", "printed"), [("monument", ZY3, GAMMA_ZY3), ("mirror", ZP3, LAMBDA_ZP3)])
def test_the_notes_example_gives_the_printed_matrix(kind, path, printed):
    """Cut off at six decimals: what is left over has the number's own sign and is below one millionth."""
    report = read_report(kind, path)
    found = np.array([field.value for field in report.fields[-9:]])
    excess = np.abs(found) - np.abs(printed) * 1e-6
    # 1e-10 below: the notes' six digits are those of the angle itself, and sin t is short of t by t^3/6 = 6.4e-11.
    assert np.all(excess > -1e-10)
    assert np.all(excess < 1e-6)
    seen = np.array(printed) != 0
    np.testing.assert_array_equal(np.sign(found[seen]), np.sign(printed)[seen])


def test_notes_examples_agree_with_figures_2_6_and_2_7():
    said = {key: f.value for key, f in by_key(read_report("monument", ZY3)).items()}
    assert [said[k] for k in ("x_mm", "y_mm", "z_mm")] == [5586.2, 20850.0, -5.8]
    assert [said[k] for k in ("alpha1_rad", "alpha2_rad", "alpha3_rad")] == [1.008848, -0.000024, 0.000145]
    assert said["azimuth_deg"] == pytest.approx(122 + 11 / 60 + 50 / 3600, abs=0.05 / 3600)  # of z^
    x_hat = np.degrees(np.arctan2(said["gamma_11"], said["gamma_12"]))
    assert x_hat == pytest.approx(32 + 11 / 60 + 50 / 3600, abs=0.3 / 3600)  # surveyed; alpha1 has six decimals
    said = {key: f.value for key, f in by_key(read_report("mirror", ZP3)).items()}
    assert [said[k] for k in ("dx_mm", "dy_mm", "dz_mm")] == [-0.075, 247.459, -0.762]
    assert [said[k] for k in ("beta1_rad", "beta2_rad", "na0", "ne0")] == [-0.000727, 0.000121, -4195, -4935]


def test_of_the_notes_examples_eleven_and_twenty_seven_fields_are_unknown():
    assert len(read_report("monument", ZY3).missing) == 11
    assert len(read_report("mirror", ZP3).missing) == 27


@pytest.mark.parametrize(
    ("turned", "angles", "u"),
    [(gamma, [1.008848, -0.02, 0.03], [5e-4, 3e-4, 1e-4]), (lambda_, [-0.03, 0.05], [2e-4, 4e-4])],
)
def test_matrix_scatter_agrees_with_its_u(turned, angles, u):
    rng = np.random.default_rng(5)
    drawn = turned(*(np.array(angles) + np.array(u) * rng.standard_normal((40_000, len(u)))).T)
    claimed = np.sqrt(np.einsum("k,kij->ij", np.array(u) ** 2, matrix_slopes(turned, np.array(angles)) ** 2))
    # The scatter of 40 000 draws is known to 0.35 %; curvature, u^2/2 of 1e-7, shows in elements that hardly move.
    np.testing.assert_allclose(drawn.std(axis=0), claimed, rtol=0.015, atol=3e-7)


def test_a_record_of_the_other_kind_is_refused():
    with pytest.raises(InputError, match=r"ZP3\.toml: .* is not a known key"):
        read_report("monument", ZP3)
    with pytest.raises(InputError, match=r"none\.toml: missing"):
        read_report("mirror", ZP3.parent / "none.toml")


def test_a_verdict_counts_the_missing_fields():
    report = read_report("mirror", ZP3)
    assert report.verdict == ("doubtful", f"27 of {len(report.fields)} fields are missing in ZP3.toml")
    assert blank_report("mirror").verdict.word == "good"
