"""jitter.csv: how far bodies of the telescope shook; a campaign without it reads as before."""

import shutil

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.records.night.campaign import read_campaign
from catseye.records.night.jitter import JitterRow, jitter_table
from repository import ROOT

NIGHT = ROOT / "examples" / "night-01"
START = 52889.125


@pytest.fixture
def folder(tmp_path):
    shutil.copytree(NIGHT, tmp_path / "night")
    return tmp_path / "night"


def read_with(folder, *rows, head="mjd_utc,body,u_mm"):
    (folder / "jitter.csv").write_text("\n".join([head, *rows]) + "\n")
    return read_campaign(folder)


def test_it_is_linear_between_rows_and_the_same_beyond():
    rows = [JitterRow(mjd_utc=START + t, body="arm", u_mm=u) for t, u in ((0.1, 0.2), (0.2, 0.6))]
    rows.insert(1, JitterRow(mjd_utc=START + 0.05, body="dish", u_mm=0.03))
    table = jitter_table(rows)
    found = table.mm(START + np.array([0.0, 0.1, 0.125, 0.15, 0.3]))
    np.testing.assert_allclose(found["arm"], [0.2, 0.2, 0.3, 0.4, 0.6], atol=1e-9)
    np.testing.assert_array_equal(found["dish"], np.full(5, 0.03))
    assert set(found) == {"arm", "dish"}


def test_a_file_with_a_header_alone_is_as_none(folder):
    assert read_campaign(folder).jitter is None
    assert read_with(folder).jitter is None
    assert read_with(folder, f"{START},arm,0.25").jitter.mm(START)["arm"] == 0.25


@pytest.mark.parametrize(
    ("rows", "refusal"),
    [
        (
            (f"{START},arm,0.2", f"{START},arm,0.3"),
            r"row 2, mjd_utc = 52889.125 is not after 52889.125, the last of the",
        ),
        ((f"{START},feed,0.2",), r"row 1, body"),
        ((f"{START},arm,-0.2",), r"row 1, u_mm = -0.2"),
        ((f"{START},arm,200",), r"row 1, u_mm = 200"),
        ((f"{START},arm,",), r"row 1, u_mm"),
        (("2452889.6,arm,0.2",), r"row 1, mjd_utc"),
    ],
)
def test_a_bad_row_is_refused_by_its_number(folder, rows, refusal):
    with pytest.raises(InputError, match=rf"^jitter\.csv.*{refusal}"):
        read_with(folder, *rows)
