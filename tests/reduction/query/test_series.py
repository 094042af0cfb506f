"""Series from an archive: points, rangers, poses, surfaces, certificates, nights, against truths that are known."""

import numpy as np
import pytest

from archive_scene import NEW_YEAR, U_ZERO, YearTruth, flip, written_year
from catseye.constants import DEGREE
from catseye.errors import InputError
from catseye.geometry.antenna.frames import ground_from_reflector
from catseye.records.archive.reading import read_table
from catseye.reduction.query.certificates import Validity, night_certificates
from catseye.reduction.query.nights import night_rows
from catseye.reduction.query.point import point_series
from catseye.reduction.query.pose import pose_series
from catseye.reduction.query.ranger import ranger_series
from catseye.reduction.query.span import ArchiveSpan
from catseye.reduction.query.surface import surface_series
from catseye.reduction.surface.shape import LitAperture, Prisms, shape_of
from query_scene import APERTURE, ASTIGMATISM, FOCAL, LENGTHENING, NIGHTS, U_PRISM, dish_archive, posture, prisms, shape

STILL = YearTruth(expansion=0.0, sag=0.0, zero_drift={"ZY104": 1.2e-3}, zero_steps={})


@pytest.fixture(scope="module")
def still(tmp_path_factory):
    """A year's nights of a structure that does not move, but for its noise and one zero."""
    return written_year(tmp_path_factory.mktemp("still") / "archive", nights=120, points=12, truth=STILL)


@pytest.fixture(scope="module")
def dish(tmp_path_factory):
    """A dish's nights: the third has no pose, the fifth is doubtful."""
    place = tmp_path_factory.mktemp("dish") / "archive"
    return dish_archive(place, without_pose=(2,), bad={4: ("doubtful", "the air was unsettled")})


def test_a_point_that_does_not_move_scatters_as_it_claims(still):
    series = point_series(ArchiveSpan(still), "ZP00003")
    assert len(series.night) == 120
    assert series.verdict.word == "good"
    assert series.u[0].tolist() == pytest.approx(list(STILL.u))
    assert abs(series.mean.factor - 1.0) < 4 * np.sqrt(2 / (3 * 119))
    u_mean = np.sqrt(np.diag(series.mean.covariance))
    assert u_mean.tolist() == pytest.approx([u / np.sqrt(120) for u in STILL.u])
    assert np.all(np.abs(series.scatter / STILL.u - 1.0) < 4 / np.sqrt(2 * 119))
    truth = np.random.default_rng((1, 0)).uniform(-50.0, 50.0, (12, 3))[3]
    assert np.all(np.abs(series.mean.place - truth) < 4 * u_mean)


def test_a_span_of_time(still):
    first = point_series(ArchiveSpan(still, until=NEW_YEAR + 10.0), "ZP00003")
    later = point_series(ArchiveSpan(still, since=NEW_YEAR + 10.0), "ZP00003")
    assert (len(first.night), len(later.night)) == (10, 110)
    with pytest.raises(InputError, match="no night in this span"):
        point_series(ArchiveSpan(still, since=NEW_YEAR + 900.0), "ZP00003")


@pytest.mark.parametrize(
    ("series", "name", "near"),
    [(point_series, "ZP0003", "ZP00003"), (ranger_series, "ZY99", "ZY109"), (pose_series, "dich", "dish")],
)
def test_an_unknown_name_is_refused_with_those_alike(still, series, name, near):
    with pytest.raises(InputError, match=f"'{name}' is not in the archive .*{near}"):
        series(ArchiveSpan(still), name)


def test_a_point_in_the_reflector_frame(dish):
    """Sky and ground turn by tens of degrees; in the reflector the prism stays but for the dish's own change."""
    name, place = prisms()[0][17], prisms()[1][17:18]
    series = point_series(ArchiveSpan(dish), name, "reflector")
    assert (len(series.night), series.unplaced) == (NIGHTS - 1, 1)
    truth = np.vstack([shape(place, *posture(k)[1:]) for k in range(NIGHTS) if k != 2])
    assert np.all(np.abs(series.x - truth) < 4.5 * U_PRISM)
    assert np.ptp(point_series(ArchiveSpan(dish), name).x, axis=0).min() > 1.0
    ground = point_series(ArchiveSpan(dish), name)
    assert np.trace(series.covariance[0]) == pytest.approx(np.trace(ground.covariance[0]))


def test_a_night_that_is_not_good_makes_a_series_doubtful(dish):
    verdict = point_series(ArchiveSpan(dish), prisms()[0][0]).verdict
    assert verdict.word == "doubtful"
    assert verdict.why.startswith("1 of 12 nights are not good, first dish-04")
    assert point_series(ArchiveSpan(dish, until=NEW_YEAR + 100.0), prisms()[0][0]).verdict.word == "good"
    assert night_rows(ArchiveSpan(dish)).verdict.word == "doubtful"


def test_a_zero_that_drifts_is_found_and_its_claim_holds(still):
    [drift] = ranger_series(ArchiveSpan(still), "ZY104").drifts
    assert drift.nights == 120
    assert drift.is_clear
    assert abs(drift.rate - STILL.zero_drift["ZY104"]) < 3.5 * drift.u_rate
    days = np.arange(120) / 365.25
    assert drift.line.u_rate == pytest.approx(U_ZERO / np.sqrt(np.sum((days - days.mean()) ** 2)), rel=1e-3)


def test_zeros_that_do_not_drift_scatter_as_they_claim(still):
    names = [f"ZY{100 + k}" for k in range(1, 19) if k != 4]
    drifts = [ranger_series(ArchiveSpan(still), name).drifts[0] for name in names]
    z = np.array([drift.rate / drift.line.u_rate for drift in drifts])
    assert np.sqrt(np.mean(z**2)) < 1.0 + 4 / np.sqrt(2 * len(z))
    assert not any(drift.is_clear for drift in drifts)


def test_the_calibration_that_nights_share_is_taken_out(still):
    series = ranger_series(ArchiveSpan(still), "ZY107")
    own, u_own = series.own
    assert np.all(u_own > series.u)
    assert own[0] / u_own[0] ** 2 == pytest.approx(series.value[0] / series.u[0] ** 2)  # the prior's value is 0


def test_poses_come_back_with_their_covariance(still, dish):
    series = pose_series(ArchiveSpan(dish), "dish")
    assert series.translation[:, 0].tolist() == pytest.approx([1e-3 * k for k in range(NIGHTS) if k != 2])
    assert np.allclose(series.covariance, 1e-8 * np.eye(6))
    whole = pose_series(ArchiveSpan(still), "feed arm")
    assert whole.u[0].tolist() == pytest.approx([40e-6, 40e-6, 60e-6, 1e-6, 1e-6, 2e-6])
    assert np.array_equal(whole.covariance, whole.covariance.transpose(0, 2, 1))
    assert np.array_equal(whole.motion[:, 3:], whole.rotation)


def test_a_surface_shows_what_the_dish_does(dish):
    series = surface_series(ArchiveSpan(dish), APERTURE)
    assert list(series.left_out) == ["dish-02-00000002"]
    assert series.verdict.word == "doubtful"
    kept = [k for k in range(NIGHTS) if k != 2]
    temperature = np.array([posture(k)[2] for k in kept])
    focal = series.column("focal_length") - FOCAL - LENGTHENING * (temperature - 10.0)
    z = focal / series.column("u_focal_length")
    assert np.abs(z).max() < 3.5
    assert abs(np.sqrt(np.mean(z**2)) - 1.0) < 4 / np.sqrt(2 * len(z))
    names = [term.name for term in series.terms]
    astigmatism = series.column("term")[:, names.index("astigmatism 0°")]
    cos = np.cos([posture(k)[1] for k in kept])
    assert np.polyfit(cos, astigmatism, 1)[0] == pytest.approx(ASTIGMATISM, rel=0.12)
    others = np.delete(series.column("term"), names.index("astigmatism 0°"), axis=1)
    assert np.abs(others).max() < 0.1 * ASTIGMATISM
    assert np.median(series.rms / (ASTIGMATISM * cos)) == pytest.approx(1.0, abs=0.12)
    noise = np.sqrt(series.column("noise"))
    assert noise == pytest.approx(0.9 * U_PRISM, rel=0.12)  # along the axis of the light: times its cosine
    count, mean, scatter = series.of_prisms()
    assert set(count.tolist()) == {NIGHTS - 1}
    assert np.sqrt(np.mean(mean**2)) == pytest.approx(ASTIGMATISM * cos.mean(), rel=0.12)
    assert scatter.min() > 0.0
    assert np.abs(series.places - prisms()[1]).max() < 1e-4


def test_the_claims_of_a_surface_are_its_scatter(dish, tmp_path):
    quiet = dish_archive(tmp_path / "archive", without_pose=(2,), noise=0.0)
    series, truth = (surface_series(ArchiveSpan(each), APERTURE) for each in (dish, quiet))
    z = ((series.column("term") - truth.column("term")) / series.column("u_term")).ravel()
    assert np.abs(z).max() < 4.0
    assert abs(np.sqrt(np.mean(z**2)) - 1.0) < 4 / np.sqrt(2 * z.size)
    z = np.concatenate(
        [(a.half_path - b.half_path) / a.u_half_path for a, b in zip(series.surfaces, truth.surfaces, strict=True)]
    )
    assert abs(np.sqrt(np.mean(z**2)) - 1.0) < 4 / np.sqrt(2 * z.size)


@pytest.mark.parametrize(("centre", "radius"), [((0.0, 0.0), 50.0), ((0.0, 20.0), 70.0)])
def test_a_surface_is_that_of_the_full_recipe(dish, centre, radius):
    """`shape_of` carries whole matrices; here single variances do, and give the same for independent prisms."""
    aperture = LitAperture(np.array(centre), radius, FOCAL)
    series = surface_series(ArchiveSpan(dish, until=NEW_YEAR + 1.0), aperture)
    rows = read_table(dish, "points", ("point", "x", "y", "z"), where={"night": str(series.night[0])})
    azimuth, elevation, _ = posture(0)
    x = np.column_stack([rows[axis] for axis in "xyz"])
    q = np.broadcast_to(U_PRISM**2 * np.eye(3), (len(x), 3, 3))
    names = tuple(rows["point"].tolist())
    shape = shape_of(Prisms(names, x, q, ground_from_reflector(azimuth, elevation), "night"), aperture)
    [night] = series.surfaces
    assert night.focal_length == pytest.approx(shape.fit.focal_length, abs=1e-8)
    assert night.u_focal_length == pytest.approx(shape.fit.u_focal_length, rel=1e-6)
    assert night.half_path == pytest.approx(shape.fit.half_path, abs=1e-9)
    assert night.u_half_path == pytest.approx(np.sqrt(np.diag(shape.fit.half_path_covariance)), rel=1e-6)
    assert (night.measured, night.noise) == pytest.approx((shape.square.measured, shape.square.noise), rel=1e-2)
    assert night.term == pytest.approx(shape.expansion.value[4:], abs=1e-9)
    assert night.u_term == pytest.approx(np.sqrt(np.diag(shape.expansion.covariance))[4:], rel=1e-6)


def test_the_aperture_of_another_dish_is_refused(dish):
    with pytest.raises(InputError, match="outside the aperture of the site: another dish"):
        surface_series(ArchiveSpan(dish), LitAperture(np.array([0.0, 54.0]), 50.0, FOCAL))


def test_a_dish_with_too_few_prisms_has_no_surface(tmp_path):
    archive = dish_archive(tmp_path / "archive", nights=2, without_pose=(0, 1))
    with pytest.raises(InputError, match="no night has a surface"):
        surface_series(ArchiveSpan(archive), APERTURE)
    with pytest.raises(InputError, match="no night has a pose"):
        point_series(ArchiveSpan(archive), prisms()[0][0], "reflector")


def test_certificates_of_a_night(still):
    found = night_certificates(ArchiveSpan(still), still.nights[5])
    assert len(found.instrument) == 18
    assert set(found.validity) == {Validity.VALID}
    assert found.verdict.word == "good"
    assert found.left[0] == pytest.approx(201.0 - 5.15)


@pytest.mark.parametrize(
    ("day", "validity"),
    [(200, Validity.VALID), (201, Validity.EXPIRED), (-201, Validity.LATER), (-200, Validity.VALID)],
)
def test_the_last_day_itself_is_valid(tmp_path, day, validity):
    archive = written_year(tmp_path / "archive", nights=1, points=5, truth=YearTruth(start=NEW_YEAR + day + 0.99))
    found = night_certificates(ArchiveSpan(archive), "year-000")
    assert set(found.validity) == {validity}
    assert (found.verdict.word == "good") is (validity is Validity.VALID)


def test_nights_come_in_order_of_time(still):
    found = night_rows(ArchiveSpan(still, since=NEW_YEAR + 50.0))
    assert found.count == 70
    assert np.all(np.diff(found.rows["mjd"]) > 0.0)
    assert np.all(found.rows["elevation"] / DEGREE < 90.0)


def test_a_damaged_file_stops_a_question(tmp_path):
    archive = written_year(tmp_path / "archive", nights=4, points=8)
    path = archive.directory / archive.files("nights")[2].path
    flip(path, 100)
    with pytest.raises(InputError, match=path.name):
        point_series(ArchiveSpan(archive), "ZP00003")
