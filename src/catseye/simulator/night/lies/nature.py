"""Lies of nature: what happens, and the reduction has no model of."""

from dataclasses import dataclass, field, replace

import numpy as np

from catseye.simulator.night.air import NIGHT, AirConditions
from catseye.simulator.night.faults import Faults, Planted
from catseye.simulator.night.fields import HorizontalGradient
from catseye.simulator.night.movements import BodyDrift, BodySway
from catseye.simulator.night.nature import CALM, Nature


@dataclass(frozen=True)
class NightSetting:
    """Arguments of `simulate_night` that a lie of nature changes."""

    conditions: AirConditions = NIGHT
    faults: Faults = field(default_factory=Faults)
    planted: Planted = field(default_factory=Planted)
    nature: Nature = CALM


def directed(numbers: tuple[float, ...], rng: np.random.Generator, able) -> np.ndarray:
    """Vector of a size in a random direction, or of its components.

    able   (d,) False for a component that stays zero if the direction is random
    """
    if len(numbers) > 1:
        return np.array(numbers)
    direction = rng.normal(size=len(able)) * np.asarray(able)
    return numbers[0] * direction / np.linalg.norm(direction)


def oscillator(
    setting: NightSetting, ranger: str, numbers: tuple[float, ...], rng: np.random.Generator
) -> NightSetting:
    """Modulation of one ranger: the site's record states too much, so its own is lower."""
    slower = {**setting.planted.modulation_ppm, ranger: -numbers[0]}
    return replace(setting, planted=replace(setting.planted, modulation_ppm=slower))


def gradient(setting: NightSetting, of: str, numbers: tuple[float, ...], rng: np.random.Generator) -> NightSetting:
    """Constant horizontal gradient, °C/m."""
    present = setting.nature.horizontal or HorizontalGradient()
    east, north = np.array(present.constant_c_per_m) + directed(numbers, rng, (True, True))
    constant = (float(east), float(north))
    return replace(setting, nature=replace(setting.nature, horizontal=replace(present, constant_c_per_m=constant)))


def cooling(setting: NightSetting, of: str, numbers: tuple[float, ...], rng: np.random.Generator) -> NightSetting:
    """Air that cools evenly, °C/h; its thermometer sticks in the records."""
    return replace(setting, conditions=replace(setting.conditions, drift_c_per_h=-numbers[0]))


def sway(setting: NightSetting, body: str, numbers: tuple[float, ...], rng: np.random.Generator) -> NightSetting:
    """Sway of a rigid body of the telescope, mm."""
    moving = BodySway(body, numbers[0], int(rng.integers(2**31)))
    return replace(setting, nature=replace(setting.nature, movements=(*setting.nature.movements, moving)))


def drift(setting: NightSetting, body: str, numbers: tuple[float, ...], rng: np.random.Generator) -> NightSetting:
    """Drift of a body or a monument's ranger, mm/h."""
    east, north, up = directed(numbers, rng, (True, True, True))
    moving = BodyDrift(body, (float(east), float(north), float(up)))
    return replace(setting, nature=replace(setting.nature, movements=(*setting.nature.movements, moving)))


def blocked(setting: NightSetting, of: str, numbers: tuple[float, ...], rng: np.random.Generator) -> NightSetting:
    """Shots without return, per cent."""
    return replace(setting, faults=replace(setting.faults, fraction_blocked=numbers[0] / 100.0))


def reflected(setting: NightSetting, of: str, numbers: tuple[float, ...], rng: np.random.Generator) -> NightSetting:
    """Shots with a stray reflection, per cent."""
    return replace(setting, faults=replace(setting.faults, fraction_reflected=numbers[0] / 100.0))
