"""Parameters by the texts that people know them by."""

import re

from catseye.reduction.epoch.parameter import Parameter, ParameterKind

OF, AXIS = r"(?P<of>\S+)", r"(?P<part>[xyz])"
FORMS = {
    ParameterKind.ZERO: rf"zero {OF}",
    ParameterKind.LEAKAGE: rf"leakage {OF} (?P<part>real|imaginary)",
    ParameterKind.AXES: rf"axes {OF} (?P<part>.+)",
    ParameterKind.AMPLITUDE: rf"amplitude {OF}",
    ParameterKind.SECOND_PASS: rf"second pass {OF} (?P<part>.+)",
    ParameterKind.CYCLIC: rf"cyclic {OF} (?P<part>.+)",
    ParameterKind.GLASS: rf"glass {OF}",
    ParameterKind.SOUND: r"the air (?P<of>\S+) - (?P<part>\S+)",
    ParameterKind.NORMAL: rf"normal {OF} (?P<part>[12])",
    ParameterKind.PATH: rf"path {OF} (?P<part>\S+)",
    ParameterKind.PROFILE: r"the air (?P<part>bend|gradient)",
    ParameterKind.THERMOMETER: rf"the air {OF}",
    ParameterKind.ELECTRONICS: rf"electronics {OF} (?P<part>\S+)",
    ParameterKind.REPEATS: rf"repeats {OF} (?P<part>\S+)",
    ParameterKind.BODY: rf"body {OF} (?P<part>.+)",
    ParameterKind.FIXED_POINT: rf"{OF}-F {AXIS}",
    ParameterKind.REFERENCE_PLACE: rf"{OF}@0 {AXIS}",
    ParameterKind.VELOCITY: rf"{OF} rate {AXIS}",
    ParameterKind.POINT: rf"{OF} {AXIS}",
}


def parameter(text):
    """The first kind whose form the text has."""
    kind, match = next((k, m) for k, form in FORMS.items() if (m := re.fullmatch(form, text)))
    made = Parameter(kind, match.groupdict().get("of", ""), match.groupdict().get("part", ""))
    assert str(made) == text
    return made


def parameters(texts):
    return tuple(parameter(text) for text in texts)
