"""Structure and its vibration from Python: models of epochs, predictions, spectra of ranges."""

import json
from dataclasses import replace

import numpy as np
import pytest

import catseye
from catseye.constants import ARCSECOND, DEGREE, MILLIMETRE
from catseye.coordinator.journal.entries import AnsweredShot
from catseye.coordinator.journal.writer import Journal
from catseye.errors import ArgumentError, EstimationError, InputError, ValidityError
from catseye.geometry.antenna.frames import ground_from_reflector
from catseye.geometry.frames.rotation import from_vector
from catseye.records.network.solved_points import FORMAT
from catseye.records.night.live import LiveShot
from catseye.simulator.clock.world_clock import ManualClock
from journal_scene import START, scene_run

NAMES = ("ZEG1", "ZEG2", "ZEG3", "ZEG4")
REST = np.array([[0.0, 5, 40], [8, 6, 48], [-8, 7, 50], [1, 12, 58]])
FOOT = np.array([0.0, -8.0, 10.0])
SIX_COS = np.array([0.002, 0.010, -0.001, 40 * ARCSECOND, 0.0, 5 * ARCSECOND])


@pytest.fixture(scope="module")
def nights(tmp_path_factory):
    """A folder of ten reductions of a body that bends with the cosine of the elevation."""
    rng, folder = np.random.default_rng(8), tmp_path_factory.mktemp("nights")
    order = [f"{name} {axis}" for name in NAMES for axis in "xyz"]
    for k, elevation in enumerate(np.linspace(10.0, 80.0, 10)):
        six = SIX_COS * np.cos(elevation * DEGREE)
        bent = FOOT + six[:3] + (REST - FOOT) @ from_vector(six[3:]).T
        x = ground_from_reflector(2.5, elevation * DEGREE).points(bent) + 5e-5 * rng.standard_normal((4, 3))
        document = {
            "format": FORMAT,
            "frame": "ground",
            "points": {n: dict(zip("xyz", row, strict=True)) for n, row in zip(NAMES, x.tolist(), strict=True)},
            "covariance_order": order,
            "covariance": (2.5e-9 * np.eye(12)).tolist(),
        }
        night = folder / f"night-{k}"
        night.mkdir()
        (night / "coordinates.json").write_text(json.dumps(document))
        pose = {"format": FORMAT, "nominal_posture": {"azimuth_deg": 2.5 / DEGREE, "elevation_deg": elevation}}
        (night / "pose.json").write_text(json.dumps(pose))
    return folder


@pytest.fixture(scope="module")
def found(nights):
    return catseye.structure(nights, points="ZEG*", group="arm", pivot=FOOT, predict_deg=(30.0, 45.0))


def test_a_model_gives_its_coefficients_and_predictions(found):
    assert found.verdict.word == "good"
    assert found.names == NAMES
    assert found.functions == ("1", "sinE", "cosE")
    at = found.functions.index("cosE")
    u = np.sqrt(np.diag(found.covariance)).reshape(-1, 6)[at]
    assert np.all(np.abs(found.coefficients[at] - SIX_COS) < 4.0 * u)
    assert found.predicted.shape == (2, 4, 3)
    assert found.predicted_covariance.shape == (2, 4, 3, 3)
    told = found.to_object()
    assert told["coefficients"]["cosE"]["value"].tolist() == found.coefficients[at].tolist()
    assert told["prediction"]["elevation_deg"] == (30.0, 45.0)
    assert [p.title for p in found.passages()][-1] == "Note"  # no epoch says a temperature


def test_columns_of_a_model_are_in_their_units(found):
    coefficients, residuals, predicted = (found.to_table(n) for n in ("coefficients", "residuals", "prediction"))
    np.testing.assert_allclose(coefficients["shift_y"].to_value("m"), found.coefficients[:, 1], rtol=1e-12)
    np.testing.assert_allclose(coefficients["turn_x"].to_value("rad"), found.coefficients[:, 3], rtol=1e-12)
    assert len(residuals) == 40
    np.testing.assert_allclose(predicted["z"].to_value("m"), found.predicted[..., 2].ravel())
    u = np.sqrt(found.predicted_covariance[0, 0, 1, 1])
    assert predicted["u_y"].to_value("mm")[0] == pytest.approx(u / MILLIMETRE)
    assert len(found.rows()) == 1 + 2 * len(found.functions)
    assert set(catseye.show(found)) == {"motion", "residuals"}


def test_folders_one_by_one_give_the_model_of_the_folder_that_holds_them(found, nights, tmp_path):
    again = catseye.structure(*sorted(nights.iterdir()), points=["ZEG*"], pivot=FOOT, predict_deg=30.0)
    np.testing.assert_array_equal(again.coefficients, found.coefficients)
    # Products of one posture and of two round differently.
    np.testing.assert_allclose(again.predicted[0], found.predicted[0], rtol=0.0, atol=1e-12)
    where = catseye.save(again, tmp_path / "out")
    assert {"structure.json", "samplers.fits", "prediction.csv"} <= {path.name for path in where.iterdir()}
    assert len(again.inputs()) == 20


def test_solved_points_are_epochs(found, nights):
    points = [catseye.load(night) for night in sorted(nights.iterdir())]
    points = [replace(each, campaign=f"night {k}") for k, each in enumerate(points)]
    again = catseye.structure(*points, points="ZEG*", pivot=FOOT)
    np.testing.assert_allclose(again.coefficients, found.coefficients, rtol=1e-9, atol=1e-12)
    assert "night 3/night-3/coordinates.json" in again.inputs()
    with pytest.raises(InputError, match="night 3: its posture is unknown"):
        catseye.structure(*points[:3], replace(points[3], posture=None), points="ZEG*")


def test_a_night_is_an_epoch():
    night = catseye.reduce("night-01")
    with pytest.raises(EstimationError, match=r"group 'group'.* 1 epochs"):
        catseye.structure(night, points="DP00*", folds=0)


def test_a_claim_without_a_check_is_doubtful(nights):
    assert catseye.structure(nights, points="ZEG*", folds=0).verdict.word == "doubtful"
    alone = catseye.structure(nights, points="ZEG*", independent=True)
    assert "independent" in alone.verdict.why


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({}, ArgumentError, "points is needed"),
        ({"points": "X*"}, InputError, r"no epoch has a point 'X\*'"),
        ({"points": "ZEG*", "way": 2.0}, InputError, "way = 2"),
        ({"points": "ZEG*", "pivot": (1.0, 2.0)}, InputError, "pivot has 2 numbers"),
        ({"points": "ZEG*", "harmonics": 3}, ValidityError, "3 harmonics"),
        ({"points": "ZEG*", "own": "all"}, ValidityError, "own = 'all'"),
        ({"points": "ZEG*", "frame": "feed"}, InputError, "frame 'feed'"),
        ({"points": "ZEG*", "folds": 1}, InputError, "1 stretches of 10"),
        ({"points": "ZEG*", "journal": "night.db"}, InputError, "journal stands alone"),
    ],
)
def test_arguments_that_cannot_be_are_named(nights, options, error, said):
    with pytest.raises(error, match=said):
        catseye.structure(nights, **options)


def test_a_reduction_without_a_format_is_refused_with_its_place(nights, tmp_path):
    document = json.loads((nights / "night-3" / "coordinates.json").read_text())
    (tmp_path / "coordinates.json").write_text(json.dumps({**document, "format": "other"}))
    with pytest.raises(InputError, match=rf"{tmp_path}: coordinates.json: format = 'other'"):
        catseye.structure(tmp_path, points="ZEG*")


@pytest.fixture(scope="module")
def journal(tmp_path_factory):
    """Ranges of two rangers to a target that shakes at 1.2 Hz, and to one that does not."""
    rng, place = np.random.default_rng(9), str(tmp_path_factory.mktemp("journal") / "night.db")
    with Journal.open(place, run=scene_run(), clock=ManualClock(START / 1e8)) as writing:
        for n in range(1600):
            for ranger, late, gain in (("ZY101", 0, 1.0), ("ZY102", 60, -0.7)):
                ticks = START + n * 148 + late
                t = (n * 148 + late) * 864e-6 + 0.064
                for target, size in (("ZEG1", 6e-5), ("ZEG2", 0.0)):
                    x = 100.0 + gain * size * np.cos(2 * np.pi * 1.2 * t) + 2e-5 * rng.standard_normal()
                    shot = LiveShot(ranger, target, ticks, 128, 64, 1000, 3e-4, None, 1.0, 0.0, 2 * n + late // 60)
                    writing.append(AnsweredShot(shot, "used", "", x, 2e-5, 0.0))
    return place


def test_a_vibration_is_another_result(journal, tmp_path):
    found = catseye.structure(vibration=journal, points="ZEG1")
    assert [one.name for one in found.found.series] == ["ZY101:ZEG1", "ZY102:ZEG1"]
    assert found.found.peaks[0].likely_hz == pytest.approx(1.2, abs=0.01)
    assert found.verdict.word == "good"
    modes, peaks, spectra = (found.to_table(name) for name in ("modes", "peaks", "spectra"))
    assert modes["frequency"].to_value("Hz")[0] == pytest.approx(1.2, abs=0.01)
    assert len(peaks) == len(found.found.peaks)
    assert len(spectra) == 2 * len(found.found.spectrum.frequency_hz)
    assert "verdict" not in found.to_object()
    assert found.rows() == []
    assert set(catseye.show(found)) == {"spectra"}
    assert (catseye.save(found, tmp_path / "out") / "spectra.csv").is_file()


def test_a_series_is_taken_off_the_others_of_its_ranger(journal):
    found = catseye.structure(vibration=journal, points="ZEG1", less="ZY101:ZEG2", stretch_s=20.0)
    assert len(found.found.series) == 1
    assert found.found.series[0].name.startswith("ZY101:ZEG1:less")
    with pytest.raises(InputError, match="less = ZY109:ZEG2: no such series"):
        catseye.structure(vibration=journal, points="ZEG1", less="ZY109:ZEG2")
    with pytest.raises(ArgumentError, match="points is needed"):
        catseye.structure(vibration=journal)
