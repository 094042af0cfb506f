"""Records of a certificate: the examples load, what is wrong is told in one line."""

import pytest

from catseye.errors import InputError
from catseye.records.laboratory.certificate_job import read_certificate_records
from repository import ROOT

EXAMPLES = ROOT / "examples" / "certificates"
LAB, JOB = EXAMPLES / "laboratory.toml", EXAMPLES / "linearity-job.toml"
LABORATORY, ORDER = 'format = "catseye-laboratory-1"\nname = "L"\n', 'format = "catseye-job-1"\n'


def test_the_examples_load_with_their_logo():
    records = read_certificate_records(LAB, JOB)
    assert records.number == "EX-2026-0143"
    assert records.logo == (EXAMPLES / "logo.svg").read_bytes()
    assert records.read == (LAB, EXAMPLES / "logo.svg", JOB)
    assert [each.expired(records.job.issued_on) for each in records.job.reference] == [False, False]
    assert records.job.reference[0].expired(records.job.reference[0].valid_until.replace(year=2028))


def test_nothing_given_is_nothing_stated():
    records = read_certificate_records(None, None)
    assert (records.laboratory, records.number, records.logo, records.read) == (None, None, b"", ())
    assert read_certificate_records(None, JOB).number == "2026-0143"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name = 7", "name = 7"),
        ('logo = "../logo.svg"', "is not a PNG or SVG file beside the record"),
        ('logo = "logo.jpg"', "is not a PNG or SVG file beside the record"),
        ('logo = "none.png"', "none.png: missing"),
        ('logo = "text.png"', "text.png: is not a PNG picture"),
        ('logo = "text.svg"', "text.svg: is not an SVG picture"),
        ('logo = "large.png"', "expected a logo of at most 1000000"),
        ('address = ["a\\u0007b"]', "control character"),
        ('contact = [" "]', "an empty text"),
        ('colour = "red"', "colour"),
        ("[[signatory]]\nname = 'A'", "role is missing"),
    ],
)
def test_a_wrong_laboratory_is_one_line(tmp_path, text, said):
    (tmp_path / "text.png").write_text("not a picture")
    (tmp_path / "text.svg").write_text("not a picture")
    (tmp_path / "large.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(1_000_001))
    head = "format = 'catseye-laboratory-1'\n" if text.startswith("name") else LABORATORY
    (tmp_path / "lab.toml").write_text(f"{head}{text}\n", encoding="utf-8")
    with pytest.raises(InputError) as problem:
        read_certificate_records(tmp_path / "lab.toml", None)
    assert said in str(problem.value)
    assert len(str(problem.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("format = 'catseye-job-2'", "the supported versions"),
        ("[environment]\ntemperature_c = [21.0, 20.0]", "is not the lowest and the highest value"),
        ("[environment]\nhumidity_percent = [20.0, 120.0]", "expected 0 to 100, in order"),
        ("[[specification]]\nkey = 'x'\nlower = 1.0", "decision_rule is missing"),
        ("decision_rule = 'generous'", "decision_rule = 'generous'"),
        ("decision_rule = 'simple-acceptance'\n[[specification]]\nkey = 'x'", "lower and upper are missing"),
        ("decision_rule = 'simple-acceptance'\n[[specification]]\nkey = 'x'\nlower = 2.0\nupper = 1.0", "is not below"),
        (
            "decision_rule = 'simple-acceptance'\n" + "[[specification]]\nkey = 'x'\nlower = 1.0\n" * 2,
            "stands twice",
        ),
        ("issued_on = '2026-09-04'", "issued_on"),
    ],
)
def test_a_wrong_job_is_one_line(tmp_path, text, said):
    (tmp_path / "job.toml").write_text(f"{'' if 'format' in text else ORDER}{text}\n", encoding="utf-8")
    with pytest.raises(InputError) as problem:
        read_certificate_records(None, tmp_path / "job.toml")
    assert said in str(problem.value)
    assert len(str(problem.value).splitlines()) == 1


def test_line_ends_in_a_text_become_spaces(tmp_path):
    (tmp_path / "job.toml").write_text(f'{ORDER}remarks = """two\n   lines"""\n', encoding="utf-8")
    assert read_certificate_records(None, tmp_path / "job.toml").job.remarks == "two lines"
