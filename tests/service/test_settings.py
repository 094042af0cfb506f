"""Settings of a living reduction that a journal keeps."""

import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catseye.errors import InputError
from catseye.reduction.epoch.settings import ReductionSettings
from catseye.reduction.live.live import LiveSettings
from catseye.service.settings import live_settings, settings_object

REAL = st.floats(1e-6, 1e6)


@given(REAL, REAL, st.integers(1, 99), st.sampled_from(["random_walk", "constant_velocity"]))
def test_any_settings_come_back_from_json_as_they_were(u, jitter, after, kind):
    usual = LiveSettings()
    told = LiveSettings(
        reduction=ReductionSettings(critical=u),
        filter=kind,
        loosening=replace(usual.loosening, body_mm={"arm": u}, profile_s=jitter),
        u_flexure_mm=u,
        jitter_mm={"arm": jitter, "dish": u},
        reference_after=after,
    )
    assert live_settings(json.loads(json.dumps(settings_object(told))), "run 1") == told


def test_what_is_not_said_is_as_usual():
    assert live_settings({"live": {"u_flexure_mm": 3}}, "run 1") == LiveSettings(u_flexure_mm=3.0)


@pytest.mark.parametrize(
    ("stored", "said"),
    [
        ({}, "does not say how it was reduced"),
        ({"live": {"colour": 1}}, r"live\.colour is not known"),
        ({"live": {"reduction": {"critical": "3"}}}, r"live\.reduction\.critical = '3'"),
        ({"live": {"filter": "magic"}}, r"live\.filter = 'magic'"),
        ({"live": {"reference_after": True}}, r"live\.reference_after = True"),
    ],
)
def test_what_cannot_be_meant_is_refused_with_its_place(stored, said):
    with pytest.raises(InputError, match=f"run 4.*{said}"):
        live_settings(stored, "run 4")
