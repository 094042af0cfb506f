"""Hydrostatic level: heights and constant from water that stands as its weight has it, loops, density, scatter."""

from dataclasses import replace

import numpy as np
import pytest

from calibration_scene import RUNS
from catseye.errors import EstimationError, InputError, ValidityError
from catseye.reduction.calibrations.monument.hydrostatic_level import LAYOUT, calibrate_level, water_density
from monument_scene import water

HEIGHTS = {"A": 0.0, "B": 0.0123, "C": -0.0045, "D": 0.0071}
ZEROS = (0.0021, -0.0013)  # C = 3.4 mm
RING = [("A", "B"), ("B", "C"), ("C", "D"), ("D", "A")]


def run(table, ways, vessels, *, noise=0.0, temperatures=None, depth=2.0, zeros=ZEROS, **sheet):
    readings = np.array(
        [
            water(
                HEIGHTS[a],
                HEIGHTS[b],
                zeros=zeros,
                vessel_from=v,
                depth=depth,
                densities=(1.0, 1.0) if temperatures is None else kell(np.array(temperatures[k])),
            )
            for k, ((a, b), v) in enumerate(zip(ways, vessels, strict=True))
        ]
    )
    readings = 1e3 * (readings + noise)
    numbers = {"vessel_from": vessels, "reading_from_mm": readings[:, 0], "reading_to_mm": readings[:, 1]}
    if temperatures is not None:
        numbers |= {
            "temperature_from_c": np.array(temperatures)[:, 0],
            "temperature_to_c": np.array(temperatures)[:, 1],
        }
        sheet["depth_m"] = depth
    words = {"from": tuple(a for a, _ in ways), "to": tuple(b for _, b in ways)}
    return table(LAYOUT, numbers, words, **{"held": "A", "u_reading_mm": 0.01, **sheet})


def kell(t):
    """Density of water, kg/m³: G. S. Kell, J. Chem. Eng. Data 20 (1975) 97, his rational formula."""
    top = 999.83952 + t * (
        16.945176 + t * (-7.9870401e-3 + t * (-46.170461e-6 + t * (105.56302e-9 - 280.54253e-12 * t)))
    )
    return top / (1.0 + 16.879850e-3 * t)


def test_density_of_water_is_kell_s_to_a_few_millionths():
    t = np.linspace(0.0, 40.0, 41)
    # Two scales of temperature and two determinations of the density: 0.005 kg/m³.
    np.testing.assert_allclose(water_density(t), kell(t), atol=0.006)
    with pytest.raises(ValidityError, match="-1 °C"):
        water_density([5.0, -1.0])


def test_exchanging_the_vessels_gives_heights_and_the_constant(table):
    c = calibrate_level(run(table, RING * 2, [1] * 4 + [2] * 4))
    for mark in "BCD":
        assert c.value(f"height_{mark}_mm") == pytest.approx(1e3 * HEIGHTS[mark], abs=1e-9)
    assert c.value("constant_mm") == pytest.approx(3.4, abs=1e-9)
    assert c.record["marks"] == ["A", "B", "C", "D"]
    # One section there and back with the vessels exchanged: dh is half the sum, C half the difference.
    two = calibrate_level(run(table, [("A", "B")] * 2, [1, 2]))
    assert two.u("height_B_mm") == pytest.approx(0.01 / np.sqrt(2))
    assert two.u("constant_mm") == pytest.approx(0.01 / np.sqrt(2))


def test_carrying_one_vessel_past_the_other_is_an_exchange_too(table):
    # Leapfrog: vessel 1 stays on B while vessel 2 goes from A to C. The ring of an even number then cancels C.
    with pytest.raises(EstimationError, match="exchange the vessels"):
        calibrate_level(run(table, [("A", "B"), ("B", "C")], [2, 1]))
    odd = calibrate_level(run(table, [("A", "B"), ("B", "C"), ("C", "A")], [1, 1, 1]))
    assert odd.value("constant_mm") == pytest.approx(3.4)  # three times C is the misclosure of the ring
    assert odd.value("height_C_mm") == pytest.approx(-4.5)


def test_a_constant_known_beforehand_is_used_and_counted(table):
    c = calibrate_level(run(table, [("A", "B")], [1], constant_mm=3.4, u_constant_mm=0.02))
    assert c.value("height_B_mm") == pytest.approx(12.3)
    assert c.u("height_B_mm") == pytest.approx(np.hypot(0.01, 0.02))
    held = calibrate_level(run(table, [("A", "B")], [2], constant_mm=3.4, u_constant_mm=0.0, held_height_mm=500.0,
                               u_held_height_mm=1.0))  # fmt: skip
    assert held.value("height_B_mm") == pytest.approx(512.3)
    assert held.u("height_B_mm") == pytest.approx(np.hypot(1.0, 0.01))
    back = calibrate_level(
        run(table, [("A", "B")], [2], held="B", held_height_mm=12.3, constant_mm=3.4, u_constant_mm=0.0)
    )
    assert back.value("height_A_mm") == pytest.approx(0.0, abs=1e-9)


def test_a_warm_drop_stands_higher_and_is_corrected(table):
    temperatures = [(12.0, 20.0), (12.0, 20.0)]
    readings = run(table, [("A", "B")] * 2, [1, 2], temperatures=temperatures, depth=2.0)
    c = calibrate_level(readings)
    # 8 °C over 2 m: the density falls by 1.3e-3, the water stands 2.6 mm high.
    assert c.rows[0][5] == pytest.approx(2.0e6 * (kell(12.0) / kell(20.0) - 1), abs=10.0)
    assert c.rows[0][5] > 2500.0
    assert c.value("height_B_mm") == pytest.approx(12.3, abs=0.01)
    vague = calibrate_level(run(table, [("A", "B")] * 2, [1, 2], temperatures=temperatures, u_tube_c=0.5))
    slope = 2.0e3 * (kell(19.5) - kell(20.5)) / kell(20.0)  # mm/°C
    assert vague.u("height_B_mm") == pytest.approx(np.hypot(0.01, 0.5 * slope) / np.sqrt(2), rel=0.01)
    # Thermometers that differ go with the vessels: exchanging these takes their offset out of the height.
    offset = calibrate_level(run(table, [("A", "B")] * 2, [1, 2], temperatures=temperatures, u_temperature_c=0.5))
    assert offset.u("height_B_mm") == pytest.approx(0.01 / np.sqrt(2), rel=0.01)
    assert offset.u("constant_mm") == pytest.approx(0.5 * slope, rel=0.01)


def test_a_loop_that_does_not_close_is_named(table):
    bad = np.zeros((8, 2))
    bad[2, 0] = 3e-4
    c = calibrate_level(run(table, RING * 2, [1] * 4 + [2] * 4, noise=bad))
    assert c.decisions[0].passed is False
    assert "set-ups" in c.decisions[0].text
    good = calibrate_level(run(table, RING * 2, [1] * 4 + [2] * 4))
    assert good.decisions[0].passed
    without = calibrate_level(run(table, RING * 2, [1] * 4 + [2] * 4, noise=bad), reject=True)
    assert [k for k, s in enumerate(without.states) if s == "rejected"] == [2]
    assert without.value("height_C_mm") == pytest.approx(-4.5)
    assert (
        calibrate_level(run(table, [("A", "B")], [1], constant_mm=0.0, u_constant_mm=0.1)).decisions[0].passed is None
    )


def test_the_misclosure_is_the_sum_of_the_readings_around_the_loop(table):
    bad = np.zeros((4, 2))
    bad[1, 0], bad[3, 1] = 5e-5, 2e-5
    c = calibrate_level(run(table, RING, [1, 2, 2, 1], noise=bad, constant_mm=3.4, u_constant_mm=0.1))
    assert c.decisions[0].statistic == pytest.approx(0.05 - 0.02, abs=1e-9)
    # The constant goes out of a ring that has each vessel behind as often as ahead: four differences are left.
    assert c.decisions[0].limit == pytest.approx(3 * 0.01 * np.sqrt(4))
    # A set-up that leads the other way round the ring counts with the other sign.
    turned = [("A", "B"), ("C", "B"), ("C", "D"), ("D", "A")]
    c = calibrate_level(run(table, turned, [1, 2, 2, 1], noise=bad, constant_mm=3.4, u_constant_mm=0.0))
    assert abs(c.decisions[0].statistic) == pytest.approx(0.05 + 0.02, abs=1e-9)


def test_misclosures_scatter_as_their_u(table):
    rng, ratio = np.random.default_rng(51), []
    for _ in range(150):
        c = calibrate_level(run(table, RING, [1, 1, 2, 1], noise=7.07e-6 * rng.standard_normal((4, 2)),
                                constant_mm=3.4, u_constant_mm=0.02, zeros=(ZEROS[0] + 2e-5 * rng.standard_normal(),
                                                                            ZEROS[1])))  # fmt: skip
        ratio.append(c.decisions[0].statistic / (c.decisions[0].limit / 3.0))
    assert np.mean(np.square(ratio)) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 150))


def test_the_micrometers_scale_acts_on_readings_not_on_the_held_elevation(table):
    low, high = (
        calibrate_level(run(table, RING * 2, [1] * 4 + [2] * 4, u_scale_ppm=100.0, held_height_mm=height))
        for height in (0.0, 806_420.0)
    )
    for mark in "BCD":
        assert high.value(f"height_{mark}_mm") - low.value(f"height_{mark}_mm") == pytest.approx(806_420.0, abs=1e-6)
        assert high.u(f"height_{mark}_mm") == pytest.approx(low.u(f"height_{mark}_mm"), rel=1e-6)


@pytest.mark.parametrize("runs", RUNS)
def test_heights_and_constant_scatter_as_claimed(table, scatters_as_claimed, runs):
    rng, values, covariances = np.random.default_rng(52), [], []
    for _ in range(runs):
        c = calibrate_level(run(table, RING * 2, [1] * 4 + [2] * 4, noise=7.07e-6 * rng.standard_normal((8, 2))))
        values.append([q.value for q in c.quantities])
        covariances.append(c.covariance)
    scatters_as_claimed(values, np.array(covariances), [12.3, -4.5, 7.1, 3.4])


def test_runs_that_do_not_hang_together_are_refused(table):
    with pytest.raises(InputError, match="does not hang together"):
        calibrate_level(run(table, [("A", "B"), ("C", "D")], [1, 2]))
    with pytest.raises(InputError, match="to itself"):
        calibrate_level(run(table, [("A", "A")], [1]))
    with pytest.raises(InputError, match=r"vessel_from = 1.5"):
        calibrate_level(run(table, [("A", "B")], [1.5]))
    with pytest.raises(InputError, match="u_constant_mm is missing"):
        calibrate_level(run(table, [("A", "B")], [1], constant_mm=3.4))
    with pytest.raises(InputError, match="has no temperatures"):
        calibrate_level(run(table, [("A", "B")] * 2, [1, 2], u_tube_c=0.5))
    made = run(table, [("A", "B")] * 2, [1, 2], temperatures=[(10.0, 11.0)] * 2)
    shallow = replace(made, sheet=made.sheet.model_copy(update={"depth_m": None}))
    with pytest.raises(InputError, match="depth_m is missing"):
        calibrate_level(shallow)
