"""Offsets dx, dy, dz from tooling ball to scan point, by height gauge.

Over a surface plate.

The assembly stands on matched v-blocks. In each set-up one of the mount's axes looks up and another one to the front
of the plate; ball and mirror are touched, and their heights differ by the offset along the axis that looks up:

    h = zero of the set-up + n . (offset of the feature) + radius where its top is touched (- bottom, 0 centre)

n is the plate's normal in mount axes. Where v-blocks or angle plate lean, n leans with them, and an offset across (dy,
a quarter of a metre) comes in: 247 mm at 2" are 2.4 um. The assembly turned round, so that the axis looks down, tells
the lean from the offset, if the long offset then lies as before.

Signs by the notes: from the ball to the mirror, up the mount's own axes.
"""

import re
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from catseye.constants import ARCSECOND, PPM
from catseye.geometry.catenary import expanded
from catseye.records.files.readings import TEXT, Sheet, SheetLayout, SheetReadings
from catseye.records.files.record import Uncertainty, Within, broken_rule
from catseye.records.files.refusal import refusal
from catseye.reduction.calibrations.calibration import Calibration, Cell, RecordValue
from catseye.reduction.calibrations.curved import CurvedFit, ModelParameter, fit_curved
from catseye.reduction.calibrations.fit import FitOptions, ObservedScatter
from catseye.reduction.calibrations.kind import (
    CalibrationKind,
    Plausibility,
    PlausibleSpan,
    ReadingScatter,
    provenance,
    residuals_by_number,
    scatter_notes,
)
from catseye.reduction.calibrations.length.gauge_blocks import Block

KIND = "height-gauge"
HEIGHT = Within(-2000, 2000)
AXES = {"x": 0, "y": 1, "z": 2}
SENSE = re.compile(r"[+-][xyz]")
TOUCH = {"top": 1.0, "centre": 0.0, "bottom": -1.0}
Diameter = Annotated[float, Within(0, 500, above=True)]
Arcseconds = Annotated[float, Within(0, 3600)]
OFFSETS = ("dx", "dy", "dz")
WAYS = ("right", "front")
SHARED = 13  # parameters before those of the set-ups


class HeightSheet(Sheet):
    """Sheet of offsets by a height gauge.

    ball_diameter_mm, u_ball_diameter_mm  diameter of the tooling ball; needed where tops or bottoms are touched
    mirror_diameter_mm, u_mirror_diameter_mm  diameter of a journal or plug gauge on the mirror's axes, likewise
    block                                 gauge blocks under the indicator, as for gauge-blocks
    film_um, u_film_um                    thickness of each film between blocks
    u_lean_arcsec                         of what it stands on, towards the front and the right: the same in all
                                          set-ups with one axis up or down
    u_seating_arcsec                      independent lean of each set-up, both directions
    u_scale_ppm                           of the height gauge
    gauge_temperature_c                   temperature of the gauge's scale and the blocks, which are true at 20 °C
    gauge_expansion_ppm_per_c             their coefficient of expansion
    dx_mm, dy_mm, dz_mm                   offset along an axis that never points up: known beforehand and held
    u_offset_mm                           of each such offset
    u_reading_mm                          scatter of a reading, if known
    """

    ball_diameter_mm: Diameter | None = None
    u_ball_diameter_mm: Annotated[float, Within(0, 1)] = 0.0
    mirror_diameter_mm: Diameter | None = None
    u_mirror_diameter_mm: Annotated[float, Within(0, 1)] = 0.0
    block: Annotated[tuple[Block, ...], Field(strict=False)] = ()
    film_um: Annotated[float, Within(-1, 10)] = 0.0
    u_film_um: Annotated[float, Within(0, 10)] = 0.0
    u_lean_arcsec: Arcseconds
    u_seating_arcsec: Arcseconds = 0.0
    u_scale_ppm: Annotated[float, Within(0, 1000)]
    gauge_temperature_c: Annotated[float, Within(-10, 50)] = 20.0
    gauge_expansion_ppm_per_c: Annotated[float, Within(-5, 50)] = 11.5
    dx_mm: Annotated[float, Within(-100, 100)] | None = None
    dy_mm: Annotated[float, Within(50, 1000)] | None = None
    dz_mm: Annotated[float, Within(-100, 100)] | None = None
    u_offset_mm: Uncertainty | None = None
    u_reading_mm: Uncertainty | None = None

    @model_validator(mode="after")
    def _says_how_well_it_knows_its_offsets(self) -> "HeightSheet":
        for name in OFFSETS:
            if getattr(self, f"{name}_mm") is not None and self.u_offset_mm is None:
                raise broken_rule(f"{name}_mm = {getattr(self, f'{name}_mm')} has no u_offset_mm (expected its u)")
        return self


LAYOUT = SheetLayout(
    KIND,
    HeightSheet,
    required={"setup": TEXT, "up": TEXT, "front": TEXT, "feature": TEXT, "touch": TEXT, "height_mm": HEIGHT},
    optional={"indicator_mm": Within(-100, 100), "blocks": TEXT},
)


def calibrate_height_gauge(readings: SheetReadings, reject: bool = False) -> Calibration:
    """Offsets of the scan point from the tooling ball, mount axes.

    From heights over a surface plate.

    readings   columns setup (a word for each), up and front ("+y": the mount's axis that looks there), feature ("ball"
               or "mirror"), touch ("top", "centre", "bottom"), height_mm, perhaps indicator_mm (added) and blocks
               (names of the sheet's blocks, joined by +; added); sheet HeightSheet
    reject     leave out what the tests reject

    Raises EstimationError where ball and mirror are not both touched in a set-up that determines a free offset.

    Source: [PARKER04] section 2.2.2, step 3; eq. 2.7 for the signs.
    """
    sheet, m = readings.sheet, len(readings)
    turned, mirror, touched = _placed(readings)
    stacks, films = _stacks(readings)
    setups = list(dict.fromkeys(readings.words["setup"]))
    which = np.array([setups.index(word) for word in readings.words["setup"]])
    scale = expanded(1.0, sheet.gauge_temperature_c, sheet.gauge_expansion_ppm_per_c * PPM)  # a warm scale reads short
    lengths = np.array([block.length_mm for block in sheet.block])
    read = readings.get("height_mm") + (readings.get("indicator_mm") if "indicator_mm" in readings.numbers else 0.0)
    observed = (read + stacks @ lengths + films * sheet.film_um * 1e-3) * scale
    sought = {
        name for name, axis in zip(OFFSETS, AXES.values(), strict=True) if np.any(np.abs(turned[:, 2, axis]) > 0.5)
    }
    parameters = _parameters(readings, sought, setups, observed, which)
    names = [p.name for p in parameters]
    upright = np.argmax(np.abs(turned[:, 2]), axis=1)  # the axis that looks up or down
    s, blocks = len(setups), len(lengths)

    def predict(values: np.ndarray) -> np.ndarray:
        p = dict(zip(names, values, strict=True))
        offsets = turned @ np.array([p[name] for name in OFFSETS])  # right, front, up in each set-up
        leans = np.array([[p[f"{axis} set-ups lean {direction}"] for direction in WAYS] for axis in AXES])[upright]
        seats = values[SHARED : SHARED + 3 * s].reshape(s, 3)[which]
        lean = leans + seats[:, 1:]
        height = offsets[:, 2] + np.sum(lean * offsets[:, :2], axis=1)
        radius = 0.5 * np.where(mirror, p["mirror diameter"], p["ball diameter"])
        true = seats[:, 0] + mirror * height + touched * radius
        off = stacks @ values[SHARED + 3 * s : SHARED + 3 * s + blocks] + films * p["film"]
        return true - off - observed * p["scale"]

    eye = np.eye(m)
    scatter = ObservedScatter(np.zeros((m, m)), {"scatter of one reading": eye}, size=float(np.abs(observed).max()))
    if sheet.u_reading_mm is not None:
        scatter = ObservedScatter(sheet.u_reading_mm**2 * eye)
    solution = fit_curved(
        observed,
        predict,
        parameters,
        scatter=scatter,
        options=FitOptions(active=readings.active, reject=reject, level=sheet.level),
    )
    return _calibration(readings, solution, [name for name in OFFSETS if name in sought])


def _placed(readings: SheetReadings) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Plate axes (m, 3, 3) in mount axes, mirror flags, and touch sign.

    Axes right, front, up; (m,) True where the mirror is touched; (m,) +1, 0, -1.
    """
    turned = np.zeros((len(readings), 3, 3))
    places: dict[str, tuple[str, str]] = {}
    for row in range(len(readings)):
        words = {name: readings.words[name][row] for name in ("setup", "up", "front", "feature", "touch")}
        for name in ("up", "front"):
            if not SENSE.fullmatch(words[name]):
                raise readings.refuse(row, f"{name} = {words[name]!r} is no axis (expected one of +x -x +y -y +z -z)")
        if words["up"][1] == words["front"][1]:
            raise readings.refuse(
                row, f"up = {words['up']!r} and front = {words['front']!r} are one axis (expected two)"
            )
        if words["feature"] not in ("ball", "mirror"):
            raise readings.refuse(row, f"feature = {words['feature']!r} is unknown (expected 'ball' or 'mirror')")
        if words["touch"] not in TOUCH:
            raise readings.refuse(row, f"touch = {words['touch']!r} is unknown (expected 'top', 'centre' or 'bottom')")
        needed = f"{words['feature']}_diameter_mm"
        if TOUCH[words["touch"]] and getattr(readings.sheet, needed) is None:
            raise refusal(
                readings.sheet_file, f"{needed} is missing (expected, as {readings.file} touches its {words['touch']})"
            )
        place = (words["up"], words["front"])
        if places.setdefault(words["setup"], place) != place:
            raise readings.refuse(
                row, f"setup = {words['setup']!r} stands another way than before (expected a new name)"
            )
        for k, word in ((2, place[0]), (1, place[1])):
            turned[row, k, AXES[word[1]]] = 1.0 if word[0] == "+" else -1.0
        turned[row, 0] = np.cross(turned[row, 1], turned[row, 2])  # right = front x up, as east = north x up
    mirror = np.array([word == "mirror" for word in readings.words["feature"]])
    return turned, mirror, np.array([TOUCH[word] for word in readings.words["touch"]])


def _stacks(readings: SheetReadings) -> tuple[np.ndarray, np.ndarray]:
    """Blocks under the indicator (m, blocks), and films between them (m,)."""
    positions = {block.name: k for k, block in enumerate(readings.sheet.block)}
    used = np.zeros((len(readings), len(positions)))
    for row, stack in enumerate(readings.words.get("blocks", ())):
        for name in (part.strip() for part in stack.split("+") if part.strip()):
            if name not in positions:
                raise readings.refuse(row, f"blocks = {stack!r}: {name!r} has no [[block]] in {readings.sheet_file}")
            if used[row, positions[name]]:
                raise readings.refuse(row, f"blocks = {stack!r}: {name!r} stands twice (expected each block once)")
            used[row, positions[name]] = 1.0
    return used, np.maximum(used.sum(axis=1) - 1.0, 0.0)


def _parameters(
    readings: SheetReadings, sought: set[str], setups: list[str], observed: np.ndarray, which: np.ndarray
) -> list[ModelParameter]:
    """Common parameters, three of each set-up, one of each block."""
    sheet = readings.sheet
    offsets = []
    for name in OFFSETS:
        value = getattr(sheet, f"{name}_mm")
        if name in sought:
            offsets.append(ModelParameter(name, value or 0.0, 1e-2))
        elif value is None:
            raise refusal(
                readings.sheet_file,
                f"{name}_mm is missing (expected with u_offset_mm, as no set-up of {readings.file} has {name[1]} up)",
            )
        else:
            offsets.append(ModelParameter(name, value, 1e-2, sheet.u_offset_mm, "mm"))
    lean, seating = sheet.u_lean_arcsec * ARCSECOND, sheet.u_seating_arcsec * ARCSECOND
    shared = [
        *offsets,
        ModelParameter("ball diameter", sheet.ball_diameter_mm or 0.0, 1e-2, sheet.u_ball_diameter_mm, "mm"),
        ModelParameter("mirror diameter", sheet.mirror_diameter_mm or 0.0, 1e-2, sheet.u_mirror_diameter_mm, "mm"),
        *(
            ModelParameter(f"{axis} set-ups lean {direction}", 0.0, 1e-4, lean, "rad")
            for axis in AXES
            for direction in WAYS
        ),
        ModelParameter("film", 0.0, 1e-3, sheet.u_film_um * 1e-3, "mm"),
        ModelParameter("scale", 0.0, 1e-4, sheet.u_scale_ppm * PPM, "1"),
    ]
    for k, setup in enumerate(setups):
        shared.append(ModelParameter(f"zero of {setup}", float(np.mean(observed[which == k])), 1e-2))
        shared += [ModelParameter(f"{setup} leans {direction}", 0.0, 1e-4, seating, "rad") for direction in WAYS]
    return shared + [ModelParameter(f"block {block.name}", 0.0, 1e-3, block.u_mm, "mm") for block in sheet.block]


def _calibration(readings: SheetReadings, solution: CurvedFit, sought: list[str]) -> Calibration:
    sheet, fit = readings.sheet, solution.fit
    calibrated, covariance = solution.quantities(
        [
            (name, f"{name}_mm", "mm", f"from the tooling ball to the mirror along the mount's {name[1]}", 1.0)
            for name in sought
        ]
    )
    record: dict[str, RecordValue] = {q.key: q.value for q in calibrated}
    record["u_offset_mm"] = max(solution.u(name) for name in OFFSETS)
    words = ("setup", "up", "front", "feature", "touch")
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (*(readings.words[word][k] for word in words), float(fit.predicted[k] + fit.residual[k]),
         float(1e3 * fit.residual[k]), float(fit.statistic[k]), state)
        for k, state in enumerate(fit.state(readings.left_out))
    )  # fmt: skip
    leans = [
        f'{name} {solution.value(name) / ARCSECOND:+.2g}" (u {solution.u(name) / ARCSECOND:.2g}")'
        for name in (f"{offset[1]} set-ups lean {direction}" for offset in sought for direction in WAYS)
    ]
    return Calibration(
        kind=KIND,
        title=f"Mirror offsets of {sheet.instrument}",
        provenance=provenance(readings),
        quantities=calibrated,
        covariance=covariance,
        columns=(*words, "height_mm", "residual_um", fit.test, "state"),
        rows=rows,
        decisions=fit.decisions(),
        fit=fit,
        variance_factor=fit.variance_factor,
        degrees_of_freedom=round(fit.degrees_of_freedom),
        notes=(
            f"{'; '.join(leans)}: an offset of 250 mm across makes {250e3 * ARCSECOND:.2g} um an arcsec",
            *scatter_notes(fit, "µm", 1e-3),
        ),
        curve=residuals_by_number(fit, 1e-3),  # set-ups stand at different heights: residuals alone share an axis
        axes=("reading", "residual (µm)"),
        method="Heights of the tooling ball and of the mirror's axes over the plate, in several set-ups, are adjusted "
        "together: the offset along the axis that looks up, a zero for each set-up. The lean of the v-blocks, each "
        "set-up's own lean, diameters, blocks, films and the gauge's scale are parameters with priors.",
        record=record,
    )  # fmt: skip


RECIPE = CalibrationKind(
    "offsets of the mirror from the tooling ball, by a height gauge",
    LAYOUT,
    calibrate_height_gauge,
    plausible=Plausibility(
        scatter=ReadingScatter(
            20.0, "µm", 1e-3, "a height gauge on a surface plate repeats to some µm [PARKER04] 2.2.2"
        ),
        sizes={
            "d[xz]_mm": PlausibleSpan(-100.0, 100.0, "what the sheet allows of an offset known beforehand", u=0.5),
            "dy_mm": PlausibleSpan(50.0, 1000.0, "what the sheet allows of an offset known beforehand", u=0.5),
        },
    ),
)
