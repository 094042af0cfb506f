"""Mounting plate: signs by hand, faces and seatings, and a claim that scatter confirms."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.reduction.calibrations.monument.mounting_plate import KIND, MountingPlateSheet, calibrate_mounting_plate
from reduction.calibrations.length_scene import readings

ARCSECOND = 1.0 / 3600.0
BLOCKS = {"A": 30.0, "B": 75.0}


def calibrated(directions, *, seatings=4, faces=("left", "right"), **sheet):
    """Readings (seatings, targets, faces), degrees."""
    rows = [(f"s{s}", t, f) for s in range(seatings) for t in BLOCKS for f in faces]
    words = {name: tuple(row[k] for row in rows) for k, name in enumerate(("seating", "target", "face"))}
    reference = tuple({"name": n, "v_block_deg": v, "u_v_block_arcsec": 1.0} for n, v in BLOCKS.items())
    numbers = {"direction_deg": np.ravel(directions)}
    return calibrate_mounting_plate(
        readings(MountingPlateSheet, KIND, numbers=numbers, words=words, reference=reference, **sheet)
    )


def table(rng, zero=40.0, collimation=20.0 * ARCSECOND, seatings=4):
    """A truth drawn by its claims: seating 3 arcsec, reading 1, v-block 1 for each reference."""
    seat = 3.0 * ARCSECOND * rng.normal(size=(seatings, 1, 1))
    wrong = ARCSECOND * rng.normal(size=(1, 2, 1))
    blocks = np.array(list(BLOCKS.values()))[None, :, None]
    faces = np.array([collimation, 180.0 - collimation])
    return np.mod(zero + seat - blocks - wrong + faces + ARCSECOND * rng.normal(size=(seatings, 2, 2)), 360.0)


def test_a_reference_at_10_deg_and_a_v_block_30_deg_clockwise_of_it_read_40_deg():
    """Face left 10 deg and 20 arcsec, face right 190 deg less 20 arcsec; B, 75 deg, reads 325."""
    c = 20.0 * ARCSECOND
    one = [[10.0 + c, 190.0 - c], [325.0 + c, 145.0 - c]]
    moved = np.array([1.0, -2.0, 2.0, -1.0])[:, None, None] * ARCSECOND  # four seatings, zero on average
    found = calibrated(np.tile(one, (4, 1, 1)) + moved, u_direction_arcsec=1.0)
    assert found.value("plate_zero_deg") == pytest.approx(40.0, abs=1e-9)
    assert found.value("collimation_arcsec") == pytest.approx(20.0, abs=1e-6)


def test_the_zero_scatters_as_claimed_and_the_record_holds_one_seating_to_come():
    """120 tables of 12 seatings; the claim's own 11 degrees of freedom widen the squares by 11/9."""
    rng, errors, later = np.random.default_rng(3), [], []
    for _ in range(120):
        found = calibrated(table(rng, seatings=12), seatings=12, u_direction_arcsec=1.0)
        errors.append((found.value("plate_zero_deg") - 40.0) / found.u("plate_zero_deg"))
        to_come = 40.0 + 3.0 * ARCSECOND * rng.normal()
        later.append((found.value("plate_zero_deg") - to_come) / ARCSECOND / found.record["u_plate_zero_arcsec"])
    spread = 4.0 * np.sqrt(2.0 / 120)
    assert np.mean(np.square(errors)) == pytest.approx(1.1, abs=spread)
    assert np.mean(np.square(later)) == pytest.approx(1.2, abs=spread + 0.1)


def test_one_face_or_two_seatings_are_refused():
    with pytest.raises(InputError, match="one face only"):
        calibrated(np.full((4, 2, 1), 10.0), faces=("left",))
    with pytest.raises(InputError, match="2 seatings"):
        calibrated(table(np.random.default_rng(1), seatings=2), seatings=2)
