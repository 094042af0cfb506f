"""The words that `--help` prints are those that the code beneath knows, in its order."""

from typing import get_args, get_type_hints

import pytest
import typer

from catseye.atmosphere.index import air
from catseye.atmosphere.sound import speed
from catseye.cli import vocabularies
from catseye.cli.live.options import PORT_BASE
from catseye.cli.vocabularies import one_of
from catseye.coordinator.modes import Mode
from catseye.errors import EstimationError
from catseye.estimation.network import datum
from catseye.estimation.quality.robustness import WEIGHTS
from catseye.estimation.shapes import paraboloid, pose
from catseye.gateways.journal.export import Form
from catseye.geometry.antenna import pointing_series, rigid_telescope
from catseye.optics import zernike
from catseye.optics.retroreflector.kinds import registry
from catseye.optics.safety import limits
from catseye.ranger import addresses
from catseye.records.laboratory.logger_sheet import PressureAt
from catseye.records.site.nodal_result import UNITS
from catseye.records.site.target import FrameName
from catseye.reduction.calibrations import kinds
from catseye.reduction.calibrations.field_report import FORMS
from catseye.reduction.design import aim
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.network import positions
from catseye.reduction.network.treatment import AdjustmentOptions
from catseye.reduction.pose import pointing_offsets
from catseye.reduction.pose import pose as pose_recipe
from catseye.reduction.pose.findings import CARRIED
from catseye.reduction.structure.series import Own
from catseye.reduction.surface.actuators import Travel
from catseye.reduction.surface.prisms import Frame
from catseye.service import settings, world
from catseye.service.coordinator import Filter
from catseye.signal.detection.frequency_plan import FrequencyPlan

SOURCES = {
    "AIR_MODELS": air.MODELS,
    "AIR_MODEL": [ReductionSettings.air_model],
    "PRESSURES_AT": get_args(PressureAt),
    "SOUND_MODELS": speed.MODELS,
    "THERMOMETRY_MODELS": reversed(speed.MODELS),
    "OSCILLATORS": get_args(get_type_hints(FrequencyPlan)["oscillator"]),
    "EDITIONS": limits.EDITIONS,
    "REFLECTORS": registry.KINDS,
    "CALIBRATION_KINDS": kinds.KINDS,
    "REPORT_KINDS": FORMS,
    "DATUMS": datum.DATUMS,
    "NETWORK_WEIGHTS": [name for name in WEIGHTS if name != "geman_mcclure"],  # whose constant is our own choice
    "LOCATE_METHODS": positions.METHODS,
    "DESIGN_CRITERIA": aim.CRITERIA,
    "POSE_GROUPS": pose_recipe.GROUPS,
    "POSE_FRAMES": pose_recipe.FRAMES,
    "POSE_WEIGHTS": pose.METHODS,
    "OPTICS": pointing_offsets.OPTICS,
    "POINTING_TERMS": pointing_series.TERMS,
    "PARABOLOID_PARTS": paraboloid.PARAMETERS,
    "NUMBERINGS": zernike.NUMBERINGS,
    "PRISM_FRAMES": get_args(Frame),
    "TRAVELS": get_args(Travel),
    "TELESCOPE_FRAMES": rigid_telescope.FRAMES,
    "SERIES_FRAMES": reversed(get_args(FrameName)),
    "OWN_FUNCTIONS": get_args(Own),
    "NODE_UNITS": tuple(UNITS),
    "CONDITIONS": world.CONDITIONS,
    "MODES": get_args(Mode),
    "FILTERS": settings.FILTERS,
    "EXPORT_FORMATS": [*get_args(Form), "campaign"],
}
IN_A_REFUSAL = {"COMPONENTS"}  # no list of them stands anywhere; the recipe's refusal names them


@pytest.mark.parametrize("name", SOURCES)
def test_a_vocabulary_is_that_of_the_code_beneath(name):
    assert getattr(vocabularies, name).split("|") == list(SOURCES[name])


def test_every_vocabulary_is_held_to_a_source():
    assert {name for name in vars(vocabularies) if name.isupper()} == set(SOURCES) | IN_A_REFUSAL


def test_the_components_are_those_that_the_recipe_names():
    with pytest.raises(EstimationError, match=f"expected {vocabularies.COMPONENTS.replace('|', ' or ')}"):
        AdjustmentOptions(components="strange")


def test_what_is_kept_outside_the_vocabularies_agrees_as_well():
    assert get_args(Filter) == settings.FILTERS
    assert list(CARRIED) == list(pointing_offsets.OPTICS)
    assert set(CARRIED.values()) <= set(pose_recipe.GROUPS)
    assert PORT_BASE == addresses.PORT_BASE


def test_a_strange_word_is_refused_with_all_that_are_known():
    check = one_of("a|b")
    assert (check("b"), check(None)) == ("b", None)
    with pytest.raises(typer.BadParameter, match=r"^'c' is not one of a, b\.$"):
        check("c")
    with pytest.raises(typer.BadParameter):
        check("a|b")
