"""Nights with all that nature does, reduced, held against their truth and against what their claims scatter by."""

from collections import Counter

import numpy as np
from scipy.stats import chi2

from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.parameter import ParameterKind
from catseye.simulator.night.air import AirConditions
from catseye.simulator.night.nature import Nature
from catseye.simulator.night.schedule import Schedule
from catseye.simulator.night.sheets import write_night
from catseye.simulator.night.simulate import SimulatedTelescope, simulate_night

CLASSES = ("ground", "arm", "ball", "triplet prism", "dish", "struct")
LEADING = 10  # eigenvectors of a class's covariance
LARGEST = 300  # points of a class whose joint covariance is taken: every k-th of more
LEAST_SHOTS = 4  # of a prism: three shots check nothing
DRAWS = 2000


def natural_setting(seed, dish_prisms):
    """Arguments of a night, drawn from the seed: winter to summer, inversion to lapse, horizon to zenith."""
    rng = np.random.default_rng(seed)
    whole_dish = dish_prisms > 1500
    conditions = AirConditions(
        temperature_c=rng.uniform(-12.0, 28.0),
        gradient_c_per_m=rng.normal(0.0, 0.01),
        surface_layer_c=rng.normal(0.0, 0.2),
        humidity_percent=rng.uniform(20.0, 95.0),
        drift_c_per_h=rng.normal(0.0, 1.0) * (1.0 if dish_prisms <= 400 else 0.4),  # hours more
        pressure_hpa=rng.uniform(910.0, 950.0),
    )
    stands = SimulatedTelescope(rng.uniform(0.0, 360.0), rng.uniform(10.0, 85.0), dish_prisms)
    rule = Schedule(interval_s=8.0, again=0.43) if whole_dish else Schedule()
    return {"telescope": stands, "conditions": conditions, "schedule": rule, "nature": Nature.drawn(seed)}


def natural_night(seed, dish_prisms):
    """Weather, posture and nature drawn from the seed."""
    return simulate_night(seed, **natural_setting(seed, dish_prisms))


def kind_of(name, campaign):
    """Class of a point, as the campaign's records have it."""
    if name in campaign.monuments:
        return "ground"
    if name in {r.name for r in campaign.feedarm.ranger}:
        return "arm"
    for triplet in campaign.triplets.values():
        if name in triplet.targets:
            return "ball" if name == triplet.ball.target else "triplet prism"
    if campaign.targets[name].type == "prism":
        return "dish"
    return "benchmark" if name in {b.target for b in campaign.benchmarks} else "struct"


def reduced(seed, dish_prisms, directory):
    """A natural night and its reduction; the samples are removed again."""
    night = natural_night(seed, dish_prisms)
    campaign = read_campaign(write_night(night, directory / f"night-{seed}"))
    reduction = reduce_epoch(campaign)
    (campaign.directory / "frames.npy").unlink()
    return night.truth, reduction


def tally(truth, reduction, seed):
    """Squared normalised errors of one night by class, with draws of what their mean would be as claimed.

    mean       class: mean over its coordinates
    claimed    class: (DRAWS,) of the same mean, drawn from the claimed covariance
    leading    class: (10,) squared errors along the leading eigenvectors over their eigenvalues
    """
    campaign, coordinates = reduction.campaign, reduction.coordinates
    rng = np.random.default_rng(seed)
    used = Counter(t for t, on in zip(coordinates.ranges.target, coordinates.ranges.used, strict=True) if on)
    found = {"mean": {}, "claimed": {}, "leading": {}}
    members = {kind: [] for kind in CLASSES}
    for name in coordinates.points:
        kind = kind_of(name, campaign) if name in coordinates.places else ""
        if kind in members and (kind != "dish" or used[name] >= LEAST_SHOTS):
            members[kind].append(name)
    for kind, names in members.items():
        some = names[:: -(-len(names) // LARGEST)]
        error = np.concatenate([coordinates.x[coordinates.index(n)] - truth.points[n] for n in some])
        _add(found, kind, error, coordinates.block(some), rng)
    fit = reduction.surface
    deviation = fit.fit.deviation - np.array([truth.paraboloid.deviations[n] for n in fit.names])
    seen = np.flatnonzero([used[n] >= LEAST_SHOTS for n in fit.names])[:: -(-len(fit.names) // (3 * LARGEST))]
    _add(found, "surface", deviation[seen], fit.fit.deviation_covariance[np.ix_(seen, seen)], rng)
    found["pose"] = pose_distance(reduction, truth)
    found["thermometers"] = [
        ((value - truth.thermometer_offsets_c[name]) / u) ** 2
        for name, (value, u) in list(coordinates.air.items())[:-1]
    ]
    found |= fates(reduction, truth)
    found["named"] = [
        p.of for p in coordinates.refuted if p.kind is ParameterKind.THERMOMETER
    ]  # all of them are innocent: their offsets are drawn from the prior
    found["factor"] = coordinates.variance_factor
    found["doubts"] = coordinates.doubts
    return found


def _add(found, kind, error, covariance, rng):
    """One class: its errors, what they would be as claimed, and the leading directions."""
    u = np.sqrt(np.diag(covariance))
    found["mean"][kind] = float(np.mean((error / u) ** 2))
    weights = np.linalg.eigvalsh(covariance / np.outer(u, u)).clip(0.0)
    found["claimed"][kind] = (rng.normal(size=(DRAWS, len(u))) ** 2 @ weights) / len(u)
    values, vectors = np.linalg.eigh(covariance)
    found["leading"][kind] = ((vectors.T @ error) ** 2 / values)[-LEADING:]


def pose_distance(reduction, truth):
    """Squared Mahalanobis distance of the pose from the truth; five degrees of freedom."""
    pose = reduction.surface.pose()
    axis, vertex = np.array(pose["axis"]), np.array(pose["vertex"])
    error = np.concatenate([vertex - truth.paraboloid.vertex, np.cross(truth.paraboloid.axis, axis)])
    arm = np.array([1.0, 1.0, 1.0, 50.0, 50.0, 50.0])  # m: metres and radians weigh alike in the rank decision
    covariance = np.array(pose["covariance"]) * np.outer(arm, arm)
    values, vectors = np.linalg.eigh(covariance)
    assert values[0] < 1e-9 * values[-1] < values[1]  # the turn about the axis is not observed, the rest is
    return float(np.sum((vectors[:, 1:].T @ (error * arm)) ** 2 / values[1:]))


def fates(reduction, truth):
    """How many bad shots went with the right reason, how many good ones went with them."""
    bad = right = good = lost = 0
    for k, shot in enumerate(reduction.campaign.shots.shot):
        was, status = truth.shot_status[str(shot)], reduction.status[k]
        if was == "good":
            good += 1
            lost += status not in ("used", "reference")
        else:
            bad += 1
            right += status in (("blocked",) if was == "blocked" else ("reflected", "undecided"))
    return {"bad": bad, "right": right, "good": good, "lost": lost}


def chance(nights, kind):
    """99 % interval of a class's mean over the nights, by drawing from the claims; and the mean itself."""
    claimed = np.mean([n["claimed"][kind] for n in nights], axis=0)
    low, high = np.quantile(claimed, [0.005, 0.995])
    return low, float(np.mean([n["mean"][kind] for n in nights])), high


def chance_of_squares(values):
    """The same of independent squares of unit normals."""
    count = len(values)
    low, high = chi2.ppf([0.005, 0.995], count) / count
    return low, float(np.mean(values)), high
