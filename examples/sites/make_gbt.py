"""Writes gbt/targets.toml, feedarm.toml and site.toml, and copies the rest of the site from night-01.

    python examples/sites/make_gbt.py

Fact, from public pages of the observatory: an aperture of 100 m, 4 m to 104 m from the vertex of a paraboloid of 60 m
focal length; 2004 panels, 2209 actuators at their corners, one prism at each actuator. From night-01: everything else
that is not on the dish, with its standard uncertainties.
Chosen, as no public table of the panels is at hand: rows of panels and where ribs change, below; where each prism
looks; its glass. With these choices the panels whose middle is in the aperture are 2004, and their corners 2209.
"""

import math
import re
import tomllib
from collections import Counter
from pathlib import Path

import numpy as np

from catseye.records.files.record import Record
from catseye.records.files.toml_text import record_toml
from catseye.records.site.target import FeedArm, TargetRow, Targets

HERE = Path(__file__).parent
NIGHT, GBT = HERE.parent / "night-01", HERE / "gbt"
SEED = 2209
FOCAL_LENGTH, APERTURE_CENTRE, APERTURE_RADIUS = 60.0, 54.0, 50.0  # m; fact
TIERS = 44  # rows of panels, concentric about the vertex, equally deep along the surface; chosen
STEP = math.radians(1.49)  # between ribs in the outermost tiers; chosen
WIDER = (18, 12, 5, 3, 2)  # in the first so many tiers the ribs are 3/2 as far apart, each time anew; chosen
AIM_MM = np.array([10.2, -5985.2, 55_949.2])  # point A of night-01's feedarm.toml: every prism looks there; chosen
INDEX = 1.527077  # group index of BK 7 over that of air, as in site.toml
HEIGHT_MM, HEIGHT_SCATTER_MM = 38.1, 0.09  # of a prism, much as the sixty of night-01; chosen
DISH_MIDDLE_MM = np.array([0.0, 54_000.0, 12_150.0])  # the middle of the aperture, on the paraboloid
AZIMUTH_DEG = 145.3  # of night-01's posture
ON_THE_ALIDADE = re.compile(r'(name = "ZAG\w+"\ntype = "hollow"\nframe = )"ground"\nposition_mm = \[([^]]*)\]')
FIRST_OF_THE_REST = '[[target]]\nname = "ZEG41040L"'
COPIED = ("benchmarks.csv", "monuments/*.toml", "mirrors/*.toml", "triplets/*.toml")


def arc(r: np.ndarray) -> np.ndarray:
    """Length along the paraboloid from its vertex to a distance r from its axis, m."""
    u = r / (2.0 * FOCAL_LENGTH)
    return FOCAL_LENGTH * (u * np.sqrt(1.0 + u * u) + np.arcsinh(u))


def hoops() -> np.ndarray:
    """Distances of the hoops between the tiers from the paraboloid's axis (TIERS + 1,), m."""
    fine = np.linspace(APERTURE_CENTRE - APERTURE_RADIUS, APERTURE_CENTRE + APERTURE_RADIUS, 200_001)
    along = arc(fine)
    return np.interp(np.linspace(along[0], along[-1], TIERS + 1), along, fine)


def steps() -> np.ndarray:
    """Angles between the ribs of each tier as multiples of STEP / 2^5, which are whole numbers (TIERS,)."""
    return np.array([3 ** (k := sum(t < w for w in WIDER)) * 2 ** (len(WIDER) - k) for t in range(TIERS)])


def half_panels() -> np.ndarray:
    """Panels of each tier on either side of the plane of symmetry, where a rib runs (TIERS,)."""
    r = hoops()
    middle = (r[1:] + r[:-1]) / 2.0
    cosine = (middle**2 + APERTURE_CENTRE**2 - APERTURE_RADIUS**2) / (2.0 * APERTURE_CENTRE * middle)
    step = steps() * STEP / 2 ** len(WIDER)
    return np.floor(np.arccos(cosine) / step + 0.5).astype(int)


def corners() -> list[tuple[int, float]]:
    """Hoop (1 next to the vertex) and angle about the axis (from +y towards +x, rad) of every corner of a panel."""
    found = {
        (hoop, int(rib * step))
        for tier, (step, half) in enumerate(zip(steps(), half_panels(), strict=True))
        for rib in range(-half, half + 1)
        for hoop in (tier + 1, tier + 2)
    }
    return [(hoop, whole * STEP / 2 ** len(WIDER)) for hoop, whole in sorted(found)]


def names(places: list[tuple[int, float]]) -> list[str]:
    """DPhhC on the plane of symmetry, DPhhPnn at x > 0 and DPhhNnn at x < 0, counted from it on each hoop hh."""
    rib_of = {hoop: -count for hoop, count in Counter(hoop for hoop, angle in places if angle < 0).items()}
    found = []
    for hoop, _ in places:
        rib = rib_of[hoop]
        rib_of[hoop] += 1
        found.append(f"DP{hoop:02d}C" if rib == 0 else f"DP{hoop:02d}{'P' if rib > 0 else 'N'}{abs(rib):02d}")
    return found


def prisms() -> list[TargetRow]:
    """All prisms of the dish, reference points on the design paraboloid."""
    places, random, r = corners(), np.random.default_rng(SEED), hoops()
    heights = np.round(random.normal(HEIGHT_MM, HEIGHT_SCATTER_MM, len(places)), 3)
    made = []
    for name, (hoop, angle), height in zip(names(places), places, heights, strict=True):
        x, y = np.round(1e3 * r[hoop - 1] * np.array([math.sin(angle), math.cos(angle)]), 3)
        position = np.array([x, y, (x * x + y * y) / (4e3 * FOCAL_LENGTH)])
        normal = (AIM_MM - position) / np.linalg.norm(AIM_MM - position)
        made.append(
            TargetRow(
                name=name,
                type="prism",
                frame="reflector",
                position_mm=tuple(np.round(position, 3).tolist()),
                material="BK7",
                normal=tuple(np.round(normal, 5).tolist()),
                height_mm=float(height),
                u_height_mm=0.002,
                hrp_mm=round(float(height) / INDEX, 3),
                pc_mm=round(-(INDEX - 1.0 / INDEX) * float(height), 4),
            )
        )
    return made


def rest_of_targets() -> str:
    """The single targets of night-01; those of the alidade, there in the ground frame of its posture, in their own."""
    text = (NIGHT / "targets.toml").read_text("utf-8")
    angle = math.radians(AZIMUTH_DEG)

    def turned(found: re.Match[str]) -> str:
        x, y, z = (float(v) for v in found[2].split(","))
        own = (x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle), z)
        return f'{found[1]}"alidade"\nposition_mm = [{own[0]:.1f}, {own[1]:.1f}, {own[2]:.1f}]'

    return ON_THE_ALIDADE.sub(turned, text[text.index(FIRST_OF_THE_REST) :])


def feed_arm() -> FeedArm:
    """night-01's feed arm with how its mounts are turned, which is chosen: y^ at the dish's middle, z^ across it."""
    arm = FeedArm.model_validate(tomllib.loads((NIGHT / "feedarm.toml").read_text("utf-8")))
    turned = []
    for ranger in arm.ranger:
        y = DISH_MIDDLE_MM - np.array(ranger.nominal_scan_point_mm)
        y /= np.linalg.norm(y)
        z = np.array([1.0, 0.0, 0.0]) - y * y[0]
        z /= np.linalg.norm(z)
        axes = {"mount_z": tuple(np.round(z, 6).tolist()), "mount_y": tuple(np.round(y, 6).tolist())}
        turned.append(ranger.model_copy(update=axes))
    return arm.model_copy(update={"ranger": tuple(turned)})


def main() -> None:
    for pattern in COPIED:
        for file in NIGHT.glob(pattern):
            copy = GBT / file.relative_to(NIGHT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(file.read_bytes())
    site = (NIGHT / "site.toml").read_text("utf-8")
    body = site.partition("\n")[2].replace('name = "night-01"', 'name = "gbt"')
    (GBT / "site.toml").write_text("# The Green Bank site: posture for a start, frames, constants.\n" + body, "utf-8")
    dish: Record = Targets(target=tuple(prisms()))
    head = "# All prisms of the dish on the design paraboloid (make_gbt.py), then the single targets of night-01.\n"
    text = head + record_toml(dish) + "\n" + rest_of_targets()
    (GBT / "targets.toml").write_text(text, "utf-8")
    note = (
        "# Rangers on the feed arm: scan points of night-01, reflector frame; how their mounts are turned is chosen.\n"
    )
    (GBT / "feedarm.toml").write_text(note + record_toml(feed_arm()), "utf-8")


if __name__ == "__main__":
    main()
