"""`catseye calibrate KIND --template`: every column and key is there, filled in it is the example, nothing is lost."""

import tomllib

import pytest

import catseye as package
from catseye.reduction.calibrations.kinds import KINDS
from repository import ROOT

EXAMPLES = ROOT / "examples" / "calibrations"


@pytest.mark.parametrize("kind", KINDS)
def test_a_template_names_every_column_and_key_and_is_toml(catseye, kind, tmp_path):
    table = tmp_path / "mine.csv"
    status, said, complaint = catseye("calibrate", kind, "--template", table)
    assert (status, complaint) == (0, "")
    assert "mine.toml" in " ".join(said.split())
    layout = KINDS[kind].layout
    (header,) = table.read_text().splitlines()
    columns = [*layout.required, *layout.optional, "mjd_utc", "left_out"]
    assert header.split(",") == list(dict.fromkeys(columns))  # each once: some kinds need mjd_utc
    text = table.with_suffix(".toml").read_text()
    assert tomllib.loads(text) == {"kind": kind}
    lines = text.splitlines()
    for key in layout.sheet.model_fields.keys() - {"format", "kind", "level"}:
        assert any(line.startswith((f"# {key} = ", f"# [[{key}]]")) for line in lines), key
    bare = tomllib.loads(
        "\n".join(line.removeprefix("# ") for line in lines if " = " in line or line.startswith("# [["))
    )
    assert set(bare) >= {"kind", "instrument", "measured_on"}  # without the marks it is TOML, too
    assert catseye("calibrate", kind, table)[0] == 1  # not yet a calibration


def test_values_of_a_template_have_their_type_and_remarks_their_unit(tmp_path):
    lines = {}
    for kind in ("invar-wire", "reference-distance", "inclinometer"):
        package.save_calibration_template(kind, tmp_path / f"{kind}.csv")
        rows = (tmp_path / f"{kind}.toml").read_text().splitlines()
        lines |= {row.removeprefix("# ").split(" = ")[0]: row for row in rows if " = " in row}
    for key in ("hanging", "estimate_scale", "cubic"):
        assert lines[key].startswith(f"# {key} = false "), key
    for key, unit in (("tension_n", "N"), ("weight_n_per_m", "N/m"), ("scale_x_volt_per_rad", "V/rad")):
        assert f", {unit}, " in lines[key]
    assert lines["u_tension_n"].endswith(": standard uncertainty of tension_n")
    assert ": standard uncertainty of the scale of the known distances" in lines["u_distance_ppm"]


@pytest.mark.parametrize("kind", ["mounting-plate", "reference-cube", "limits", "retroreflector"])
def test_a_template_filled_in_with_the_example_is_the_example(kind, tmp_path):
    table = tmp_path / f"{kind}.csv"
    package.save_calibration_template(kind, table)
    rows = (EXAMPLES / f"{kind}.csv").read_text()
    header, *readings = rows.splitlines()
    read = header.split(",")
    columns = [name for name in table.read_text().strip().split(",") if name in read]  # those not read are deleted
    cells = [dict(zip(read, row.split(","), strict=True)) for row in readings]
    table.write_text("\n".join([",".join(columns), *(",".join(row[name] for name in columns) for row in cells)]))
    sheet = table.with_suffix(".toml")
    filled = (EXAMPLES / f"{kind}.toml").read_text().replace(f'kind = "{kind}"\n', "")
    sheet.write_text(sheet.read_text() + filled)
    mine, theirs = package.calibrate(kind, table), package.calibrate(kind, EXAMPLES / f"{kind}.csv")
    assert mine.values.tolist() == theirs.values.tolist()


def test_readings_and_foreign_sheets_are_never_overwritten(catseye, tmp_path):
    table = tmp_path / "mine.csv"
    table.write_text("stop,azimuth_counts\nlow,1\n")
    status, _, complaint = catseye("calibrate", "limits", "--template", table)
    assert status == 1
    assert "readings would be lost" in complaint
    (tmp_path / "other.toml").write_text("a = 1\n")
    assert catseye("calibrate", "limits", "--template", tmp_path / "other.csv")[0] == 1
    assert not (tmp_path / "other.csv").exists()
    assert (tmp_path / "other.toml").read_text() == "a = 1\n"


@pytest.mark.parametrize("words", [("limits",), ("limits", "a.csv", "--template", "b.csv"),
                                   ("limits", "--template", "b.csv", "--write", "r.toml")])  # fmt: skip
def test_one_of_both_is_asked_for(catseye, words):
    assert catseye("calibrate", *words)[0] == 2


def test_a_table_is_a_csv(catseye, tmp_path):
    assert "does not end in .csv" in catseye("calibrate", "limits", "--template", tmp_path / "b.txt")[2]
