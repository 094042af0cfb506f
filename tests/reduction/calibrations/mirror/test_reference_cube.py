"""Reference cube: the centre of any scan, signs by hand, and a claim that scatter confirms."""

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.reduction.calibrations.mirror.reference_cube import KIND, ReferenceCubeSheet, calibrate_reference_cube
from reduction.calibrations.length_scene import readings

STEPS = np.arange(-200.0, 201.0, 40.0)


def scan(azimuth, elevation, *, play=0.0, noise=None, aside=10.0):
    """Returns of a true centre, read up and down in each axis with the other one 10 counts off."""
    ways = [(1.0, STEPS), (-1.0, STEPS[::-1])]
    a = np.concatenate([*(steps for _, steps in ways), *(np.full(len(STEPS), aside) for _ in ways)]) + 1000.0
    e = np.concatenate([*(np.full(len(STEPS), -aside) for _ in ways), *(steps for _, steps in ways)]) + 2000.0
    sense = np.concatenate([np.full(len(STEPS), sign) for _ in range(2) for sign, _ in ways])
    true = a - 0.5 * play * sense - azimuth, e - 0.5 * play * sense - elevation  # where the axis is, from the cube
    volts = 5.0 * np.exp(-0.5 * ((true[0] / 90.0) ** 2 + (true[1] / 70.0) ** 2))
    volts = volts + (0.0 if noise is None else noise.normal(size=len(a)) * 0.02)
    words = tuple("up" if sign > 0 else "down" for sign in sense)
    return {"azimuth_counts": a, "elevation_counts": e, "amplitude_volt": np.maximum(volts, 0.0)}, {"sense": words}


def calibrated(numbers, words, **sheet):
    return calibrate_reference_cube(readings(ReferenceCubeSheet, KIND, numbers=numbers, words=words, **sheet))


def test_a_centre_between_the_steps_and_the_play_are_found():
    """Counts that grew lead the axis: play above zero. To 0.01 counts, where the search settles."""
    found = calibrated(*scan(1013.7, 1987.2, play=4.0), u_amplitude_volt=0.01)
    np.testing.assert_allclose(
        [found.value(f"{key}_counts") for key in ("azm_zrg", "elv_zrg", "play", "width_azimuth")],
        [1013.7, 1987.2, 4.0, 90.0], atol=0.01,
    )  # fmt: skip
    assert found.record == {"azm_zrg": 1014, "elv_zrg": 1987}


def test_centres_scatter_as_claimed_with_the_settling_common_to_a_scan():
    """80 scans, 160 squares: the mean of such a sum of normal errors scatters by the root of 2/160, 0.11."""
    rng, errors = np.random.default_rng(11), []
    for _ in range(80):
        settled = 0.5 * rng.normal(size=2)
        found = calibrated(*scan(1013.7 + settled[0], 1987.2 + settled[1], noise=rng), u_amplitude_volt=0.02)
        errors.append([(found.value("azm_zrg_counts") - 1013.7) / found.u("azm_zrg_counts"),
                       (found.value("elv_zrg_counts") - 1987.2) / found.u("elv_zrg_counts")])  # fmt: skip
    assert np.mean(np.square(errors)) == pytest.approx(1.0, abs=4 * 0.11)
    assert found.u("azm_zrg_counts") > 0.5


@pytest.mark.parametrize("azimuth", [1250.0, 750.0])
def test_a_scan_that_has_not_passed_its_peak_is_refused(azimuth):
    with pytest.raises(InputError, match="scan in azimuth has not passed its peak"):
        calibrated(*scan(azimuth, 2000.0))
