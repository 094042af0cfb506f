"""Settings of a live reduction stored in journals."""

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
def test_settings_survive_the_round_trip_through_json(u, jitter, after, kind):
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


def test_missing_settings_have_defaults():
    assert live_settings({"live": {"u_flexure_mm": 3}}, "run 1") == LiveSettings(u_flexure_mm=3.0)


@pytest.mark.parametrize(
    ("stored", "said"),
    [
        ({}, "reduction settings are missing"),
        ({"live": {"colour": 1}}, r"live\.colour is unknown"),
        ({"live": {"reduction": {"critical": "3"}}}, r"live\.reduction\.critical = '3'"),
        ({"live": {"filter": "magic"}}, r"live\.filter = 'magic'"),
        ({"live": {"reference_after": True}}, r"live\.reference_after = True"),
    ],
)
def test_invalid_settings_are_refused_with_their_place(stored, said):
    with pytest.raises(InputError, match=f"run 4.*{said}"):
        live_settings(stored, "run 4")
