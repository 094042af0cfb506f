"""Panel corners against solid panels that a crew of the simulator reads, and against algebra done otherwise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import norm

from catseye.errors import InputError
from catseye.estimation.least_squares.rows import full_jacobian
from catseye.records.panels.readings import PanelMap
from catseye.reduction.panels.crew import members, sessions, setting, standing
from catseye.reduction.panels.heights import conformity, meetings, reduce_panels, surface_rms
from catseye.reduction.panels.job import verdicts
from catseye.reduction.panels.maps import fitted_map
from catseye.reduction.panels.model import panel_model, used_layout
from catseye.simulator.laboratory.panels import CornerTour, Crew, panel_readings, screwed, solid_panels
from panel_scene import dish, patch, read, standing_by_chance, survey, tool


def calm(rng):
    """A crew without any noise: only digits are lost."""
    return Crew(rng, gauge=0.0, zero=0.0, lean=1e-4, inclinometer=0.0, level=0.0, flat=0.0)


@pytest.fixture
def sheet():
    return tool(u_slope_urad=1.0, u_shape_um=1.0, u_set_um=300.0)


def relative_truth(found, true):
    """Each corner less the mean of those that were read with it."""
    rest = np.full(true.shape, np.nan)
    for four in meetings(found.layout, found.times > 0):
        here = four[four >= 0]
        if len(here) > 1:
            rest.ravel()[here] = true.ravel()[here] - true.ravel()[here].mean()
    return rest


def test_without_noise_the_heights_are_those_of_the_solid_panels(tmp_path, sheet):
    """Curvature, linearity, scale, temperature, sag, turns and leans all undone: a digit is 1 µm, 0.3 rms.

    The rest is the weak prior: 300 µm against 50 of the shafts' stands pull slopes of panels by some per cent.
    """
    rng = np.random.default_rng(1)
    layout = patch()
    solid = standing_by_chance(layout, sheet, rng)
    rows, stands = panel_readings(solid, sheet, calm(rng), tour=CornerTour(turns=(0, 1, 2, 3)))
    found = reduce_panels(
        read(rows, tmp_path / "r.csv", layout, sheet), layout, sheet, survey=survey(stands, 1e-7, rng)
    )
    assert found.layout.panels == layout.panels
    true = solid.heights()
    assert np.sqrt(np.mean((found.relative - relative_truth(found, true))[found.known] ** 2)) < 1.2e-6
    assert found.known.sum() == 4 * 18 - 4


def test_forgetting_the_curvature_would_be_seen(tmp_path, sheet):
    """The rise is 39 µm at these corners and nearly alike under all gauges: the mean height would be wrong."""
    rng = np.random.default_rng(2)
    layout = patch()
    solid = solid_panels(layout, rng, piston=0.0, slope=0.0, twist=0.0)
    rows, stands = panel_readings(solid, sheet, calm(rng), shafts=np.zeros(len(layout.corners)))
    readings = read(rows, tmp_path / "r.csv", layout, sheet)
    model = panel_model(readings, layout, sheet)
    inside = np.isin(readings.corner[model.tips.row], np.flatnonzero(np.bincount(layout.quad.ravel()) == 4))
    slope = np.linalg.norm(layout.xy[readings.corner[model.tips.row]], axis=1) / 120.0
    mean_curvature = 0.5 * ((1.0 + slope**2) ** -1.5 + (1.0 + slope**2) ** -0.5) / 120.0
    assert model.tips.rise[inside] == pytest.approx((0.5 * 2 * 0.075**2 * mean_curvature)[inside], abs=1e-7)
    assert 38e-6 < np.median(model.tips.rise[inside]) < 41e-6
    found = reduce_panels(readings, layout, sheet, survey=survey(stands, 1e-6, rng))
    assert np.nanmax(np.abs(found.actuator)) < 3e-6


def test_the_answer_is_that_of_another_solver(tmp_path, sheet):
    """scipy's least squares over the whitened rows of the same model, dense."""
    rng = np.random.default_rng(3)
    layout = patch(("T20", "T21"), 1)
    solid = standing_by_chance(layout, sheet, rng)
    rows, _ = panel_readings(solid, sheet, Crew(rng))
    found = reduce_panels(read(rows, tmp_path / "r.csv", layout, sheet), layout, sheet)
    n = found.model.columns.size
    a, b = [], []
    for group in found.model.groups:
        c = group.covariance
        m = len(group.observed)
        whole = np.diag(c) if c.ndim == 1 else c
        if c.ndim == 3:
            whole = np.zeros((m, m))
            for k, block in enumerate(c):
                at = slice(k * len(block), (k + 1) * len(block))
                whole[at, at] = block
        root = np.linalg.inv(np.linalg.cholesky(whole))
        a.append(root @ full_jacobian(group, np.zeros(n)))
        b.append(root @ group.observed)
    a, b = np.concatenate(a), np.concatenate(b)
    size = 1.0 / np.linalg.norm(a, axis=0)
    other = least_squares(lambda x: a @ (x * size) - b, np.zeros(n), jac=lambda x: a * size, xtol=1e-15, ftol=1e-15)
    assert found.solution.x == pytest.approx(other.x * size, abs=2e-10)
    assert found.solution.covariance == pytest.approx(np.linalg.inv(a.T @ a), abs=1e-14)


def test_the_tool_alone_leaves_shapes_of_the_surface_unseen(tmp_path, sheet):
    """Corners that stay flush may still rise and fall hoop by hoop and rib by rib, panels turning like hinged plates.

    A reading is a height at one place of one panel: 4p of them less a shaft a corner, c, and a warp a panel, p, leave
    4p - (4p - c + p) = c - p shapes; of k hoops by l ribs k + l - 1, and of the whole dish 2209 - 2004 = 205 at most.
    A shift and two tilts are among them, but all others too want the survey.
    """
    rng = np.random.default_rng(4)
    layout = patch()
    rows, _ = panel_readings(standing_by_chance(layout, sheet, rng), sheet, Crew(rng))
    readings = read(rows, tmp_path / "r.csv", layout, sheet)
    model = panel_model(readings, layout, sheet)
    known = [g for g in model.groups if g.name.startswith("readings") or g.name == "warps"]
    heights = 4 * len(layout.panels)
    seen = np.concatenate([full_jacobian(g, np.zeros(model.columns.size)) for g in known])
    other = seen[:, heights : heights + len(layout.corners)]  # shafts are not known
    q = np.linalg.qr(other)[0]
    rest = seen[:, :heights] - q @ (q.T @ seen[:, :heights])
    values = np.linalg.svd(rest, compute_uv=False)
    hoops, ribs = 4, 7
    unseen = int(np.sum(values < 1e-9 * values[0]))
    hoops, ribs = 4, 7
    assert unseen == len(layout.corners) - len(layout.panels) == hoops + ribs - 1
    assert np.sort(values)[unseen] > 0.01 * values[0]


def test_a_survey_makes_the_whole_surface_known(tmp_path, sheet):
    rng = np.random.default_rng(5)
    layout = patch()
    solid = standing_by_chance(layout, sheet, rng)
    rows, stands = panel_readings(solid, sheet, Crew(rng))
    readings = read(rows, tmp_path / "r.csv", layout, sheet)
    alone = reduce_panels(readings, layout, sheet)
    known = reduce_panels(readings, layout, sheet, survey=survey(stands, 50e-6, rng))
    assert np.median(known.u_departure) < 0.6 * np.median(alone.u_departure)
    assert np.nanmedian(known.u_relative) < np.nanmedian(alone.u_relative)
    z = (known.departure - solid.heights()) / known.u_departure
    assert np.abs(z).max() < 4.0


def test_a_wrong_reading_is_found_by_name_and_left_out(tmp_path, sheet):
    rng = np.random.default_rng(6)
    layout = patch()
    solid = standing_by_chance(layout, sheet, rng)
    rows, stands = panel_readings(solid, sheet, Crew(rng), tour=CornerTour(turns=(0, 1, 2), members=("Ada",)))
    at = next(k for k, row in enumerate(rows) if row.startswith("DP21P01,1,"))
    cells = rows[at].split(",")
    cells[6] = f"{float(cells[6]) + 0.08:.3f}"
    rows[at] = ",".join(cells)
    readings = read(rows, tmp_path / "r.csv", layout, sheet)
    known = survey(stands, 80e-6, rng)
    named = reduce_panels(readings, layout, sheet, survey=known)
    assert [(d.where, d.gauge, d.corner, d.member, d.rivals, d.out) for d in named.doubts] == [
        (f"line {at + 1}", "c", "DP21P01", "Ada", (), False)
    ]
    assert named.doubts[0].error == pytest.approx(80e-6, abs=15e-6)
    without = reduce_panels(readings, layout, sheet, survey=known, reject=True)
    assert [d.out for d in without.doubts] == [True]
    assert without.variance_factor < 1.3 < named.variance_factor
    true = relative_truth(without, solid.heights())
    z = ((without.relative - true) / without.u_relative)[without.known]
    assert np.abs(z).max() < 4.0


def test_two_contradicting_placements_are_both_rejected(tmp_path, sheet):
    sheet = sheet.model_copy(update={"panel": sheet.panel.model_copy(update={"u_twist_um": 200.0})})
    rng = np.random.default_rng(7)
    layout = patch()
    rows, stands = panel_readings(standing_by_chance(layout, sheet, rng), sheet, Crew(rng))
    at = next(k for k, row in enumerate(rows) if row.startswith("DP21P01,2,"))
    cells = rows[at].split(",")
    cells[4] = f"{float(cells[4]) + 0.15:.3f}"
    rows[at] = ",".join(cells)
    readings = read(rows, tmp_path / "r.csv", layout, sheet)
    found = reduce_panels(readings, layout, sheet, survey=survey(stands, 80e-6, rng), reject=True)
    assert {d.where for d in found.doubts} == {f"line {at}", f"line {at + 1}"}
    assert {(d.panel, d.out) for d in found.doubts} == {(found.doubts[0].panel, True)}
    p = found.layout.panels.index(found.doubts[0].panel)
    k = [found.layout.corners[c] for c in found.layout.quad[p]].index("DP21P01")
    assert found.times[p, k] == 0
    assert verdicts(found)[p, k] == "read"


def test_turns_of_screws_bring_corners_together(tmp_path, sheet):
    """The list is obeyed by panels that are solid bodies: 1.27 mm a turn, clockwise raises; the rest is u."""
    rng = np.random.default_rng(8)
    layout = patch()
    solid = standing_by_chance(layout, sheet, rng)
    rows, stands = panel_readings(solid, sheet, Crew(rng), tour=CornerTour(turns=(0, 1, 2, 3)))
    known = survey(stands, 50e-6, rng)
    found = reduce_panels(read(rows, tmp_path / "r.csv", layout, sheet), layout, sheet, survey=known)
    moved = screwed(solid, 0.9 * np.where(found.known, found.turns, 0.0) * 1.27e-3)
    true = relative_truth(found, moved.heights())
    assert standing(found).rms > 150e-6
    left_over = 0.1 * found.relative[found.known]
    assert np.abs((true[found.known] - left_over) / found.u_relative[found.known]).max() < 4.0
    rows, _ = panel_readings(moved, sheet, Crew(rng), tour=CornerTour(turns=(0, 1, 2, 3)), shafts=stands)
    left = reduce_panels(read(rows, tmp_path / "l.csv", layout, sheet), layout, sheet, survey=known)
    done = setting(found, left)
    assert done.gain == pytest.approx(0.9, abs=4.0 * done.u_gain + 0.001)
    assert done.scatter < 10e-6
    other = sheet.model_copy(update={"screw": sheet.screw.model_copy(update={"clockwise": "lowers"})})
    again = reduce_panels(read(rows, tmp_path / "l.csv", layout, other), layout, other, survey=known)
    assert again.turns[again.known] == pytest.approx(-left.turns[left.known])


def test_maps_lay_the_best_fit_on_the_design(tmp_path, sheet):
    """Bumps of 60 µm: with maps the departure is that of the panel's rigid body, though its corners lie elsewhere."""
    rng = np.random.default_rng(9)
    layout = patch()
    calm_panels = solid_panels(layout, rng, piston=2e-4, slope=8e-5, twist=0.0)
    bumpy = solid_panels(layout, rng, piston=0.0, slope=0.0, twist=0.0, bump=60e-6)
    solid = replace(calm_panels, bumps=bumpy.bumps, bump_k=bumpy.bump_k, bump_phase=bumpy.bump_phase)
    maps = {name: fitted_map(_map_of(solid, p, rng)) for p, name in enumerate(layout.panels)}
    rows, stands = panel_readings(solid, tool(), Crew(rng), tour=CornerTour(turns=(0, 1, 2, 3)))
    known = survey(stands, 20e-6, rng)
    readings = read(rows, tmp_path / "r.csv", layout, tool())
    with_maps = reduce_panels(readings, layout, tool(), survey=known, maps=maps)
    without = reduce_panels(readings, layout, tool(), survey=known)
    plane = calm_panels.heights() + _plane_of_shape(solid, maps)
    far, near = ((f.departure - plane) for f in (without, with_maps))
    assert np.sqrt(np.mean(near**2)) < 0.5 * np.sqrt(np.mean(far**2))
    assert np.abs(near / with_maps.u_departure).max() < 4.0


def _grid(layout, p):
    u, v = (g.ravel() for g in np.meshgrid(np.linspace(-0.98, 0.98, 11), np.linspace(-0.98, 0.98, 9)))
    weight = 0.25 * np.stack([(1 - u) * (1 - v), (1 + u) * (1 - v), (1 + u) * (1 + v), (1 - u) * (1 + v)], axis=1)
    return weight @ layout.xy[layout.quad[p]]


def _own(layout, p, xy):
    from catseye.reduction.panels.model import panel_axes

    at = np.column_stack([xy, np.sum(xy**2, axis=1) / (4.0 * layout.focal_length)])
    return panel_axes(layout, np.full(len(xy), p), at)


def _map_of(solid, p, rng):
    xy = _grid(solid.layout, p)
    deviation = solid.shape(np.full(len(xy), p), xy) + rng.normal(0.0, 3e-6, len(xy))
    own = _own(solid.layout, p, xy)
    return PanelMap(solid.layout.panels[p], own, deviation + 5e-5 + own @ [3e-5, -2e-5], "")


def _plane_of_shape(solid, maps):
    """(p, 4) m: the best-fit plane of each panel's own bumps at its corners, which belongs to its rigid place."""
    layout = solid.layout
    rest = np.empty((len(layout.panels), 4))
    for p, name in enumerate(layout.panels):
        corner = layout.xy[layout.quad[p]]
        rest[p] = solid.shape(np.full(4, p), corner) - maps[name].at(_own(layout, p, corner))
    return rest


def test_a_map_gives_its_plane_and_its_shape_back_and_bears_a_foreign_point():
    rng = np.random.default_rng(10)
    xy = np.column_stack([g.ravel() for g in np.meshgrid(np.linspace(-1.2, 1.2, 12), np.linspace(-0.9, 0.9, 9))])
    shape = 2e-5 * np.sin(2.0 * xy[:, 0]) * np.cos(1.5 * xy[:, 1])
    given = 4e-4 + xy @ [1e-4, -2e-4] + shape + rng.normal(0.0, 2e-6, len(xy))
    given[17] += 2e-3
    found = fitted_map(PanelMap("T", xy, given, ""))
    clean = np.delete(np.arange(len(xy)), 17)
    plain = np.linalg.lstsq(np.column_stack([np.ones(len(clean)), xy[clean]]), given[clean], rcond=None)[0]
    assert found.fit == pytest.approx(plain, abs=3e-6)
    assert np.flatnonzero(found.outlying).tolist() == [17]
    robust = least_squares(
        lambda f: (f[0] + xy @ f[1:] - given) / 1.345e-5, np.zeros(3), loss="huber", x_scale=1e-4, xtol=1e-15
    )
    assert found.fit == pytest.approx(robust.x, abs=5e-6)  # scipy's Huber with nearly that scale
    at = rng.uniform([-1.1, -0.8], [1.1, 0.8], (50, 2))
    wanted = 2e-5 * np.sin(2.0 * at[:, 0]) * np.cos(1.5 * at[:, 1])
    smooth = fitted_map(PanelMap("T", xy[clean], given[clean], ""))
    plane = np.array([4e-4, 1e-4, -2e-4]) - smooth.fit
    assert smooth.at(at) == pytest.approx(wanted + plane[0] + at @ plane[1:], abs=6e-6)
    with pytest.raises(InputError, match="no point within"):
        found.at(np.array([[3.0, 0.0]]))


def test_conformity_is_the_share_of_a_normal_law_between_the_limits():
    h, u = np.array([0.0, 20e-6, -40e-6]), np.array([10e-6, 5e-6, 12e-6])
    wanted = norm(h, u).cdf(25e-6) - norm(h, u).cdf(-25e-6)
    assert conformity(h, u, 25e-6) == pytest.approx(wanted, abs=1e-14)


def test_offsets_by_design_are_no_departures(tmp_path, sheet):
    """Up to 200 µm from edge to edge: panels that stand at their offsets are to be left alone, though edges differ."""
    rng = np.random.default_rng(11)
    layout = patch()
    offset = rng.uniform(-1e-4, 1e-4, (len(layout.panels), 1)) * np.ones(4)
    rows, stands = panel_readings(
        screwed(solid_panels(layout, rng, piston=0.0, slope=0.0, twist=0.0), offset), sheet, Crew(rng)
    )
    readings, known = read(rows, tmp_path / "r.csv", layout, sheet), survey(stands, 80e-6, rng)
    made = reduce_panels(readings, replace(layout, offset=offset), sheet, survey=known)
    assert np.nanmax(np.abs(made.relative) / made.u_relative) < 4.0
    assert standing(made).within == 1.0
    forgotten = reduce_panels(readings, layout, sheet, survey=known)
    assert standing(forgotten).rms > 40e-6


def test_a_careless_member_and_a_drifting_session_stand_out(tmp_path, sheet):
    rng = np.random.default_rng(12)
    layout = patch(side=5)
    solid = standing_by_chance(layout, sheet, rng)
    half = len(layout.corners) // 2
    good, stands = panel_readings(
        solid, sheet, Crew(rng), tour=CornerTour(corners=np.arange(half), members=("Ada",), turns=(0, 1, 2))
    )
    rest = CornerTour(corners=np.arange(half, len(layout.corners)), members=("Ben",), turns=(0, 1, 2))
    bad, _ = panel_readings(solid, sheet, Crew(rng, gauge=9e-6), tour=rest, shafts=stands)
    rows = good + [row.replace(",day", ",late") for row in bad[1:]]
    readings = read(rows, tmp_path / "r.csv", layout, sheet)
    found = reduce_panels(readings, layout, sheet, survey=survey(stands, 80e-6, rng))
    ada, ben = members(found)
    assert (ada.name, ada.in_control, ben.name, ben.in_control) == ("Ada", True, "Ben", False)
    assert ada.u_gauge == pytest.approx(3e-6, rel=0.15)
    assert 5e-6 < ben.u_gauge < 10e-6
    assert sum(r.readings for r in sessions(found)) == ada.readings + ben.readings
    degrees = sum(r.degrees_of_freedom for r in members(found))
    total = sum(r.variance_factor * r.degrees_of_freedom for r in members(found))
    assert degrees == pytest.approx(found.degrees_of_freedom)
    assert total == pytest.approx(found.variance_factor * found.degrees_of_freedom)


def test_a_gauge_over_no_panel_and_a_corner_without_its_panels_are_refused(tmp_path, sheet):
    rng = np.random.default_rng(13)
    layout = patch()
    rows, _ = panel_readings(solid_panels(layout, rng), sheet, Crew(rng))
    edge = next(k for k, row in enumerate(rows) if row.startswith("DP20N03,0,"))
    cells = rows[edge].split(",")
    cells[4:8] = ["0.1"] * 4
    rows[edge] = ",".join(cells)
    with pytest.raises(InputError, match=rf"line {edge + 1}, a_mm at DP20N03, turn 0, has no panel under it"):
        reduce_panels(read(rows, tmp_path / "r.csv", layout, sheet), layout, sheet)
    flat = [row for row in rows if row.startswith(("corner", "FLAT"))]
    with pytest.raises(InputError, match="holds no reading at a corner"):
        used_layout(read(flat, tmp_path / "r.csv", layout, sheet), layout, sheet)
    cold = [rows[0], *(row.rsplit(",", 1)[0] + "," for row in rows[1:] if "DP20N03,0," not in row)]
    with pytest.raises(InputError, match="elevation_deg is blank"):
        reduce_panels(read(cold, tmp_path / "r.csv", layout, sheet), layout, sheet)


def test_a_shift_and_a_tilt_of_the_whole_dish_do_not_count(tmp_path, sheet):
    rng = np.random.default_rng(14)
    layout = patch(("T20", "T30"), 10)
    rows, _ = panel_readings(solid_panels(layout, rng), sheet, Crew(rng))
    found = reduce_panels(read(rows, tmp_path / "r.csv", layout, sheet), layout, sheet)
    xy = layout.xy[layout.quad]
    slope = xy / 120.0
    length = np.sqrt(1.0 + np.sum(slope**2, axis=2))
    lifted = (1e-3 + 2e-4 * slope[..., 0]) / length
    assert surface_rms(found, lifted)[0] < 1e-12
    assert surface_rms(found, lifted + 1e-5 * rng.standard_normal(lifted.shape))[0] == pytest.approx(1e-5, rel=0.2)


@pytest.mark.slow
def test_the_whole_dish_takes_seconds(tmp_path):
    from time import perf_counter

    rng = np.random.default_rng(15)
    layout, sheet = dish(), tool()
    rows, stands = panel_readings(solid_panels(layout, rng), sheet, Crew(rng))
    readings = read(rows, tmp_path / "r.csv", layout, sheet)
    reduce_panels(readings, layout, sheet)  # compiles
    start = perf_counter()
    found = reduce_panels(readings, layout, sheet, survey=survey(stands, 80e-6, rng))
    assert perf_counter() - start < 30.0
    assert found.known.sum() == 8016 - 78
    assert np.isfinite(found.u_relative[found.known]).all()
    assert found.variance_factor == pytest.approx(1.0, abs=0.1)
