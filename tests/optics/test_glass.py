"""Glass: its makers' printed lines and temperature coefficients, derivatives in high precision, the refusals."""

import mpmath
import pytest

from catseye.atmosphere.index.air import air
from catseye.errors import ValidityError
from catseye.optics.glass import (
    GLASSES,
    absolute_index,
    group_index,
    group_wavelength,
    index_over_air,
    phase_index,
    reference_air,
    slopes,
    temperature_slopes,
)
from catseye.optics.retroreflector.prism import range_constant

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
# Absolute temperature coefficients of the same sheet, 1e-6/K to one digit: 1060 nm, e line, g line.
N_BK7_WARMED = [(-30.0, (0.3, 0.8, 1.2)), (30.0, (1.1, 1.6, 2.1)), (70.0, (1.5, 2.1, 2.7))]
# Computed column of table I in [MALITSON65], six digits, as public transcriptions give it.
SILICA_LINES = [(0.404656, 1.469618), (0.546074, 1.460078), (0.706519, 1.455145), (0.365015, 1.474539)]
# Makers' n_d and Abbe numbers; [OHARA17] gives six digits
ABBE = [("N-BK7", 1.51680, 64.17, 5e-3), ("BK7-old", 1.51680, 64.17, 5e-3), ("S-LAH79", 2.003300, 28.273280, 1e-6)]


@pytest.mark.parametrize(("wavelength_um", "index"), N_BK7_LINES)
def test_n_bk7_gives_its_data_sheet(wavelength_um, index):
    # half of the fifth digit, and the 5e-6 to which the sheet calls its formula good
    assert float(phase_index(wavelength_um, "N-BK7")) == pytest.approx(index, abs=1e-5)


@pytest.mark.parametrize(("wavelength_um", "index"), SILICA_LINES)
def test_fused_silica_gives_the_table_of_its_paper(wavelength_um, index):
    assert float(phase_index(wavelength_um, "fused-silica")) == pytest.approx(index, abs=1e-6)


@pytest.mark.parametrize(("glass", "n_d", "abbe", "tolerance"), ABBE)
def test_the_makers_index_and_abbe_number_come_out(glass, n_d, abbe, tolerance):
    d, f, c = (float(phase_index(line, glass)) for line in (0.5875618, 0.4861327, 0.6562725))
    assert d == pytest.approx(n_d, abs=1e-6)
    assert (d - 1.0) / (f - c) == pytest.approx(abbe, abs=max(tolerance, 1e-5))


@pytest.mark.parametrize(("temperature_c", "printed"), N_BK7_WARMED)
def test_n_bk7_warms_as_its_data_sheet_prints(temperature_c, printed):
    for line, coefficient in zip((1.060, 0.546074, 0.4358343), printed, strict=True):
        slope = float(temperature_slopes(line, "N-BK7", temperature_c).phase)
        # half of the digit; the sheet's value is a mean over 20 K about this temperature
        assert slope * 1e6 == pytest.approx(coefficient, abs=0.055)


def test_fused_silica_warms_as_goddard_measured():
    """Leviton and Frey (arXiv:0805.0091), Corning 7980 at 293 K: 8.74e-6/K in the visible to 8.16e-6/K at 1.55 um."""
    for wavelength_um, measured in ((0.5, 8.74), (1.55, 8.16)):
        # another silica and another laboratory: some 4 % is what dn/dT of silicas differs by
        assert float(temperature_slopes(wavelength_um, "fused-silica").phase) * 1e6 == pytest.approx(measured, rel=0.05)


def in_high_precision(glass):
    c, formula = GLASSES[glass].coefficients, GLASSES[glass].formula

    def index(w):
        if formula == "schott":
            return mpmath.sqrt(c[0] + c[1] * w**2 + c[2] / w**2 + c[3] / w**4 + c[4] / w**6 + c[5] / w**8)
        return mpmath.sqrt(1 + sum(c[i] * w**2 / (w**2 - c[i + 3]) for i in range(3)))

    return index


@pytest.mark.parametrize("glass", list(GLASSES))
@pytest.mark.parametrize("wavelength_um", [0.4, 0.6328, 0.780, 1.0])
def test_group_index_and_slopes_are_the_derivatives_taken_in_high_precision(glass, wavelength_um):
    index = in_high_precision(glass)
    with mpmath.workdps(40):
        w = mpmath.mpf(wavelength_um)
        first = mpmath.diff(index, w)
        expected = index(w) - w * first
        bent = -w * mpmath.diff(index, w, 2)
    assert float(group_index(wavelength_um, glass)) == pytest.approx(float(expected), abs=1e-14)
    found = slopes(wavelength_um, glass)
    assert float(found.phase) == pytest.approx(float(first), abs=1e-13)
    assert float(found.group) == pytest.approx(float(bent), abs=1e-12)


@pytest.mark.parametrize("glass", list(GLASSES))
@pytest.mark.parametrize("temperature_c", [None, -20.0, 45.0])
def test_the_absolute_group_index_is_the_derivative_of_the_absolute_phase_index(glass, temperature_c):
    step = 1e-3
    n = [float(absolute_index(0.780 + k * step, glass, temperature_c).phase) for k in (-2, -1, 0, 1, 2)]
    derivative = (n[0] - 8 * n[1] + 8 * n[3] - n[4]) / (12 * step)
    # the fifth derivative times step^4 / 30 is some 1e-12
    assert float(absolute_index(0.780, glass, temperature_c).group) == pytest.approx(
        n[2] - 0.780 * derivative, abs=1e-10
    )


@pytest.mark.parametrize("glass", list(GLASSES))
def test_at_the_makers_temperature_nothing_is_warmed(glass):
    at = GLASSES[glass].reference_c
    assert absolute_index(0.780, glass, at) == absolute_index(0.780, glass)


@pytest.mark.parametrize("wavelength_um", [0.4, 0.5461, 0.780, 1.014])
def test_the_makers_air_is_todays_dry_air(wavelength_um):
    today = air(20.0, 1013.25, 0.0, wavelength_um=wavelength_um, model="ciddor_hill1999", co2_ppm=300.0)
    found = reference_air(wavelength_um, 20.0)
    assert float(found.phase) == pytest.approx(float(today.phase_index), abs=2e-7)
    assert float(found.group) == pytest.approx(float(today.group_index), abs=2e-7)


def test_dividing_by_the_air_twice_has_the_documented_effect():
    """The memo's index ratio, by the notes' air; 38.4 mm prism and the ball of its table."""
    about = air(20.0, 933.0, 50.0, wavelength_um=0.780, model="rueger1990")
    true = float(index_over_air(0.780, air_phase=about.phase_index, air_group=about.group_index).group)
    memo = 1.527463 / 1.00025324
    assert true - memo == pytest.approx(4.3e-4, abs=5e-6)
    prism_um = float(range_constant(0.0384, memo) - range_constant(0.0384, true)) * 1e6
    assert prism_um == pytest.approx(24.0, abs=0.5)  # above 0: the memo's range is too long
    assert (true - memo) * (1.969 + 3.799) * 25.4e3 == pytest.approx(63.0, abs=0.5)
    # in the makers' own air the ratio is the makers' index, apart from the wavelength, which is named in vacuum
    own = reference_air(0.780, 20.0)
    same = index_over_air(0.780, air_phase=own.phase, air_group=own.group)
    assert float(same.group) == pytest.approx(float(group_index(0.780 / own.phase)), abs=1e-14)


def test_group_wavelength_is_the_notes():
    assert float(group_wavelength(1.5e9, 0.780)) / 2 == pytest.approx(0.065422711, abs=5e-10)
    with pytest.raises(ValidityError, match="frequency = 0 Hz"):
        group_wavelength([1e9, 0.0], 0.780)


def test_old_and_new_bk7_differ_as_the_docstrings_say():
    assert float(group_index(0.780, "N-BK7") - group_index(0.780)) == pytest.approx(1.15e-5, abs=5e-8)
    assert float(phase_index(0.780, "N-BK7") - phase_index(0.780)) == pytest.approx(-3.5e-6, abs=5e-8)


def test_a_value_outside_is_refused_with_value_and_limits():
    with pytest.raises(ValidityError) as caught:
        phase_index([0.780, 10.6])
    text = "wavelength 10.6 um is outside 0.365-1.014 um, where [PARKER04] eq. 1.44 holds for BK7-old"
    assert str(caught.value) == text
    with pytest.raises(ValidityError, match="wavelength nan um"):
        group_index(float("nan"), "N-BK7")
    with pytest.raises(ValidityError, match=r"temperature 300 C is outside -100 to 140 C, where \[SCHOTT14\] holds"):
        absolute_index(0.780, "N-BK7", 300.0)
    with pytest.raises(ValidityError, match="temperature nan C"):
        absolute_index(0.780, "N-BK7", float("nan"))


def test_an_unknown_glass_is_refused_with_those_known():
    with pytest.raises(ValidityError, match="glass 'BK7' is unknown; known are BK7-old, N-BK7, fused-silica"):
        group_index(0.780, "BK7")
    with pytest.raises(ValidityError, match="glass 'BK7' is unknown"):
        absolute_index(0.780, "BK7")


@pytest.mark.parametrize("glass", list(GLASSES))
def test_arrays_keep_their_shape(glass):
    assert group_index([[0.5, 0.6, 0.7]], glass).shape == (1, 3)
    assert absolute_index([[0.5, 0.6, 0.7]], glass, [[0.0], [20.0]]).group.shape == (2, 3)
