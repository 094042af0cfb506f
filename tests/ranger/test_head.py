"""Limits of the sampling; conformance of the scripted head."""

import pytest

from catseye.errors import ValidityError
from catseye.ranger.head import SamplingSettings
from ranger.head_conformance import HeadConformance
from ranger.scripted_head import ScriptedHead


class TestScriptedHead(HeadConformance):
    def head(self):
        return ScriptedHead()

    def pass_time(self, head, seconds):
        head.advance(seconds)


def test_default_sampling_is_8192_words_in_128_ms():
    assert SamplingSettings().samples * SamplingSettings().cycles == 8192
    assert SamplingSettings().duration == 0.128


@pytest.mark.parametrize(
    ("values", "said"),
    [((64, 1200, 1000), "76800 words"), ((64, 128, 2000), "128000 samples a second"), ((64, 0, 1000), "0 cycles")],
)
def test_quoted_limits_are_enforced(values, said):
    with pytest.raises(ValidityError, match=said):
        SamplingSettings(*values)


def test_limits_themselves_are_legal():
    assert SamplingSettings(64, 1024, 1562).samples == 64  # 65 536 words, 99 968 samples a second
    assert SamplingSettings(10, 1, 10_000).duration == pytest.approx(1e-4)
