"""Nights with one wrong record: is it named, is its error within the claim, or is nothing said?"""

import dataclasses
import re

import numpy as np
from scipy.stats import chi2

from catseye.errors import EstimationError, InputError
from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.simulator.night.sheets import write_night
from nature_scene import natural_night

PRISMS, FIRST_SEED = 60, 6001
BEYOND = chi2.ppf(0.999, 3)  # of a point's squared error in its own uncertainties: one in a thousand
NAMED, COVERED, NOTICED, SILENT = OUTCOMES = ("named", "covered", "noticed", "silent")
WX, RANGER, TARGET = "WX1", "ZY101", "ZEG41040L"


def _weather(campaign, **columns):
    return dataclasses.replace(campaign, weather=dataclasses.replace(campaign.weather, **columns))


def _record(campaign, part, name, **values):
    table = dict(getattr(campaign, part))
    table[name] = table[name].model_copy(update=values)
    return dataclasses.replace(campaign, **{part: table})


def _pressure(campaign, stations):
    own = np.array([name in stations for name in campaign.weather.station])
    return _weather(campaign, pressure_hpa=campaign.weather.pressure_hpa + 86.0 * own)


def _modulation(campaign):
    ranging = campaign.site.ranging
    faster = ranging.model_copy(update={"modulation_hz": ranging.modulation_hz * (1.0 + 5e-6)})
    return dataclasses.replace(campaign, site=campaign.site.model_copy(update={"ranging": faster}))


def _certificate(campaign):
    first, *others = campaign.benchmarks
    longer = first.model_copy(update={"certified_distance_mm": first.certified_distance_mm + 1.0})
    return dataclasses.replace(campaign, benchmarks=(longer, *others))


def _mirror(campaign, **changes):
    sheet = campaign.mirror_of(RANGER)
    return _record(
        campaign, "mirrors", sheet.zp, **{key: change(getattr(sheet, key)) for key, change in changes.items()}
    )


def _triplets(campaign):
    taller = {n: t.model_copy(update={"h_corr_mm": t.h_corr_mm + 0.3}) for n, t in campaign.triplets.items()}
    return dataclasses.replace(campaign, triplets=taller)


def _typed(campaign):
    x, y, z = campaign.targets[TARGET].position_mm
    return _record(campaign, "targets", TARGET, position_mm=(x + 100.0, y, z))


CASES = {  # what is wrong -> change of the records, pattern of a note or verdict that names it
    "pressure of one station reduced to sea level": (lambda c: _pressure(c, (WX,)), rf"barometer.*{WX}'s is wrong"),
    "pressure of both stations reduced to sea level": (lambda c: _pressure(c, ("WX1", "WX2")), r"barometer|pressure"),
    "both thermometers 2 °C too high": (
        lambda c: _weather(c, temperature_c=c.weather.temperature_c + 2.0),
        r"thermometer.*is biased by \+",
    ),
    "humidity as a fraction": (
        lambda c: _weather(c, humidity_percent=c.weather.humidity_percent / 100.0),
        r"humidity.*fraction",
    ),
    "modulation 5 ppm too high": (_modulation, r"modulation|frequency"),
    "a benchmark's certificate 1 mm too long": (_certificate, r"certificate|benchmarks\.csv"),
    f"D0 of {RANGER} 1 mm too long": (lambda c: _mirror(c, d0_mm=lambda v: v + 1.0), rf"{RANGER}'s zero is not"),
    f"sign of dz on {RANGER}'s mirror sheet": (lambda c: _mirror(c, dz_mm=lambda v: -v), rf"{RANGER}.*offset|dz_mm"),
    "monument ZY103 moved east by 1 mm": (
        lambda c: _record(c, "monuments", "ZY103", x_mm=c.monuments["ZY103"].x_mm + 1.0),
        r"ZY103.*(monument|survey|moved)",
    ),
    "heights of all triplets 0.3 mm too large": (_triplets, r"h_corr|triplets?'"),
    f"target {TARGET} typed 100 mm off": (_typed, rf"{TARGET}: its typed position"),
}


def night_of(seed, directory):
    """A night's truth, its campaign, and its reduction with right records."""
    night = natural_night(seed, PRISMS)
    campaign = read_campaign(write_night(night, directory / f"night-{seed}"))
    return night.truth, campaign, reduce_epoch(campaign)


def outcome(name, truth, campaign, usual):
    """Outcome of one wrong record: one of OUTCOMES, mean squared normalised error, largest shift of a coordinate, m.

    A night that is refused has no errors: both are nan.
    """
    change, pattern = CASES[name]
    try:
        reduction = reduce_epoch(change(campaign))
    except (InputError, EstimationError) as refusal:
        return (NAMED if re.search(pattern, str(refusal)) else NOTICED), np.nan, np.nan
    coordinates = reduction.coordinates
    points = [n for n in coordinates.points if n in coordinates.places and n in truth.points]
    errors = [coordinates.x[coordinates.index(n)] - truth.points[n] for n in points]
    squares = np.array([e @ np.linalg.solve(coordinates.block([n]), e) for n, e in zip(points, errors, strict=True)])
    before = usual.coordinates
    shifts = [coordinates.x[coordinates.index(n)] - before.x[before.index(n)] for n in points if n in before.places]
    mean, largest = float(squares.mean() / 3.0), float(np.abs(shifts).max())
    verdict = reduction.verdict
    said = [note for note in reduction.notes if note not in usual.notes]
    if any(re.search(pattern, text) for text in (*said, verdict.why)):
        return NAMED, mean, largest
    if mean < 2.0 and np.mean(squares > BEYOND) < 0.01:
        return COVERED, mean, largest
    return (NOTICED if said or verdict.word != "good" else SILENT), mean, largest


def median(values):
    """Median of the values that are numbers; None where none is."""
    numbers = [value for value in values if np.isfinite(value)]
    return float(np.median(numbers)) if numbers else None


def measured(count, directory, say):
    """A row for each wrong record: how many of so many nights had which outcome."""
    found = {name: [] for name in CASES}
    for seed in range(FIRST_SEED, FIRST_SEED + count):
        night = night_of(seed, directory)
        for name in CASES:
            found[name].append(outcome(name, *night))
            say(f"night {seed}, {name}: {found[name][-1][0]}")
        (directory / f"night-{seed}" / "frames.npy").unlink()
    return [
        {
            "record": name,
            **{key: sum(each[0] == key for each in outcomes) for key in OUTCOMES},
            "refused": sum(bool(np.isnan(each[1])) for each in outcomes),
            "mean_square": median([each[1] for each in outcomes]),
            "largest_shift_m": median([each[2] for each in outcomes]),
            "first_night": outcomes[0][0],
        }
        for name, outcomes in found.items()
    ]
