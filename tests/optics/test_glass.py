"""Glass: its maker's printed lines, the derivative, the refusals."""

import mpmath
import pytest

from catseye.errors import ValidityError
from catseye.optics.glass import GLASSES, group_index, phase_index

# Fraunhofer lines of the N-BK7 data sheet, [SCHOTT14]: wavelength in um, index to five digits.
N_BK7_LINES = [
    (0.4046561, 1.53024),
    (0.4358343, 1.52668),
    (0.4861327, 1.52238),
    (0.5460740, 1.51872),
    (0.5875618, 1.51680),
    (0.6562725, 1.51432),
    (0.8521100, 1.50980),
    (1.0139800, 1.50731),
    (1.5296000, 1.50091),
]


@pytest.mark.parametrize(("wavelength_um", "index"), N_BK7_LINES)
def test_n_bk7_gives_its_data_sheet(wavelength_um, index):
    # half of the fifth digit, and the 5e-6 to which the sheet calls its formula good
    assert float(phase_index(wavelength_um, "N-BK7")) == pytest.approx(index, abs=1e-5)


@pytest.mark.parametrize("glass", list(GLASSES))
@pytest.mark.parametrize("wavelength_um", [0.4, 0.6328, 0.780, 1.0])
def test_group_index_is_the_derivative_taken_in_high_precision(glass, wavelength_um):
    c = GLASSES[glass].coefficients

    def index(w):
        if GLASSES[glass].formula == "schott":
            return mpmath.sqrt(c[0] + c[1] * w**2 + c[2] / w**2 + c[3] / w**4 + c[4] / w**6 + c[5] / w**8)
        return mpmath.sqrt(1 + sum(c[i] * w**2 / (w**2 - c[i + 3]) for i in range(3)))

    with mpmath.workdps(40):
        w = mpmath.mpf(wavelength_um)
        expected = index(w) - w * mpmath.diff(index, w)
    assert float(group_index(wavelength_um, glass)) == pytest.approx(float(expected), abs=1e-14)


def test_old_and_new_bk7_differ_as_the_docstrings_say():
    assert float(group_index(0.780, "N-BK7") - group_index(0.780)) == pytest.approx(1.15e-5, abs=5e-8)
    assert float(phase_index(0.780, "N-BK7") - phase_index(0.780)) == pytest.approx(-3.5e-6, abs=5e-8)


def test_a_wavelength_outside_is_refused_with_value_and_limits():
    with pytest.raises(ValidityError) as caught:
        phase_index([0.780, 10.6])
    text = "wavelength 10.6 um is outside 0.365-1.014 um, where [PARKER04] eq. 1.44 holds for BK7-old"
    assert str(caught.value) == text
    with pytest.raises(ValidityError, match="wavelength nan um"):
        group_index(float("nan"), "N-BK7")


def test_an_unknown_glass_is_refused_with_those_known():
    with pytest.raises(ValidityError, match="glass 'BK7' is not known; known are BK7-old, N-BK7"):
        group_index(0.780, "BK7")


def test_arrays_keep_their_shape():
    assert group_index([[0.5, 0.6, 0.7]]).shape == (1, 3)
    assert group_index([[0.5, 0.6, 0.7]], "N-BK7").shape == (1, 3)
