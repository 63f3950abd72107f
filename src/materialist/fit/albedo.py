"""The albedo alone: with cached transport the rendering of a pixel is linear in it, so each is a problem of its own."""

import time
from functools import partial

import torch

from materialist.fit.engine import MaterialProblem
from materialist.fit.losses import decode, encode, encoded_error
from materialist.fit.optimise import StageResult, Stop, never
from materialist.fit.settings import MaterialSettings
from materialist.types import Progress

HALVINGS = 16
"""Of the range in which the encoded albedo lies: it is then known to 1/131072."""
STRIP_PIXELS = 2**18
"""Solved at once: what is computed of a whole large picture does not fit into memory that is at hand."""


def solve_albedo(
    problem: MaterialProblem,
    photo: torch.Tensor,
    start: torch.Tensor,
    settings: MaterialSettings,
    *,
    progress: Progress | None = None,
    stop: Stop = never,
) -> tuple[torch.Tensor, StageResult]:
    """Maps [P, 5] whose albedo minimises (s(render) - s(photo))^2 + delta w (s(A) - s(A0))^2, s the encoding.

    photo: [P, 3] linear. start: [P, 5] the prior; roughness and metallic stay. `stop` leaves the prior from there on.
    """
    begin = time.perf_counter()
    maps = start.clone()
    weight = settings.delta * settings.weights[0]
    strips = range(0, len(photo), STRIP_PIXELS)
    losses = [0.0, 0.0]
    for number, first in enumerate(strips):
        if progress is not None:
            progress("albedo", number, len(strips))
        if stop():
            break
        rows = slice(first, first + STRIP_PIXELS)
        # --- Radiance as a line: offset + slope A ---
        black = start[rows].clone()
        white = start[rows].clone()
        black[:, :3] = 0
        white[:, :3] = 1
        with torch.no_grad():
            offset = problem(black, rows)
            slope = problem(white, rows) - offset
        # --- Bisection: the minimum is where the cost stops falling ---
        seen = encode(photo[rows], settings.encoding)
        before = encode(start[rows, :3], settings.encoding)

        error_at = partial(_error, offset, slope, photo[rows], seen, settings)
        low = torch.zeros_like(before)
        high = encode(torch.ones_like(before), settings.encoding)
        for _ in range(HALVINGS):
            middle = ((low + high) / 2).requires_grad_()
            error = error_at(middle)
            (gain,) = torch.autograd.grad(error.sum(), middle)
            rises = error.detach() * gain + weight * (middle.detach() - before) > 0
            low = torch.where(rises, low, middle.detach())
            high = torch.where(rises, middle.detach(), high)
        # --- The solution, and the mean cost before and after ---
        solution = (low + high) / 2
        maps[rows, :3] = decode(solution, settings.encoding)
        for k, encoded in enumerate((before, solution)):
            cost = error_at(encoded).square() + weight * (encoded - before).square()
            losses[k] += float(cost.sum()) / photo.numel()
    if progress is not None:
        progress("albedo", len(strips), len(strips))
    seconds = time.perf_counter() - begin
    return maps, StageResult("albedo", HALVINGS, seconds, tuple(losses))


def _error(
    offset: torch.Tensor,
    slope: torch.Tensor,
    photo: torch.Tensor,
    seen: torch.Tensor,
    settings: MaterialSettings,
    encoded: torch.Tensor,
) -> torch.Tensor:
    """[P, 3] encoded rendering minus `seen`, the encoded photo [P, 3], for an encoded albedo [P, 3]."""
    radiance = offset + slope * decode(encoded, settings.encoding)
    return encoded_error(radiance, photo, settings.encoding, white=settings.white, encoded=seen)
