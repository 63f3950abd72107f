"""Why the package has a BSDF of its own: ours and Mitsuba's `principled` against the paper's formulas.

`pytest -m slow tests/render/test_principled.py -s` writes the table of docs/rendering.md.
"""

import sys
import time

import numpy as np
import pytest
from disney import ALBEDO, NORMAL, evaluate, interaction, make, mi, pairs, tilted, vector

from materialist.bsdf import disney as brdf

ROUGHNESS, METALLIC = (0.1, 0.2, 0.4, 0.7, 1.0), (0.0, 0.5, 1.0)


def deviation(plugin, roughness, metallic, count=20_000):
    """Relative differences [N] from the paper, green channel: |value - paper| / (paper + 0.01)."""
    wi, wo = pairs(count, 11, roughness)
    paper = (brdf.evaluate(np.array(ALBEDO), roughness, metallic, NORMAL, wi, wo) * wo[:, 2:])[:, 1]
    value = evaluate(make(roughness=roughness, metallic=metallic, plugin=plugin), wi, wo)[:, 1]
    return np.abs(value - paper) / (paper + 0.01)


def reflectance(plugin, roughness, metallic, degrees, count=100_000):
    """Directional albedo (green) under constant light."""
    rng = np.random.default_rng(1)
    u1, u2 = mi.Float(rng.random(count).astype(np.float32)), mi.Point2f(rng.random((2, count)).astype(np.float32))
    wi = np.broadcast_to(tilted(degrees), (count, 3))
    _, weight = make(roughness=roughness, metallic=metallic, plugin=plugin).sample(
        mi.BSDFContext(), interaction(wi), u1, u2
    )
    return float(np.array(weight)[1].mean())


def seconds(plugin, count=2**20):
    """Time of one eval_pdf of a million pairs, compilation apart."""
    import drjit as dr

    wi, wo = pairs(count, 2, 0.4)
    bsdf, si, out, best = make(plugin=plugin), interaction(wi), vector(wo), np.inf
    for _ in range(4):
        start = time.perf_counter()
        dr.eval(bsdf.eval_pdf(mi.BSDFContext(), si, out))
        dr.sync_thread()
        best = min(best, time.perf_counter() - start)
    return best


def test_principled_is_another_model():
    """Its dielectric reflects by Fresnel's equations where the paper has Schlick's, and its back is black."""
    assert np.median(deviation("materialist_disney", 0.2, 0.0)) < 1e-5
    assert np.percentile(deviation("principled", 0.2, 0.0), 95) > 0.02
    back = [tilted(30, -1)], [tilted(50, -1)]
    assert (evaluate(make(plugin="principled"), *back) == 0).all()
    assert (evaluate(make(), *back) > 0).all()


@pytest.mark.slow
def test_table_for_the_documentation():
    out = [
        "| R | M | ours: median | ours: max | principled: median | 95 % | max | reflectance at 75°: ours | principled |"
    ]
    out.append("|---|---|---|---|---|---|---|---|---|")
    for metallic in METALLIC:
        for roughness in ROUGHNESS:
            ours, theirs = (deviation(p, roughness, metallic) for p in ("materialist_disney", "principled"))
            shares = [reflectance(p, roughness, metallic, 75) for p in ("materialist_disney", "principled")]
            assert np.median(ours) < 1e-5
            out.append(
                f"| {roughness} | {metallic} | {np.median(ours):.0e} | {ours.max():.0e} | {np.median(theirs):.1%} "
                f"| {np.percentile(theirs, 95):.1%} | {theirs.max():.0%} | {shares[0]:.3f} | {shares[1]:.3f} |"
            )
    times = [seconds(p) for p in ("materialist_disney", "principled")]
    out.append(f"\neval_pdf of 2^20 pairs: ours {times[0] * 1e3:.0f} ms, principled {times[1] * 1e3:.0f} ms")
    sys.stdout.write("\n".join(out) + "\n")
