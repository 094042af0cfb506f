"""Uncertain inputs of one range, with analytical slopes.

With s = half / (2 pi n), metres a radian, l the path length in air of the phase, P the target's phasor, R_j those of
the references with weights w_j, G = -n_g h cos r + h_rp cos I the glass of a prism with a fixed reference point:

    phase of the target      -S = -(s + c'), c' the slope of cyclic deviation and second pass by the phase
    phase of the electronics  S
    leakage L                 S Im(dL/P - sum w_j dL/R_j) - s k Re(dL/P - sum v_j |R_j| dL/R_j / sum v_j |R_j|)
    coupling k                s ln(A/A_ref)
    second pass               -s times the slopes of `second_pass_turn`
    frequency                 -l / f
    index                     -l / n
    height h                  -n_g cos r       (the point h_rp below the face stays where it is; with two indices the
                              group path over h)
    index of the glass        -h / cos r       (the same)
    radii of a ball           -(n_g - 1), -n_g
"""

from dataclasses import dataclass
from typing import assert_never

import numpy as np

from catseye.atmosphere.index.air import MODELS, air
from catseye.atmosphere.path.mean import mean_over_height, pressure_at
from catseye.atmosphere.weather.humidity import saturation, vapour_pressure_hpa
from catseye.constants import DEGREE, MILLIMETRE, PPM, TWO_PI
from catseye.estimation.quality.propagation import STUDENT, Input
from catseye.optics.retroreflector.kinds.kind import GlassForm
from catseye.optics.retroreflector.prism import obliquity_slope
from catseye.reduction.budget.scene import FELT, ShotScene, head_columns
from catseye.reduction.epoch.head import (
    AXES,
    IMAGE,
    LASER,
    head_corrections,
    head_noise,
    head_unknowns,
    radian_length,
)
from catseye.reduction.epoch.parameter import ParameterKind
from catseye.signal.detection.buffers import inspect_buffers
from catseye.signal.detection.cycle_scatter import FEWEST_FOR_BATCHES
from catseye.signal.systematics.cyclic import cyclic_slope
from catseye.signal.systematics.multipath import second_pass_slopes

NAMED = 0.01  # weight of a reference beyond which it has its own line
DITHERED = 0.5  # codes of rms noise above which a converter's steps are averaged like noise
ASSUMED = "assumed: "
SHEET = "mirrors/{}.toml: "
NEW_EACH_SHOT = {  # effect -> key of its item, keys of the sheet
    LASER: ("feedback", "u_feedback_rad"),
    IMAGE: ("image", "u_image_um, image_offset_um, detector_lag_rad"),
}


@dataclass(frozen=True)
class Item:
    """One input of a range.

    key      for the chain
    given    name, value, standard uncertainty, distribution, degrees of freedom, in the unit
    unit     of value and u
    slope    m, range by the input, a unit
    source   record or assumption
    """

    key: str
    given: Input
    unit: str
    slope: float
    source: str


def items_of(scene: ShotScene) -> tuple[Item, ...]:
    """Inputs of a range in the order of the light.

    Samples, electronics, head, air, glass.
    """
    return (*_samples(scene), *_electronics(scene), *_head(scene), *_frequency(scene), *_air(scene), *_glass(scene))


def correlation_of(scene: ShotScene, items: tuple[Item, ...]) -> np.ndarray:
    """Correlation of all inputs.

    The thermometers' as assumed; an effect on target and references alike is one input.
    """
    r = np.eye(len(items))
    thermometers = [k for k, item in enumerate(items) if item.key.startswith("thermometer ")]
    for i in thermometers:
        for j in thermometers:
            if i != j:
                r[i, j] = scene.assumptions.thermometer_correlation
    return r


def _phase_slope(scene: ShotScene) -> tuple[float, float]:
    """Slopes S and s, m a radian, of the range by the electronics' phase.

    With and without cyclic deviation and second pass.
    """
    s = scene.half / (TWO_PI * scene.index)
    mirror = scene.mirror
    cosine, sine = (np.array(c) * MILLIMETRE for c in (mirror.cyclic_cosine_mm, mirror.cyclic_sine_mm))
    return s + float(cyclic_slope(scene.phase, cosine, sine)) + s * float(_second_pass_slopes(scene)[0]), s


def _second_pass_slopes(scene: ShotScene) -> tuple[np.ndarray, np.ndarray]:
    """Slopes of the second pass's turn by phase, rad/rad, and amplitude, rad/V."""
    mirror = scene.mirror
    pair = mirror.second_pass_cosine_per_volt, mirror.second_pass_sine_per_volt
    return second_pass_slopes(scene.phase, abs(scene.phasor), *pair)


def _noise(scene: ShotScene, row: int, phasor: complex) -> tuple[str, float]:
    """Distribution and degrees of freedom of a buffer's phase noise.

    Of the quadrature across the phasor, as in `measure_phases`.

    From 16 cycles on it is that of one quadrature, of fewer degrees where the noise is coloured; of both below that;
    one cycle alone is judged about its mean and three harmonics.

    phasor   of the light: a leakage turns the directions along and across
    """
    shots = scene.campaign.shots
    m, n = int(shots.cycles[row]), int(shots.samples_per_cycle[row])
    if m < FEWEST_FOR_BATCHES:
        return STUDENT, float(2 * (m - 1) if m > 1 else n - 7)
    detection = inspect_buffers(scene.campaign.frames[shots.frame[[row]], : m * n], n).detection
    _, degrees = detection.scatter.variance(np.array([phasor]))
    return STUDENT, float(degrees[0, 1])


def _samples(scene: ShotScene) -> list[Item]:
    campaign, row = scene.campaign, scene.row
    shots, adc = campaign.shots, campaign.site.adc
    slope, s = _phase_slope(scene)
    amplitude = abs(scene.phasor)
    count = int(shots.cycles[row] * shots.samples_per_cycle[row])
    code = adc.full_scale_volt / 2 ** (adc.bits - 1)
    rms = scene.u_across * np.sqrt(0.5 * count)
    # Without noise every cycle repeats the same rounding, and more cycles do not average it.
    rounded = count if rms >= DITHERED * code else int(shots.samples_per_cycle[row])
    u_steps = code / np.sqrt(12.0) * np.sqrt(2.0 / rounded)
    u_noise = float(np.sqrt(max(scene.u_across**2 - u_steps**2, 0.0)))
    kind, degrees = _noise(scene, row, scene.phasor)
    noise = f"frames.npy row {shots.frame[row]}: scatter of {shots.cycles[row]} cycles, less the converter's steps"
    phase = float(np.mod(np.angle(scene.phasor), TWO_PI))
    coupling = scene.mirror.amplitude_to_phase_rad
    return [
        *(
            Item(key, Input(effect, 0.0, u), "rad", -slope, SHEET.format(scene.mirror.zp) + source)
            for effect, u in head_noise(scene.mirror).items()
            for key, source in (NEW_EACH_SHOT[effect],)
        ),
        Item("noise", Input("noise of the target", phase, u_noise / amplitude, kind, degrees), "rad", -slope, noise),
        Item(
            "amplitude",
            Input("amplitude of the target", amplitude, scene.u_phasor, kind, degrees),
            "V",
            s * (coupling / amplitude - float(_second_pass_slopes(scene)[1])),
            "as the noise",
        ),
        Item(
            "steps",
            Input("steps of the converter", 0.0, u_steps / amplitude),
            "rad",
            -slope,
            f"site.toml: {adc.bits} bits, {adc.full_scale_volt:g} V; a step rectangular, {rounded} averaged",
        ),
    ]


def _electronics(scene: ShotScene) -> list[Item]:
    references, (slope, _) = scene.references, _phase_slope(scene)
    shots = scene.campaign.shots
    items = []
    for k in np.flatnonzero(np.abs(references.weight) >= NAMED):
        row = int(references.shots[k])
        kind, degrees = _noise(scene, row, complex(references.phasor[k]))
        after = references.seconds[k] - scene.seconds
        name = f"noise of reference shot {shots.shot[row]}"
        quantity = Input(name, float(references.unwrapped[k]), float(references.u_phase[k]), kind, degrees)
        source = f"frames.npy row {shots.frame[row]}; {abs(after):.0f} s {'later' if after > 0 else 'before'}"
        source += f", weight {references.weight[k]:.3f}"
        items.append(Item(f"reference {k}", quantity, "rad", slope * float(references.weight[k]), source))
    minor = np.abs(references.weight) < NAMED
    if minor.any():
        u = float(np.sqrt(np.sum((references.weight * references.u_phase)[minor] ** 2)))
        quantity = Input("noise of other references", 0.0, u)
        items.append(Item("references", quantity, "rad", slope, f"{minor.sum()} shots of little weight"))
    drift = scene.campaign.site.ranging.electronic_drift_mrad_per_sqrt_hour
    quantity = Input("walk of the electronics", references.phase, references.u_walk)
    source = f"site.toml: {drift:g} mrad in the first hour, as its square root; between {_gap(scene)}"
    return [*items, Item("walk", quantity, "rad", slope, source)]


def _gap(scene: ShotScene) -> str:
    after = scene.references.seconds - scene.seconds
    before, later = after[after <= 0], after[after > 0]
    if not len(before) or not len(later):
        return (
            f"the shot and the nearest reference, {np.min(np.abs(after)):.0f} s {'before' if len(before) else 'later'}"
        )
    return f"references {later.min() - before.max():.0f} s apart"


def _head(scene: ShotScene) -> list[Item]:
    mirror, references = scene.mirror, scene.references
    file = SHEET.format(mirror.zp)
    slope, s = _phase_slope(scene)
    target = 1.0 / scene.phasor
    cube = complex(np.sum(references.weight / references.phasor))
    share = references.level * np.abs(references.phasor) / references.amplitude
    cube_level = complex(np.sum(share / references.phasor))
    leakage = scene.leakage
    items = []
    for key, unit, value in (("real", 1.0, leakage.real), ("imaginary", 1.0j, leakage.imag)):
        turn, level = (unit * (target - cube)).imag, (unit * (target - cube_level)).real
        quantity = Input(f"leakage, {key}", value, mirror.u_leakage_volt)
        by = slope * turn - s * mirror.amplitude_to_phase_rad * level
        by += s * float(_second_pass_slopes(scene)[1]) * abs(scene.phasor) * (unit * target).real
        items.append(Item(f"leakage {key}", quantity, "V", by, f"{file}u_leakage_volt; in target and references alike"))
    quantity = Input("distance of the cube D0", mirror.d0_mm, mirror.u_d0_mm)
    return [*items, Item("d0", quantity, "mm", MILLIMETRE, f"{file}u_d0_mm"), *_effects(scene, file)]


def _effects(scene: ShotScene, file: str) -> list[Item]:
    """Axes, coupling and cyclic deviation, where the sheet has them."""
    mirror = scene.mirror
    unknowns = head_unknowns(scene.campaign, scene.ranger)
    corrections = head_corrections(
        scene.campaign,
        scene.ranger,
        head_columns(scene.campaign, scene.ranger),
        sight=(scene.b - scene.a)[None],
        phase=np.array([scene.phase]),
        amplitude=np.array([abs(scene.phasor)]),
        reference_amplitude=np.array([scene.references.amplitude]),
        per_radian=radian_length(np.array([scene.modulation_hz]), np.array([scene.index])),
    )
    slopes = iter(corrections.slopes[0])
    items = []
    for unknown in unknowns:
        kind = unknown.quantity.kind
        values: tuple[float, ...]
        if kind is ParameterKind.AXES:
            values, unit, factor = tuple(getattr(mirror, key) for key in AXES), "mm", MILLIMETRE
        elif kind is ParameterKind.AMPLITUDE:
            values, unit, factor = (mirror.amplitude_to_phase_rad,), "rad", 1.0
        elif kind is ParameterKind.SECOND_PASS:
            values = mirror.second_pass_cosine_per_volt, mirror.second_pass_sine_per_volt
            unit, factor = "1/V", 1.0
        else:
            values, unit, factor = (*mirror.cyclic_cosine_mm, *mirror.cyclic_sine_mm), "mm", MILLIMETRE
        values = values or (0.0,) * len(unknown.parts)
        for part, value in zip(unknown.parts, values, strict=True):
            key, name = {
                ParameterKind.AXES: (f"axes {part}", part),
                ParameterKind.AMPLITUDE: ("coupling", "amplitude to phase"),
                ParameterKind.CYCLIC: (f"cyclic {part}", f"cyclic, {part}"),
                ParameterKind.SECOND_PASS: (f"second pass {part}", f"second pass, {part}"),
            }[kind]
            quantity = Input(name, float(value), unknown.u / factor)
            items.append(Item(key, quantity, unit, float(next(slopes)) * factor, file + unknown.key))
    return items


def _frequency(scene: ShotScene) -> list[Item]:
    f = scene.modulation_hz
    quantity = Input("modulation frequency", f, scene.assumptions.u_frequency * f)
    return [Item("frequency", quantity, "Hz", -scene.length / f, ASSUMED + "a rubidium oscillator left alone")]


def _air(scene: ShotScene) -> list[Item]:
    field, assumed = scene.field, scene.assumptions
    by_index = -scene.length / scene.index
    pressure, humidity = mean_readings(scene)
    by_pressure, by_humidity = _weather_slopes(scene)
    fluctuation = scene.campaign.site.ranging.path_index_fluctuation_ppm
    items = []
    for k, name in enumerate(field.stations):
        quantity = Input(f"offset of thermometer {name}", 0.0, float(field.sigmas[k]))
        source = ASSUMED + "never compared with a standard"
        items.append(Item(f"thermometer {name}", quantity, "°C", by_index * float(scene.path.slopes[0, k]), source))
    at = len(field.stations)
    unit = "°C" if field.profile == "bend" else "°C/m"
    quantity = Input(f"{field.profile} of temperature with height", 0.0, float(field.sigmas[at]))
    source = ASSUMED + ("half-way between the stations" if field.profile == "bend" else "stations at one height")
    items.append(Item("profile", quantity, unit, by_index * float(scene.path.slopes[0, at]), source))
    line = field.line_of_first
    if line is not None:
        column = field.names.index(line.name)
        quantity = Input(f"temperature of {line.name} by sound", 0.0, float(field.sigmas[column]))
        items.append(
            Item("sound", quantity, "°C", by_index * float(scene.path.slopes[0, column]), "path_temperatures.csv")
        )
    chosen = MODELS[scene.settings.air_model]
    temperature = float(field.smoothed(scene.campaign.shots.mjd_utc[[scene.row]])[0, :, 0].mean())
    vapour = vapour_pressure_hpa(temperature, pressure, humidity, chosen.vapour_formula)
    light = {"wavelength_um": field.wavelength_um}
    formula = float(chosen.uncertainty(temperature, pressure, vapour, **light)) / PPM
    return [
        *items,
        Item(
            "pressure",
            Input("pressure", pressure, assumed.u_pressure_hpa),
            "hPa",
            by_index * by_pressure,
            "weather.csv; u " + ASSUMED + "a station's barometer",
        ),
        Item(
            "humidity",
            Input("relative humidity", humidity, assumed.u_humidity_percent),
            "%",
            by_index * by_humidity,
            "weather.csv; u " + ASSUMED + "a station's hygrometer",
        ),
        Item("formula", Input("formula of the index", 0.0, formula), "ppm", by_index * PPM, scene.settings.air_model),
        Item(
            "unread",
            Input("air that no station reads", 0.0, field.u_unread(scene.path)[0] / PPM),
            "ppm",
            by_index * PPM,
            "experience, without the ranges: catseye help decisions/0017-air-as-a-process",
        ),
        Item(
            "fluctuation",
            Input("path against smooth air", 0.0, fluctuation),
            "ppm",
            by_index * PPM,
            "site.toml: path_index_fluctuation_ppm",
        ),
    ]


def mean_readings(scene: ShotScene) -> tuple[float, float]:
    """Pressure and humidity, smoothed to the shot's instant.

    hPa at the stations' mean height, and relative humidity in %.
    """
    state = scene.field.smoothed(scene.campaign.shots.mjd_utc[[scene.row]])[0]
    return float(state[:, 1].mean()), float(state[:, 2].mean())


def _weather_slopes(scene: ShotScene) -> tuple[float, float]:
    """Slopes of the path's mean group index by pressure and humidity.

    A hPa and a %; temperature by the stations' line.
    """
    field = scene.field
    temperatures = field.smoothed(scene.campaign.shots.mjd_utc[[scene.row]])[0, :, 0]
    pressure, humidity = mean_readings(scene)
    middle = float(field.heights.mean())
    line = field.line_of_first
    warm = 0.0 if line is None else float(line.at(scene.campaign.shots.mjd_utc[[scene.row]])[0][0])
    slope, level = (0.0, float(temperatures.mean()))
    if field.profile == "bend":
        slope, level = np.polyfit(field.heights - middle, temperatures, 1)

    def slopes(z: np.ndarray) -> np.ndarray:
        at = pressure_at(pressure, middle, z)
        moist = air(
            level + slope * (z - middle),
            at,
            np.full(z.shape, humidity),
            wavelength_um=field.wavelength_um,
            model=field.model,
        )
        if line is None:
            return np.stack([moist.sensitivity.pressure_hpa, moist.sensitivity.humidity_percent])
        # temperature by sound, vapour by the stations
        chosen = MODELS[field.model]
        saturated = saturation(level + slope * (z - middle), at, chosen.vapour_formula)
        state = (warm, at, moist.vapour_pressure_hpa)
        partials = chosen.partials(*state, wavelength_um=field.wavelength_um, co2_ppm=chosen.co2_ppm)
        by_pressure = partials.pressure_hpa + partials.vapour_pressure_hpa * humidity / 100.0 * saturated.per_hpa
        return np.stack([by_pressure, partials.vapour_pressure_hpa * saturated.pressure_hpa / 100.0])

    by_pressure, by_humidity = mean_over_height(slopes, scene.a[2], scene.b[2])
    return float(by_pressure), float(by_humidity)


def _glass(scene: ShotScene) -> list[Item]:
    place, campaign = scene.place, scene.campaign
    n = campaign.site.ranging.bk7_to_air_group_index_ratio
    u_n = scene.assumptions.half_width_index_ratio / np.sqrt(3.0)
    ratio = Input("index of the glass over air", n, u_n, "rectangular")
    melt = ASSUMED + "no sheet names its melt"
    match place.glass:
        case GlassForm.NONE:
            return []
        case GlassForm.SPHERES:
            file, r1, r2, u = ball_of(scene)
            return [
                Item("r1", Input("radius of the small ball", r1, u), "mm", -(n - 1.0) * MILLIMETRE, f"{file}u_r_mm"),
                Item("r2", Input("radius of the large ball", r2, u), "mm", -n * MILLIMETRE, f"{file}u_r_mm"),
                Item("ratio", ratio, "", -(r1 + r2) * MILLIMETRE, melt),
            ]
        case GlassForm.SLAB:
            return _slab(scene, ratio, melt)
        case _:
            assert_never(place.glass)


def _slab(scene: ShotScene, ratio: Input, melt: str) -> list[Item]:
    """Inputs of a prism's glass."""
    place, campaign, n = scene.place, scene.campaign, ratio.value
    height = place.height
    bends = campaign.site.ranging.bk7_to_air_phase_index_ratio
    square = float(np.sin(scene.incidence) ** 2)
    cos_r = float(np.sqrt(1.0 - square / (n if bends is None else bends) ** 2))
    in_glass = n * cos_r if bends is None else (n * bends - square) / (bends * cos_r)
    in_unit = place.group in campaign.triplets
    file = f"triplets/{place.group}.toml: " if in_unit else "targets.toml: "
    u_normal = scene.settings.u_plate_normal if in_unit else scene.settings.u_normal
    by_angle = float(obliquity_slope(height, n, np.cos(scene.incidence), phase=bends))
    quantity = Input("height of the prism", height / MILLIMETRE, place.u_constant / n / MILLIMETRE)
    tilt = Input("angle of incidence", scene.incidence / DEGREE, u_normal / DEGREE)
    across = Input("tilt of the face across it", 0.0, u_normal / DEGREE)
    return [
        Item("height", quantity, "mm", -in_glass * MILLIMETRE, f"{file}u_height_mm"),
        Item("ratio", ratio, "", -height / cos_r, melt),
        Item("incidence", tilt, "°", by_angle * DEGREE, f"{file}normal; u " + ASSUMED + "as the layout's README"),
        Item("across", across, "°", 0.0, "as the angle of incidence; second order only"),
    ]


def ball_of(scene: ShotScene) -> tuple[str, float, float, float]:
    """File, radii and their standard uncertainty, mm, of the shot's ball."""
    triplet = next(t for t in scene.campaign.triplets.values() if t.ball.target == scene.target)
    return f"triplets/{triplet.triplet}.toml: ", triplet.ball.r1_mm, triplet.ball.r2_mm, triplet.ball.u_r_mm


def felt(scene: ShotScene) -> np.ndarray:
    """Indices of the references with a significant weight."""
    return np.flatnonzero(np.abs(scene.references.weight) >= FELT)
