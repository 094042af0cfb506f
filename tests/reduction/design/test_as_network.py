"""A design's covariance is that of the network adjustment, which shares no formula with it but the ranges."""

import numpy as np

from catseye.estimation.design.network import predict
from catseye.estimation.network.plan import plan
from catseye.records.site.folder import read_site
from catseye.records.site.solids import Solids
from catseye.reduction.design.as_network import network_of_scene
from catseye.reduction.design.scene import scene_of_site
from repository import ROOT

SCENE = scene_of_site(read_site(ROOT / "examples" / "sites" / "gbt"), Solids())


def test_the_plan_of_the_site_has_the_same_covariances():
    planned = plan(network_of_scene(SCENE), most=1)
    prediction = predict(SCENE.network(0))
    size = np.abs(prediction.covariance).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(planned.solution.covariance / size, prediction.covariance / size, atol=1e-6)
    assert planned.solution.network.points.names == tuple(point.name for point in SCENE.points)
    zeros = planned.solution.u_parameters[: len(SCENE.rangers)]
    assert (zeros < 1.0001e-5).all()  # no worse than their prior of 10 um
