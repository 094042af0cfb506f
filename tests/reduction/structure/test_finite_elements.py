"""A finite element result in a structural model bends the telescope as the truss itself, at any elevation."""

import runpy

import numpy as np
import pytest

from catseye.api.telescope.finite_elements import import_model
from catseye.errors import ArgumentError, InputError
from catseye.geometry.antenna.deformation import TelescopePosture
from catseye.records.site.structural_model import StructuralModel, read_structural_model
from catseye.reduction.structure.antenna import antenna_of
from catseye.reduction.structure.displacement import displacements, model_points
from catseye.reduction.structure.epochs import read_epochs
from catseye.reduction.structure.model_fit import model_fit
from repository import ROOT

MODEL = ROOT / "examples" / "structural-model" / "telescope.toml"
HERE = ROOT / "examples" / "finite-elements"
TRUSS = runpy.run_path(str(HERE / "make_truss.py"))
PLACED = {"nodes": HERE / "nodes.csv", "axes": "-y,x,z", "origin_m": TRUSS["ORIGIN"].tolist()}
CASES = {"unit": "mm", "case": ["1=cosE", "2=sinE"]}


@pytest.fixture(scope="module")
def bent():
    return import_model(MODEL, HERE / "reflector.pch", **PLACED, **CASES)


def only_gravity_of_the_dish(record):
    """Antenna of a model whose alidade and elevation axis stand still."""
    document = record.model_dump()
    for frame in document["frame"]:
        if frame["name"] in ("alidade", "elevation"):
            del frame["motion"]
    return antenna_of(StructuralModel.model_validate(document))


@pytest.mark.parametrize("elevation", [0.0, 37.0, 90.0])
def test_targets_move_as_the_truss_solved_at_that_elevation(bent, elevation):
    antenna = only_gravity_of_the_dish(bent.model)
    names = [match.target for match in bent.imported.matches]
    points = [point for name in names for point in model_points(antenna, [name])]
    posture = TelescopePosture(0.4, np.radians(elevation), 15.0)
    found = displacements(antenna, points, posture).body[0]
    node_targets = TRUSS["nodes"]()[1]
    solved = TRUSS["solved"](TRUSS["gravity"](elevation))[[node_targets.index(name) for name in names]]
    assert np.max(np.linalg.norm(solved, axis=1)) > 0.015
    # a turn of 1e-3 rad times a displacement of 38 mm, which a linear result leaves out
    np.testing.assert_allclose(found, solved, rtol=0, atol=4e-5)


def test_five_elevations_give_the_same_model_as_the_two_load_cases(bent):
    other = import_model(MODEL, HERE / "elevations.csv", **PLACED)
    total = bent.imported.rigid + bent.imported.residual
    np.testing.assert_allclose(other.imported.rigid + other.imported.residual, total, rtol=0, atol=2e-8)  # rounding
    assert other.imported.misfit < 2e-8
    assert other.verdict.word == "good"


@pytest.mark.parametrize(("claimed", "word"), [("46,", "good"), ("84.5,", "doubtful")])
def test_elevations_that_contradict_gravity_are_told(tmp_path, claimed, word):
    """The case at 45 degrees, filed under another elevation."""
    rows = (HERE / "elevations.csv").read_text().splitlines()
    rows = [row.replace("45,", claimed, 1) if row.startswith("45,") else row for row in rows]
    (tmp_path / "other.csv").write_text("\n".join(rows) + "\n")
    found = import_model(MODEL, tmp_path / "other.csv", **PLACED)
    assert found.imported.misfit > 1e-4
    assert found.verdict.word == word


def test_terms_of_temperature_stay_and_those_of_gravity_are_replaced(bent):
    before = next(frame for frame in read_structural_model(MODEL).frame if frame.name == "reflector").motion
    after = next(frame for frame in bent.model.frame if frame.name == "reflector").motion
    assert after.terms == ("cosE", "sinE", "t", "cosE*t")
    assert after.turn_x_arcsec[2:] == (0.0, 0.15)
    assert after.shift_z_mm[2:] == (before.shift_z_mm[3], 0.0)
    assert after.pivot_mm == before.pivot_mm
    rim = next(group for group in bent.model.group if group.name == "rim")
    assert rim.shifts.terms == ("cosE", "sinE", "t")
    assert all(point.shift_z_mm[2] == 0.02 for point in rim.point)
    assert bent.imported.unmatched == ("ZES1", "ZES2", "ZES3", "ZES4")


def test_its_uncertainty_is_the_prior_of_a_fit(bent):
    """[PARKER04] section 2.6: ranges refine the finite element model."""
    antenna = antenna_of(bent.model)
    motion = antenna.motions["reflector"]
    k = len(motion.basis)
    u = np.sqrt(np.diag(motion.covariance)).reshape(6, k)
    size = np.linalg.norm(motion.coefficients[3:, 0])
    np.testing.assert_allclose(u[3:, 0], 0.1 * size, rtol=1e-9)
    assert np.all(u[:, 2:] == 0.0)  # the model's own terms of temperature count as known
    epochs = read_epochs([], ROOT / "examples" / "structure" / "epochs.csv")
    fit = model_fit(antenna, epochs, free={"reflector": ["turn_x"]})
    gravity = [row for row in fit.coefficients if row.function in ("cosE", "sinE")]
    assert all(row.u < 0.9 * u[3, n] for n, row in enumerate(gravity))
    # the epochs' telescope is another one than the truss: it must be seen
    assert fit.verdict.word == "doubtful"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"axes": "x,y,z"}, "no target has a node near it"),
        ({"case": ["1=cosE"]}, "case 2 has no meaning"),
        ({"case": ["1=cosE", "2=30"]}, "expected one kind"),
        ({"case": ["1=cosE", "2=sinE", "3=t"]}, "case '3' is not there"),
        ({"case": ["1=cosE", "2=cosE"]}, "each once"),
        ({"case": ["1=0", "2=180"]}, "do not determine"),
        ({"frame": "boom"}, "'boom' is not in the structural model"),
        ({"frame": "feed_arm", "within_m": 0.01}, "no target has a node"),
    ],
)
def test_what_cannot_be_read_into_the_model_is_refused(options, said):
    with pytest.raises(InputError, match=said):
        import_model(MODEL, HERE / "reflector.pch", **{**PLACED, **CASES, **options})


def test_a_node_that_names_a_target_far_off_or_unknown_is_refused(tmp_path):
    rows = (HERE / "nodes.csv").read_text().splitlines()
    for target, said in (("ZEG41040L", "m from ZEG41040L at rest"), ("BOOM", "names 'BOOM'")):
        text = [rows[0] + ",target", rows[1] + f",{target}", *(row + "," for row in rows[2:])]
        (tmp_path / "nodes.csv").write_text("\n".join(text) + "\n")
        with pytest.raises(InputError, match=said):
            import_model(MODEL, HERE / "reflector.pch", **{**PLACED, **CASES, "nodes": tmp_path / "nodes.csv"})


@pytest.mark.parametrize("axes", ["y,x,z", "x,y", "x,x,z", "x,y,w"])
def test_axes_that_are_none_are_refused(axes):
    with pytest.raises(ArgumentError, match="no right-handed system"):
        import_model(MODEL, HERE / "reflector.pch", **{**PLACED, **CASES, "axes": axes})


def test_the_examples_files_are_those_that_its_script_makes(tmp_path):
    TRUSS["main"].__globals__["HERE"] = tmp_path
    TRUSS["main"]()
    assert (tmp_path / "nodes.csv").read_text() == (HERE / "nodes.csv").read_text()
    made, stored = (np.loadtxt(p / "elevations.csv", delimiter=",", skiprows=1) for p in (tmp_path, HERE))
    np.testing.assert_allclose(made, stored, rtol=0, atol=2e-5)  # last digit, by another linear algebra
