"""Scene of a certificate with laboratory and job, as it is meant and with hostile texts in its records."""

import dataclasses
from datetime import UTC, datetime

import pytest

import catseye
from catseye.gateways.calibrations.calibration_certificate import calibration_subject
from catseye.gateways.certificates.statement import certificate_document
from catseye.records.laboratory.certificate_job import CertificateJob, CertificateRecords, LaboratoryRecord
from repository import ROOT

EXAMPLES = ROOT / "examples" / "certificates"
WHEN = datetime(2026, 9, 30, 23, 0, tzinfo=UTC)
HOSTILE = ('<script>alert(1)</script> & "q" --> #panic("x") $x$ *b* \\u{1} ]] [', "W" * 300, "−–ẑ x̂ α₁ π θ ° ± ²")


@pytest.fixture(scope="session")
def when():
    return WHEN


@pytest.fixture(scope="session")
def certified():
    """Linearity with the laboratory and the job of the examples."""
    return catseye.calibrate(
        "linearity",
        "calibrations/linearity.csv",
        laboratory=EXAMPLES / "laboratory.toml",
        job=EXAMPLES / "linearity-job.toml",
    )


@pytest.fixture(scope="session")
def document_of():
    """Function of a calibration's result -> document of its certificate."""

    def made(result):
        subject = calibration_subject(result.calibration)
        return certificate_document(subject, result.issue.records, result.issue.conformities, WHEN)

    return made


@pytest.fixture(scope="session")
def document(certified, document_of):
    return document_of(certified)


@pytest.fixture(scope="session")
def hostile_texts():
    """Markup of every kind, a very long word, and signs that a font may lack."""
    return HOSTILE


@pytest.fixture(scope="session")
def hostile(certified):
    """The certificate with markup of every kind and very long words in its records."""
    markup, long, signs = HOSTILE
    laboratory = LaboratoryRecord(
        format="catseye-laboratory-1", name=markup, address=[long, signs], accreditation=long,
        signatory=[{"name": markup, "role": long}],
    )  # fmt: skip
    job = CertificateJob(
        format="catseye-job-1", number=markup, procedure=long, place=signs, condition=markup,
        customer={"name": long, "address": [markup]},
        reference=[{"name": markup, "traceability": long, "laboratory": signs}],
    )  # fmt: skip
    subject = dataclasses.replace(calibration_subject(certified.calibration), title=markup)
    return certificate_document(subject, CertificateRecords(laboratory, b"", job), (), WHEN)
