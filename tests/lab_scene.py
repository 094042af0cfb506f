"""The calibration lab on paper: a rigid mirror, rays, plates and screens, by scipy's rotations and not by catseye.

Each function makes a table of readings as (numbers, words) from a truth; noise comes from a generator that is passed
in, none where it is None. `python tests/lab_scene.py` writes the examples of these kinds, good and planted.
"""

from datetime import date

import numpy as np
from scipy.integrate import quad
from scipy.optimize import root
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, norm

from catseye.records.files.readings import SheetReadings
from repository import ROOT

ARC = np.pi / 180 / 3600
TURN = 100_000.0
PER_RADIAN = TURN / (2 * np.pi)
WHO = {
    "instrument": "ZP103",
    "serial": "7",
    "measured_on": date(2026, 9, 1),
    "valid_until": date(2027, 9, 1),
    "by": "a",
    "report": "r",
}


def table(kind, numbers, words=None, left_out=None, **sheet):
    """Readings of a RECIPE, as `read_readings` would give them."""
    layout = kind.layout
    m = len(next(iter({**numbers, **(words or {})}.values())))
    return SheetReadings(
        file="t.csv",
        sheet=layout.sheet.model_validate({"kind": layout.kind, **WHO, **sheet}),
        sheet_file="t.toml",
        numbers={name: np.asarray(v, dtype=float) for name, v in numbers.items()},
        words={name: tuple(v) for name, v in (words or {}).items()},
        where=tuple(f"line {k + 2}" for k in range(m)),
        left_out=left_out or ("",) * m,
    )


def noise(rng, size, shape=()):
    return np.zeros(shape) if rng is None else size * rng.standard_normal(shape)


def columns(rows, numbers, words=()):
    """Rows of dicts as columns."""
    return {name: [row[name] for row in rows] for name in numbers}, {
        name: [row[name] for row in rows] for name in words
    }


# ------------------------------------------------------------------------------------------ the mirror and its light


def normal_of(theta, shaft, tilt=0.0, axis_tilt=0.0):
    """Face's normal in mirror axes: leaned on the shaft, the shaft turned, lifted, turned about the azimuth."""
    body = Rotation.from_euler("x", -tilt).apply([0.0, 0.0, 1.0])  # +z towards +y
    body = Rotation.from_euler("y", shaft).apply(body)  # +z towards +x
    return Rotation.from_euler("z", theta).apply(Rotation.from_euler("x", axis_tilt).apply(body))


def in_mount(vector, beta):
    """The mirror, once along the mount's axes, turned about x by beta1 and then about y by beta2."""
    return Rotation.from_euler("y", beta[1]).apply(Rotation.from_euler("x", beta[0]).apply(vector))


def bounced(direction, normal):
    """A ray off a plane: half a turn about the normal, backwards."""
    return -Rotation.from_rotvec(np.pi * normal).apply(direction)


def autocollimator_reads(face, beta, lean=(0.0, 0.0), roll=0.0, flat=None):
    """x, y in rad of the beam; `flat` (lean up, lean along) puts a flat on the x axis into the way."""
    axes = Rotation.from_euler("y", lean[0]) * Rotation.from_euler("x", -lean[1]) * Rotation.from_euler("z", roll)
    ray = bounced(axes.apply([0.0, 0.0, -1.0]), in_mount(face, beta))
    if flat is not None:
        plate = np.array([-1.0, flat[0], flat[1]]) / np.sqrt(1.0 + flat[0] ** 2 + flat[1] ** 2)
        ray = bounced(bounced(ray, plate), in_mount(face, beta))
    x, y, z = axes.inv().apply(ray)
    return np.array([x / z, y / z])


SETTINGS = [(a, e, "mirror") for e in (0, 12, -12) for a in range(0, 100_000, 12_500)]
SIGHTS = [(0, 12_500, "flat"), (50_000, -12_500, "flat")] * 3


def autocollimation(
    truth, rng=None, *, settings=(*SETTINGS, *SIGHTS), size=0.3, u_count=0.0, display="beam", signs=(1, 1)
):
    """truth: beta, na0, ne0, tilt, axis_tilt, lean, roll, flat."""
    rows = []
    for a, e, into in settings:
        na, ne = np.round(truth["na0"]) + a, np.round(truth["ne0"]) + e
        stands = np.array([na - truth["na0"], ne - truth["ne0"]]) + noise(rng, u_count, 2)
        face = normal_of(*stands / PER_RADIAN, truth.get("tilt", 0.0), truth.get("axis_tilt", 0.0))
        flat = truth.get("flat", (0.0, 0.0)) if into == "flat" else None
        seen = autocollimator_reads(face, truth["beta"], truth.get("lean", (0.0, 0.0)), truth.get("roll", 0.0), flat)
        seen = seen / ARC * (1.0 if display == "beam" else 0.5) + noise(rng, size, 2)
        rows.append({"azimuth_counts": na, "elevation_counts": ne, "into": into,
                     "x_arcsec": signs[0] * seen[0], "y_arcsec": signs[1] * seen[1]})  # fmt: skip
    return columns(rows, ("azimuth_counts", "elevation_counts", "x_arcsec", "y_arcsec"), ("into",))


# ------------------------------------------------------------------------------------------------- heights on a plate

PLACES = {"a": ("+y", "+z"), "b": ("+x", "+z"), "c": ("-x", "-z"), "d": ("+z", "+x"), "e": ("-z", "-x")}
BALL, PLUG = 19.05, 12.0  # mm


def axis(word):
    vector = np.zeros(3)
    vector["xyz".index(word[1])] = 1.0 if word[0] == "+" else -1.0
    return vector


def heights(truth, rng=None, *, size=0.001, places=PLACES, touches=("top", "bottom"), times=3, seating=0.0):
    """truth: offset (3,) mm, lean {axis: (right, front)} rad of what it stands on."""
    rows = []
    for number, (setup, (up, front)) in enumerate(places.items()):
        plate = np.stack([np.cross(axis(front), axis(up)), axis(front), axis(up)])  # of mount vectors
        right, forward = np.array(truth.get("lean", {}).get(up[1], (0.0, 0.0))) + noise(rng, seating, 2)
        # what stands on a plate that is lifted on its right stands higher there
        lifted = Rotation.from_euler("y", -right) * Rotation.from_euler("x", forward)
        mirror = lifted.apply(plate @ np.asarray(truth["offset"]))[2]
        for feature in ("ball", "mirror"):
            for touch in touches:
                radius = 0.5 * (BALL if feature == "ball" else PLUG) * {"top": 1, "bottom": -1, "centre": 0}[touch]
                for _ in range(times):
                    h = 120.0 + 31.0 * number + (mirror if feature == "mirror" else 0.0) + radius
                    rows.append({"setup": setup, "up": up, "front": front, "feature": feature, "touch": touch,
                                 "height_mm": h + noise(rng, size)})  # fmt: skip
    return columns(rows, ("height_mm",), ("setup", "up", "front", "feature", "touch"))


# ------------------------------------------------------------------------------------------------- both faces


def plane_of(theta, shaft, e, s, tilt=0.0):
    """A point of the face and its normal: the shaft stands e along the mount's azimuth, the face s before it."""
    face = normal_of(theta, shaft, tilt)
    return Rotation.from_euler("z", theta).apply([e, 0.0, 0.0]) + s * face, face


def beam_of(theta, shaft, truth):
    """Where the laser leaves the face, its direction, and the way from the plane across it through the scan point."""
    e, s, beam_x, beam_y = truth.get("offsets", (0.0, 0.0, 0.0, 0.0))  # m
    tilt_x, tilt_y = truth.get("beam_tilt", (0.0, 0.0))
    point, face = plane_of(theta, shaft, e, s, truth.get("tilt", 0.0))
    coming = -np.array([tilt_x, tilt_y, np.sqrt(1.0 - tilt_x**2 - tilt_y**2)])
    start = np.array([beam_x, beam_y, 0.0])
    way = (point - start) @ face / (coming @ face)
    hit = start + way * coming
    return hit, bounced(coming, face), hit @ coming


def found_at(target, truth, prime=False):
    """Mount azimuth and shaft, rad, at which the beam meets a target (3,) m, by a general solver."""
    r = np.linalg.norm(target)
    theta, phi = np.arctan2(target[1], target[0]), np.arccos(target[2] / r)
    start = np.array([theta + np.pi, -phi / 2] if prime else [theta, phi / 2])
    aside = np.linalg.svd(target[None] / r)[2][1:]

    def miss(angles):
        hit, direction, _ = beam_of(*angles, truth)
        return aside @ (hit + direction * ((target - hit) @ direction) - target) / r

    found = root(miss, start, tol=1e-14)
    assert np.abs(miss(found.x)).max() < 1e-12
    return found.x


def range_to(target, truth, prime=False):
    hit, direction, way = beam_of(*found_at(target, truth, prime), truth)
    return way + (target - hit) @ direction


def pointed(theta, phi, distance=1.0):
    return distance * np.array([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)])


LINES = (
    ("A", 30.0, 90.0, "face"),
    ("A", 30.0, 90.0, "back"),
    ("B", 10.0, 60.0, "target"),
    ("C", 55.0, 120.0, "target"),
    ("D", 20.0, 30.0, "target"),
    ("D", 20.0, 30.0, "face"),
)


def faces(truth, rng=None, *, size=2e-5, lines=LINES, times=3):
    """truth: offsets (e, s, 0, 0) m, back m, zero m, known {line: error m of its known distance}."""
    e, s = truth["offsets"][:2]
    rows = []
    for line, length, phi_deg, to in lines:
        phi = np.radians(phi_deg)
        u = pointed(0.3, phi)
        for pointing in ("direct", "prime"):
            sense = 1.0 if pointing == "direct" else -1.0
            # autocollimation: the shaft is turned by Phi itself, so that the face (or back) looks along u
            shaft_at = sense * e * np.array([np.cos(0.3), np.sin(0.3), 0.0])
            if to == "target":
                d = range_to(length * u, truth, pointing == "prime") + truth.get("zero", 0.0)
            else:
                out = s if to == "face" else truth["back"]
                d = length - (shaft_at + out * u) @ u
            for _ in range(times):
                rows.append({"line": line, "to": to, "pointing": pointing, "phi_deg": phi_deg,
                             "distance_m": d + noise(rng, size),
                             "known_distance_m": length + truth.get("known", {}).get(line, 0.0)})  # fmt: skip
    return columns(rows, ("phi_deg", "distance_m", "known_distance_m"), ("line", "to", "pointing"))


def sky(seed=4, count=8):
    """Directions and distances of targets: theta, phi in rad, m."""
    rng = np.random.default_rng(seed)
    return list(
        zip(rng.uniform(-1.4, 1.4, count), rng.uniform(0.35, 2.1, count), rng.uniform(10, 100, count), strict=True)
    )


def pointings(truth, rng=None, *, size=0.3, targets=None, frame=(0.0, 0.0)):
    """truth: na0, ne0, tilt, beam_tilt, offsets (m), axis_tilt; `frame` turns the known directions about x, y."""
    rows = []
    for number, (theta, phi, distance) in enumerate(targets or sky()):
        at = Rotation.from_rotvec([frame[0], frame[1], 0.0]).apply(pointed(theta, phi, distance))
        for pointing in ("direct", "prime"):
            turn, shaft = found_at(at, truth, pointing == "prime")
            seen = np.array([truth["na0"], truth["ne0"]]) + PER_RADIAN * np.array([turn, shaft]) + noise(rng, size, 2)
            rows.append({"target": f"T{number}", "pointing": pointing, "azimuth_counts": seen[0],
                         "elevation_counts": seen[1], "distance_m": distance, "theta_deg": np.degrees(theta),
                         "phi_deg": np.degrees(phi)})  # fmt: skip
    return columns(
        rows,
        ("azimuth_counts", "elevation_counts", "distance_m", "theta_deg", "phi_deg"),
        ("target", "pointing"),
    )


# ------------------------------------------------------------------------------------ encoder, spots, focus, searches


def waves(psi, cosine, sine):
    return sum(c * np.cos(k * psi) + s * np.sin(k * psi) for k, (c, s) in enumerate(zip(cosine, sine, strict=True), 1))


def polygon(truth, rng=None, *, faces=12, starts=(0, 3), size=0.02, u_face=1.0 * ARC):
    """truth: zero, cosine, sine (counts). A polygon on the axis, set up once for each run."""
    wrong = noise(rng, u_face, faces)
    rows = []
    for run, first in enumerate(starts):
        begin = 0.4 + 0.7 * run
        for j in range(faces):
            off = 0.0 if rng is None else rng.uniform(-30, 30) * ARC  # servo and hand
            psi = begin + 2 * np.pi * j / faces + wrong[(j + first) % faces] + off
            n = truth["zero"] + PER_RADIAN * psi + waves(psi, truth["cosine"], truth["sine"]) + noise(rng, size)
            rows.append({"angle_deg": 360.0 * j / faces, "counts": n, "reading_arcsec": off / ARC,
                         "face": f"f{(j + first) % faces}", "run": f"r{run}"})  # fmt: skip
    return columns(rows, ("angle_deg", "counts", "reading_arcsec"), ("face", "run"))


def spots(
    truth, rng=None, *, size=0.02, screens=(("before", -0.3), ("near", 0.5), ("far", 4.0)), azimuths=8, shaft=0.6
):
    """truth: beam (mm), beam_tilt, na0. Rays to screens that turn with the mount, square to a true beam."""
    laser = {
        "offsets": (0.0, 0.0, *np.array(truth["beam"]) * 1e-3),
        "beam_tilt": truth["beam_tilt"],
        "tilt": truth.get("tilt", 0.0),
    }
    rows = []
    for screen, path in screens:
        for k in range(azimuths):
            theta = 2 * np.pi * k / azimuths
            turned = Rotation.from_euler("z", theta)
            hit, direction, _ = beam_of(theta, shaft, laser)
            if path > 0:  # axes of the screen: growing Phi, growing Theta
                middle, p, q = (
                    turned.apply(v)
                    for v in (pointed(0.0, 2 * shaft, path), pointed(0.0, 2 * shaft + np.pi / 2), [0.0, 1.0, 0.0])
                )
                n = pointed(theta, 2 * shaft)
            else:
                middle, p, q, n = (
                    np.array([0.0, 0.0, -path]),
                    turned.apply([1.0, 0, 0]),
                    turned.apply([0, 1.0, 0]),
                    np.array([0.0, 0.0, 1.0]),
                )
                t = truth["beam_tilt"]
                direction = np.array([t[0], t[1], np.sqrt(1.0 - t[0] ** 2 - t[1] ** 2)])
                hit = np.array([*laser["offsets"][2:], 0.0])
            at = hit + direction * ((middle - hit) @ n) / (direction @ n) - middle
            seen = 1e3 * np.array([at @ p, at @ q]) + [3.0, -2.0] + noise(rng, size, 2)
            rows.append({"screen": screen, "path_m": path, "azimuth_counts": truth["na0"] + PER_RADIAN * theta,
                         "p_mm": seen[0], "q_mm": seen[1]})  # fmt: skip
    return columns(rows, ("path_m", "azimuth_counts", "p_mm", "q_mm"), ("screen",))


def through_focus(truth, rng=None, *, size=0.01, places=None):
    """truth: focus, rayleigh (mm), fill; the light in the disc integrated ring by ring."""
    rows = []
    for z in np.linspace(-3.0, 3.0, 25) if places is None else places:
        square = 1.0 + ((z - truth["focus"]) / truth["rayleigh"]) ** 2
        if truth.get("fill"):
            radius = np.sqrt(truth["fill"] / 2.0)  # in units of the waist
            caught, _ = quad(lambda r, w2=square: 4.0 * r / w2 * np.exp(-2.0 * r * r / w2), 0.0, radius)
        else:
            caught = 1.0 / square
        rows.append({"position_mm": z, "amplitude_volt": 4.0 * caught * np.exp(noise(rng, size))})
    return columns(rows, ("position_mm", "amplitude_volt"))[0]


def cal_eq(parameters, point):
    """Azimuth and elevation counts by the notes' program CAL.EQ, typed from its print (figure 2.5), in metres."""
    x, y, z, alpha1, alpha2, alpha3, dx, dy, dz, theta, phi, na0, ne0 = parameters
    cos, sin = np.cos, np.sin
    a = np.array([[cos(phi), 0, -sin(phi)], [0, 1, 0], [sin(phi), 0, cos(phi)]])
    b = np.array([[1, 0, 0], [0, cos(theta), sin(theta)], [0, -sin(theta), cos(theta)]])
    c = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    d = np.array([[cos(alpha1), 0, -sin(alpha1)], [0, 1, 0], [sin(alpha1), 0, cos(alpha1)]])
    e = np.array([[cos(alpha2), sin(alpha2), 0], [-sin(alpha2), cos(alpha2), 0], [0, 0, 1]])
    f = np.array([[1, 0, 0], [0, cos(alpha3), sin(alpha3)], [0, -sin(alpha3), cos(alpha3)]])
    r = b @ a @ (f @ e @ d @ c @ (point - np.array([x, y, z])) - np.array([dx, dy, dz]))
    azimuth = np.mod(np.arctan2(r[1], r[0]) + np.pi / 2, 2 * np.pi) - np.pi / 2
    return np.array(
        [TURN * azimuth / (2 * np.pi) + na0, TURN * np.arccos(r[2] / np.linalg.norm(r)) / (4 * np.pi) + ne0]
    )


def field(seed=11, count=24):
    """Targets (n, 3) m round a telescope, as ZY103 sees them."""
    rng = np.random.default_rng(seed)
    place = np.column_stack([rng.uniform(-40, 90, count), rng.uniform(-60, 140, count), rng.uniform(5, 80, count)])
    return np.round(place, 4)


def searches(parameters, rng=None, *, size=0.5, u_target=0.0, targets=None, prime=()):
    """Counts at which targets were found; `prime` names those found in the other pointing."""
    rows = []
    for number, place in enumerate(field() if targets is None else targets):
        na, ne = cal_eq(parameters, place + noise(rng, u_target, 3))
        pointing = "prime" if number in prime else "direct"
        if pointing == "prime":
            na, ne = na + TURN / 2, 2 * parameters[12] - ne
        seen = np.array([na, ne]) + noise(rng, size, 2)
        rows.append({"target": f"T{number}", "pointing": pointing, "x_m": place[0], "y_m": place[1], "z_m": place[2],
                     "azimuth_counts": seen[0], "elevation_counts": seen[1]})  # fmt: skip
    return columns(rows, ("x_m", "y_m", "z_m", "azimuth_counts", "elevation_counts"), ("target", "pointing"))


MONUMENT = {
    "monument": "ZY103", "zp": "ZP103", "x_mm": 112993.278, "y_mm": 44279.270, "z_mm": 0.0,
    "u_x_mm": 0.1, "u_y_mm": 0.1, "u_z_mm": 0.1, "azimuth_deg": 248.599755, "alpha1_rad": -1.1972916,
    "alpha2_rad": 0.0000157, "alpha3_rad": -0.0000043, "u_alpha1_rad": 4e-5, "u_alpha2_rad": 2e-5, "u_alpha3_rad": 2e-5,
    "latitude_deg": 38.433520, "elevation_m": 806.420,
}  # fmt: skip
MIRROR = {
    "zp": "ZP103", "dx_mm": -0.046, "dy_mm": 247.607, "dz_mm": -0.588, "u_offset_mm": 0.005,
    "beta1_rad": -0.000493, "beta2_rad": 0.000094, "u_beta_rad": 1e-5, "na0": 2691, "ne0": 1434, "u_zero_counts": 1.5,
    "az_low_limit": -21309, "az_high_limit": 75691,
}  # fmt: skip


def station_truth():
    """The 13 numbers of MONUMENT and MIRROR in SI, and their standard uncertainties."""
    values = [MONUMENT[f"{k}_mm"] * 1e-3 for k in "xyz"] + [MONUMENT[f"alpha{k}_rad"] for k in (1, 2, 3)]
    values += (
        [MIRROR[f"d{k}_mm"] * 1e-3 for k in "xyz"]
        + [MIRROR[f"beta{k}_rad"] for k in (1, 2)]
        + [MIRROR["na0"], MIRROR["ne0"]]
    )
    u = [MONUMENT[f"u_{k}_mm"] * 1e-3 for k in "xyz"] + [MONUMENT[f"u_alpha{k}_rad"] for k in (1, 2, 3)]
    u += [MIRROR["u_offset_mm"] * 1e-3] * 3 + [MIRROR["u_beta_rad"]] * 2 + [MIRROR["u_zero_counts"]] * 2
    return np.array(values, dtype=float), np.array(u)


def check_scatter(values, covariances, truth, chance=1e-5):
    """Values (n, q) scatter about the truth (q,) or (n, q) as their covariances claim, and their mean is right.

    chance   of each of the 3 q + 1 bounds to be passed on one side where the claim is true; the seeds are fixed
    """
    values, claimed = np.asarray(values, dtype=float), np.mean(covariances, axis=0)
    n, q = values.shape
    off = values - truth
    u = np.sqrt(np.diag(claimed))
    assert np.all(np.abs(off.mean(axis=0)) < norm.isf(chance) * u / np.sqrt(n)), off.mean(axis=0) / u
    squares = np.einsum("ni,nij,nj->n", off / u, np.linalg.inv(np.asarray(covariances) / np.outer(u, u)), off / u)
    assert chi2.isf(1.0 - chance, q * n) < squares.sum() < chi2.isf(chance, q * n), squares.mean() / q
    each = (off**2).sum(axis=0) / u**2
    assert np.all((chi2.isf(1.0 - chance, n) < each) & (each < chi2.isf(chance, n))), each / n


# ----------------------------------------------------------------------------------------------- the examples

EXAMPLES = {
    # kind: truth and planted fault for the comment, sheet, numbers and words, the wrong reading and by how much
    "autocollimation": (
        "Truth: beta1 -150 arcsec, beta2 +25 arcsec, N_a0 -4195.3, N_e0 -4935.4, face tilt 20 arcsec; the\n"
        "autocollimator looks 0.6 arcsec off z.",
        "Reading 12 (line 13) is wrong by 30 arcsec in y.",
        {"displays": "beam", "na0_nominal": -4190.0, "ne0_nominal": -4930.0, "u_lean_x_arcsec": 1.0,
         "u_lean_y_arcsec": 1.0, "u_roll_arcsec": 120.0, "u_flat_arcsec": 1.0, "u_axis_tilt_arcsec": 2.0,
         "u_reading_arcsec": 0.3, "u_count": 0.05},
        lambda rng: autocollimation(
            {"beta": (-150 * ARC, 25 * ARC), "na0": -4195.3, "ne0": -4935.4, "tilt": 20 * ARC,
             "lean": (0.6 * ARC, -0.4 * ARC)}, rng, u_count=0.05),
        ("y_arcsec", 11, 30.0),
    ),
    "height-gauge": (
        "Truth: dx -0.075, dy 247.459, dz -0.762 mm; the v-blocks lean 4 arcsec, 1 um of reading.",
        "Reading 20 (line 21) is wrong by 0.05 mm.",
        {"ball_diameter_mm": BALL, "u_ball_diameter_mm": 0.0005, "mirror_diameter_mm": PLUG,
         "u_mirror_diameter_mm": 0.0005, "u_lean_arcsec": 6.0, "u_seating_arcsec": 0.5, "u_scale_ppm": 3.0,
         "u_reading_mm": 0.001},
        lambda rng: heights(
            {"offset": (-0.075, 247.459, -0.762), "lean": {"x": (4 * ARC, 1 * ARC), "z": (-3 * ARC, 2 * ARC)}},
            rng, times=2, seating=0.5 * ARC),
        ("height_mm", 19, 0.05),
    ),
    "both-faces": (
        "Truth: axis offset +0.40 mm, mirror offset -0.30 mm, 20 um of reading.",
        "Reading 9 (line 10) is wrong by 0.3 mm.",
        {"u_distance_mm": 0.02, "u_known_distance_mm": 0.03, "u_zero_mm": 0.2},
        lambda rng: faces({"offsets": (0.4e-3, -0.3e-3, 0.0, 0.0), "back": 12e-3, "zero": 0.1e-3,
                           "known": {"A": 2e-5, "B": -3e-5, "C": 1e-5, "D": -1e-5}}, rng),
        ("distance_m", 8, 3e-4),
    ),
    "both-faces-pointing": (
        "Truth: face tilt 0.2 mrad, beam tilt 0.1 and -0.3 mrad, N_a0 2691.4, N_e0 1434.7.",
        "Reading 5 (line 6) is wrong by 10 counts in azimuth.",
        {"na0_nominal": 2691.0, "ne0_nominal": 1434.0, "axis_offset_mm": 0.4, "u_axis_mm": 0.02,
         "u_direction_arcsec": 2.0, "u_frame_arcsec": 2.0, "u_counts": 0.3},
        lambda rng: pointings({"na0": 2691.4, "ne0": 1434.7, "tilt": 2e-4, "beam_tilt": (1e-4, -3e-4),
                               "offsets": (0.4e-3, 0.0, 0.0, 0.0)}, rng),
        ("azimuth_counts", 4, 10.0),
    ),
    "encoder": (
        "Truth: cosine 3.0, -1.0, sine -2.0, 0.5 counts, of once and twice a turn.",
        "Reading 18 (line 19) is wrong by 1.5 counts.",
        {"axis": "azimuth", "zero_counts": 2691.0, "u_face_arcsec": 1.0, "u_counts": 0.04, "u_reading_arcsec": 0.4},
        lambda rng: polygon({"zero": 2691.0, "cosine": (3.0, -1.0), "sine": (-2.0, 0.5)}, rng, size=0.05,
                            starts=(0, 3, 6)),
        ("counts", 17, 1.5),
    ),
    "limits": (
        "Truth: stops at -21810 and 76191 counts, touched within 3.",
        "Reading 9 (line 10) met a cable at 76100.",
        {"margin_counts": 480.0, "u_touch_counts": 3.0, "na0": 2691.0},
        lambda rng: ({"azimuth_counts": np.round(np.repeat([-21_810.0, 76_191.0], 5) + noise(rng, 3.0, 10))},
                     {"stop": ["low"] * 5 + ["high"] * 5}),
        ("azimuth_counts", 8, -91.0),
    ),
    "alignment": (
        "Truth: beam at 0.21, -0.33 mm, tilt 0.3 and 0.1 mrad, 20 um of reading.",
        "Reading 11 (line 12) is wrong by 0.3 mm.",
        {"na0": 2691.0, "u_screen_turn_deg": 0.5, "u_path_mm": 2.0, "u_spot_mm": 0.02, "face_tilt_rad": 9.7e-5,
         "u_face_tilt_rad": 1e-6},
        lambda rng: spots({"beam": (0.21, -0.33), "beam_tilt": (3e-4, 1e-4), "na0": 2691.0, "tilt": 9.7e-5}, rng),
        ("p_mm", 10, 0.3),
    ),
    "detector-focus": (
        "Truth: best focus 0.31 mm, depth 1.4 mm, 1 % of reading.",
        "Reading 20 (line 21) is 0.15 V too low.",
        {"model": "gaussian_beam", "installed_mm": 0.80, "u_installed_mm": 0.05, "u_amplitude_share": 0.01,
         "amplitude_to_phase_rad": -0.0018, "u_amplitude_to_phase_rad": 0.0002},
        lambda rng: (through_focus({"focus": 0.31, "rayleigh": 1.4}, rng), {}),
        ("amplitude_volt", 19, -0.15),
    ),
    "search-results": (
        "Truth: the records but for N_a0 2692.8, N_e0 1432.9 and alpha1 -1.1972616 (+30 urad).",
        "Reading 7 (line 8) is another target, 12 counts away.",
        {"u_counts": 0.5, "u_target_mm": 2.0, "monument": MONUMENT, "mirror": MIRROR},
        lambda rng: searches(
            station_truth()[0] + np.array([0, 0, 0, 3e-5, 0, 0, 0, 0, 0, 0, 0, 1.8, -1.1]), rng, u_target=2e-3,
            prime=(3, 9)),
        ("elevation_counts", 6, 12.0),
    ),
}  # fmt: skip
PLACES_AFTER_POINT = {"mm": 4, "m": 6, "counts": 2, "arcsec": 2, "deg": 6, "volt": 4}


def write_example(kind, folder, planted=False, seed=None):
    """KIND.csv and KIND.toml, as `catseye calibrate KIND` reads them; KIND-planted with a wrong reading."""
    truth, fault, sheet, made, (name, row, by) = EXAMPLES[kind]
    numbers, words = made(np.random.default_rng(sum(map(ord, kind)) if seed is None else seed))
    if planted:
        numbers[name][row] += by
        truth = f"{truth}\n{fault}"
    if kind == "both-faces":
        numbers["known_distance_m"] = [round(v, 5) for v in numbers["known_distance_m"]]
    rounded = {n: [round(float(v), PLACES_AFTER_POINT[n.rpartition("_")[2]]) for v in numbers[n]] for n in numbers}
    if kind == "encoder":
        rounded = {n: [round(float(v), 2) for v in column] for n, column in numbers.items()}
    cells = {**words, **rounded}
    lines = [",".join(cells), *(",".join(map(str, row)) for row in zip(*cells.values(), strict=True))]
    stem = f"{kind}-planted" if planted else kind
    (folder / f"{stem}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    head = {"kind": kind, "instrument": "ZP103", "serial": "example-103", "measured_on": date(2026, 9, 1),
            "valid_until": date(2028, 9, 1), "by": "example", "report": "tests/lab_scene.py"}  # fmt: skip
    plain = {key: value for key, value in {**head, **sheet}.items() if not isinstance(value, dict)}
    text = [*(f"# {line}" for line in truth.splitlines()), *(f"{key} = {said(value)}" for key, value in plain.items())]
    for key, value in sheet.items():
        if isinstance(value, dict):
            text += ["", f"[{key}]", *(f"{k} = {said(v)}" for k, v in value.items())]
    (folder / f"{stem}.toml").write_text("\n".join(text) + "\n", encoding="utf-8")


def said(value):
    return f'"{value}"' if isinstance(value, str) else str(value)


if __name__ == "__main__":
    for each in EXAMPLES:
        for with_fault in (False, True):
            write_example(each, ROOT / "examples" / "calibrations", with_fault)
