"""The unknowns of a campaign and what its records say of them."""

import dataclasses

import numpy as np
import pytest

from catseye.errors import InputError
from catseye.reduction.epoch.epoch import reduce_epoch
from catseye.reduction.epoch.prior_names import APPROXIMATE
from catseye.reduction.epoch.unknowns import build_network


def prior(network, name):
    found = [p for p in network.priors if p.name == name]
    assert found, name
    return found


def sigma(group):
    return np.sqrt(group.covariance if group.covariance.ndim == 1 else np.diag(group.covariance))


def test_priors_carry_the_records_uncertainties(night_01, network_01):
    (monuments,) = prior(network_01, "monuments")
    assert len(monuments.observed) == 3 * 12 - 1  # z of ZY103 defines the datum
    np.testing.assert_allclose(sigma(monuments), 0.1e-3)
    assert len(prior(network_01, "mirror offsets")) == 12
    for group in prior(network_01, "mirror offsets"):
        np.testing.assert_allclose(sigma(group), 0.005e-3)
    np.testing.assert_allclose(sigma(prior(network_01, "ranger zeros")[0]), 0.010e-3)
    np.testing.assert_allclose(sigma(prior(network_01, "leakage")[0]), 0.0008)
    assert len(prior(network_01, "benchmarks")) == len(night_01.benchmarks)
    for group, record in zip(prior(network_01, "benchmarks"), night_01.benchmarks, strict=True):
        assert group.observed[0] == pytest.approx(record.certified_distance_mm * 1e-3)
        assert sigma(group)[0] == pytest.approx(record.u_mm * 1e-3)
    for group, record in zip(prior(network_01, "triplet spacings"), night_01.triplets.values(), strict=True):
        assert group.observed[0] == pytest.approx(record.d12_mm * 1e-3)
        assert sigma(group)[0] == pytest.approx(record.u_d12_mm * 1e-3)


def test_a_triplets_ball_is_held_tighter_along_the_normal_than_across(night_01, network_01):
    for group, record in zip(prior(network_01, "triplet balls"), night_01.triplets.values(), strict=True):
        normal = network_01.places[record.left_prism.target].normal
        assert normal @ group.covariance @ normal == pytest.approx((record.u_h_corr_mm * 1e-3) ** 2)
        values = np.sort(np.linalg.eigvalsh(group.covariance))
        np.testing.assert_allclose(values[1:], (record.u_lateral_mm * 1e-3) ** 2)
        np.testing.assert_allclose(group.observed, record.h_corr_mm * 1e-3 * normal, atol=1e-15)


def test_the_start_fulfils_every_prior_that_it_can(network_01):
    """Places come from the same records, so nothing but the benchmarks' certificates is at odds with the start."""
    x = np.array(network_01.layout.start)
    for group in network_01.priors:
        if group.name != "benchmarks":
            np.testing.assert_allclose(group.predict(x)[0], group.observed, atol=1e-9, err_msg=group.name)


def test_typed_positions_alone_are_held_by_the_typing_prior(night_01, network_01):
    (typed,) = prior(network_01, APPROXIMATE)
    assert len(typed.observed) == 3 * sum(p.typed for p in network_01.places.values())
    assert not any(network_01.places[n].typed for n in night_01.monuments)


def test_only_the_datums_z_is_held(network_01):
    held = [n for n, free in zip(network_01.layout.names, network_01.layout.free, strict=True) if not free]
    assert held == ["ZY103-F z"]


def test_unmeasured_points_are_no_unknowns_but_a_complete_triplet_is(night_01, part, targets_01, reduced_night_01):
    keep = (targets_01 == "TR03-L") | (targets_01 == "ZRG") | (targets_01 == "ZBM02")
    few = reduce_epoch(part(night_01, keep)).coordinates
    seen = {p for p in few.points if not p.endswith("-F")}
    arm = {r.name for r in night_01.feedarm.ranger}
    assert seen - arm == {"TR03-L", "TR03-R", "TR03-B", "ZBM02", *night_01.monuments}
    assert few.shots[few.index("TR03-R")] == 0
    # the sheet places the prism that was not ranged: spacing 0.03 mm, axis 0.3 degree of 635 mm
    apart = few.x[few.index("TR03-R")] - few.x[few.index("TR03-L")]
    assert np.linalg.norm(apart) == pytest.approx(night_01.triplets["TR03"].d12_mm * 1e-3, abs=1e-4)
    joint = few.block(["TR03-L", "TR03-R"])
    across = joint[:3, :3] + joint[3:, 3:] - joint[:3, 3:] - joint[3:, :3]
    assert np.sqrt(np.linalg.eigvalsh(across)[-1]) == pytest.approx(0.635 * np.radians(0.3), rel=0.05)


def changed(campaign, what, key):
    """The campaign with one standard uncertainty set to zero."""
    if what == "mirror":
        name = campaign.monuments["ZY104"].zp
        return dataclasses.replace(
            campaign, mirrors=campaign.mirrors | {name: campaign.mirrors[name].model_copy(update={key: 0.0})}
        )
    if what == "triplet":
        return dataclasses.replace(
            campaign, triplets=campaign.triplets | {"TR02": campaign.triplets["TR02"].model_copy(update={key: 0.0})}
        )
    first, *rest = campaign.benchmarks
    return dataclasses.replace(campaign, benchmarks=(first.model_copy(update={key: 0.0}), *rest))


@pytest.mark.parametrize(
    ("what", "key", "place"),
    [
        ("mirror", "u_offset_mm", "mirrors/ZP104.toml: u_offset_mm = 0"),
        ("mirror", "u_d0_mm", "mirrors/ZP104.toml: u_d0_mm = 0"),
        ("mirror", "u_leakage_volt", "mirrors/ZP104.toml: u_leakage_volt = 0"),
        ("triplet", "u_h_corr_mm", "triplets/TR02.toml: u_h_corr_mm = 0"),
        ("triplet", "u_lateral_mm", "triplets/TR02.toml: u_lateral_mm = 0"),
        ("triplet", "u_d12_mm", "triplets/TR02.toml: u_d12_mm = 0"),
        ("benchmark", "u_mm", "benchmarks.csv: ZBM01, u_mm = 0"),
    ],
)
def test_a_zero_uncertainty_that_cannot_be_weighed_is_refused_where_it_stands(
    night_01, reduced_night_01, what, key, place
):
    r = reduced_night_01
    with pytest.raises(InputError) as caught:
        build_network(changed(night_01, what, key), r.phases, r.electronics, settings=r.settings)
    assert str(caught.value).startswith(place)
    assert "\n" not in str(caught.value)


def test_a_surveyed_coordinate_of_zero_uncertainty_is_held(night_01, reduced_night_01):
    r = reduced_night_01
    fixed = night_01.monuments["ZY101"].model_copy(update={"u_x_mm": 0.0, "u_y_mm": 0.0, "u_z_mm": 0.0})
    campaign = dataclasses.replace(night_01, monuments=night_01.monuments | {"ZY101": fixed})
    layout = build_network(campaign, r.phases, r.electronics, settings=r.settings).layout
    held = [n for n, free in zip(layout.names, layout.free, strict=True) if not free]
    assert held == ["ZY101-F x", "ZY101-F y", "ZY101-F z", "ZY103-F z"]
