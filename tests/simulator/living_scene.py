"""Twins that the tests of the living site share."""

import hashlib
from dataclasses import replace
from functools import cache

import numpy as np

from catseye.records.site.folder import SiteFolder, read_site
from catseye.simulator.night.faults import EFFECTS
from catseye.simulator.twin.conditions import LIVING_EFFECTS, LIVING_NIGHT, LivingPlanted
from catseye.simulator.twin.motion import AxisMotion
from catseye.simulator.twin.site import Twin
from repository import ROOT

START = 60_000.1  # MJD; 21 h local mean time at Green Bank
ALL = (*EFFECTS, *LIVING_EFFECTS)
DISH = ("DP01C", "DP20C", "DP20P10", "DP33N15", "DP44C")


@cache
def whole_site() -> SiteFolder:
    return read_site(ROOT / "examples/sites/gbt")


@cache
def site() -> SiteFolder:
    """Green Bank with five prisms on the dish: what is left of the truth is the same, and made in no time."""
    whole = whole_site()
    kept = {name: t for name, t in whole.targets.items() if not name.startswith("DP") or name in DISH}
    return replace(whole, targets=kept)


def only(*effects: str, **planted) -> LivingPlanted:
    """Everything left out but these."""
    return LivingPlanted(ignore=[e for e in ALL if e not in effects], **planted)


def twin(motion="fixed 145.3 30", *, seed=1, planted=None, conditions=LIVING_NIGHT, faults=None, at=None) -> Twin:
    return Twin(
        site() if at is None else at,
        seed=seed,
        start_mjd=START,
        motion=AxisMotion.parse(motion),
        conditions=conditions,
        faults=faults,
        planted=planted,
    )


def phasor(shot) -> complex:
    """Mean of a whole buffer, V: z of z e^-ij, by its definition."""
    j = np.arange(len(shot.samples))
    return complex(2.0 * shot.volts_per_code * np.mean(shot.samples * np.exp(2j * np.pi * j / shot.samples_per_cycle)))


def rms(x) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def digest(made: Twin) -> str:
    """Of much that a twin can be asked."""
    t, found = np.array([0.0, 33.3, 1234.5]), hashlib.sha256()
    for name in ("ZY105", "TR03-B", "DP20C", "ZY115", "ZAG731D", "ZBM03", "ZY104-F"):
        found.update(made.point(name, t).tobytes())
    found.update(made.shot("ZY115", "DP20C", 44.4).samples.tobytes())
    found.update(made.phasors("ZY105", made.counts("ZY105", "ZEG41040L", t), t).tobytes())
    found.update(repr((made.weather("WX1", 55.5), made.posture(3.3))).encode())
    return found.hexdigest()
