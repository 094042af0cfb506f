"""Design of networks: the exact derivative beside differences, and the search beside scipy's minimisers.

Differences are forward ones of the same prediction, one more evaluation a coordinate, as scipy's `minimize` makes
them without a derivative. Of the large structure sixteen are timed. The search moves twelve rangers of the Green Bank
site by at most 20 m; scipy's minimisers have the same criterion and regions, and the note says what each reached.
"""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from catseye.estimation.design.addition import with_ranger
from catseye.estimation.design.criteria import WorstAxis
from catseye.estimation.design.descent import descend
from catseye.estimation.design.network import DesignNetwork, predict
from catseye.records.site.design_layout import read_design_layout
from catseye.records.site.folder import read_site
from catseye.records.site.solids import Solids
from catseye.reduction.design.aim import aim_of
from catseye.reduction.design.objective import DesignObjective
from catseye.reduction.design.regions import Constraints, moving_units
from catseye.reduction.design.scene import DesignScene, scene_of_layout, scene_of_site
from catseye.reduction.design.vary import variations
from harness import Contender, Row, main, missing, raced

EXAMPLES = Path(__file__).parents[1] / "examples"
TIMED = 16  # differences of the large structure
STEP = 1e-4  # m, of a difference


def gbt() -> DesignScene:
    """Green Bank site in its record's posture."""
    return scene_of_site(read_site(EXAMPLES / "sites" / "gbt"), Solids())


def structure() -> DesignScene:
    """Bundled structure of 500 m: 200 rangers, 600 targets."""
    return scene_of_layout(read_design_layout(EXAMPLES / "designs" / "structure-500m.toml"), Solids())


def objective_of(scene: DesignScene, vary: str) -> DesignObjective:
    """Logarithm of the worst axis by the places of rangers on the ground, smooth enough for any minimiser."""
    units = moving_units(scene, variations([vary]))
    aim = aim_of(scene, "worst", [])
    return DesignObjective(scene, aim, units, Constraints(5.0, 1.0, scene.solids), squarings=3)


def rows(quick: bool) -> Iterator[Row]:
    """Derivative of two networks, candidates for one more ranger, and a search."""
    yield _derivative(
        quick, "Green Bank, 12 rangers' places of 58 points", objective_of(gbt(), "rangers within 20 m"), None
    )
    large = objective_of(structure(), "rangers within 15 m")
    yield _derivative(quick, "500 m, 200 rangers' places, 600 targets, 37 702 ranges", large, TIMED)
    yield _candidate(quick, large.scene)
    yield _search(quick)


def _derivative(quick: bool, what: str, objective: DesignObjective, timed: int | None) -> Row:
    places = objective.places
    count = 2 * len(places)
    made = timed or count

    def differences() -> np.ndarray:
        base, slopes = objective.value(objective.at(places)), np.zeros(count)
        for k in range(made):
            moved = places.copy()
            moved[k // 2, k % 2] += STEP
            slopes[k] = (objective.value(objective.at(moved)) - base) / STEP
        return slopes

    exact = objective(places)[1][:, :2].ravel()
    departure = np.abs(differences()[:made] - exact[:made]).max() / np.abs(exact).max()
    return raced(
        "design: value and derivative",
        what,
        {
            "catseye": Contender(lambda: objective(places)),
            "forward differences": Contender(differences, share=(made + 1) / (count + 1)),
        },
        quick=quick,
        clock=time.process_time,  # all on one thread
        note=f"differences of {STEP * 1e3:g} mm depart by {departure:.0e} of the largest; ours is exact to rounding",
    )


def _candidate(quick: bool, scene: DesignScene) -> Row:
    """One candidate place of one more ranger: low-rank update beside the prediction of the larger network."""
    network = scene.network(0)
    prediction = predict(network)
    criterion = WorstAxis(np.flatnonzero(network.ranger_of < 0))
    place, u = np.array([60.0, 20.0, 2.0]), np.full(3, 2e-4)
    near = np.linalg.norm(network.points - place, axis=1) < scene.limits.far
    targets = np.flatnonzero(near & (network.ranger_of < 0))
    larger = DesignNetwork(
        points=np.concatenate([network.points, place[None]]),
        rangers=np.append(network.rangers, len(network.points)),
        pairs=np.concatenate([network.pairs, [(len(network.rangers), t) for t in targets]]),
        claim=network.claim,
        information=np.concatenate([network.information, np.diag(1.0 / u**2)[None]]),
        u_zero=np.append(network.u_zero, 2e-5),
        u_scale=network.u_scale,
    )

    def update() -> float:
        return criterion.true_value(with_ranger(prediction, place, targets, u=u, u_zero=2e-5))

    def whole() -> float:
        return criterion.true_value(predict(larger))

    return raced(
        "design: one more ranger",
        f"500 m, a candidate place that sees {len(targets)} targets",
        {"catseye": Contender(update), "prediction of the larger network": Contender(whole), **_dense(quick, larger)},
        quick=quick,
        clock=time.process_time,  # all on one thread
        note=f"both agree to {abs(update() / whole() - 1.0):.0e}",
    )


def _dense(quick: bool, network: DesignNetwork) -> dict[str, Contender]:
    """Inverse of one dense matrix of all unknowns, without the time to fill it."""
    if quick:
        return {}
    size = 3 * len(network.points) + len(network.rangers) + 1
    matrix = np.eye(size) + 0.1 / size
    return {"one dense inverse of all unknowns (numpy)": Contender(lambda: np.linalg.inv(matrix))}


def _search(quick: bool) -> Row:
    objective = objective_of(gbt(), "rangers within 20 m")
    start = objective.places
    home = start[:, :2]
    reached: dict[str, float] = {}

    def ours() -> None:
        reached["catseye"] = descend(objective, objective.restrict, start, reach=5.0, steps=100).value

    def at(flat: np.ndarray) -> np.ndarray:
        return np.column_stack([flat.reshape(-1, 2), start[:, 2]])

    def by_scipy(method: str, exact: bool) -> Any:
        from scipy.optimize import minimize

        inside = {"type": "ineq", "fun": lambda flat: 400.0 - np.sum((flat.reshape(-1, 2) - home) ** 2, axis=1)}

        def function(flat: np.ndarray) -> Any:
            if not exact:
                return objective.value(objective.at(at(flat)))
            value, slopes = objective(at(flat))
            return value, slopes[:, :2].ravel()

        def run() -> None:
            found = minimize(
                function, home.ravel(), method=method, jac=exact, constraints=[inside], options={"maxiter": 100}
            )
            reached[f"scipy {method}{', our derivative' if exact else ''}"] = float(found.fun)

        return run

    contenders = {"catseye": Contender(ours)}
    skipped = missing("scipy")
    if not skipped:
        contenders["scipy SLSQP, our derivative"] = Contender(by_scipy("SLSQP", True))
        contenders["scipy SLSQP"] = Contender(by_scipy("SLSQP", False))
        if not quick:
            contenders["scipy trust-constr"] = Contender(by_scipy("trust-constr", False))
    row = raced(
        "design: search",
        "Green Bank, 12 rangers within 20 m, smooth worst axis",
        contenders,
        quick=quick,
        clock=time.process_time,
    )
    begun = objective.value(objective.at(start))
    falls = ", ".join(f"{name} {100 * (1 - np.exp(0.5 * (value - begun))):.1f} %" for name, value in reached.items())
    return Row(**{**row.__dict__, "note": f"fall of the uncertainty: {falls}", "skipped": skipped})


if __name__ == "__main__":
    main(rows)
