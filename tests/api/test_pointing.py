"""Pointing in Python: the series, its predictions and the track, from paths and from records."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from astropy import units

import catseye
from catseye.constants import ARCSECOND, DEGREE
from catseye.errors import ArgumentError, InputError
from catseye.geometry.antenna.pointing_series import published
from catseye.records.laboratory.star_offsets import read_star_offsets
from catseye.records.laboratory.tilts import read_tilts
from repository import ROOT

STARS, TILTS = ROOT / "examples/pointing/stars.dat", ROOT / "examples/pointing/tilts.csv"


def test_the_series_of_a_file_and_of_its_record_are_one():
    file, record = catseye.fit_pointing(STARS), catseye.fit_pointing(read_star_offsets(STARS))
    np.testing.assert_array_equal(file.values, record.values)
    assert file.sources() == (STARS,)
    assert record.sources() == ()
    assert file.verdict == record.verdict


def test_the_series_has_tables_with_units_and_what_the_command_prints():
    found = catseye.fit_pointing(STARS, against="published", terms=["IA", "IE"])
    table = found.to_table()
    assert table["value"].unit == units.arcsec
    np.testing.assert_allclose(table["value"].to_value(units.rad), found.values)
    assert len(found.to_table("observations")) == len(found.used) == 72
    assert set(found.figures()) == {"residuals", "sky", "correlation"}
    assert found.difference.shape == (2,)
    assert found.to_object()["terms"] == ["IA", "IE"]


def test_a_model_is_saved_and_predicts_with_its_covariance(tmp_path):
    found = catseye.fit_pointing(STARS, u_arcsec=5.2 * units.arcsec)
    found.save_model(tmp_path / "m.toml")
    assert tomllib.loads((tmp_path / "m.toml").read_text())["terms"] == list(found.terms)
    one = catseye.predict_pointing(145.3, 30.0, model=tmp_path / "m.toml")
    record = catseye.predict_pointing(145.3, 30.0, model=catseye.load(tmp_path / "m.toml"))
    np.testing.assert_array_equal(one.correction, record.correction)
    rows = found.findings.fit.series.covariance_of_correction(145.3 * DEGREE, 30 * DEGREE)
    np.testing.assert_allclose(one.u, np.sqrt(np.diag(rows)), rtol=1e-6)
    again = catseye.fit_pointing(STARS, against=catseye.load(tmp_path / "m.toml"), u_arcsec=5.2)
    np.testing.assert_allclose(again.difference, 0.0, atol=1e-6 * ARCSECOND)


def test_predictions_broadcast_and_have_a_row_each():
    azimuth = np.array([0.0, 90.0, 145.3])
    found = catseye.predict_pointing(azimuth * units.deg, 30.0)
    expected = published().correction(azimuth * DEGREE, 30.0 * DEGREE)
    np.testing.assert_allclose(found.correction, expected, rtol=1e-12)
    assert (found.u, found.covariance) == (None, None)
    table = found.to_table()
    np.testing.assert_allclose(table["correction_elevation"].to_value("rad"), expected[:, 1])
    across = (table["azimuth_encoder"] - table["azimuth"]).to_value("rad") * np.cos(30 * DEGREE)
    np.testing.assert_allclose(across, expected[:, 0], atol=1e-12)
    assert len(found.lines()) == 9


def test_the_track_of_files_and_of_records_is_one(tmp_path):
    file, record = (catseye.track_pointing(tilts=each, harmonics=3) for each in (TILTS, read_tilts(TILTS)))
    np.testing.assert_array_equal(file.values, record.values)
    assert len(file.undetermined) == 4
    assert set(file.figures()) == {"tilt", "residuals"}
    assert len(file.to_table("observations")) == len(file.profile.azimuth)
    catseye.save(file, tmp_path / "out")
    assert json.loads((tmp_path / "out" / "track.json").read_text())["harmonics"] == 3


def test_an_output_over_an_input_is_refused(tmp_path):
    stars = tmp_path / "stars.dat"
    stars.write_bytes(STARS.read_bytes())
    found = catseye.fit_pointing(stars)
    for save in (found.save_model, found.save_stars):
        with pytest.raises(InputError, match="is an input"):
            save(stars)
    assert stars.read_bytes() == STARS.read_bytes()


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: catseye.fit_pointing(STARS, terms=["IA", "XX"]), "terms"),
        (lambda: catseye.fit_pointing(STARS, terms=["IA", "IA"]), "terms"),
        (lambda: catseye.fit_pointing(STARS, u_arcsec=0.0), "u_arcsec"),
        (lambda: catseye.fit_pointing([]), "files"),
        (lambda: catseye.predict_pointing(541.0, 0.0), "azimuth_deg"),
        (lambda: catseye.predict_pointing(0.0, 90.0), "elevation_deg"),
        (lambda: catseye.predict_pointing(float("nan"), 10.0), "azimuth_deg"),
        (lambda: catseye.track_pointing(), "tilts"),
    ],
)
def test_invalid_arguments_are_refused_by_name(call, name):
    with pytest.raises(ArgumentError, match=name):
        call()


BENT = {"structure": "structural-model/telescope.toml", "site": "gbt", "temperature_c": 5.0}


def test_a_series_beside_a_structural_model_is_that_of_what_the_model_leaves():
    """Stars of a telescope that bends by the model: with it the series alone comes back, without it another."""
    stars = catseye.fit_pointing("pointing/stars.dat").findings.observations.stars
    series = catseye.fit_pointing("pointing/stars.dat").findings.fit.series
    found = catseye.displace_model(
        BENT["structure"],
        posture_deg=np.degrees(np.column_stack([stars.azimuth, stars.elevation])),
        temperature_c=BENT["temperature_c"],
        site=BENT["site"],
        points="ZEG41040L",
    )
    seen = series.correction(stars.azimuth, stars.elevation) + found.beam.correction
    encoders = stars.azimuth + seen[:, 0] / np.cos(stars.elevation), stars.elevation + seen[:, 1]
    bent = replace(stars, azimuth_encoder=encoders[0], elevation_encoder=encoders[1])
    fit = catseye.fit_pointing(bent, **BENT)
    np.testing.assert_allclose(fit.values, series.values, rtol=0, atol=1e-12)
    assert fit.sky_rms < 1e-13
    plain = catseye.fit_pointing(bent)
    assert np.max(np.abs(plain.values - series.values)) > 10 * ARCSECOND
    both = catseye.predict_pointing(np.degrees(stars.azimuth), np.degrees(stars.elevation), model=series, **BENT)
    np.testing.assert_allclose(both.correction, seen, rtol=0, atol=1e-13)
    moved = both.encoders[:, 1] - stars.elevation
    np.testing.assert_allclose(moved, seen[:, 1], rtol=0, atol=1e-13)


def test_half_of_a_structural_models_arguments_is_refused():
    with pytest.raises(catseye.ArgumentError, match="structure needs site"):
        catseye.predict_pointing(0.0, 45.0, structure=BENT["structure"])
    with pytest.raises(catseye.ArgumentError, match="temperature_c needs structure"):
        catseye.fit_pointing("pointing/stars.dat", temperature_c=3.0)
    with pytest.raises(catseye.ValidityError, match="elevation -2 deg"):
        catseye.predict_pointing(0.0, -2.0, **BENT)
