"""Fit of a structural model to epochs: the example's truth comes back within u, and a wrong claim is told."""

import runpy
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from catseye.errors import EstimationError, InputError
from catseye.geometry.antenna.deformation import COMPONENTS
from catseye.records.site.structural_model import read_structural_model
from catseye.reduction.structure.antenna import antenna_of
from catseye.reduction.structure.epochs import read_epochs
from catseye.reduction.structure.model_fit import model_fit
from repository import ROOT

MODEL = ROOT / "examples" / "structural-model" / "telescope.toml"
EPOCHS = ROOT / "examples" / "structure" / "epochs.csv"
MAKER = runpy.run_path(str(EPOCHS.parent / "make_epochs.py"))


@pytest.fixture(scope="module")
def antenna():
    return antenna_of(read_structural_model(MODEL))


@pytest.fixture(scope="module")
def read():
    return read_epochs([], EPOCHS)


@pytest.fixture(scope="module")
def found(antenna, read):
    return model_fit(antenna, read)


def test_the_examples_truth_comes_back_within_its_covariance(found):
    truth = antenna_of(MAKER["truth"]())
    expected = np.concatenate(
        [truth.motions[owner].coefficients[COMPONENTS.index(component)] for owner, component in found.fit.free]
    )
    error = np.array([row.after for row in found.coefficients]) - expected
    q = float(error @ np.linalg.solve(found.fit.covariance, error))
    low, high = chi2.ppf([0.005, 0.995], len(error))
    assert low < q < high
    start = np.array([row.before for row in found.coefficients]) - expected
    assert float(start @ np.linalg.solve(found.fit.covariance, start)) > high  # the model's own is far off
    assert found.verdict.word == "good"
    assert found.p > 0.01


def test_without_a_choice_it_fits_what_the_file_gives_of_the_measured_frames(found):
    owners = dict.fromkeys(owner for owner, _ in found.fit.free)
    assert list(owners) == ["alidade", "reflector", "feed_arm"]
    assert ("feed_arm", "turn_z") not in found.fit.free  # not in the file
    assert len(found.coefficients) == 3 * 3 + 3 * 5 + 4 * 4


def test_a_network_that_claims_too_little_makes_the_fit_doubtful(antenna, read):
    rng = np.random.default_rng(2)
    off = [
        replace(epoch, coordinates=epoch.coordinates + 2e-3 * rng.standard_normal(epoch.coordinates.shape))
        for epoch in read.epochs
    ]
    found = model_fit(antenna, replace(read, epochs=tuple(off)))
    assert found.verdict.word == "doubtful"
    assert "depart from the fitted model" in found.verdict.why


def test_a_fit_from_the_written_model_frees_the_same_coefficients(found, read):
    from datetime import date

    again = found.updated(date(2026, 1, 1))
    assert str(again.measured_on) == "2004-04-29"  # the day of the epochs
    assert model_fit(antenna_of(again), read).fit.free == found.fit.free


def test_an_epoch_without_temperature_needs_one_for_a_model_that_depends_on_it(antenna, read):
    cold = replace(read, epochs=tuple(replace(epoch, temperature_c=float("nan")) for epoch in read.epochs))
    with pytest.raises(InputError, match=r"epoch epoch-01.csv: its temperature is unknown"):
        model_fit(antenna, cold)
    assert model_fit(antenna, cold, temperature_c=20.0, free={"alidade": ["turn_x"]}).fit.free


def test_what_no_epoch_determines_is_named(antenna, read):
    with pytest.raises(EstimationError, match="elevation shift_y 1"):
        model_fit(antenna, read, free={"elevation": ["shift_y"], "reflector": ["shift_y"], "feed_arm": ["shift_y"]})
    with pytest.raises(EstimationError, match="subreflector turn_x 1 floats"):
        model_fit(antenna, read, free={"subreflector": ["turn_x"]})


def test_a_table_without_uncertainty_is_refused(tmp_path):
    (tmp_path / "one.csv").write_text("point,x_m,y_m,z_m\nZEG41040L,1,2,3\n")
    (tmp_path / "list.csv").write_text("reduction,azimuth_deg,elevation_deg\none.csv,0,45\n")
    with pytest.raises(InputError, match=r"one.csv: its points have no uncertainty"):
        read_epochs([], tmp_path / "list.csv")


@pytest.mark.parametrize("k", [0, 7, 15])
def test_the_examples_tables_are_those_that_its_script_makes(tmp_path, k):
    MAKER["main"].__globals__["HERE"] = tmp_path
    MAKER["main"]()
    name = f"epoch-{k + 1:02d}.csv"
    assert (tmp_path / name).read_text() == (EPOCHS.parent / name).read_text()
    assert (tmp_path / "epochs.csv").read_text() == EPOCHS.read_text()
