"""The figure of polarization: numbers that the panels show, drawn alike twice."""

import pytest

from catseye.errors import ValidityError
from catseye.gateways.optics.polarization_figures import corners, polarization_plot


def test_numbers_and_picture_of_the_ranger_s_wavelength():
    drawn, told = polarization_plot()
    assert drawn.count("<svg ") == 1
    assert drawn == polarization_plot()[0]
    assert list(told["corners"]) == list(corners(0.780, "BK7-old"))
    bare, gold = told["corners"]["BK7-old, bare"], told["corners"]["hollow, gold"]
    assert bare["returned"] == pytest.approx(1.0)
    assert bare["far_field_axis"] == pytest.approx(0.298, abs=5e-4)
    assert bare["crossed_least"] == pytest.approx(bare["crossed_most"])  # threefold: no azimuth is better straight on
    assert gold["returned"] == pytest.approx(0.975**3, abs=0.02)  # each mirror straight on has 0.975
    assert gold["through_splitter_and_quarter_wave"] > 0.99 * gold["returned"]


def test_a_wavelength_without_metals_is_refused():
    with pytest.raises(ValidityError, match=r"wavelength 1\.2 um"):
        polarization_plot(1.2, "N-BK7")
