"""`adjust`, `compare`, `plan`, `locate` from Python: the numbers of the commands, arrays, verdicts."""

import inspect
import json

import numpy as np
import pytest
from astropy import units
from astropy.table import QTable

import catseye
from catseye.api import network as face
from catseye.errors import ArgumentError, EstimationError, InputError
from catseye.estimation.least_squares.adjustment import adjust
from catseye.estimation.network import adjustment as network_adjustment

CUBE = np.array([[x, y, z] for x in (0.0, 60.0) for y in (0.0, 50.0) for z in (0.0, 20.0)])
TARGETS = np.array([[20.0, 11.0, 7.0], [33.0, 30.0, 4.0], [45.0, 17.0, 12.0]])


def written(folder, *, blunder=0.0, moved=0.0, seed=5):
    """A folder of its own: stations at the corners of a box, ranges to three targets with 0.1 mm of noise."""
    folder.mkdir()
    generator = np.random.default_rng(seed)
    targets = TARGETS + np.array([[moved, 0.0, 0.0], [0.0] * 3, [0.0] * 3])
    d = np.linalg.norm(targets[None] - CUBE[:, None], axis=2) + 1e-4 * generator.standard_normal((8, 3))
    d[2, 1] += blunder
    points = ["point,x,y,z,role", *(f"S{k},{x},{y},{z},fixed" for k, (x, y, z) in enumerate(CUBE))]
    ranges = ["from,to,distance", *(f"S{k},T{j},{d[k, j]:.6f}" for k in range(8) for j in range(3))]
    (folder / "points.csv").write_text("\n".join(points))
    (folder / "ranges.csv").write_text("\n".join(ranges))
    return folder


def test_an_adjustment_has_arrays_in_the_order_of_the_file(tmp_path):
    answer = catseye.adjust(written(tmp_path / "net"), sigma_mm=0.1)
    assert answer.names[8:] == ("T0", "T1", "T2")
    np.testing.assert_allclose(answer.x[8:], TARGETS, rtol=0, atol=5e-4)
    assert answer.verdict.word == "good"
    assert answer.residuals.shape == answer.redundancy.shape == (24,)
    assert answer.degrees_of_freedom == pytest.approx(24 - 9)
    assert answer.covariance.shape == (33, 33)
    blocks = answer.covariance.reshape(11, 3, 11, 3)
    np.testing.assert_allclose(blocks[np.arange(11), :, np.arange(11)], answer.covariances, rtol=1e-9, atol=1e-20)
    assert not len(answer.suspects)
    assert not len(answer.likely)
    table = answer.to_table()
    assert str(table["u_x"].unit) == "mm"
    assert len(answer.to_table("observations")) == 24
    assert len(repr(answer)) < 1200
    assert set(catseye.show(answer, "plan")) == {"plan"}


def test_the_full_covariance_is_in_the_axes_of_the_file():
    """A .gkf with its own axes and handedness: blocks and whole agree, and whole is symmetric."""
    answer = catseye.adjust("networks/total-station.gkf")
    n = len(answer.names)
    blocks = answer.covariance.reshape(n, 3, n, 3)[np.arange(n), :, np.arange(n)]
    np.testing.assert_allclose(blocks, answer.covariances, rtol=1e-9, atol=1e-18)
    np.testing.assert_allclose(answer.covariance, answer.covariance.T, rtol=1e-9, atol=1e-18)


def test_a_blunder_is_likely_and_nothing_is_removed(tmp_path):
    answer = catseye.adjust(written(tmp_path / "net", blunder=0.01), sigma_mm=0.1)
    row = 2 * 3 + 1
    assert answer.verdict.word == "doubtful"
    assert "slope distance S2 - T1" in answer.verdict.why
    assert answer.likely.tolist() == [row]
    assert answer.suspects[0] == row
    assert answer.adjusted.table.active.all()
    cleaned = catseye.adjust(written(tmp_path / "again", blunder=0.01), sigma_mm=0.1, reject=True)
    assert cleaned.verdict.word == "good"
    assert not cleaned.adjusted.table.active[row]
    assert json.loads(json.dumps(cleaned.to_object()["likely"])) == [row]


def test_one_blunder_makes_many_suspects_and_one_is_likely(tmp_path):
    answer = catseye.adjust(written(tmp_path / "net", blunder=1.0), sigma_mm=0.1)
    assert len(answer.suspects) > 3
    assert answer.likely.tolist() == [7]


def test_what_moved_is_found_between_two_epochs(tmp_path):
    first = catseye.adjust(written(tmp_path / "first"), sigma_mm=0.1)
    second = catseye.adjust(written(tmp_path / "second", moved=0.002, seed=4), sigma_mm=0.1)
    moved = catseye.compare(first, second, points=["T0", "T1", "T2"])
    assert dict(zip(moved.names, moved.words, strict=True))["T0"] == "moved"
    at = moved.names.index("T0")
    assert abs(moved.displacement[at, 0] - 0.002) < 4 * moved.u[at, 0]
    assert "T0" in moved.verdict.why
    assert set(moved.sources()) == {tmp_path / "first", tmp_path / "second"}
    catseye.save(moved, tmp_path / "out")
    assert (tmp_path / "out" / "displacements.csv").exists()


def test_a_plan_says_what_it_would_be_worth(tmp_path):
    planned = catseye.plan("networks/feed-arm.toml", budget_s=20.0, runs=2)
    assert planned.u.shape == (len(planned.names), 3)
    assert planned.to_object()["monte_carlo"]["runs"] == 2
    assert planned.to_object()["verdict"]["word"] == planned.verdict.word
    candidates, told = planned.to_table("candidates"), planned.to_object()
    for column in ("gain", "mean_u"):
        assert candidates[column].to_value("m").tolist() == pytest.approx([c[column] for c in told["candidates"]])
    points = planned.to_table("points")
    worst = {each["point"]: each["u"] for each in told["weakest"]}
    longest = {str(row["point"]): row["longest_axis"].to_value("m") for row in points}
    assert len(worst) >= 3
    assert [longest[n] for n in worst] == pytest.approx(list(worst.values()))
    assert points["u_x"].to_value("m").tolist() == pytest.approx([told["points"][n]["u"][0] for n in points["point"]])


def test_a_network_without_an_answer_is_a_failed_result_that_is_not_saved(tmp_path):
    folder = written(tmp_path / "net")
    text = (folder / "points.csv").read_text().replace("fixed", "free")
    (folder / "points.csv").write_text(text)
    answer = catseye.adjust(folder, sigma_mm=0.1)
    assert answer.verdict.word == "failed"
    assert "floats" in answer.verdict.why
    with pytest.raises(EstimationError, match="floats"):
        catseye.save(answer, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    with pytest.raises(EstimationError, match="floats"):
        catseye.compare(answer, answer)
    with pytest.raises(InputError, match="missing"):
        catseye.adjust(tmp_path / "nowhere")


def columns_of(folder):
    """The same network as arrays: names, and lengths in m with their units where astropy gives them."""
    tables = {}
    for table in ("points", "ranges"):
        lines = [line.split(",") for line in (folder / f"{table}.csv").read_text().splitlines()]
        cells = {name: [row[k] for row in lines[1:]] for k, name in enumerate(lines[0])}
        names = {"point", "role", "from", "to"}
        tables[table] = {name: cells[name] if name in names else np.array(cells[name], float) for name in cells}
    return tables


def test_arrays_are_adjusted_as_the_same_data_of_a_folder_bit_for_bit(tmp_path):
    folder = written(tmp_path / "net", blunder=0.01)
    tables = columns_of(folder)
    options = {"sigma_mm": 0.1, "reject": True}
    one, two = catseye.adjust(folder, **options), catseye.adjust(tables, **options)
    assert two.names == one.names
    for name in ("x", "u", "covariances", "residuals", "standardised", "redundancy", "suspects", "likely"):
        np.testing.assert_array_equal(getattr(two, name), getattr(one, name))
    assert (two.variance_factor, two.verdict) == (one.variance_factor, one.verdict)
    assert (two.sources(), two.inputs()) == ((), {})


def test_tables_with_units_are_adjusted_in_metres(tmp_path):
    folder = written(tmp_path / "net")
    tables = {name: QTable(columns) for name, columns in columns_of(folder).items()}
    tables["ranges"]["distance"] = (tables["ranges"]["distance"] * units.m).to(units.mm)
    tables["ranges"]["sigma"] = np.full(24, 0.1) * units.mm
    answer = catseye.adjust(tables)
    np.testing.assert_allclose(answer.x, catseye.adjust(folder, sigma_mm=0.1).x, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.pop("ranges"), "the tables points .expected points and ranges"),
        (lambda t: t["ranges"].pop("to"), "column 'to' is missing"),
        (lambda t: t["ranges"].update(strange=[1.0] * 24), "column 'strange' is unknown"),
        (lambda t: t["ranges"].update(distance=t["ranges"]["distance"][1:]), "columns of different lengths"),
        (lambda t: t["ranges"]["distance"].__setitem__(3, np.nan), "row 3, distance = '' .expected a finite number"),
        (lambda t: t["ranges"]["distance"].__setitem__(3, -1.0), "row 3, distance = '-1.0' .expected above 0 m"),
        (lambda t: t["points"].update(x=np.zeros((8, 2))), "has the shape"),
        (lambda t: t["points"].update(x=np.zeros(8) * units.s), "adjust: points, x"),
    ],
)
def test_a_column_that_cannot_be_used_is_refused_with_its_table_and_row(tmp_path, change, said):
    tables = columns_of(written(tmp_path / "net"))
    change(tables)
    with pytest.raises(InputError, match=said):
        catseye.adjust(tables, sigma_mm=0.1)


TREATMENTS = [{}, {"robust": "huber"}, {"reject": True}, {"components": "groups"}, {"datum": "free"}]


@pytest.mark.parametrize("options", TREATMENTS)
def test_the_cap_of_iterations_reaches_every_solution_of_every_treatment(options, monkeypatch):
    """One step is too few for the ring; every solution, tried or final, has the cap."""
    caps = []

    def recorded(*args, solver, **more):
        caps.append(solver.iterations)
        return adjust(*args, solver=solver, **more)

    usual = catseye.adjust("networks/ground-ring", **options)
    assert usual.status == "converged"
    assert usual.adjusted.solution.iterations > 1
    capped = catseye.adjust("networks/ground-ring", iterations=1, **options)
    assert capped.status.startswith("not converged: the last step was")
    assert capped.adjusted.solution.iterations == 1
    monkeypatch.setattr(network_adjustment, "adjust", recorded)
    same = catseye.adjust("networks/ground-ring", iterations=49, **options)
    np.testing.assert_array_equal(same.x, usual.x)
    assert set(caps) == {49}


def test_type_checkers_are_told_every_keyword_of_adjust():
    parameters = inspect.signature(catseye.adjust).parameters.values()
    keywords = {each.name for each in parameters if each.kind is each.KEYWORD_ONLY}
    assert set(face._AdjustOptions.__annotations__) == keywords


def test_invalid_and_contradicting_arguments_are_named(tmp_path):
    folder = written(tmp_path / "net")
    for options, names in (
        ({"iterations": 0}, ("iterations",)),
        ({"level": 1.0}, ("level",)),
        ({"reject": True, "robust": "huber"}, ("robust", "reject")),
        ({"points": ["T0"]}, ("points",)),
    ):
        with pytest.raises(ArgumentError) as problem:
            catseye.adjust(folder, sigma_mm=0.1, **options)
        assert problem.value.names == names


def test_a_later_epoch_makes_a_comparison_with_the_options_of_both(tmp_path):
    first, second = written(tmp_path / "first"), written(tmp_path / "second", moved=0.002, seed=4)
    one = catseye.adjust(first, second, points=["T0", "T1", "T2"], sigma_mm=0.1)
    epochs = [catseye.adjust(each, sigma_mm=0.1) for each in (first, second)]
    two = catseye.compare(*epochs, points=["T0", "T1", "T2"])
    assert one.to_object() == two.to_object()
    np.testing.assert_array_equal(one.displacement, two.displacement)


def test_estimated_parameters_stand_among_the_sentences():
    answer = catseye.adjust("networks/feed-arm.toml")
    estimated = [p.name for p in answer.adjusted.network.parameters if p.sigma > 0.0 and p.unit != "rad"]
    assert estimated
    said = {p.title: p.text for p in answer.passages()}["Parameters"]
    assert all(name in said for name in estimated[:12])


def test_many_targets_are_located_each_with_its_status():
    d = np.linalg.norm(TARGETS[:, None] - CUBE[None], axis=2)
    d[1, 2:] = np.nan
    there = catseye.locate(CUBE, d, 1e-4)
    np.testing.assert_allclose(there.x[[0, 2]], TARGETS[[0, 2]], rtol=0, atol=1e-9)
    assert there.covariance.shape == (3, 3, 3)
    assert there.found.tolist() == [True, False, True]
    assert "three are needed" in there.status[1]
    assert there.verdict.word == "doubtful"
    assert len(there.to_table()) == 3
    assert catseye.locate(CUBE, d[[0, 2]], 1e-4).verdict.word == "good"
    assert catseye.locate(CUBE[:3], d[[0], :3], 1e-4).verdict.word != "good"
    assert catseye.locate(CUBE, d[1], 1e-4).verdict.word == "failed"
