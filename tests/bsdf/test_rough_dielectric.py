"""Rough glass loses no light (see test_bodies.py): the albedo that is made up for, and new values by parameters."""

import numpy as np
import pytest

from materialist.bsdf.rough_dielectric import COSINES, PLUGIN, directional_albedo
from materialist.render.variant import setup


def described(ior, alpha):
    return {
        "type": "roughdielectric",
        "distribution": "ggx",
        "alpha": alpha,
        "int_ior": ior,
        "ext_ior": 1.0,
    }


@pytest.mark.parametrize("ior, alpha", [(1.5, 0.04), (1.5, 0.49), (2.0, 1.0)])
def test_the_albedo_is_what_mitsubas_sampler_leaves(ior, alpha):
    setup()
    import drjit as dr
    import mitsuba as mi

    bsdf = mi.load_dict(described(ior, alpha))
    table = directional_albedo(ior, alpha)
    count = 1 << 15
    for side in (0, 1):
        for k in (0, COSINES // 3, COSINES - 1):
            cosine = (k + 0.5) / COSINES
            si = dr.zeros(mi.SurfaceInteraction3f, count)
            si.wi = mi.Vector3f(float(np.sqrt(1 - cosine**2)), 0.0, cosine * (1 - 2 * side))
            sampler = mi.load_dict({"type": "independent"})
            sampler.seed(1, count)
            context = mi.BSDFContext(
                mi.TransportMode.Importance
            )  # energy: no factor for the density of radiance
            _, weight = bsdf.sample(context, si, sampler.next_1d(), sampler.next_2d(), True)
            assert table[side, k] == pytest.approx(float(np.mean(weight.x)), abs=0.01)


def test_new_values_change_the_gain():
    setup()
    import mitsuba as mi

    bsdf = mi.load_dict({"type": PLUGIN, "interface": described(1.5, 0.1)})
    params = mi.traverse(bsdf)
    params["interface.alpha.value"], params["interface.eta"] = 0.5, 1.3
    params.update()
    np.testing.assert_allclose(
        np.array(bsdf.table).reshape(2, -1), directional_albedo(1.3, 0.5), atol=1e-5
    )
