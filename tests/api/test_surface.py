"""Surface from Python: the numbers of the command, from nights, files and arrays."""

import csv

import numpy as np
import pytest

import catseye
from catseye.constants import MILLIMETRE
from catseye.errors import ArgumentError, EstimationError, InputError
from catseye.optics.zernike import Term
from surface_scene import NAMES, half_path_of, prisms

ROWS = np.arange(0, len(NAMES), 24)
U_MM = np.random.default_rng(3).uniform(0.02, 0.05, (len(ROWS), 3))


@pytest.fixture(scope="module")
def night():
    return catseye.reduce("night-01")


@pytest.fixture(scope="module")
def written(night, tmp_path_factory):
    return catseye.save(night, tmp_path_factory.mktemp("night") / "out")


@pytest.fixture(scope="module")
def dishes():
    """Three epochs of prisms."""
    return [prisms(half_path_of(Term(2, 2), size), u=3e-5, seed=k, rows=ROWS) for k, size in enumerate((0, 2e-4, 4e-4))]


@pytest.fixture(scope="module")
def tables(dishes, tmp_path_factory):
    """The same as tables, each coordinate with its own u."""
    paths = []
    for k, dish in enumerate(dishes):
        paths.append(tmp_path_factory.mktemp("tables") / f"{k}.csv")
        with paths[-1].open("w", newline="") as stream:
            rows = csv.writer(stream)
            rows.writerow(["point", "x_m", "y_m", "z_m", "u_x_mm", "u_y_mm", "u_z_mm"])
            rows.writerows(
                [name, *x, *u] for name, x, u in zip(dish.names, dish.points.tolist(), U_MM.tolist(), strict=True)
            )
    return paths


def numbers(answer):
    """A result's object without the names of its sources."""
    if isinstance(answer, dict):
        return {key: numbers(value) for key, value in answer.items() if key not in ("source", "sources", "verdict")}
    return [numbers(value) for value in answer] if isinstance(answer, list | tuple) else answer


def assert_same(one, two):
    """Equal to the last bit, nan in the same places."""
    if isinstance(one, dict):
        assert one.keys() == two.keys()
        for key in one:
            assert_same(one[key], two[key])
    elif isinstance(one, list):
        assert len(one) == len(two)
        for left, right in zip(one, two, strict=True):
            assert_same(left, right)
    else:
        np.testing.assert_array_equal(one, two)


def test_a_night_and_what_it_wrote_give_one_surface(night, written):
    first, second = catseye.surface(night, site="night-01"), catseye.surface(written, site="night-01")
    np.testing.assert_allclose(first.deviations, second.deviations, rtol=0, atol=1e-9)
    assert first.covariance.shape == (60, 60)
    assert first.u_focal_length > 0.0
    held = catseye.surface(night, site="night-01", free=("vertex", "axis"))
    assert held.u_focal_length == 0.0
    assert "focal length held" in held.verdict.why
    assert set(first.tables()) == {"prisms", "zernike"}
    moved = catseye.surface(night, site="gbt", actuators=True)
    assert len(moved.to_table("actuators")) > 2000
    with pytest.raises(InputError, match="needs an epoch"):
        catseye.surface()


def test_a_surface_s_columns_are_in_their_units(night):
    surface = catseye.surface(night)
    prisms, told = surface.to_table("prisms"), surface.to_object()["deviations"]
    for column in ("deviation", "u_deviation", "half_path"):
        assert prisms[column].to_value("m").tolist() == pytest.approx([told[n][column] for n in prisms["point"]])
    terms = surface.found.shapes[-1].expansion
    zernike = surface.to_table("zernike")
    assert zernike["value"].to_value("m") == pytest.approx(terms.value)
    assert zernike["u"].to_value("m") == pytest.approx(np.sqrt(np.diag(terms.covariance)))


def test_arrays_give_what_the_same_table_gives(dishes, tables):
    one = catseye.surface(tables[1], frequency_ghz=86)
    two = catseye.surface(points=dishes[1].points, u=U_MM * MILLIMETRE, names=dishes[1].names, frequency_ghz=86)
    assert_same(numbers(two.to_object()), numbers(one.to_object()))
    assert two.verdict == one.verdict._replace(why=one.verdict.why.replace(str(tables[1]), "points"))
    assert two.names == dishes[1].names
    assert two.inputs() == {}


def test_arrays_of_several_epochs_give_a_change_and_a_look_up_table(dishes, tables):
    options = {"elevation_deg": (10.0, 40.0, 70.0), "temperature_c": (5.0, 6.0, 7.0)}
    points = np.array([dish.points for dish in dishes])
    given = {"u": U_MM * MILLIMETRE, "names": dishes[0].names}
    for count in (2, 3):
        some = {name: values[:count] for name, values in options.items()}
        one, two = catseye.surface(*tables[:count], **some), catseye.surface(points=points[:count], **given, **some)
        assert_same(numbers(two.to_object()), numbers(one.to_object()))
        assert (two.found.change is None, two.found.lookup is None) == (count != 2, count != 3)


def test_a_covariance_of_all_points_is_that_of_each_where_they_are_independent(dishes):
    x, n = dishes[1].points, len(ROWS)
    blocks = np.einsum("ni,ij->nij", (U_MM * MILLIMETRE) ** 2, np.eye(3))
    full = np.einsum("nm,nij->nimj", np.eye(n), blocks).reshape(3 * n, 3 * n)
    one, two = (catseye.surface(points=x, covariance=q) for q in (blocks, full))
    np.testing.assert_allclose(two.u, one.u, rtol=1e-9)
    np.testing.assert_array_equal(two.deviations, one.deviations)
    assert one.names[:2] == ("P1", "P2")


def test_a_missing_prism_is_left_out(dishes):
    holed = dishes[1].points.copy()
    holed[4, 1] = np.nan
    found = catseye.surface(points=holed, u=5e-5, names=dishes[1].names)
    rest = np.delete(np.arange(len(ROWS)), 4)
    again = catseye.surface(points=holed[rest], u=5e-5, names=[dishes[1].names[k] for k in rest])
    assert found.names == again.names
    np.testing.assert_array_equal(found.deviations, again.deviations)
    np.testing.assert_array_equal(found.u, again.u)


def test_units_of_arrays_are_converted(dishes):
    from astropy import units

    plain = catseye.surface(points=dishes[1].points, u=5e-5)
    found = catseye.surface(points=dishes[1].points * units.m, u=0.05 * units.mm)
    np.testing.assert_allclose(found.u, plain.u, rtol=1e-12)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, "either u or covariance"),
        ({"u": 1e-4, "covariance": np.eye(3)}, "either u or covariance"),
        ({"u": np.ones(4)}, r"u of shape \(4,\)"),
        ({"u": -1e-4, "names": ["A"]}, "1 names"),
        ({"u": 1e-4, "names": ["A"] * len(ROWS)}, "'A' twice"),
        ({"u": 0.0}, "variances above 0"),
        ({"u": 1e-4, "frame": "ground"}, "azimuth_deg and elevation_deg"),
        ({"u": 1e-4, "elevation_deg": (1.0, 2.0)}, "elevation_deg has 2 values for 1 epochs"),
        ({"u": 1e-4, "free": ("focus",)}, "free = 'focus'"),
        ({"u": 1e-4, "order": "fringe"}, "order = 'fringe'"),
        ({"u": 1e-4, "taper_db": -1}, "taper_db = -1"),
        ({"u": 1e-4, "zernike": 0}, "zernike = 0"),
        ({"u": 1e-4, "frequency_ghz": np.nan}, "frequency_ghz = nan"),
        ({"u": 1e-4, "azimuth_deg": 541}, "azimuth_deg = 541"),
        ({"u": 1e-4, "positions": "p.csv"}, "positions p.csv: goes with actuators only"),
    ],
)
def test_arguments_that_cannot_be_are_named(dishes, options, said):
    with pytest.raises(InputError, match=said):
        catseye.surface(points=dishes[1].points, **options)


def test_points_and_inputs_exclude_each_other(dishes, tables):
    with pytest.raises(ArgumentError, match="points stand alone"):
        catseye.surface(tables[0], points=dishes[0].points, u=1e-4)
    with pytest.raises(InputError, match=r"shape \(4, 2\)"):
        catseye.surface(points=np.zeros((4, 2)), u=1e-4)
    with pytest.raises(InputError, match="looks like mm"):
        catseye.surface(points=1e3 * dishes[0].points, u=1e-4)
    with pytest.raises(EstimationError, match="points: "):
        catseye.surface(points=dishes[0].points[:3], u=1e-4)


def test_the_table_of_actuators_is_a_method(dishes, tmp_path):
    found = catseye.surface(points=dishes[1].points, u=5e-5, names=dishes[1].names, actuators=True)
    path = found.save_actuators(tmp_path / "actuators.csv")
    assert len(path.read_text().splitlines()) == 1 + len(found.to_table("actuators"))
    with pytest.raises(InputError, match=r"ends in '.txt'"):
        found.save_actuators(tmp_path / "actuators.txt")
    with pytest.raises(InputError, match="no actuator corrections"):
        catseye.surface(points=dishes[1].points, u=5e-5).save_actuators(tmp_path / "a.csv")
    assert len(found.rows()) == 1 + len(found.to_table("zernike"))
