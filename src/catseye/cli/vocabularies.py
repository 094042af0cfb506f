"""The words that options take and `--help` prints, each list once for all commands.

They are decided elsewhere, in modules whose import `--help` spares itself, or in `catseye.names`, which imports
nothing; `tests/cli/test_vocabularies.py` holds each list equal to its source.
"""

from collections.abc import Callable

import typer

from catseye import names

# atmosphere
AIR_MODELS = "|".join(names.AIR_MODELS)
AIR_MODEL = names.NOTES_AIR_MODEL  # of a reduction
SOUND_MODELS = "parker2004|cramer1993|real_gas"
PRESSURES_AT = "station|sea-level|altimeter"
THERMOMETRY_MODELS = "real_gas|cramer1993|parker2004"  # the one of choice first

# optics and mirrors
EDITIONS = "iec2014|ansi2014"
REFLECTORS = "|".join(names.RETROREFLECTORS)
OSCILLATORS = "above|below"

# calibrations and their reports
CALIBRATION_KINDS = (
    "reference-distance|leakage|leakage-lit|linearity|retroreflector|amplitude-to-phase|second-pass|"
    "feedback|oscillator|repeatability|prism-constant|ball-constant|gauge-blocks|spacers|invar-wire|autocollimation|height-gauge|both-faces|"
    "both-faces-pointing|encoder|limits|alignment|detector-focus|search-results|monument-azimuth|plate-levels|"
    "monument-place|inclinometer|hydrostatic-level|reference-cube|mounting-plate"
)
REPORT_KINDS = "monument|mirror"

# networks
DATUMS = "free|fixed"
NETWORK_WEIGHTS = "huber|l1|biweight|igg3"
COMPONENTS = "rangers|groups"
LOCATE_METHODS = "least_squares|averaging"
DESIGN_CRITERIA = "trace|worst|pose|gain"

# the telescope
POSE_GROUPS = "dish|feed-arm|alidade|subreflector"
POSE_FRAMES = "ground|alidade|reflector"
POSE_WEIGHTS = "l1|huber|igg3|biweight"
OPTICS = "prime|gregorian"
POINTING_TERMS = "IA|IE|CA|NPAE|AW|AN|HZCZ|HZSZ"
PARABOLOID_PARTS = "vertex|axis|focal-length"
NUMBERINGS = "noll|ansi"
PRISM_FRAMES = "reflector|ground"
TRAVELS = "normal|axis"
TELESCOPE_FRAMES = "ground|alidade|elevation|reflector|feed_arm|prime_focus|subreflector"
SERIES_FRAMES = "reflector|alidade|ground"
OWN_FUNCTIONS = "place|each"
NODE_UNITS = "m|mm|in"

# a living site
CONDITIONS = "night|windy-day|dewy-night"
MODES = "active|passive|hold"
FILTERS = "random_walk|constant_velocity"
EXPORT_FORMATS = "csv|fits|campaign"


def one_of(words: str) -> Callable[[str | None], str | None]:
    """A check of an option's value; one that was not given passes."""

    def check(value: str | None) -> str | None:
        if value is not None and value not in words.split("|"):
            raise typer.BadParameter(f"{value!r} is not one of {words.replace('|', ', ')}.")
        return value

    check.words = tuple(words.split("|"))  # type: ignore[attr-defined] # for completion and the reference
    return check
