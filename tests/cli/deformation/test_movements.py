"""`catseye movements`: example, JSON, files, refusals."""

import json

import pytest

from catseye.records.files.examples import example

TABLES = ("before", "after", "points")


def words(place="movements"):
    return ["movements", f"{place}/before.csv", f"{place}/after.csv", "--points", f"{place}/points.csv"]


def test_the_example_is_good_with_its_constraints_and_writes_its_files(catseye, tmp_path):
    out = tmp_path / "out"
    more = ["--constraints", "movements/constraints.toml", "--air-ppm", 0.5]
    status, said, err = catseye(*words(), *more, "--out", out)
    assert (status, err) == (0, "")
    assert "plane weldments holds" in said
    files = (
        "changes.csv constraints.csv elevation.svg movements.csv movements.json plan.svg provenance.json report.html"
    )
    assert sorted(path.name for path in out.iterdir()) == files.split()
    found = json.loads(catseye(*words(), *more, "--json")[1])
    saved = json.loads((out / "movements.json").read_text())
    assert found == saved
    assert len(found["covariance"]) == 3 * len(found["names"])
    assert found["constraints"][1]["verdict"] == "holds"


def test_without_constraints_a_point_is_undetermined_and_strict_is_1(catseye):
    status, said, err = catseye(*words(), "--strict")
    assert status == 1
    assert "FA4" in err
    assert "undetermined" in said


@pytest.mark.parametrize(
    ("table", "old", "new", "complaint"),
    [
        ("after", "ZY101,FA1", "ZY101,FAX", "to = 'FAX' is not a point (expected perhaps 'FA"),
        ("before", "ZY103,FA1", "ZY101,FA1", "line 3, 'ZY101' to 'FA1' occurs twice (expected each once)"),
        ("before", "ZY101,FA1", "FA2,FA1", "'FA2' is both station and target"),
        ("points", "FA1,", "FA9,", "to = 'FA1' is not a point"),
    ],
)
def test_spoilt_tables_are_refused_in_one_line(catseye, tmp_path, table, old, new, complaint):
    for name in TABLES:
        text = example(f"movements/{name}.csv").read_text()
        assert name != table or old in text
        (tmp_path / f"{name}.csv").write_text(text.replace(old, new, 1) if name == table else text)
    if new == "FA2,FA1":  # in both epochs, or the line is no common one
        (tmp_path / "after.csv").write_text((tmp_path / "after.csv").read_text().replace(old, new, 1))
    status, out, err = catseye(*words(tmp_path))
    assert (status, out) == (1, "")
    assert complaint in err
    assert err.count("\n") == 1


def test_lines_of_one_epoch_are_named_and_epochs_without_a_common_line_refused(catseye, tmp_path):
    for name in TABLES:
        (tmp_path / f"{name}.csv").write_text(example(f"movements/{name}.csv").read_text())
    lines = (tmp_path / "after.csv").read_text().splitlines()
    (tmp_path / "after.csv").write_text("\n".join([lines[0], *lines[2:]]) + "\n")
    said = " ".join(catseye(*words(tmp_path))[1].split())
    assert "Not used, measured in one epoch only: ZY101 to FA1" in said
    (tmp_path / "after.csv").write_text(lines[0] + "\nZY101,FA4,100.0,0.0001\n")
    assert "have no line in common" in catseye(*words(tmp_path))[2]
