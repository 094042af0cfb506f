"""Campaign files in the layout of night-01, to the last key and decimal."""

import csv
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from catseye.constants import MILLIMETRE, SECONDS_PER_DAY
from catseye.errors import InputError
from catseye.records.site.retroreflector import GlassForm
from catseye.simulator.night.air import ELEVATION_OF_Z0
from catseye.simulator.night.glass import GLASS_TO_AIR
from catseye.simulator.night.head import CYCLES, SAMPLES_PER_CYCLE, TunedHead
from catseye.simulator.night.night import Night
from catseye.simulator.night.stations import STATIONS
from catseye.simulator.night.structure import TrueTarget, TrueTriplet
from catseye.simulator.night.world import (
    METRES_PER_DEGREE,
    SITE_LATITUDE_DEG,
    U_LEAKAGE_VOLT,
    TrueHead,
    TrueMonument,
)

README = """# Measurement campaign, {name}

A simulated night (catseye.simulator, seed {seed}): azimuth {azimuth:.1f} deg, elevation {elevation:.1f} deg,
{shots} shots. Layout, signal and geometry are those of night-01's README.
"""
TARGETS = "# Single targets.  Positions are approximate unless a certificate says otherwise (see README).\n\n"
SITE = """# Site, frames and instrument constants of the campaign.
[campaign]
name = "{name}"
start_mjd_utc = {start:.8f}
azimuth_deg = {azimuth!r}          # astronomical azimuth of the telescope, clockwise from north (encoder)
elevation_deg = {elevation!r}         # elevation of the telescope (encoder)

[site]
latitude_deg = 38.433121
longitude_deg = -79.839835
elevation_of_z0_m = 806.42     # height above sea level of z = 0 of the ground frame

[frames.ground]
description = "origin x, y: centre of the pintle bearing; z = 0: centre of the tooling ball (Kelvin fixed point) of \
ZY103; x east, y north, z up; Cartesian, earth curvature already removed"

[frames.reflector]
description = "origin at the vertex of the parent paraboloid, z along its axis, y from the vertex towards the dish; \
nominal transformation to ground below"
reflector_to_elevation_mm = [0.000, -54839.108, 4999.990]
elevation_axis_height_mm = 48260.000

[paraboloid]
focal_length_mm = 60000.000
aperture_centre_mm = [0.000, 54000.000]
aperture_radius_mm = 50000.000

[ranging]
modulation_hz = {modulation!r}
if_hz = 1000.0
wavelength_um = 0.780
bk7_to_air_group_index_ratio = 1.527077   # value behind the tabulated glass constants
electronic_drift_mrad_per_sqrt_hour = 10.0  # typical, after warm-up; warm-up transients of some 0.03 rad occur
path_index_fluctuation_ppm = {fluctuation!r}           # typical residual of a path against smooth air, one sigma

[adc]
bits = 16
full_scale_volt = 10.0      # code 32768 = 10 V, bipolar
samples_per_cycle = 64
cycles = 128

"""
STATION = """[[weather_station]]
name = "{name}"
elevation_m = {elevation:.3f}
"""


def vector(values, decimals: int) -> str:
    return "[" + ", ".join(f"{v + 0.0:.{decimals}f}" for v in np.round(values, decimals)) + "]"


def prism_constants(height_mm: float, u_height_mm: float = 0.002) -> str:
    """Four lines common to all prism sheets, from the typed height."""
    hrp, pc = height_mm / GLASS_TO_AIR, -(GLASS_TO_AIR - 1.0 / GLASS_TO_AIR) * height_mm
    return f"height_mm = {height_mm:.3f}\nu_height_mm = {u_height_mm:.3f}\nhrp_mm = {hrp:.3f}\npc_mm = {pc:.4f}\n"


def monument_sheet(m: TrueMonument) -> str:
    x, y, z = m.fixed_point_mm
    _, north, up = m.fixed_point_mm if m.levelled_mm is None else m.levelled_mm
    zero = "   # defines z = 0" if m.u_mm[2] == 0.0 else ""
    return (
        "# Laser monument calibration report\n"
        f'monument = "{m.ranger}"\nzp = "ZP{m.ranger[2:]}"\n'
        f"x_mm = {x:.3f}\ny_mm = {y:.3f}\nz_mm = {z:.3f}\n"
        f"u_x_mm = {m.u_mm[0]:.3f}\nu_y_mm = {m.u_mm[1]:.3f}\nu_z_mm = {m.u_mm[2]:.3f}{zero}\n"
        f"azimuth_deg = {m.azimuth_deg:.6f}       # survey azimuth of the line fixed point -> v-block\n"
        f"alpha1_rad = {m.alpha_rad[0]:.7f}       # pi - azimuth\n"
        f"alpha2_rad = {m.alpha_rad[1]:.7f}       # rotation about z^\n"
        f"alpha3_rad = {m.alpha_rad[2]:.7f}       # rotation about x^\n"
        f"latitude_deg = {SITE_LATITUDE_DEG + north * MILLIMETRE / METRES_PER_DEGREE:.6f}\n"
        f"elevation_m = {ELEVATION_OF_Z0 + up * MILLIMETRE:.3f}\n"
    )


def head_sheet(h: TrueHead) -> str:
    dx, dy, dz = h.offset_mm
    return (
        "# Laser mirror assembly calibration report\n"
        f'zp = "{h.zp}"\n'
        f"leakage_amplitude_volt = {h.leakage_amplitude_volt:.5f}\nleakage_phase_rad = {h.leakage_phase_rad:.4f}\n"
        f"u_leakage_volt = 0.0008\nd0_mm = {h.d0_mm:.3f}\nu_d0_mm = 0.010\n"
        f"dx_mm = {dx:.3f}\ndy_mm = {dy:.3f}\ndz_mm = {dz:.3f}\nu_offset_mm = 0.005\n"
        f"beta1_rad = {h.beta_rad[0]:.6f}      # rotation about x (theta)\n"
        f"beta2_rad = {h.beta_rad[1]:.6f}      # rotation about y (phi)\n"
        f"na0 = {h.na0}\nne0 = {h.ne0}\n"
        f"az_low_limit = {h.na0 - 24000}\naz_high_limit = {h.na0 + 73000}\n"
        f"azm_zrg = {h.na0 + 37500}\nelv_zrg = {h.ne0 + 24600}\n"
    )


def frequency_entry(tuned: TunedHead) -> str:
    """Table of a further modulation frequency of a head's sheet."""
    return (
        f"\n[[frequency]]\nmodulation_hz = {tuned.modulation_hz!r}\n"
        f"leakage_amplitude_volt = {tuned.leakage_amplitude_volt:.5f}\n"
        f"leakage_phase_rad = {tuned.leakage_phase_rad:.4f}\nu_leakage_volt = {U_LEAKAGE_VOLT:.4f}\n"
    )


def target_entry(t: TrueTarget) -> str:
    entry = f'[[target]]\nname = "{t.name}"\ntype = "{t.kind.name}"\n'
    entry += 'material = "BK7"\n' if t.kind.glass is GlassForm.SLAB else ""
    entry += f'frame = "{t.frame}"\nposition_mm = {vector(t.position_mm, 1)}\n'
    if t.normal_typed is not None:
        entry += f"normal = {vector(t.normal_typed, 5)}     # outward normal of the entry face, same frame\n"
    if t.kind.glass is GlassForm.SLAB:
        entry += prism_constants(t.sizes_mm[0])
    return entry


def station_entry(night: Night, name: str) -> str:
    """Table of a weather station, with its place where needed."""
    entry = STATION.format(name=name, elevation=STATIONS[name])
    if night.truth.nature.calm:
        return entry
    x, y, _ = night.truth.stations.places[name]
    return entry + f"x_m = {x:.1f}\ny_m = {y:.1f}\n"


def triplet_sheet(t: TrueTriplet) -> str:
    left, right, ball = t.targets
    serial = 99 + 2 * int(t.name[2:])
    r1, r2 = ball.sizes_mm
    return (
        "# Triplet retroreflector unit data sheet\n"
        f'triplet = "{t.name}"\nframe = "reflector"\n'
        f"nominal_position_mm = {vector(t.position_mm, 1)}     # ball centre\n"
        f"normal = {vector(t.normal, 5)}                   # top plate normal, prism side, towards A\n"
        f"axis = {vector(t.axis, 5)}                     # unit vector from the left to the right prism\n"
        f"d12_mm = {t.d12_mm:.3f}\nu_d12_mm = 0.030\n"
        f"h_corr_mm = {t.h_corr_mm:.3f}                # ball centre above the prism mid-point, along the normal\n"
        "u_h_corr_mm = 0.020\n"
        f"l_mpbc_mm = {t.l_mpbc_mm:.3f}                # surface-plate value\n"
        "u_l_mpbc_mm = 0.045\n"
        "u_lateral_mm = 0.040               # ball centre against the mid-point, each direction in the plate\n\n"
        f'[left_prism]\ntarget = "{left.name}"\nserial = {serial}\n{prism_constants(left.sizes_mm[0])}\n'
        f'[right_prism]\ntarget = "{right.name}"\nserial = {serial + 1}\n{prism_constants(right.sizes_mm[0])}\n'
        f'[ball]\ntarget = "{ball.name}"\nr1_mm = {r1:.3f}\nr2_mm = {r2:.3f}\nu_r_mm = 0.003\n'
        f"pc_b_mm = {-(GLASS_TO_AIR * (r1 + r2) - r1):.4f}\n"
    )


def feed_arm_sheet(feed_arm: dict[str, TrueTarget], aim_point_mm) -> str:
    text = "# Rangers on the feed arm: nominal scan points, reflector frame (good to some 15 mm).\n\n"
    for name, t in feed_arm.items():
        text += f'[[ranger]]\nname = "{name}"\nzp = "ZP{name[2:]}"\n'
        text += f"nominal_scan_point_mm = {vector(t.position_mm, 1)}\n\n"
    text += (
        f"[aim_point]\nnominal_mm = {vector(aim_point_mm, 1)}   # point A the triplets are aimed at, reflector frame\n"
    )
    return text


def write_table(path: Path, header: str, rows) -> None:
    with named(path), path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header.split(","))
        writer.writerows(rows)


def write_night(night: Night, directory: str | Path) -> Path:
    """Write the campaign into a new or empty directory, whole or not at all.

    Raises InputError: the directory is not empty.
    """
    directory = Path(directory)
    if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
        raise InputError(f"{directory}: exists and is not an empty directory; name a new one")
    partial = directory.with_name(directory.name + ".partial")
    partial.mkdir(parents=True)
    try:
        write_files(night, partial)
        partial.replace(directory)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return directory


def write_files(night: Night, directory: Path) -> None:
    """Write all files of the campaign into an existing, empty directory.

    Raises OSError with the file's name: no room, no permission.
    """
    for folder in ("monuments", "mirrors", "triplets"):
        (directory / folder).mkdir()
    for name, text in _texts(night).items():
        with named(directory / name) as path:
            path.write_text(text, encoding="utf-8")
    _write_tables(night, directory)
    with named(directory / "frames.npy") as path, path.open("wb") as file:
        np.lib.format.write_array_header_1_0(file, np.lib.format.header_data_from_array_1_0(night.frames))
        file.write(np.ascontiguousarray(night.frames).data.cast("B"))  # numpy's writing loses the system's reason


@contextmanager
def named(path: Path) -> Iterator[Path]:
    """Add the file name to an OSError raised inside."""
    try:
        yield path
    except OSError as problem:
        problem.filename = problem.filename or str(path)
        raise


def _texts(night: Night) -> dict[str, str]:
    """Readme and sheets by relative path."""
    texts = {
        "README.md": README.format(
            name=night.name,
            seed=night.seed,
            azimuth=night.azimuth_deg,
            elevation=night.elevation_deg,
            shots=len(night.shots),
        ),
        "site.toml": SITE.format(
            name=night.name,
            start=night.start_mjd_utc,
            azimuth=float(night.azimuth_deg),
            elevation=float(night.elevation_deg),
            modulation=float(night.modulation_hz),
            fluctuation=float(night.conditions.index_fluctuation_ppm),
        )
        + "\n".join(station_entry(night, name) for name in STATIONS),
        "feedarm.toml": feed_arm_sheet(night.telescope.feed_arm, night.telescope.aim_point_mm),
        "targets.toml": TARGETS + "\n".join(target_entry(t) for t in night.single_targets),
    }
    texts |= {f"monuments/{name}.toml": monument_sheet(m) for name, m in night.monuments.items()}
    texts |= {
        f"mirrors/{h.zp}.toml": head_sheet(h) + "".join(map(frequency_entry, night.tuned.get(name, ())))
        for name, h in night.heads.items()
    }
    texts |= {f"triplets/{t.name}.toml": triplet_sheet(t) for t in night.telescope.triplets}
    return texts


def _write_tables(night: Night, directory: Path) -> None:
    """Write benchmarks, weather, shots, and path temperatures if sound was used."""
    start = night.start_mjd_utc
    write_table(
        directory / "benchmarks.csv",
        "target,ranger,certified_distance_mm,u_mm",
        ((b.name, b.ranger, f"{b.certified_mm:.3f}", "0.020") for b in night.benchmarks),
    )
    write_table(
        directory / "weather.csv",
        "mjd_utc,station,temperature_c,pressure_mb,humidity_pct",
        (
            (
                f"{start + w.seconds / SECONDS_PER_DAY:.8f}",
                w.station,
                f"{w.temperature_c:.2f}",
                f"{w.pressure_hpa:.2f}",
                f"{w.humidity_percent:.1f}",
            )
            for w in night.weather
        ),
    )
    if night.sounded:
        write_table(
            directory / "path_temperatures.csv",
            "mjd_utc,ranger,target,temperature_c,u_temperature_c",
            (
                (
                    f"{start + s.seconds / SECONDS_PER_DAY:.8f}",
                    s.ranger,
                    s.target,
                    f"{s.temperature_c:.3f}",
                    f"{s.u_temperature_c:.3f}",
                )
                for s in night.sounded
            ),
        )
    write_table(
        directory / "shots.csv",
        "shot,mjd_utc,ranger,target,cycles,samples_per_cycle,frame" + ",modulation_hz" * bool(night.tuned),
        (
            (
                *(i + 1, f"{start + s.seconds / SECONDS_PER_DAY:.9f}", s.ranger, s.target),
                *(CYCLES, SAMPLES_PER_CYCLE, i),
                *((repr(s.modulation_hz),) if night.tuned else ()),
            )
            for i, s in enumerate(night.shots)
        ),
    )
