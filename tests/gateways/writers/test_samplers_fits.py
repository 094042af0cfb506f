"""Tables in the manner of the telescope's samplers: strict FITS, read back bit for bit, nothing half-written."""

import hashlib
import json

import numpy as np
import pytest
from astropy.io import fits

from catseye.errors import InputError
from catseye.gateways.writers.columns import Column, Table
from catseye.gateways.writers.output import PROVENANCE
from catseye.gateways.writers.samplers_fits import (
    SamplerColumn,
    SamplerTable,
    join_samplers,
    join_tables,
    read_samplers,
    sampler_tables,
    write_samplers,
)

MJD = np.array([60000.123456789, 60000.5])


def tables():
    rng = np.random.default_rng(4)
    odd = np.array([np.nextafter(0.1, 1.0), np.nan])
    columns = {
        "X": SamplerColumn("m", odd, "east"),
        "COV": SamplerColumn(
            "m2", rng.standard_normal((2, 3, 3)), "of x, y, z; rows then columns " + "long " * 20 + "end"
        ),
        "SIX": SamplerColumn("", rng.standard_normal((2, 6))),
        "COUNT": SamplerColumn("", np.array([3, -(2**62)])),
        "USED": SamplerColumn("", np.array([True, False])),
        "POINT": SamplerColumn("", ["ZEG41040L", "T1"]),
        "PSD": SamplerColumn("m2 / Hz", np.array([1e-300, 5e-324])),
    }
    told = {"frame": "reflector, at rest", "pivot": "(0, 0, 60) m", "header": {"EPOCHS": 17, "GROUP": "feed arm"}}
    return {
        "ARM": SamplerTable("ARM", columns, MJD, "Places of the feed arm; " * 6 + "end", **told),
        "NONE": SamplerTable("NONE", {"Y": SamplerColumn("rad", np.zeros(0))}, np.zeros(0)),
        "TERMS": SamplerTable("TERMS", {"TERM": SamplerColumn("", ["1", "cosE"])}),
    }


def test_samplers_round_trip_is_exact(tmp_path):
    place, given = tmp_path / "s.fits", tables()
    write_samplers(place, given)
    found = read_samplers(place)
    assert list(found) == list(given)
    for name, table in given.items():
        for attribute in ("name", "comment", "frame", "pivot"):
            assert getattr(found[name], attribute) == getattr(table, attribute)
        assert dict(found[name].header) == dict(table.header)
        assert list(found[name].columns) == list(table.columns)
        if table.mjd is None:
            assert found[name].mjd is None
        else:
            assert np.asarray(found[name].mjd).tobytes() == np.asarray(table.mjd).tobytes()
        for key, column in table.columns.items():
            other = found[name].columns[key]
            assert (other.unit, other.comment) == (column.unit, column.comment)
            one, two = np.asarray(other.values), np.asarray(column.values)
            assert one.shape == two.shape
            assert one.tolist() == two.tolist() if one.dtype.kind == "U" else one.tobytes() == two.tobytes()


def test_astropy_accepts_the_file_and_all_units(tmp_path):
    from astropy.table import Table

    place = tmp_path / "s.fits"
    write_samplers(place, tables())
    with fits.open(place, checksum=True) as pages:
        pages.verify("exception")
        header = pages["ARM"].header
        assert (header["TTYPE1"], header["TUNIT1"]) == ("MJD", "d")
        assert (header["TIMESYS"], header["MJDREF"], header["ORIGIN"]) == ("UTC", 0.0, "catseye")
        assert header["CATSEYE"]
        assert header["FRAME"] == "reflector, at rest"
        assert "TELESCOP" not in header
        assert pages["ARM"].columns["COV"].dim == "(3,3)"
    read = Table.read(place, hdu="ARM")
    assert str(read["PSD"].unit) == "m2 / Hz"
    np.testing.assert_array_equal(read["MJD"], MJD)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"columns": {"T": SamplerColumn("degC", [1.0, 2.0])}}, "use K"),
        ({"columns": {"T": SamplerColumn("metre", [1.0, 2.0])}}, "not in the FITS standard"),
        ({"columns": {"T": SamplerColumn("m", [1.0])}}, "different lengths"),
        ({"columns": {"T": SamplerColumn("", ["µ", "a"])}}, "not printable ASCII"),
        ({"columns": {"T": SamplerColumn("", ["a ", "a"])}}, "ends in a blank"),
        ({"columns": {"T": SamplerColumn("", [1j, 2j])}}, "expected rows of numbers"),
        ({"columns": {"T": SamplerColumn("", np.array([2**63, 1], dtype=np.uint64))}}, "below 2\\^63"),
        ({"columns": {"T": SamplerColumn("m", np.zeros((2, 0)))}}, "rows are empty"),
        ({"columns": {"x": SamplerColumn("m", [1.0, 2.0])}}, "capital letters"),
        ({"columns": {"MJD": SamplerColumn("d", [1.0, 2.0])}}, "expected another name"),
        ({"columns": {}, "mjd": None}, "no column"),
        ({"mjd": MJD + 2400000.5}, "no Julian Date"),
        ({"header": {"TTYPE9": 1}}, "none reserved by FITS"),
        ({"name": "other"}, "expected its name"),
    ],
)
def test_values_invalid_in_fits_are_refused_with_their_place(change, expected):
    given = {"name": "T", "columns": {"X": SamplerColumn("m", [1.0, 2.0])}, "mjd": MJD, **change}
    with pytest.raises(InputError, match=expected):
        sampler_tables({"T": SamplerTable(**given)})
    with pytest.raises(InputError, match="at least one table"):
        sampler_tables({})


def test_foreign_file_is_kept_and_own_file_is_replaced(tmp_path):
    place = tmp_path / "s.fits"
    place.write_bytes(b"SIMPLE  =                    T")
    with pytest.raises(InputError, match="not a catseye file"):
        write_samplers(place, tables())
    assert place.read_bytes() == b"SIMPLE  =                    T"
    place.unlink()
    write_samplers(place, tables())
    before = place.read_bytes()
    with pytest.raises(InputError, match="FITS standard"):
        write_samplers(place, {"T": SamplerTable("T", {"X": SamplerColumn("metre", [1.0])})})
    assert place.read_bytes() == before
    write_samplers(place, {"TERMS": tables()["TERMS"]})
    assert list(read_samplers(place)) == ["TERMS"]
    assert [p.name for p in tmp_path.iterdir()] == ["s.fits"]


def test_damaged_or_foreign_file_is_refused(tmp_path):
    place = tmp_path / "s.fits"
    content = bytearray(sampler_tables(tables()))
    content[2880 * 4 + 40] ^= 1
    at = content.find(np.float64(0.1).byteswap().tobytes()[:3])
    content[at + 4] ^= 1
    place.write_bytes(content)
    with pytest.raises(InputError, match="cannot be read as FITS"):
        read_samplers(place)
    fits.HDUList([fits.PrimaryHDU()]).writeto(tmp_path / "other.fits")
    with pytest.raises(InputError, match="not a samplers file of catseye"):
        read_samplers(tmp_path / "other.fits")
    with pytest.raises(InputError, match="cannot be read"):
        read_samplers(tmp_path / "missing.fits")


def test_the_file_joins_the_provenance_of_its_directory(tmp_path):
    (tmp_path / PROVENANCE).write_text(json.dumps({"format": "f", "outputs": {"a.csv": "0"}}))
    join_samplers(tmp_path, "samplers.fits", tables())
    outputs = json.loads((tmp_path / PROVENANCE).read_text())["outputs"]
    assert outputs == {
        "a.csv": "0",
        "samplers.fits": hashlib.sha256((tmp_path / "samplers.fits").read_bytes()).hexdigest(),
    }


def test_an_outputs_tables_are_in_the_fits_with_the_same_numbers(tmp_path):
    (tmp_path / PROVENANCE).write_text('{"format": "a test", "outputs": {}}')
    (tmp_path / "points-left.csv").write_text(
        "point,x_m,u_x_um,slope_x_urad,m,note\nT1,1.25,3,-4,2,0.3 µm off\nT2,,4,5,-2,\n", encoding="utf-8"
    )
    six = SamplerTable("SIX", {"SHIFT": SamplerColumn("m", np.zeros((1, 3)))})
    units = {"x_m": "m", "u_x_um": "um", "slope_x_urad": "urad"}
    names = ("point", "x_m", "u_x_um", "slope_x_urad", "m", "note")
    points = Table("points-left.csv", "", tuple(Column(name, units.get(name, ""), "", len) for name in names))
    join_tables(tmp_path, [points], frame="ground", pivot="1, 2, 3 m", tables={"SIX": six})
    found = read_samplers(tmp_path / "samplers.fits")
    assert list(found) == ["SIX", "POINTS_LEFT"]
    table = found["POINTS_LEFT"]
    assert (table.frame, table.pivot) == ("ground", "1, 2, 3 m")
    assert [c.unit for c in table.columns.values()] == ["", "m", "um", "urad", "", ""]
    np.testing.assert_array_equal(table.columns["X_M"].values, [1.25, np.nan])
    np.testing.assert_array_equal(table.columns["M"].values, [2.0, -2.0])
    assert [str(v).strip() for v in table.columns["NOTE"].values] == ["0.3 um off", ""]
    told = json.loads((tmp_path / PROVENANCE).read_text())["outputs"]
    assert told["samplers.fits"] == hashlib.sha256((tmp_path / "samplers.fits").read_bytes()).hexdigest()


def test_the_same_tables_give_the_same_bytes_at_any_time(monkeypatch):
    tables = {"AXIS": SamplerTable("AXIS", {"Z": SamplerColumn("m", [48.26, 48.27])}, mjd=[60000.0, 60000.5])}
    first = sampler_tables(tables, header={"CAMPAIGN": "night-01"})
    monkeypatch.setattr("astropy.io.fits.hdu.base._ValidHDU._get_timestamp", lambda _: "2099-01-01T00:00:00")
    assert sampler_tables(tables, header={"CAMPAIGN": "night-01"}) == first
    assert b"2099" not in first
