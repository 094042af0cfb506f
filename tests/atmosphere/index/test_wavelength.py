"""Wavelengths in air: printed numbers, inverses, and the index of a modulation from its two sidebands."""

import tomllib

import pytest
from mpmath import diff, mp, mpf

from catseye.atmosphere.index import rueger1990, wavelength
from catseye.atmosphere.index.air import group_refractivity, phase_refractivity
from catseye.errors import ValidityError
from repository import TESTS
from vector_scene import function_of

VECTORS = tomllib.loads((TESTS / "vectors" / "path.toml").read_text(encoding="utf-8"))["vector"]
STATE = (20.0, 933.0, 50.0)


@pytest.mark.parametrize("vector", VECTORS, ids=lambda vector: vector["name"])
def test_a_printed_number_is_reproduced(vector):
    got = function_of(vector["function"])(**vector["inputs"])
    got = getattr(got, vector["field"]) if "field" in vector else got
    assert float(got) / vector.get("scale", 1.0) == pytest.approx(
        vector["expected"], rel=0.0, abs=vector["tolerance"]
    ), f"{vector['source']}: {vector['why']}"


def test_the_notes_carrier_and_sidebands_were_reckoned_with_three_hundred_million_metres_a_second():
    for printed, shift in ((384_615.3, 0.0), (384_616.8, 1.5), (384_613.8, -1.5)):
        assert 3e8 / 780e-9 / 1e9 + shift == pytest.approx(printed, abs=0.1)  # truncated
        assert abs(299_792_458.0 / 780e-9 / 1e9 + shift - printed) > 200.0


@pytest.mark.parametrize("model", ["rueger1990", "ciddor_hill1999"])
@pytest.mark.parametrize("modulation_hz", [1e8, 1.5e9, 1e11, 1e12])
def test_the_sidebands_beat_in_the_group_index(model, modulation_hz):
    beat = wavelength.sidebands(0.780, modulation_hz, *STATE, model=model)
    group = float(group_refractivity(*STATE, model=model))
    phase = float(phase_refractivity(*STATE, model=model))
    # the next term, m²/6 d²n_g/df², measured below: 1.76e-11 at 1 THz; and the rounding of n - 1 over 2m/f
    bound = 2e-11 * (modulation_hz / 1e12) ** 2 + 1e-16 * 384e12 / modulation_hz
    assert abs(float(beat.refractivity) - group) < bound
    assert group - phase > 4e-6  # what would be wrong with the index of the light


def test_in_high_precision_the_beat_misses_the_group_index_by_four_parts_in_ten_to_the_seventeen():
    """Owens' phase formula at the notes' example; density factors as printed, n(f) f differentiated by mpmath."""
    dry, wet = (mpf(float(d)) for d in rueger1990.density_factors(20.0, 933.0, 11.7323))

    def n(f):
        s = (f / mpf(299792458) / mpf(10) ** 6) ** 2
        d = mpf("1646386.0") / (mpf("238.0185") - s) + mpf("47729.9") / (mpf("57.362") - s)
        w = mpf("6487.31") + mpf("58.058") * s - mpf("0.7115") * s**2 + mpf("0.08851") * s**3
        return 1 + (d * dry + w * wet) / mpf(10) ** 8

    with mp.workdps(60):
        f, m = mpf(299792458) / mpf("780e-9"), mpf("1.5e9")
        beat = (n(f + m) * (f + m) - n(f - m) * (f - m)) / (2 * m)
        group = diff(lambda x: x * n(x), f)
        by_wavelength = n(f) - mpf("0.78") * diff(lambda lam: n(mpf(299792458) / lam * 10**6), mpf("0.78"))
        assert abs(by_wavelength - group) < mpf(10) ** -25  # eq. 1.1 is the derivative by frequency
        assert float(beat - group) == pytest.approx(4.0e-17, rel=0.05)
        assert float(beat - group) == pytest.approx(float(m**2 / 6 * diff(lambda x: x * n(x), f, 3)), rel=1e-6)
        assert float(group - 1) * 1e6 == pytest.approx(253.246815, abs=2e-6)  # and it is the notes' number


def test_a_modulation_in_megahertz_is_refused():
    with pytest.raises(ValidityError, match="modulation frequency 1500 Hz"):
        wavelength.modulation_wavelength(1500.0, 1.00025)
