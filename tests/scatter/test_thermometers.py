"""A wave of 0.3 °C and 35 minutes over the whole site, and thermometers that are off: named, or covered and told."""

import pytest

from catseye.records.night.campaign import read_campaign
from catseye.reduction.epoch.contradictions.contradiction import RecordGroup
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.parameter import Parameter, ParameterKind
from catseye.simulator.night.faults import Faults
from catseye.simulator.night.fields import AirWave
from catseye.simulator.night.nature import Nature
from catseye.simulator.night.sheets import write_night
from catseye.simulator.night.simulate import SimulatedTelescope, simulate_night
from nature_scene import tally

WAVE = Nature(waves=(AirWave(amplitude_c=0.3, period_s=2100.0),))
SEED = 7003
LITTLE = 0.3  # of a mean square: another answer to the same shots, whose thermometer is as unsure as it is off


@pytest.fixture(scope="module", params=[60, pytest.param(600, marks=pytest.mark.slow)])
def found(request, tmp_path_factory):
    """From what a station is off by to the tally and the coordinates of the same night."""
    where, kept = tmp_path_factory.mktemp("waves"), {}

    def reduced(station, off_c):
        if (station, off_c) not in kept:
            faults = Faults(lying_station=station, lying_thermometer_c=off_c)
            night = simulate_night(
                SEED, telescope=SimulatedTelescope(dish_prisms=request.param), faults=faults, nature=WAVE
            )
            campaign = read_campaign(write_night(night, where / f"{station}{off_c:+g}"))
            reduction = reduce_epoch(campaign)
            (campaign.directory / "frames.npy").unlink()
            kept[station, off_c] = tally(night.truth, reduction, SEED), reduction.coordinates
        return kept[station, off_c]

    return reduced


def test_with_a_wave_thermometers_are_within_two_u_of_their_truth(found):
    told, coordinates = found("WX1", 0.0)
    assert max(told["thermometers"]) < 4.0
    assert coordinates.refuted == ()
    assert not coordinates.doubts


@pytest.mark.parametrize("off_c", [2.0, 5.0])
def test_the_lower_thermometer_determined_by_benchmarks_is_named(found, off_c):
    """Among what would explain it: benchmarks know the index of the low air, not whose error its change is."""
    told, coordinates = found("WX1", off_c)
    (contradiction,) = coordinates.contradictions
    thermometers = {e.of for e in contradiction.explanations if e.group is RecordGroup.THERMOMETERS}
    assert "WX1" in thermometers
    assert "WX2" not in thermometers
    assert max(told["thermometers"]) < 4.0
    for kind, mean in told["mean"].items():
        assert mean < (2.0 if off_c < 3.0 else 3.0), kind


@pytest.mark.parametrize(
    ("station", "off_c"),
    [
        ("WX1", 1.0),
        ("WX2", 1.0),
        *(pytest.param("WX2", off, marks=pytest.mark.slow) for off in (2.0, 3.0)),
        ("WX2", 5.0),
    ],
)
def test_an_undetermined_thermometer_is_covered_and_both_candidates_named(found, station, off_c):
    (clean, _), (told, coordinates) = found("WX1", 0.0), found(station, off_c)
    assert any("lean to" in n or "inversion" in n or "contradict" in n for n in coordinates.notes)
    if Parameter(ParameterKind.THERMOMETER, station) in coordinates.refuted:
        return
    for kind, mean in told["mean"].items():
        assert mean < max(clean["mean"][kind] + LITTLE, 1.15), kind
    if station == "WX2":
        assert any("inversion" in note and "WX2" in note for note in coordinates.notes)
        assert bool(coordinates.doubts) == (off_c > 3.0)
    assert max(told["thermometers"]) < 4.0
