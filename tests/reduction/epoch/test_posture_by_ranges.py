"""A posture that is off by hundredths of a degree is told from the phases, and named with the right one."""

import re
from dataclasses import replace

import pytest

from catseye.errors import InputError
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.motion.posture_by_ranges import posture_by_ranges


def turned(campaign, azimuth=0.0, elevation=0.0):
    stands = campaign.site.campaign
    posture = {"azimuth_deg": stands.azimuth_deg + azimuth, "elevation_deg": stands.elevation_deg + elevation}
    return replace(campaign, site=campaign.site.model_copy(update={"campaign": stands.model_copy(update=posture)}))


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 0.1), (0.1, 0.0), (0.02, -0.06), (0.0, -1.0), (-0.7, 0.5)])
def test_the_right_posture_is_found(night_01, reduced_night_01, azimuth, elevation):
    r = reduced_night_01
    (record,) = posture_by_ranges(turned(night_01, azimuth, elevation), r.phases, r.electronics)
    assert record.fatal
    (fit,) = re.findall(r"fit ([\d.]+)°, ([\d.]+)°", record.text)
    stands = night_01.site.campaign
    assert float(fit[0]) == pytest.approx(stands.azimuth_deg, abs=0.015)
    assert float(fit[1]) == pytest.approx(stands.elevation_deg, abs=0.015)


@pytest.mark.parametrize("elevation", [0.0, 0.01, -0.03])
def test_a_pointing_correction_is_no_other_posture(night_01, reduced_night_01, elevation):
    r = reduced_night_01
    assert posture_by_ranges(turned(night_01, elevation=elevation), r.phases, r.electronics) == []


def test_few_lines_say_nothing(night_01, reduced_night_01):
    r = reduced_night_01
    few = {name: e for name, e in r.electronics.items() if name in ("ZY101", "ZY113")}
    assert posture_by_ranges(turned(night_01, elevation=0.1), r.phases, few) == []


def test_a_night_with_another_posture_is_refused_in_one_line(few_01):
    with pytest.raises(InputError, match=r"site.toml: campaign.azimuth_deg, campaign.elevation_deg: .* contradict"):
        reduce_epoch(turned(few_01, elevation=0.1))
