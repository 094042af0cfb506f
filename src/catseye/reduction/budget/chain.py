"""Range as a function of drawn inputs, for the Monte Carlo.

From phasors to metres, not linearised. It shares with the budget the list of inputs and no slope. Drift: a path of
the electronics is drawn through all reference shots and the target's, and the interpolation is applied to it.
"""

from typing import assert_never

import numpy as np

from catseye.atmosphere.index.air import MODELS, air, group_refractivity
from catseye.atmosphere.path.mean import mean_over_height, pressure_at
from catseye.atmosphere.weather.humidity import vapour_pressure_hpa
from catseye.constants import DEGREE, MILLIMETRE, PPM, SPEED_OF_LIGHT, TWO_PI
from catseye.estimation.quality.propagation import Draw, Model, draw_inputs
from catseye.geometry.mirror.encoder import azimuth_angle, elevation_angle
from catseye.geometry.mirror.mirror_path import beam_angles, direction_angles, path_change
from catseye.optics.retroreflector.kinds.kind import GlassForm
from catseye.optics.retroreflector.prism import range_constant
from catseye.reduction.budget.inputs import Item, correlation_of, felt
from catseye.reduction.budget.scene import ShotScene, walk_of
from catseye.reduction.epoch.head import image_of, mounted, only_prime
from catseye.reduction.site.stations import AXES
from catseye.signal.systematics.multipath import second_pass_turn

NODES = 3  # of the quadrature along the path: exact to degree 5 in height


class DrawnInputs:
    """Drawn inputs by key; an absent key returns its default."""

    def __init__(self, items: tuple[Item, ...], x: np.ndarray) -> None:
        self.at = {item.key: k for k, item in enumerate(items)}
        self.best = {item.key: item.given.value for item in items}
        self.x = x

    def __call__(self, key: str, default: float = 0.0) -> np.ndarray:
        return self.x[:, self.at[key]] if key in self.at else np.full(len(self.x), default)

    def off(self, key: str) -> np.ndarray:
        """Deviation of an input from its best value."""
        return self(key) - self.best.get(key, 0.0)

    def orders(self, kind: str) -> list[np.ndarray]:
        """Coefficients of a cyclic deviation, order 1 first, mm."""
        return [self.x[:, k] for key, k in self.at.items() if key.startswith(f"cyclic {kind} ")]


def measurement(scene: ShotScene, items: tuple[Item, ...]) -> Model:
    """Range (n,), m, as a function of inputs (n, k).

    Inputs in the items' order and units.
    """

    def model(x: np.ndarray) -> np.ndarray:
        v = DrawnInputs(items, x)
        target, phase, level = _phase(scene, v)
        coupled = v("coupling") * np.log(np.abs(target) / level)
        per_radian = 0.5 * SPEED_OF_LIGHT / (v("frequency") * TWO_PI * _index(scene, v))
        again, _ = second_pass_turn(phase, np.abs(target), v("second pass cosine"), v("second pass sine"))
        image = float(image_of(scene.mirror).mean)
        length = per_radian * (TWO_PI * scene.cycles - phase + coupled - again + image)
        cyclic = sum(
            c * np.cos(k * phase) + s * np.sin(k * phase)
            for k, (c, s) in enumerate(zip(v.orders("cosine"), v.orders("sine"), strict=True), start=1)
        )
        return length + (v("d0") - cyclic) * MILLIMETRE + _glass(scene, v) + _axes(scene, v)

    return model


def drawing(scene: ShotScene, items: tuple[Item, ...]) -> Draw:
    """Function that draws inputs, the electronics' walk as a path.

    Its arguments are a generator and a number.
    """
    inputs = [item.given for item in items]
    correlation = correlation_of(scene, items)
    walk = next(k for k, item in enumerate(items) if item.key == "walk")

    def draw(generator: np.random.Generator, n: int) -> np.ndarray:
        x = draw_inputs(inputs, generator, n, correlation=correlation)
        x[:, walk] = inputs[walk].value + _walked(scene, generator, n)
        return x

    return draw


def _walked(scene: ShotScene, generator: np.random.Generator, n: int) -> np.ndarray:
    """Error (n,), rad, of the interpolated electronics phase.

    Against interpolation between noiseless references.
    """
    rows = felt(scene)
    references = scene.references
    when = np.append(references.seconds[rows], scene.seconds)
    order = np.argsort(when, kind="stable")
    steps = generator.standard_normal((n, len(when) - 1)) * np.sqrt(np.diff(when[order])) * walk_of(scene.campaign)
    path = np.zeros((n, len(when)))
    path[:, order[1:]] = np.cumsum(steps, axis=1)
    return path[:, -1] - path[:, :-1] @ references.weight[rows]


def _phase(scene: ShotScene, v: DrawnInputs) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Phasor, electronics-corrected phase and reference amplitude.

    V; rad, not wrapped; V.
    """
    leakage = v("leakage real") + 1j * v("leakage imaginary") - scene.leakage
    amplitude, direction = abs(scene.phasor), scene.phasor / abs(scene.phasor)
    turn = v.off("noise") + v.off("steps") + v.off("feedback") + v.off("image")
    noise = direction * (v.off("amplitude") + 1j * amplitude * turn)
    target = scene.phasor + noise - leakage
    references = scene.references
    electronics, level = v.off("references") + v.off("walk"), np.zeros(len(v.x))
    for k in np.union1d(felt(scene), np.flatnonzero(references.level)):
        phasor = references.phasor[k] * (1.0 + 1j * v.off(f"reference {k}")) - leakage
        electronics += references.weight[k] * np.angle(phasor / references.phasor[k])
        level += references.level[k] * np.abs(phasor)
    return target, scene.phase + np.angle(target / scene.phasor) - electronics, level


def _index(scene: ShotScene, v: DrawnInputs) -> np.ndarray:
    """Group index (n,) of the path in the drawn air."""
    field = scene.field
    read = field.smoothed(scene.campaign.shots.mjd_utc[[scene.row]])[0, :, 0]
    true = np.stack([t - v(f"thermometer {name}") for t, name in zip(read, field.names, strict=False)], axis=1)
    middle = field.heights.mean()
    arms = field.heights - middle
    mean = true.mean(axis=1)
    bent = field.profile == "bend"
    slope = true @ arms / np.sum(arms**2) if bent else v("profile")
    pressure, humidity = v("pressure"), v("humidity")
    legal = np.clip(humidity, 0.0, 100.0)  # beyond, the index continues along its tangent
    light = {"wavelength_um": field.wavelength_um, "model": field.model}
    line = field.line_of_first
    warm, share = (0.0, 0.0) if line is None else line.at(scene.campaign.shots.mjd_utc[[scene.row]])
    sound = warm - share * v("sound")
    best = air(float(read.mean()), v.best["pressure"], v.best["humidity"], **light).sensitivity.humidity_percent

    def profile(z: np.ndarray) -> np.ndarray:
        temperature = mean[:, None] + slope[:, None] * (z - middle)
        if bent:
            low, high = field.heights.min(), field.heights.max()
            temperature = temperature + v("profile")[:, None] * 4.0 * (z - low) * (high - z) / (high - low) ** 2
        at = pressure_at(pressure[:, None], middle, z)
        if line is None:
            return group_refractivity(temperature, at, np.broadcast_to(legal[:, None], z.shape), **light)
        # temperature by sound, vapour by the stations
        chosen = MODELS[field.model]
        vapour = vapour_pressure_hpa(temperature, at, legal[:, None], chosen.vapour_formula)
        state = (sound[:, None], at, vapour)
        return chosen.refractivity(*state, wavelength_um=field.wavelength_um, co2_ppm=chosen.co2_ppm)

    ends = (np.full(len(v.x), scene.a[2]), np.full(len(v.x), scene.b[2]))
    mean_refractivity = mean_over_height(profile, *ends, nodes=NODES)
    excess = best * (humidity - legal)
    return 1.0 + mean_refractivity + excess + (v("formula") + v("unread") + v("fluctuation")) * PPM


def _glass(scene: ShotScene, v: DrawnInputs) -> np.ndarray:
    """Correction for the glass (n,), m.

    Its reference point stays where the records have it.
    """
    place = scene.place
    n0 = scene.campaign.site.ranging.bk7_to_air_group_index_ratio
    n = v("ratio", n0)
    match place.glass:
        case GlassForm.NONE:
            return np.full(len(v.x), place.constant)
        case GlassForm.SPHERES:
            r1, r2 = v("r1") * MILLIMETRE, v("r2") * MILLIMETRE
            best = -(n0 * (v.best["r1"] + v.best["r2"]) - v.best["r1"]) * MILLIMETRE
            return r1 - n * (r1 + r2) + (place.constant - best)
        case GlassForm.SLAB:
            return _slab(scene, v, n)
        case _:
            assert_never(place.glass)


def _slab(scene: ShotScene, v: DrawnInputs, n: np.ndarray) -> np.ndarray:
    """Correction for a prism's glass (n,), m, at group indices (n,)."""
    place, towards = scene.place, scene.towards
    n0 = scene.campaign.site.ranging.bk7_to_air_group_index_ratio
    assert place.normal is not None
    along = towards - (towards @ place.normal) * place.normal
    size = float(np.linalg.norm(along))
    first = along / size if size > 1e-12 else np.linalg.svd(place.normal[None])[2][1]
    second = np.cross(place.normal, first)
    lean, across = v.off("incidence") * DEGREE, v("across") * DEGREE
    normal = place.normal - lean[:, None] * first + across[:, None] * second  # leaning away from the beam
    cosine = normal @ towards / np.linalg.norm(normal, axis=1)
    height, depth = v("height") * MILLIMETRE, place.height / n0
    bends = scene.campaign.site.ranging.bk7_to_air_phase_index_ratio
    square = 1.0 - cosine**2
    in_glass = np.sqrt(n**2 - square) if bends is None else (n * bends - square) / np.sqrt(bends**2 - square)  # n cos r
    typed = place.constant - float(range_constant(place.height, n0))  # Pc of the sheet
    return -height * in_glass + depth * cosine + typed


def _axes(scene: ShotScene, v: DrawnInputs) -> np.ndarray:
    """Correction (n,), m, for axes and beam that do not meet.

    Minus the target's change, plus the cube's.
    """
    if "axes axis offset" not in v.at:
        return np.zeros(len(v.x))
    mirror = scene.mirror
    sight = mounted(scene.campaign, scene.ranger).mirror_from_ground @ (scene.b - scene.a)
    keys = [f"axes {key.removesuffix('_mm').replace('_', ' ')}" for key in AXES]
    offsets = np.stack([v(key) for key in keys], axis=1) * MILLIMETRE
    prime = only_prime(mirror, direction_angles(sight)[0])
    theta, phi = beam_angles(sight, offsets, prime=prime)
    target, _ = path_change(theta, phi, np.linalg.norm(sight), offsets, prime=prime)
    cube, _ = path_change(
        azimuth_angle(mirror.azm_zrg, mirror.na0),
        elevation_angle(mirror.elv_zrg, mirror.ne0),
        mirror.d0_mm * MILLIMETRE,
        offsets,
    )
    return cube - target
