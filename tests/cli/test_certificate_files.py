"""--certificate, --laboratory and --job as programs call them: PDF and page, numbers used once, whole or not at all."""

import sys

import pytest

from repository import ROOT

EXAMPLES = ROOT / "examples" / "certificates"
RECORDS = ("--laboratory", EXAMPLES / "laboratory.toml", "--job", EXAMPLES / "linearity-job.toml")
LINEARITY = ("calibrate", "linearity", "calibrations/linearity.csv", "--quiet")


def needs_typst():
    pytest.importorskip("typst", reason="typst is not installed: the extra catseye[pdf]")


def test_a_certificate_is_a_pdf_or_a_page_of_the_same_content(catseye, tmp_path):
    needs_typst()
    pdf, page = tmp_path / "c.pdf", tmp_path / "c.html"
    for path in (pdf, page, pdf):  # the third writes the same bytes over the first
        before = pdf.read_bytes() if pdf.exists() else b""
        assert catseye(*LINEARITY, *RECORDS, "--certificate", path) == (0, "", "")
    assert pdf.read_bytes() == before
    assert "EX-2026-0143" in page.read_text(encoding="utf-8")


def test_a_number_is_used_once(catseye, tmp_path):
    first, other = tmp_path / "first.html", tmp_path / "other.html"
    assert catseye(*LINEARITY, *RECORDS, "--certificate", first)[0] == 0
    before = first.read_bytes()
    leakage = ("calibrate", "leakage", "calibrations/leakage.csv", "--quiet")
    (tmp_path / "job.toml").write_text('format = "catseye-job-1"\nnumber = "EX-2026-0143"\n', encoding="utf-8")
    for path in (other, first):
        record = tmp_path / "r.toml"
        arguments = (*leakage, "--job", tmp_path / "job.toml", "--certificate", path, "--write", record)
        status, out, err = catseye(*arguments)
        assert (status, out) == (1, "")
        assert "number 'EX-2026-0143' stands in first.html already (expected a new number" in err
        assert len(err.splitlines()) == 1
    assert first.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["first.html", "job.toml"]


def test_a_number_is_used_once_among_directories_of_results(tmp_path):
    import catseye
    from catseye.errors import InputError

    job = tmp_path / "job.toml"
    job.write_text('format = "catseye-job-1"\nnumber = "7"\nissued_on = 2026-09-04\n', encoding="utf-8")
    one = catseye.calibrate("leakage", "calibrations/leakage.csv", job=job)
    catseye.save(one, tmp_path / "one")
    catseye.save(one, tmp_path / "one")  # the same again
    other = catseye.calibrate("repeatability", "calibrations/repeatability.csv", job=job)
    with pytest.raises(InputError, match=r"number '7' stands in one/certificate\.html already"):
        catseye.save(other, tmp_path / "two")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["job.toml", "one"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--certificate", "c.png"), "certificate c.png: a certificate is PDF or HTML"),
        (("--certificate", "c"), "a certificate is PDF or HTML"),
        (("--certificate", "c.html", "--laboratory", "no.toml"), "no.toml: missing"),
        (("--certificate", "c.html", "--job", EXAMPLES / "laboratory.toml"), "laboratory.toml: format = "),
        (("--certificate", "job.toml", "--job", "job.toml"), "certificate job.toml: is an input"),
        (
            ("--certificate", "c.html", "--job", "job.toml"),
            "job.toml: specification[0].key = 'd0_mm' is not a quantity",
        ),
    ],
)
def test_what_cannot_be_done_is_one_line_and_writes_nothing(catseye, tmp_path, monkeypatch, options, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "job.toml").write_text(
        'format = "catseye-job-1"\ndecision_rule = "simple-acceptance"\n[[specification]]\nkey = "d0_mm"\nlower = 0.0\n'
    )
    status, out, err = catseye(*LINEARITY, *options)
    assert (status, out) == (1, "")
    assert said in err
    assert len(err.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["job.toml"]


def test_without_typst_a_pdf_is_refused_and_the_record_is_not_written(catseye, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "typst", None)
    status, out, err = catseye(*LINEARITY, "--certificate", tmp_path / "c.pdf", "--write", tmp_path / "r.toml")
    assert (status, out) == (1, "")
    assert 'pip install "catseye[pdf]"' in err
    assert not list(tmp_path.iterdir())


def test_conformity_is_told(catseye, tmp_path):
    status, out, _ = catseye(*LINEARITY[:3], *RECORDS)
    assert status == 0
    assert "scale_ppm: conditional pass; limits -4 to 4 ppm, probability of conformity 0.9462" in " ".join(out.split())


@pytest.mark.parametrize(
    ("kind", "record"), [("monument", "night-01/monuments/ZY101.toml"), ("mirror", "mirrors/ZP3.toml")]
)
def test_a_record_has_a_certificate_beside_its_form(catseye, tmp_path, kind, record):
    form, page = tmp_path / "form.html", tmp_path / "certificate.html"
    laboratory = ("--laboratory", EXAMPLES / "laboratory.toml")
    assert catseye("certificate", kind, record, "--out", form, "--certificate", page, *laboratory, "--quiet")[0] == 0
    text = page.read_text(encoding="utf-8")
    for word in ("Example Length Laboratory", "Certificate of calibration", "Uncertainty budgets", "SHA-256"):
        assert word in text
    status, out, err = catseye("certificate", kind, "--blank", "--certificate", tmp_path / "blank.html")
    assert (status, out) == (1, "")
    assert "a blank form has no results" in err
    assert not (tmp_path / "blank.html").exists()


def test_a_triplet_has_a_certificate_one_sheet_at_a_time(catseye, tmp_path):
    page = tmp_path / "tr.html"
    options = ("--certificate", page, "--laboratory", EXAMPLES / "laboratory.toml", "--quiet")
    assert catseye("triplet", "triplets/TR01.toml", *options) == (0, "", "")
    text = page.read_text(encoding="utf-8")
    for word in ("h_corr_mm", "l_mpbc_mm", "difference_mm", "index ratio", "0.15 mm", "Example Length Laboratory"):
        assert word in text
    both = ("triplet", "triplets/TR01.toml", "triplets/TR02.toml")
    status, _, err = catseye(*both, *options)
    assert status == 2
    assert "--laboratory and --job are of one certificate" in err
    status, _, err = catseye(*both, "--certificate", tmp_path / "new.html", "--quiet")
    assert status == 1
    assert "2 sheets were read (expected one" in err
    assert [path.name for path in tmp_path.iterdir()] == ["tr.html"]


def test_a_baseline_has_a_certificate_beside_its_record(catseye, tmp_path):
    page, record = tmp_path / "b.html", tmp_path / "b.toml"
    read = ("baselines/busselton/ts30-baseline-observations.csv", "--heights", "baselines/busselton/pillar-heights.csv")
    options = ("--certificate", page, "--write", record, "--serial", "S-7", "--measured-on", "2021-03-01", "--quiet")
    (tmp_path / "job.toml").write_text(
        'format = "catseye-job-1"\ndecision_rule = "simple-acceptance"\n'
        '[[specification]]\nkey = "zero_mm"\nlower = -1.0\nupper = 1.0\n',
        encoding="utf-8",
    )
    assert catseye("baseline", *read, *options, "--job", tmp_path / "job.toml") == (0, "", "")
    text = page.read_text(encoding="utf-8").replace("<wbr>", "")  # where a long word may break
    for word in ("S-7", "2021-03-01", "scatter of the sets", "x_6_m", "ts30-baseline-observations.csv", ">pass<"):
        assert word in text
    assert record.exists()
