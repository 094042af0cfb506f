"""Certificates and records of calibrations: nothing lost on the way out and back, nothing that is no number."""

import copy
import dataclasses
import json
import tomllib
from datetime import UTC, date, datetime

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.gateways.calibrations.calibration_certificate import _cell, _form, calibration_subject
from catseye.gateways.calibrations.certificate_record import MARK, QUANTITY, calibration_object, calibration_toml
from catseye.gateways.calibrations.summary import rounded
from catseye.gateways.certificates.page import certificate_html
from catseye.gateways.certificates.rounding import rounded_result
from catseye.gateways.certificates.statement import certificate_document
from catseye.gateways.writers.objects import json_line
from catseye.records.files.reading import read_record
from catseye.records.laboratory.calibration import CalibrationRecord
from catseye.records.laboratory.certificate_job import CertificateRecords
from catseye.records.site.mirror import Mirror
from catseye.reduction.calibrations.kinds import calibrate
from repository import ROOT

EXAMPLES = ROOT / "examples" / "calibrations"
MINE = ("reference-distance", "leakage", "leakage-lit", "linearity", "retroreflector", "amplitude-to-phase")
WHEN = datetime(2026, 9, 2, 10, 0, tzinfo=UTC)


def certificate(calibration, when):
    """Page of a calibration without a laboratory or a job."""
    return certificate_html(certificate_document(calibration_subject(calibration), CertificateRecords(), (), when))


@pytest.fixture(scope="module")
def made():
    """Function kind -> Calibration of the example, rejecting."""
    found = {}

    def of(kind):
        if kind not in found:
            found[kind] = calibrate(kind, EXAMPLES / f"{kind}.csv", reject=True)
        return found[kind]

    return of


@pytest.mark.parametrize("kind", MINE)
def test_a_record_reads_back_as_it_was(made, tmp_path, kind):
    found = made(kind)
    (tmp_path / "r.toml").write_text(calibration_toml(found), encoding="utf-8")
    record = read_record(tmp_path / "r.toml", CalibrationRecord)
    assert [dict(q) for q in record.quantity] == [{key: getattr(q, key) for key in QUANTITY} for q in found.quantities]
    np.testing.assert_array_equal(record.covariance.matrix, found.covariance)
    assert record.record == found.record
    assert record.measured_on == found.provenance["measured_on"] == date(2026, 9, 1)
    assert record.inputs_sha256 == found.provenance["inputs_sha256"]
    assert len(record.readings.rows) == len(found.rows)
    assert [row[-1] for row in record.readings.rows] == [row[-1] for row in found.rows]
    assert [d.name for d in record.decision] == [d.name for d in found.decisions]
    assert record.notes == found.notes


@pytest.mark.parametrize("kind", ["reference-distance", "leakage", "leakage-lit", "linearity", "amplitude-to-phase"])
def test_values_to_copy_fit_the_rangers_record(made, kind):
    sheet = tomllib.loads((EXAMPLES.parent / "night-01" / "mirrors" / "ZP101.toml").read_text(encoding="utf-8"))
    copied = Mirror.model_validate({**sheet, **made(kind).record})
    for key, value in made(kind).record.items():
        assert getattr(copied, key) == (tuple(value) if isinstance(value, list) else value)


@pytest.mark.parametrize("kind", MINE)
def test_json_holds_no_nan_and_every_reading(made, kind):
    said = json.loads(json_line(calibration_object(made(kind))), parse_constant=pytest.fail)
    assert said["format"] == "catseye-calibration-1"
    assert len(said["readings"]) == len(made(kind).rows)
    n = len(said["quantities"])
    assert np.shape(said["covariance"]) == (n, n)
    for k, each in enumerate(said["quantities"].values()):
        assert each["coverage_factor"] >= 2.0
        assert each["high"] - each["value"] == pytest.approx(each["coverage_factor"] * each["u"])
        assert said["covariance"][k][k] == pytest.approx(each["u"] ** 2)


@pytest.mark.parametrize("kind", MINE)
def test_a_page_shows_every_quantity_test_and_line_to_sign(made, kind):
    found = made(kind)
    text = certificate(found, WHEN)
    for q in found.quantities:
        for number in rounded_result(q.value, q.u, q.coverage):
            assert f">{number}</td>" in text
    assert text.count("date, signature") == 3
    assert text.count("<tr>") > len(found.rows)
    assert "http" not in text.replace("http://www.w3.org", "")  # stands alone
    for word in ("2026-09-01", "2026-09-02", "example-103", found.provenance["inputs_sha256"][f"{kind}.csv"]):
        assert word in text
    assert certificate(found, WHEN) == text


def test_certificate_escapes_user_text(made):
    found = made("leakage")
    odd = dataclasses.replace(found, title="<b>", provenance={**found.provenance, "by": '<script>"&'})
    text = certificate(odd, WHEN)
    assert "<script>" not in text
    assert "&lt;script&gt;" in text
    assert tomllib.loads(calibration_toml(odd))["by"] == '<script>"&'


def test_odd_names_survive_toml(made):
    found = made("leakage")
    name = 'two\nlines \\ "quoted" \x7f é'
    odd = dataclasses.replace(found, provenance={**found.provenance, "by": name}, record={name: {"a b": [1.5, 2]}})
    document = tomllib.loads(calibration_toml(odd))
    assert document["by"] == name
    assert document["record"] == {name: {"a b": [1.5, 2]}}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d["covariance"]["matrix"][0].__setitem__(1, 1.0), "is not symmetric"),
        (lambda d: d["covariance"]["matrix"][0].__setitem__(0, 1.0), "does not have the squares of u"),
        (lambda d: d["covariance"]["matrix"].pop(), "is not 2 by 2, as there are 2 quantities"),
        (lambda d: d["covariance"]["order"].reverse(), "(expected ['leakage_amplitude_volt', 'leakage_phase_rad']"),
        (lambda d: d["readings"]["rows"][3].pop(), "readings.rows, row 4 has 7 cells (expected 8)"),
        (lambda d: d.pop("by"), "by is missing"),
        (lambda d: d.__setitem__("format", "catseye-calibration-2"), "the supported versions"),
        (lambda d: d.__setitem__("extra", 1), "extra = 1 is not a known key"),
    ],
)
def test_a_bad_record_is_refused_in_one_line(made, tmp_path, change, said):
    from pydantic import ValidationError

    from catseye.records.files.refusal import explained

    document = tomllib.loads(calibration_toml(made("leakage")))
    bad = copy.deepcopy(document)
    change(bad)
    with pytest.raises(ValidationError) as problem:
        CalibrationRecord.model_validate(bad)
    assert said in explained(problem.value, bad, CalibrationRecord)
    CalibrationRecord.model_validate(document)
    (tmp_path / "bad.toml").write_text(f"{MARK}\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"bad\.toml: "):
        read_record(tmp_path / "bad.toml", CalibrationRecord)


def test_rounding_keeps_two_digits_of_u():
    assert rounded(1.23456, 0.0996) == ("1.23", "0.10")
    assert rounded(1.23456, 0.00123) == ("1.2346", "0.0012")
    assert rounded(12345.6, 9.96) == ("12346", "10")
    assert rounded(1.0, float("nan")) == ("1", "unknown")


def test_lengths_have_the_digits_of_their_residuals():
    assert _cell(24003.09162, _form("distance_mm")) == "24003.09162"
    assert _cell(24.00309162, _form("distance_m")) == "24.0030916"
