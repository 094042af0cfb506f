"""Makes the sheets of this directory by the simulator, with noise; run it to have them again.

TR01 three spacers; TR02 repeated flips; TR03 one placement; TR04 a unit to be refused (the silvered shell is 0.2 mm
larger than its sheet says); TR05 a placement whose ball phase was read wrong by 0.02 rad; TR06 a placement where the
memo's INT rule slips. TR99 is the layout's own example, made by others, with the true h_corr of -0.023 mm.
"""

from pathlib import Path

import numpy as np

from catseye.atmosphere.index.air import group_refractivity
from catseye.simulator.laboratory.triplet import TripletScenes, random_scenes, triplet_sheets

HERE = Path(__file__).parent
SPACERS = (0.0, 0.0254, 0.0508)
U_PHASE, U_HEIGHT, U_D12 = 0.0004, 0.003e-3, 0.03e-3
LASER = {"wavelength_um": 0.780, "model": "rueger1990"}


def scenes_of_one_unit(rng: np.random.Generator, spacers: tuple[float, ...], **changes: float) -> TripletScenes:
    """A random unit on one set of stops, a case for each spacer; `changes` are of the unit or of the first depth."""
    one = random_scenes(rng, 1, offset=0.01)
    values = {name: np.repeat(np.asarray(value), len(spacers), axis=0) for name, value in vars(one).items()}
    for name, value in changes.items():
        values[name] = np.full(len(spacers), value)
    values["depth"] = values["depth"] - np.array(spacers) / np.cos(values["yaw"]) / np.cos(values["pitch"])
    turn = rng.uniform(0.0, 3.0, (2, len(spacers)))  # with phi_cal under 2 pi, as the memo's 3.4b asks
    values["phi_cal"] = np.mod(values["phi_cal"], 3.0)
    values["phi_zrg"], values["phi_zrg_fp"] = turn
    return TripletScenes(**values)


def sheet(
    name: str,
    serial: int,
    seed: int,
    spacers: tuple[float, ...],
    *,
    wrong: float = 0.0,
    shell: float = 0.0,
    **changes: float,
) -> str:
    """The text of a sheet; `wrong` is added to the last ball phase, `shell` to the true radius R2."""
    rng = np.random.default_rng(seed)
    scene = scenes_of_one_unit(rng, spacers, **changes)
    count = len(spacers)
    weather = [np.round(c + rng.normal(0.0, s, (2, count)), 2) for c, s in ((20.4, 0.2), (931.0, 0.3), (47.0, 1.0))]
    eta, eta_fp = 1.0 + np.asarray(group_refractivity(*weather, **LASER))
    scene = TripletScenes(**(vars(scene) | {"eta": eta, "eta_fp": eta_fp}))
    seen = triplet_sheets(scene)
    told = seen.pc_b
    seen = triplet_sheets(TripletScenes(**(vars(scene) | {"radius_2": scene.radius_2 + shell})))
    noise = rng.normal(0.0, U_PHASE, (5, count))
    noise[2, -1] += wrong
    phases = {
        "phi_1": seen.phi_1 + noise[0],
        "phi_2": seen.phi_2 + noise[1],
        "phi_bcfp": seen.phi_bcfp + noise[2],
        "phi_zrg": scene.phi_zrg + noise[3],
        "phi_zrg_flipped": scene.phi_zrg_fp + noise[4],
    }
    phases = {key: np.mod(value, 2.0 * np.pi) for key, value in phases.items()}
    heights = [float(v[0]) + rng.normal(0.0, U_HEIGHT) for v in (seen.l_1, seen.l_2, seen.l_bt)]
    coarse = float(seen.d_toppl[0]) + rng.normal(0.0, 1e-3)
    lines = [
        f"# {name}: made by make_examples.py by exact geometry; true h_corr = {1e3 * float(scene.h_corr[0]):+.6f} mm.",
        'format = "catseye-triplet-measurement-1"',
        f'triplet = "{name}"',
        "measured_on = 2003-05-14",
        'by = "made up"',
        "bk7_to_air_group_index_ratio = 1.527077",
        "modulation_hz = 1500000000.0",
        "wavelength_um = 0.780",
        'air_model = "rueger1990"',
        f"d12_mm = {1e3 * (float(seen.d_12[0]) + rng.normal(0.0, U_D12)):.6f}",
        f"u_d12_mm = {1e3 * U_D12:.3f}",
        "",
        "[surface_plate]",
        *(f"{key}_mm = {1e3 * value:.6f}" for key, value in zip(("l1", "l2", "l_bt"), heights, strict=True)),
        "l_post_mm = 88.900000",
        f"u_height_mm = {1e3 * U_HEIGHT:.3f}",
    ]
    for k, side in ((1, "left"), (2, "right")):
        lines += ["", f"[{side}_prism]", f"serial = {serial + k - 1}"]
        lines += [
            f"{key}_mm = {1e3 * float(value[0]):.6f}"
            for key, value in (
                ("height", getattr(scene, f"height_{k}")), ("hrp", getattr(seen, f"hrp_{k}")),
                ("pc", getattr(seen, f"pc_{k}")),
            )
        ]  # fmt: skip
    radii = (("r1", scene.radius_1), ("r2", scene.radius_2), ("pc_b", told))
    lines += ["", "[ball]", *(f"{key}_mm = {1e3 * float(value[0]):.6f}" for key, value in radii)]
    for j, spacer in enumerate(spacers):
        lines += [
            "",
            "[[placement]]",
            f"spacer_mm = {1e3 * spacer:.1f}",
            f"d_toppl_mm = {1e3 * (coarse - spacer):.1f}",
            f"h_s_mm = {1e3 * float(seen.h_s[j]):.0f}.0",
            f"phi_1_rad = {phases['phi_1'][j]:.6f}",
            f"phi_2_rad = {phases['phi_2'][j]:.6f}",
            f"phi_zrg_rad = {phases['phi_zrg'][j]:.6f}",
            f"phi_cal_rad = {float(scene.phi_cal[j]):.6f}",
            f"temperature_c = {weather[0][0, j]:.2f}",
            f"pressure_hpa = {weather[1][0, j]:.2f}",
            f"humidity_percent = {weather[2][0, j]:.2f}",
            f"phi_bcfp_rad = {phases['phi_bcfp'][j]:.6f}           # flipped: ball towards the ranger",
            f"phi_zrg_flipped_rad = {phases['phi_zrg_flipped'][j]:.6f}",
            f"temperature_flipped_c = {weather[0][1, j]:.2f}",
            f"pressure_flipped_hpa = {weather[1][1, j]:.2f}",
            f"humidity_flipped_percent = {weather[2][1, j]:.2f}",
            f"u_phase_rad = {U_PHASE}",
        ]
    return "\n".join(lines) + "\n"


def main() -> None:
    made = {
        "TR01": sheet("TR01", 101, 1, SPACERS),
        "TR02": sheet("TR02", 103, 2, tuple(s for s in SPACERS for _ in range(3))),
        "TR03": sheet("TR03", 105, 3, (0.0,)),
        "TR04": sheet("TR04", 107, 4, SPACERS, shell=0.2e-3),
        "TR05": sheet("TR05", 109, 5, (*SPACERS, 0.0762, 0.1016), wrong=0.02),
        "TR06": sheet("TR06", 111, 7, SPACERS, depth=18.0481, yaw=0.0, pitch=0.0),
    }
    for name, text in made.items():
        (HERE / f"{name}.toml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
