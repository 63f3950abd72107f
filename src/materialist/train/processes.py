"""One process or several: what torchrun says, and what the processes tell each other."""

from __future__ import annotations

import os
from dataclasses import dataclass, field

import torch
from torch import distributed, nn
from torch.nn.parallel import DistributedDataParallel

from materialist.predict.device import on_gpu


@dataclass(frozen=True)
class Processes:
    """The place of this process among those that train together."""

    rank: int = 0
    world: int = 1
    device: torch.device = field(default_factory=lambda: torch.device("cpu"))

    @property
    def first(self) -> bool:
        """Whether this process writes the files."""
        return self.rank == 0

    def wrap(self, network: nn.Module) -> nn.Module:
        """The network as the training step calls it: gradients are averaged over all processes."""
        if self.world == 1:
            return network
        places = [self.device.index] if self.device.type == "cuda" else None
        return DistributedDataParallel(network, device_ids=places)

    def agree(self, stop: bool) -> bool:
        """The first process's answer, for all: clocks differ, but all must stop after the same step."""
        if self.world == 1:
            return stop
        answer = torch.tensor([float(stop)], device=self.device)
        distributed.broadcast(answer, src=0)
        return bool(answer.item())

    def leave(self) -> None:
        """Part from the others."""
        if self.world > 1 and distributed.is_initialized():
            distributed.destroy_process_group()


def join(device: str = "auto") -> Processes:
    """Take the place that torchrun gave this process, or be alone; raises SetupError when there is no such device.

    `device`: `auto` (CUDA where there is one), `cpu` or `cuda`.
    """
    gpu = on_gpu(device)
    place = torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0"))) if gpu else torch.device("cpu")
    world, rank = int(os.environ.get("WORLD_SIZE", "1")), int(os.environ.get("RANK", "0"))
    if gpu:
        torch.cuda.set_device(place)
    if world > 1:
        distributed.init_process_group("nccl" if gpu else "gloo")
    return Processes(rank, world, place)
