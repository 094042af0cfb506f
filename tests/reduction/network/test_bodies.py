"""`networks/bodies.toml`: a rigid body and a plane take the place of ranges, and are tested."""

import numpy as np

import catseye
from catseye.records.files.examples import example

TRUTH = {  # of the simulation, m
    "B1": [35.0, 30.0, 40.0], "B2": [37.2521, 30.81546, 40.1519], "B3": [34.3819, 31.68718, 40.1067],
    "B4": [36.62028, 32.47556, 40.60728], "R1": [20.0, 20.0, 11.8], "R2": [50.0, 22.0, 11.22003],
    "R3": [48.0, 52.0, 11.55997], "R4": [22.0, 50.0, 12.05991], "R5": [35.0, 36.0, 11.65995],
}  # fmt: skip
TEXT = example("networks/bodies.toml").read_text(encoding="utf-8")


def changed(tmp_path, text):
    (tmp_path / "n.toml").write_text(text, encoding="utf-8")
    return catseye.adjust(tmp_path / "n.toml")


def test_points_of_two_ranges_are_found_by_the_body_and_the_plane():
    found = catseye.adjust("networks/bodies.toml")
    assert found.verdict.word == "good"
    at = [found.names.index(name) for name in TRUTH]
    assert (np.abs(found.x[at] - np.array(list(TRUTH.values()))) < 4.0 * found.u[at]).all()


def test_without_them_these_points_float(tmp_path):
    bare = changed(tmp_path, TEXT[: TEXT.index("[[body]]")] + TEXT[TEXT.index("[[observations]]") :])
    assert bare.verdict.word == "failed"
    assert "R5" in bare.status
    assert "B4" in bare.status


def test_a_body_that_is_not_as_its_file_says_is_contradicted(tmp_path):
    line = next(line for line in TEXT.splitlines() if 'name = "B2"' in line)
    x = float(line.split("[")[1].split(",")[0])
    found = changed(tmp_path, TEXT.replace(line, line.replace(f"{x:.3f}", f"{x + 5:.3f}")))
    assert found.verdict.word != "good"
    kinds = found.adjusted.table.kinds
    assert kinds[found.adjusted.table.kind[found.suspects[0]]] == "rigid_body"
