"""A night whose claims are far too wide is no good one, as a network's: an uncertainty in another unit, most likely."""

from dataclasses import replace

from catseye.records.night.jitter import JitterRow, jitter_table
from catseye.reduction.epoch.epoch import reduce_epoch


def test_a_jitter_of_millimetres_typed_for_tenths_is_doubtful(night_01):
    """3 mm of sway that is not there: the variance factor is 0.23."""
    start = float(night_01.shots.mjd_utc[0])
    shaken = jitter_table([JitterRow(mjd_utc=start, body="arm", u_mm=3.0)])
    found = reduce_epoch(replace(night_01, jitter=shaken)).verdict
    assert found.word == "doubtful"
    assert "52 % less than their uncertainties claim" in found.why
    assert "check the units" in found.why
    assert reduce_epoch(night_01).verdict.word == "good"
