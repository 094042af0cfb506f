"""results.fits of a reduction: standard, exact, the same bytes twice, and read by a reader that is not astropy."""

import csv
import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest
from astropy.io import fits

import catseye.gateways.epoch.objects as objects_module
from catseye.gateways.epoch.record_tests import listed_tests
from catseye.gateways.epoch.results_fits import results_fits
from catseye.gateways.epoch.tables import COORDINATES, RANGES, SURFACE
from catseye.gateways.writers.samplers_fits import read_samplers
from gateways.record_scene import with_checks
from kept_scene import reduction_directory, reduction_of_example

BLOCK, CARD = 2880, 80  # bytes, by the FITS standard
DTYPES = {"D": ">f8", "K": ">i8", "L": "i1", "A": "S"}


@pytest.fixture(scope="module")
def directory():
    return reduction_directory()


@pytest.fixture(scope="module")
def tables(directory):
    return plain_tables((directory / "results.fits").read_bytes())


def plain_tables(content):
    """Columns of each binary table, by a reader of cards and bytes alone."""
    found, at = {}, 0
    while at < len(content):
        cards = {}
        while "END" not in cards:
            block = content[at : at + BLOCK].decode("ascii")
            cards |= {block[k : k + 8].strip(): block[k + 10 : k + CARD] for k in range(0, BLOCK, CARD)}
            at += BLOCK
        value = {name: text.split("/")[0].strip().strip("'").strip() for name, text in cards.items()}
        if value.get("XTENSION") is None and value.get("NAXIS") == "0":
            continue
        fields = []
        for k in range(1, int(value["TFIELDS"]) + 1):
            form = value[f"TFORM{k}"]
            count, kind = int(form[:-1] or 1), form[-1]
            item = f"S{count}" if kind == "A" else (DTYPES[kind], (count,)) if count > 1 else DTYPES[kind]
            fields.append((value[f"TTYPE{k}"], item) if not isinstance(item, tuple) else (value[f"TTYPE{k}"], *item))
        rows = int(value["NAXIS2"])
        layout = np.dtype(fields)
        assert layout.itemsize == int(value["NAXIS1"])
        found[value["EXTNAME"]] = np.frombuffer(content, layout, rows, at), value
        size = layout.itemsize * rows + int(value["PCOUNT"])
        at += -(-size // BLOCK) * BLOCK
    return found


def units_of(header):
    """Unit of each column; "" without."""
    return {header[f"TTYPE{k}"]: header.get(f"TUNIT{k}", "") for k in range(1, int(header["TFIELDS"]) + 1)}


def texts(column):
    return [cell.decode("ascii").rstrip() for cell in column]


def test_astropy_and_its_checksums_accept_it(directory):
    with fits.open(directory / "results.fits", checksum=True) as pages:  # warnings are errors
        pages.verify("exception")
        names = [page.name for page in pages]
        checks = ["RECORDS", "GROUPS", "SCATTER"]
        assert names == [
            "PRIMARY", "POINTS", "RANGES", "SURFACE", "POSE", "ZEROS", *checks, "COVARIANCE", "PROVENANCE",
        ]  # fmt: skip
        header = pages[0].header
    assert (header["CAMPAIGN"], header["TIMESYS"], header["VERDICT"]) == ("night-01", "UTC", "good")
    assert header["DATE-BEG"].startswith("2003-09-07T03:00:29.")
    assert header["MJD-BEG"] < header["MJD-END"] < header["MJD-BEG"] + 0.05
    assert "COVFILE" not in header


def test_points_and_covariance_are_those_of_coordinates_json_to_the_last_bit(directory, tables):
    told = json.loads((directory / "coordinates.json").read_text())
    points, header = tables["POINTS"]
    assert texts(points["POINT"]) == list(told["points"])
    for axis in "xyz":
        assert points[axis.upper()].tolist() == [point[axis] for point in told["points"].values()]
    assert points["SHOTS"].tolist() == [point["shots"] for point in told["points"].values()]
    covariance, _ = tables["COVARIANCE"]
    order = [f"{p} {a}" for p, a in zip(texts(covariance["POINT"]), texts(covariance["AXIS"]), strict=True)]
    assert order == told["covariance_order"]
    assert covariance["COVARIANCE"].tolist() == told["covariance"]
    assert (header["TTYPE3"], header["TUNIT3"]) == ("X", "m")


def test_zeros_and_pose_are_those_of_the_json_files(directory, tables):
    told = json.loads((directory / "coordinates.json").read_text())["ranger_zeros"]
    zeros, _ = tables["ZEROS"]
    assert texts(zeros["RANGER"]) == list(told)
    assert zeros["ZERO"].tolist() == [row["zero"] for row in told.values()]
    assert zeros["U_ZERO"].tolist() == [row["u_zero"] for row in told.values()]
    pose, header = tables["POSE"]
    expected = json.loads((directory / "pose.json").read_text())
    for name in ("pivot", "translation", "rotation", "vertex", "focus", "axis"):
        assert pose[name.upper()][0].tolist() == expected[name]
    assert pose["COVARIANCE"][0].reshape(6, 6).tolist() == expected["covariance"]
    assert float(header["EL"]) == expected["nominal_posture"]["elevation_deg"]


@pytest.mark.parametrize(("name", "table"), [("RANGES", RANGES), ("POINTS", COORDINATES), ("SURFACE", SURFACE)])
def test_every_column_of_a_csv_is_there_unrounded_with_its_unit(directory, tables, name, table):
    stored, header = tables[name]
    units = units_of(header)
    rows = list(csv.DictReader((directory / table.file).read_text(encoding="utf-8").splitlines()))
    assert len(rows) == len(stored)
    for column in table.columns:
        title = column.label.upper()
        if column.name.endswith("_ppm"):
            values, unit = stored[title] * 1e6, ""
        else:
            values, unit = stored[title], column.unit
        assert units[title] == unit
        if values.dtype.kind == "S":
            plain = [row[column.name].isascii() for row in rows]
            assert any(plain)
            assert all(a == row[column.name] for a, row, p in zip(texts(values), rows, plain, strict=True) if p)
            continue
        for value, row in zip(values.tolist(), rows, strict=True):
            cell = row[column.name]
            if not cell:
                assert np.isnan(value)
            else:
                digits = len(cell.partition(".")[2])
                assert value == pytest.approx(float(cell), abs=0.51 * 10.0**-digits, rel=1e-15)


def test_zeros_and_pose_are_in_metres_and_radians(tables):
    assert units_of(tables["ZEROS"][1]) == {"RANGER": "", "ZERO": "m", "U_ZERO": "m"}
    pose = dict.fromkeys(("PIVOT", "TRANSLATION", "VERTEX", "FOCUS"), "m") | {"ROTATION": "rad"}
    assert units_of(tables["POSE"][1]) == pose | {"AXIS": "", "COVARIANCE": ""}
    assert units_of(tables["COVARIANCE"][1])["COVARIANCE"] == "m2"


def test_records_contradictions_and_scatter_are_tables(directory):
    doubted = with_checks(reduction_of_example(), 2)
    coordinates = doubted.coordinates
    found = plain_tables(results_fits(doubted))
    records, header = found["RECORDS"]
    assert texts(records["RECORD"]) == [test.record for test in listed_tests(coordinates)]
    assert texts(records["GROUP"]) == [test.group for test in listed_tests(coordinates)]
    error = np.array([test.error for test in listed_tests(coordinates)])
    np.testing.assert_array_equal(records["ERROR"], error)
    u = [test.u_error if np.isfinite(test.u_error) else np.nan for test in listed_tests(coordinates)]
    np.testing.assert_array_equal(records["U_ERROR"], u)
    assert units_of(header)["UNIT"] == ""
    contradictions, _ = found["CONTRADICTIONS"]
    assert contradictions["CONTRADICTION"].tolist() == [1, 1, 1, 2, 2]
    assert contradictions["RANK"].tolist() == [1, 1, 1, 1, 2]
    assert contradictions["ERROR"].tolist() == [1.0, -0.12, 0.003, 0.92, -0.9]
    groups, _ = found["GROUPS"]
    assert groups["DOF"].tolist() == [36, 18]
    assert groups["PROBABILITY"].tolist() == [3e-67, 0.5062]
    scatter, header = found["SCATTER"]
    assert scatter["SWAY"].tolist() == [0.0, 0.00031]
    assert units_of(header)["SWAY"] == "m"
    assert texts(found["UNMEASURED"][0]["POINT"]) == ["ZEG41099L"]


def test_the_provenance_names_each_input_with_its_hash(directory, tables):
    rows, _ = tables["PROVENANCE"]
    told = json.loads((directory / "provenance.json").read_text())
    kinds, names, values = (texts(rows[title]) for title in ("KIND", "NAME", "VALUE"))
    inputs = {n: v for k, n, v in zip(kinds, names, values, strict=True) if k == "input"}
    assert inputs == told["inputs_sha256"]
    assert dict(zip(names, values, strict=True))["air_model"] == told["settings"]["air_model"]
    content = (directory / "results.fits").read_bytes()
    assert told["outputs"]["results.fits"] == hashlib.sha256(content).hexdigest()


def test_two_writings_have_the_same_bytes(directory):
    assert results_fits(reduction_of_example()) == (directory / "results.fits").read_bytes()


def test_our_reader_gives_the_tables_back(directory):
    tables = read_samplers(directory / "results.fits")
    coordinates = reduction_of_example().coordinates
    np.testing.assert_array_equal(tables["COVARIANCE"].columns["COVARIANCE"].values, coordinates.covariance)
    assert tables["POINTS"].frame == "ground: x east, y north, z up"
    np.testing.assert_array_equal(tables["RANGES"].mjd, reduction_of_example().campaign.shots.mjd_utc)


def test_many_points_leave_the_covariance_to_its_own_file(monkeypatch):
    monkeypatch.setattr(objects_module, "MOST_INSIDE", 100)
    with fits.HDUList.fromstring(results_fits(reduction_of_example())) as pages:
        assert pages[0].header["COVFILE"] == "covariance.fits"
        assert "COVARIANCE" not in pages


def test_a_night_without_a_dish_has_neither_surface_nor_pose():
    without = replace(reduction_of_example(), surface=None)
    names = list(plain_tables(results_fits(without)))
    assert names == ["POINTS", "RANGES", "ZEROS", "RECORDS", "GROUPS", "SCATTER", "COVARIANCE", "PROVENANCE"]
