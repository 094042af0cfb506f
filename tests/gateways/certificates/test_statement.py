"""Certificates as documents: what ISO/IEC 17025 7.8 asks for is there, and what nobody stated is not invented."""

import dataclasses
from datetime import date

import pytest

import catseye
from catseye.gateways.calibrations.calibration_certificate import calibration_subject
from catseye.gateways.calibrations.field_certificate import report_subject
from catseye.gateways.certificates.document import NOT_STATED, CellTable, Facts, Paragraph
from catseye.gateways.certificates.page import certificate_html
from catseye.gateways.certificates.statement import certificate_document
from catseye.records.laboratory.certificate_job import CertificateRecords, Specification
from catseye.reduction.calibrations.conformity import conformities
from repository import ROOT


def blocks_of(document, kind):
    chapters = (document.results, *document.chapters)
    return [block for chapter in chapters for block in chapter.blocks if isinstance(block, kind)]


def grid(document, heading):
    [found] = [block for block in blocks_of(document, CellTable) if block.columns[0] == heading]
    return found


def test_everything_that_was_stated_is_there(certified, document):
    facts = dict(document.facts.rows)
    assert document.heading == "Certificate of calibration EX-2026-0143"
    assert document.issued_on.isoformat() == facts["issued on"] == "2026-09-04"
    assert facts["customer"] == "Example Observatory; 2 Dish Road; Green Valley"
    assert (facts["instrument"], facts["serial number"]) == ("ZP103", "example-103")
    assert (facts["received on"], facts["measured on"]) == ("2026-08-30", "2026-09-01")
    assert "valid until (agreed)" not in facts  # 7.8.4.3: no interval unless the customer agreed to it
    assert document.letterhead.logo.startswith(b"<svg")
    assert document.signatures == (("measured by", "A. Example"), ("head of the laboratory", "B. Example"))
    environment = grid(document, "environment during the work")
    assert environment.rows[0] == ("temperature", "20.2", "20.6", "0.1", "°C", "job")
    standards = grid(document, "standard")
    assert standards.rows[0][:3] == ("laser interferometer", "I-7", "R-2025-118")
    assert NOT_STATED not in "".join("".join(row) for row in standards.rows)
    raw = dict(grid(document, "raw data").rows)
    assert raw == certified.calibration.provenance["inputs_sha256"]
    assert [row[-2] for row in document.results.blocks[0].rows][:3] == ["pass", "conditional pass", "–"]
    decided = [row for block in blocks_of(document, CellTable) if "guard band" in block.columns for row in block.rows]
    assert decided[0][:5] == ("zero_mm", "-0.1", "0.1", "mm", "0.018")
    assert decided[1][5:7] == ("0.9462", "conditional pass")


def test_what_nobody_stated_is_printed_so(document_of):
    found = catseye.calibrate("leakage", "calibrations/leakage.csv")
    document = document_of(found)
    facts = dict(document.facts.rows)
    for name in (
        "certificate number",
        "customer",
        "contact",
        "order",
        "procedure",
        "place",
        "condition",
        "received on",
    ):
        assert facts[name] == NOT_STATED
    assert document.letterhead.name == "Laboratory: not stated"
    assert (document.number, document.number_mark) == (None, "")
    assert [row[1:3] for row in grid(document, "environment during the work").rows] == [(NOT_STATED, NOT_STATED)] * 3
    assert Facts((("traceability", NOT_STATED),)) in blocks_of(document, Facts)
    assert any("No decision rule was agreed" in block.text for block in blocks_of(document, Paragraph))
    assert document.issued_on.isoformat() == "2026-09-30"
    assert [name for _, name in document.signatures] == [""] * 3


def test_the_readings_own_weather_is_the_environment_where_the_job_has_none(document_of):
    document = document_of(catseye.calibrate("linearity", "calibrations/linearity.csv"))
    assert grid(document, "environment during the work").rows[0] == (
        "temperature", "20.4", "20.4", "0.1", "°C", "readings and sheet"
    )  # fmt: skip


def test_a_budget_on_the_certificate_adds_up_as_printed(certified, document):
    budgets = [block for block in blocks_of(document, CellTable) if block.columns[0] == "contribution"]
    assert len(budgets) == len(certified.keys)
    for block in budgets[:2]:
        parts = [float(row[7]) for row in block.rows if "·" not in row[7]]
        assert sum(p**2 for p in parts[:-1]) ** 0.5 == pytest.approx(parts[-1], rel=1e-3)  # four digits are printed


def test_an_expired_standard_is_named_so(certified, when):
    job = certified.issue.records.job
    old = job.reference[0].model_copy(update={"valid_until": date(2026, 8, 31)})
    records = dataclasses.replace(certified.issue.records, job=job.model_copy(update={"reference": (old,)}))
    document = certificate_document(calibration_subject(certified.calibration), records, (), when)
    assert grid(document, "standard").rows[0][5] == "2026-08-31, before the measurement"


def test_one_content_has_one_mark_and_another_has_another(certified, document_of):
    one, two = document_of(certified), document_of(certified)
    assert one.content_mark == two.content_mark
    other = dataclasses.replace(one, subject="another")
    assert (other.number_mark, other.content_mark != one.content_mark) == (one.number_mark, True)


@pytest.mark.parametrize(("kind", "record"), [("monument", "monuments/ZY3.toml"), ("mirror", "mirrors/ZP3.toml")])
def test_a_record_without_uncertainties_says_so(kind, record, when):
    found = catseye.certificate(kind, record)
    document = certificate_document(report_subject(found.report), CertificateRecords(), (), when)
    assert {row[2] for row in document.results.blocks[0].rows} == {NOT_STATED}
    assert len(document.results.blocks[0].rows) == len(found.report.quantities)


@pytest.mark.parametrize(
    ("kind", "record", "keys"),
    [
        ("monument", "monuments/ZY101.toml", {"u_alpha1_rad": 2e-6, "u_alpha2_rad": 3e-6, "u_alpha3_rad": 5e-6}),
        ("mirror", "mirrors/ZP101.toml", {"u_beta_rad": 2e-5}),
    ],
)
def test_direction_cosines_have_the_budget_of_their_angles(tmp_path, kind, record, keys):
    text = (ROOT / "examples" / "night-01" / record).read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.partition(" =")[0] not in keys]
    stated = [f"{key} = {u}" for key, u in keys.items()]
    (tmp_path / "r.toml").write_text("\n".join([*stated, *lines]), encoding="utf-8")
    quantities = {q.key: q for q in catseye.certificate(kind, tmp_path / "r.toml").report.quantities}
    for q in quantities.values():
        if q.u > 0.0:
            assert sum(row.part**2 for row in q.budget) == pytest.approx(q.u**2, rel=1e-7)
    if kind == "monument":  # by hand: element 33 is -sin alpha3 cos alpha2, and both angles are small
        [only] = quantities["gamma_33"].budget
        assert (only.source, only.part) == ("alpha3_rad", pytest.approx(5e-6, rel=1e-6))
    else:
        assert {row.source for key in ("lambda_13", "lambda_23") for row in quantities[key].budget} == {
            "beta1_rad", "beta2_rad"
        }  # fmt: skip


def test_a_page_escapes_every_text(hostile):
    text = certificate_html(hostile)
    assert "<script" not in text
    assert "&lt;script&gt;" in text
    foot = text[text.index("@bottom-left") : text.index("@bottom-right")]
    assert "\\00003cscript\\00003e" in foot  # in CSS by numbers
    assert "<" not in foot


def test_a_page_prints_with_numbers_and_without_a_column_cut_off(document):
    text = certificate_html(document)
    assert 'content: "page " counter(page) " of " counter(pages)' in text
    assert "td.w { min-width: 0; }" in text
    assert "thead { display: table-header-group; }" in text


@pytest.mark.parametrize(
    ("limits", "word", "why"),
    [
        ((-9.0, 9.0), "good", ""),
        ((0.02, 9.0), "doubtful", "zero_mm conditional"),
        ((1.0, 9.0), "failed", "zero_mm fail"),
    ],
)
def test_first_page_is_no_better_than_the_statements_of_conformity(certified, when, limits, word, why):
    """Its own tests pass; the item lies within, near or outside its limits."""
    zero = Specification(key="zero_mm", lower=limits[0], upper=limits[1])
    job = certified.issue.records.job.model_copy(update={"specification": (zero,)})
    judged = conformities(certified.calibration.quantities, job)
    subject = calibration_subject(certified.calibration)
    verdict = certificate_document(subject, certified.issue.records, judged, when).verdict
    assert (subject.verdict.word, verdict.word) == ("good", word)
    assert why in verdict.why
