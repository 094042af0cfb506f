"""Writes the example of a panel setting crew: readings as found and as left, survey, maps, for three tiers of the GBT.

    python examples/panels/make_example.py

A twin made the readings (catseye.simulator.laboratory.panels): solid panels with twists and bumps, a tool on shafts
that lean. One reading of as-found.csv is 120 µm wrong: its line is said at the end.
"""

import math
import sys
from pathlib import Path

import numpy as np

from catseye.records.files.reading import read_record
from catseye.records.panels.instrument import PanelInstrument
from catseye.records.panels.layout import layout_of_site
from catseye.records.panels.readings import read_maps, read_panel_readings, read_survey
from catseye.records.site.folder import read_site
from catseye.reduction.panels.heights import reduce_panels
from catseye.reduction.panels.maps import fitted_map
from catseye.simulator.laboratory.panels import CornerTour, Crew, panel_readings, screwed, solid_panels

HERE = Path(__file__).parent
TIERS = ("T20", "T21", "T22")
SIDE = 12  # panels on either side of the plane of symmetry
U_SURVEY = 80e-6  # m
WRONG = ("DP21P05,1,", 4, 0.120)  # start of the row, column a_mm, mm


def main() -> None:
    layout = layout_of_site(read_site(HERE.parent / "sites" / "gbt"))
    panels = [k for k, n in enumerate(layout.panels) if n[:3] in TIERS and int(n[4:]) <= SIDE]
    part = layout.only(np.array(panels))
    (HERE / "layout.csv").write_text(part.csv(), "utf-8")
    sheet = read_record(HERE / "tool.toml", PanelInstrument)
    rng = np.random.default_rng(11)
    solid = solid_panels(part, rng, piston=2.5e-4, slope=8e-5, twist=2e-5, bump=4e-5)
    write_maps(solid, HERE / "maps", rng)
    crew = Crew(rng)
    tour = CornerTour(members=("Ada", "Ben"), a_day=25, turns=(0, 1, 2))
    rows, stands = panel_readings(solid, sheet, crew, tour=tour)
    wrong = next(k for k, row in enumerate(rows) if row.startswith(WRONG[0]))
    cells = rows[wrong].split(",")
    cells[WRONG[1]] = f"{float(cells[WRONG[1]]) + WRONG[2]:.3f}"
    rows[wrong] = ",".join(cells)
    (HERE / "as-found.csv").write_text("\n".join(rows) + "\n", "utf-8")
    seen = stands + rng.normal(0.0, math.hypot(U_SURVEY, sheet.u_stand_um * 1e-6), len(stands))
    survey = [f"{n},{h * 1e6:.1f},{U_SURVEY * 1e6:.1f}" for n, h in zip(part.corners, seen, strict=True)]
    (HERE / "survey.csv").write_text("\n".join(["corner,height_um,u_um", *survey]) + "\n", "utf-8")
    found = reduce_panels(
        read_panel_readings(HERE / "as-found.csv", part, sheet),
        part,
        sheet,
        survey=read_survey(HERE / "survey.csv", part),
        maps={name: fitted_map(one) for name, one in read_maps(HERE / "maps", part).items()},
        reject=True,
    )
    turn = np.where(found.known, found.turns, 0.0) * 0.98 + rng.normal(0.0, 0.004, found.turns.shape)
    moved = screwed(solid, np.where(found.known, turn, 0.0) * sheet.screw.pitch_mm * 1e-3)
    rows, _ = panel_readings(
        moved, sheet, Crew(rng), tour=CornerTour(members=("Ada", "Ben"), a_day=25, turns=(0, 1, 2)), shafts=stands
    )
    (HERE / "as-left.csv").write_text("\n".join(rows) + "\n", "utf-8")
    sys.stdout.write(f"wrong: line {wrong + 1}, a_mm\n")


def write_maps(solid, directory: Path, rng: np.random.Generator) -> None:
    """Maps on a grid of 9 by 7 points, noise of 5 µm, as the panel lay on the machine."""
    directory.mkdir(exist_ok=True)
    layout = solid.layout
    from catseye.geometry.antenna.panel_surface import panels_under
    from catseye.reduction.panels.model import panel_axes

    for p, name in enumerate(layout.panels):
        four = layout.xy[layout.quad[p]]
        u, v = (g.ravel() for g in np.meshgrid(np.linspace(-0.985, 0.985, 9), np.linspace(-0.97, 0.97, 7)))
        weight = 0.25 * np.stack([(1 - u) * (1 - v), (1 + u) * (1 - v), (1 + u) * (1 + v), (1 - u) * (1 + v)], axis=1)
        xy = weight @ four
        assert np.all(panels_under(xy, four[None])[0] == 0)
        at = np.column_stack([xy, np.sum(xy**2, axis=1) / (4.0 * layout.focal_length)])
        own = panel_axes(layout, np.full(len(xy), p), at)
        # on the machine the panel is free of its four screws: no twist
        free = type(solid)(**{**solid.__dict__, "twist": np.zeros_like(solid.twist)})
        deviation = free.shape(np.full(len(xy), p), xy) + rng.normal(0.0, 5e-6, len(xy)) + 3e-5 + own @ [2e-5, -3e-5]
        rows = [f"{1e3 * x:.1f},{1e3 * y:.1f},{1e6 * d:.1f}" for (x, y), d in zip(own, deviation, strict=True)]
        (directory / f"{name}.csv").write_text("\n".join(["x_mm,y_mm,deviation_um", *rows]) + "\n", "utf-8")


if __name__ == "__main__":
    main()
