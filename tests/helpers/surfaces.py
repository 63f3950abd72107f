"""The BSDF under test, its inputs as random batches, and its values as numpy arrays."""

import numpy as np

from materialist.render.variant import setup

mi = setup("cpu")

ALBEDO = (0.8, 0.4, 0.1)
NORMAL = np.array([0.0, 0.0, 1.0])
"""The local frame's normal."""


def make(albedo=ALBEDO, roughness=0.5, metallic=0.0):
    """A BSDF with constant parameters."""
    return mi.load_dict(
        {
            "type": "materialist_disney",
            "base_color": {"type": "rgb", "value": list(albedo)},
            "roughness": {"type": "uniform", "value": roughness},
            "metallic": {"type": "uniform", "value": metallic},
        }
    )


def interaction(wi):
    """A batch of surface interactions with local incident directions [N, 3]."""
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f, len(wi))
    si.wi = mi.Vector3f(np.asarray(wi, np.float32).T)
    si.uv = mi.Point2f(0.5, 0.5)
    return si


def evaluate(bsdf, wi, wo):
    """f_r |cos theta_o| [N, 3] of local directions [N, 3]."""
    return np.array(bsdf.eval(mi.BSDFContext(), interaction(wi), vector(wo))).T


def vector(directions):
    return mi.Vector3f(np.asarray(directions, np.float32).T)


def directions(count, seed, *, lowest=0.02):
    """[N, 3] float32 unit directions of the upper hemisphere, cosine above `lowest`."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(lowest, 1, count)
    phi = rng.uniform(0, 2 * np.pi, count)
    s = np.sqrt(1 - z**2)
    return np.stack([s * np.cos(phi), s * np.sin(phi), z], -1).astype(np.float32)


def draws(count, seed):
    """The two arguments of `sample` that are random, [N] and [N, 2]."""
    rng = np.random.default_rng(seed)
    return mi.Float(rng.random(count).astype(np.float32)), mi.Point2f(
        rng.random((2, count)).astype(np.float32)
    )


def pairs(count, seed, roughness):
    """wi, wo [N, 3]: half anywhere, half near the mirror direction, where the specular lobe is."""
    rng = np.random.default_rng(seed + 1)
    wi = directions(count, seed)
    wo = directions(count, seed + 2)
    half = count // 2
    near = wi[:half] * [-1, -1, 1] + rng.normal(size=(half, 3)) * 2 * roughness**2
    near /= np.linalg.norm(near, axis=-1, keepdims=True)
    wo[:half] = np.where(near[:, 2:] > 0.02, near, wo[:half])
    return wi, wo


def tilted(degrees, side=1):
    """Direction `degrees` from the normal, off the axes, on the side of the surface that `side` names."""
    t = np.radians(degrees)
    return np.array([np.sin(t) * 0.8, np.sin(t) * 0.6, side * np.cos(t)])
