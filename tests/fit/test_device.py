"""A whole fit with torch on another device than the processor: nothing of the one meets anything of the other.

The other device is made up, for machines without a card: its tensors call themselves `meta`, keep their values in the
processor's memory, and refuse, as those of CUDA do, to be combined with others.
"""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves, tree_map
from transport_scenes import furnished_room, windowed_sky

from materialist import buffers
from materialist.edits.preview import Preview
from materialist.fit.invert import FitSetup, invert
from materialist.fit.settings import DEFAULT, PAPER
from materialist.render.scene import RenderScene
from materialist.types import Photo, Prediction, Scene


class Far(torch.Tensor):
    """A tensor of the other device."""

    @staticmethod
    def __new__(cls, near):
        return torch.Tensor._make_wrapper_subclass(cls, near.shape, near.stride(), dtype=near.dtype, device="meta")

    def __init__(self, near):
        self.near = near

    @classmethod
    def __torch_dispatch__(cls, function, types, args=(), kwargs=None):
        raise AssertionError("only OtherDevice computes with these")


class OtherDevice(TorchDispatchMode):
    """Computes with tensors of the other device and refuses mixtures."""

    MOVES, INDEXES = ("_to_copy", "copy_"), ("index", "index_put", "index_put_", "_index_put_impl_")

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        name, kwargs = function._schema.name.split("::")[1], dict(kwargs or {})
        tensors = [t for t in tree_leaves((args, kwargs)) if isinstance(t, torch.Tensor)]
        far = [isinstance(t, Far) for t in tensors]
        if name in self.INDEXES:  # places may lie in the processor's memory
            far = [f for f, t in zip(far, tensors, strict=True) if f or t.is_floating_point()]
        elif name not in self.MOVES:
            far = [f for f, t in zip(far, tensors, strict=True) if f or t.dim()]
        assert name in self.MOVES or len(set(far)) < 2, f"{name} mixes devices: {far}"
        there = args[0] if name == "copy_" else None
        target = kwargs.pop("device", None)
        goes = target is not None and torch.device(target).type == "meta"
        stays = any(far) and target is None and (there is None or isinstance(there, Far))
        near = tree_map(lambda t: t.near if isinstance(t, Far) else t, (args, kwargs))
        found = function(*near[0], **near[1])
        if there is not None or name.endswith("_"):
            return args[0]
        return tree_map(lambda t: Far(t) if isinstance(t, torch.Tensor) and (goes or stays) else t, found)


@pytest.fixture
def elsewhere(monkeypatch):
    """Torch's device beside the renderer is the other one, and so is what the renderer takes and gives."""
    render = RenderScene.render_torch

    def render_there(scene, *tensors, **options):
        assert all(t.device.type == "meta" for t in tensors), "the renderer lies on the other device"
        return render(scene, *(t.cpu() for t in tensors), **options).to("meta")

    monkeypatch.setattr(RenderScene, "render_torch", render_there)
    monkeypatch.setattr(buffers, "torch_device", lambda: "meta")
    monkeypatch.setattr("materialist.fit.light.torch_device", lambda: "meta")
    with OtherDevice():
        yield


def asked(engine: str, preset, **options) -> FitSetup:
    camera, geometry, truth = furnished_room(16)
    room = RenderScene(geometry, camera)
    room.set_materials(truth)
    room.set_envmap(windowed_sky(16))
    linear = np.clip(room.render(spp=16), 0, 1)
    light = preset.light
    few = replace(light.schedule, max_steps=2)
    stages = tuple(replace(s, schedule=replace(s.schedule, max_steps=2)) for s in preset.materials.stages)
    preset = replace(
        preset, light=replace(light, schedule=few), materials=replace(preset.materials, stages=stages), rerender_spp=2
    )
    normal, depth = np.zeros_like(linear), np.full(linear.shape[:2], 3.0, np.float32)
    normal[..., 2] = 1
    prior = Prediction(truth, normal, depth, light=np.full((8, 16, 4), 0.5, np.float32))
    photo = Photo(linear=linear, camera=camera, original=linear)
    return FitSetup(photo, prior, preset, "none", engine, envmap_height=16, device="cpu", **options)


@pytest.mark.parametrize("engine, preset", [("transport", DEFAULT), ("transport", PAPER), ("path", PAPER)])
def test_a_fit_elsewhere_finds_what_it_finds_here(engine, preset, request):
    setup = asked(engine, preset, mask=np.eye(16) > 0, spp=2)
    here = invert(setup)
    request.getfixturevalue("elsewhere")
    there = invert(setup)
    np.testing.assert_allclose(there.envmap, here.envmap, rtol=1e-4)
    np.testing.assert_allclose(there.materials.albedo, here.materials.albedo, atol=1e-5)
    if preset is DEFAULT:  # and the quick look
        scene = Scene(
            setup.photo.camera,
            setup.photo,
            setup.prior,
            there.materials,
            setup.prior.normal,
            setup.prior.depth,
            there.prepared.geometry,
            there.envmap,
            rerender=there.rerender,
        )
        assert Preview(scene).render(replace(scene, envmap=2 * scene.envmap)).mean() > 0
