"""Pieces put into a hole so that no seam shows.

Pieces agree with their surroundings in detail, seldom in brightness: light falls off along a wall. So they give their
gradients, and the hole's borders give the level (Perez et al. 2003, Poisson Image Editing), on each surface by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.edits.remove.patches import Plan
from materialist.types import Array


@dataclass(frozen=True)
class BlendSettings:
    """How levels follow the hole's borders; logarithms of radiance, tuned by eye on six photos."""

    floor: float = 0.05  # radiance added before the logarithm; below it levels change by a sum, not by a factor
    alike: float = 0.25  # largest step to what is known beside a piece; more: other things set the level, too
    most: float = 0.5  # largest change of a level; more: pieces that do not fit each other turn dark or bright
    held: float = 1e-4  # weight of a piece's own level beside one gradient; less: borders reach farther in
    exact: float = 1.0  # the same where a symmetric plane gives the level, which the border knows less well


def seamless(plan: Plan, radiance: Array, settings: BlendSettings = BlendSettings()) -> Array:
    """Radiance or albedo [H, W, C] with the plan's hole filled by its pieces, their levels as the hole's borders say.

    Gradients are those of logarithms, so that light changes a pattern as a factor. None is kept where two surfaces
    meet. float32, the rest as it was.
    """
    hole = plan.hole
    values = np.log(np.maximum(np.asarray(radiance, np.float64), 0) + settings.floor)
    filled = plan.fill(values).astype(np.float64)
    where = np.full(hole.shape, -1)
    where[plan.rows, plan.columns] = plan.source
    where[~hole] = -1
    pairs = [_pairs(plan, values, filled, where, along, settings.alike) for along in (0, 1)]
    first, second, step = (np.concatenate([pair[i] for pair in pairs]) for i in range(3))
    held = np.full(hole.shape, settings.held)
    held[plan.rows[: plan.exact], plan.columns[: plan.exact]] = settings.exact
    solved = _solved(hole, filled, held[hole], first, second, step)
    off = np.clip(solved - filled[hole], -settings.most, settings.most)
    out = np.asarray(radiance, np.float32).copy()
    out[hole] = np.maximum(np.exp(filled[hole] + off) - settings.floor, 0)
    return out


def _pairs(
    plan: Plan, values: Array, filled: Array, where: Array, along: int, alike: float
) -> tuple[Array, Array, Array]:
    """Neighbours of which one at least is in the hole: row-major first [N] and second [N], and second - first [N, C].

    `where` [H, W]: the source of each pixel of the hole, -1 elsewhere; `along`: the axis; `alike`: of `BlendSettings`.
    """
    hole, width = plan.hole.ravel(), plan.hole.shape[1]
    label = np.zeros(hole.size, int) if plan.label is None else plan.label.ravel()
    flat, own, where = values.reshape(hole.size, -1), filled.reshape(hole.size, -1), where.ravel()
    grid = np.arange(hole.size).reshape(plan.hole.shape)
    first, second = (grid[:-1], grid[1:]) if along == 0 else (grid[:, :-1], grid[:, 1:])
    first, second = first.ravel(), second.ravel()
    near = (hole[first] | hole[second]) & (label[first] == label[second])
    first, second = first[near], second[near]
    total, count = np.zeros((len(first), flat.shape[1])), np.zeros(len(first))
    off = np.zeros(len(first))
    for here, there, stride in ((first, second, width ** (1 - along)), (second, first, -(width ** (1 - along)))):
        source = where[here]
        beside = source + stride
        sound = (source >= 0) & (beside >= 0) & (beside < hole.size)
        if along == 1:
            sound &= source // width == beside // width
        source, beside = np.where(sound, source, 0), np.where(sound, beside, 0)
        sound &= ~hole[source] & ~hole[beside] & (label[source] == label[here]) & (label[beside] == label[here])
        gradient = (flat[beside] - flat[source]) * np.sign(stride)
        total += np.where(sound[:, None], gradient, 0)
        count += sound
        expected = np.where(sound[:, None], flat[beside], own[here])
        off = np.where(hole[here] & ~hole[there], np.abs(expected - flat[there]).max(-1), off)
    step = np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], own[second] - own[first])
    same = off <= alike  # what differs more is another thing, and says nothing about the level
    return first[same], second[same], step[same]


def _solved(hole: Array, filled: Array, held: Array, first: Array, second: Array, step: Array) -> Array:
    """[P, C] values of the hole's pixels, row-major, whose differences are `step` in the sense of least squares.

    `held` [P] is how much they are kept to `filled` [H, W, C].
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import splu

    number = np.where(hole, np.cumsum(hole).reshape(hole.shape) - 1, -1).ravel()
    flat = filled.reshape(hole.size, -1)
    right = held[:, None] * flat[hole.ravel()]
    rows, columns, entries = [], [], []
    for here, there, wanted in ((first, second, -step), (second, first, step)):
        inside = number[here] >= 0
        here, there, wanted = number[here[inside]], there[inside], wanted[inside]
        border = number[there] < 0
        np.add.at(right, here, wanted + np.where(border[:, None], flat[there], 0))
        rows += [here, here[~border]]
        columns += [here, number[there[~border]]]
        entries += [np.ones(len(here)), np.full(int((~border).sum()), -1.0)]
    every = np.arange(len(right))
    entries, rows, columns = [*entries, held], [*rows, every], [*columns, every]
    places = np.concatenate(rows), np.concatenate(columns)
    matrix = coo_matrix((np.concatenate(entries), places), (len(every),) * 2).tocsc()
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(right)
