"""A whole fit with torch on another device than the processor, made up for machines without a card: its tensors call
themselves `meta`, keep their values in the processor's memory, and refuse, as those of CUDA do, to meet others."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from made_room import Room
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves, tree_map_only

from materialist import buffers
from materialist.edits.preview import Preview
from materialist.fit.invert import invert
from materialist.fit.settings import DEFAULT, PAPER
from materialist.render.scene import RenderScene
from materialist.types import Scene


class Far(torch.Tensor):
    __torch_dispatch__ = classmethod(lambda *_: NotImplemented)  # OtherDevice computes

    @staticmethod
    def __new__(cls, near):
        return torch.Tensor._make_wrapper_subclass(
            cls, near.shape, near.stride(), dtype=near.dtype, device="meta"
        )

    def __init__(self, near):
        self.near = near


class OtherDevice(TorchDispatchMode):
    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        name = function._schema.name.removeprefix("aten::")
        kwargs = dict(kwargs or {})
        # Numbers, and places in a tensor, may come from the processor.
        indexing = name in ("index", "index_put", "index_put_", "_index_put_impl_")

        def counts(t):
            return isinstance(t, Far) or (t.is_floating_point() if indexing else t.dim())

        far = {
            isinstance(t, Far)
            for t in tree_leaves((args, kwargs))
            if isinstance(t, torch.Tensor) and counts(t)
        }
        assert len(far) < 2 or name in ("_to_copy", "copy_"), f"{name} mixes devices"
        device = kwargs.pop("device", None)
        there = True in far if device is None else torch.device(device).type == "meta"
        near_args, near_kwargs = tree_map_only(Far, lambda t: t.near, (args, kwargs))
        found = function(*near_args, **near_kwargs)
        return (
            args[0]
            if name.endswith("_")
            else tree_map_only(torch.Tensor, Far, found)
            if there
            else found
        )


@pytest.fixture
def elsewhere(monkeypatch):
    render = RenderScene.render_torch

    def render_there(scene, *tensors, **options):
        assert all(isinstance(t, Far) for t in tensors), "the renderer lies on the other device"
        return render(scene, *(t.cpu() for t in tensors), **options).to("meta")

    monkeypatch.setattr(RenderScene, "render_torch", render_there)
    monkeypatch.setattr(buffers, "torch_device", lambda: "meta")
    monkeypatch.setattr("materialist.fit.light.torch_device", lambda: "meta")
    with OtherDevice():
        yield


@pytest.mark.parametrize(
    "engine, preset",
    [
        ("transport", DEFAULT),
        pytest.param("transport", PAPER, marks=pytest.mark.slow),
        pytest.param("path", PAPER, marks=pytest.mark.slow),
    ],
)
def test_a_fit_elsewhere_finds_what_it_finds_here(engine, preset, request):
    room = Room(16)
    setup = room.setup(
        preset.at_most(2), spp=2, engine=engine, completion="none", mask=np.eye(16) > 0
    )
    prior = replace(setup.prior, light=np.full((8, 16, 4), 0.5, np.float32))
    here = invert(setup := replace(setup, prior=prior))
    request.getfixturevalue("elsewhere")
    there = invert(setup)
    np.testing.assert_allclose(there.envmap, here.envmap, rtol=1e-4)
    np.testing.assert_allclose(there.materials.albedo, here.materials.albedo, atol=1e-5)
    if engine == "transport":  # and the quick look
        seen = (
            there.materials,
            prior.normal,
            prior.depth,
            there.geometry,
            there.envmap,
            there.rerender,
        )
        scene = Scene(room.camera, room.photo, prior, *seen)
        assert Preview(scene).render(replace(scene, envmap=2 * scene.envmap)).mean() > 0
