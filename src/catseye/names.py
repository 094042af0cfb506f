"""Names that files, options and registries share: air models and kinds of retroreflector; and words of numbers.

A registry imports the file of each name, so that a new air model or a new kind is its file and one word here. This
module imports nothing, which keeps `--help` quick.

An air model is a file of `atmosphere/index`, a kind of retroreflector one of `optics/retroreflector/kinds`.
"""

from typing import Final, Literal, TypeAlias, get_args

AirModelName: TypeAlias = Literal["ciddor_hill1999", "rueger1990", "iag1999_closed", "barrell_sears1963"]
SingleRetroreflectorName: TypeAlias = Literal["prism", "hollow"]  # those that targets.toml may list
RetroreflectorName: TypeAlias = Literal[SingleRetroreflectorName, "ball"]  # and a part of a triplet

AIR_MODELS: Final[tuple[AirModelName, ...]] = get_args(AirModelName)
SINGLE_RETROREFLECTORS: Final[tuple[SingleRetroreflectorName, ...]] = get_args(SingleRetroreflectorName)
RETROREFLECTORS: Final[tuple[RetroreflectorName, ...]] = get_args(RetroreflectorName)

AIR_MODEL: Final = "ciddor_hill1999"  # of new work
NOTES_AIR_MODEL: Final = "rueger1990"  # of the working notes, which version 1 of the campaign's layout prescribes


def megahertz(frequency_hz: float) -> str:
    """Frequency in words, to the hertz.

    >>> megahertz(1500.5e6)
    '1500.5 MHz'
    """
    return f"{frequency_hz / 1e6:.10g} MHz"


def counted(count: int, noun: str) -> str:
    """Number with its noun.

    >>> counted(1, "night"), counted(365, "night")
    ('1 night', '365 nights')
    """
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
