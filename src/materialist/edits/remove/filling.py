"""What fills a hole: planes with translational symmetry go on, patches of the surroundings do the rest.

Pieces agree with their surroundings in detail, seldom in brightness: light falls off along a wall. So they give their
gradients, and the hole's borders give the level (Perez et al. 2003, Poisson Image Editing), on each surface by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.color import linear_to_srgb
from materialist.edits.remove.patches import copied, patch_sources
from materialist.edits.remove.symmetry import repeated_sources
from materialist.geometry.membrane import membrane
from materialist.types import Array, Camera, Materials


@dataclass(frozen=True)
class Filling:
    """Where a hole takes its values from."""

    hole: Array
    """[H, W] bool."""
    label: Array
    """[H, W] int: surfaces in and around the hole."""
    source: Array | None
    """[H, W] int row-major source of each pixel; None where nothing can be copied."""
    exact: Array
    """[H, W] bool: sources that a symmetry gives."""

    def radiance(self, values: Array) -> Array:
        """[H, W, C] float32 radiance or albedo with the hole filled, by a membrane where nothing can be copied."""
        if self.source is None:
            return membrane(values, ~self.hole)
        return seamless(values, self.hole, self.source, self.label, self.exact)

    def materials(self, old: Materials) -> Materials:
        """Materials with the hole filled."""
        rest = np.stack([old.roughness, old.metallic], -1)
        rest = membrane(rest, ~self.hole) if self.source is None else copied(rest, self.source)
        albedo = np.clip(self.radiance(old.albedo), 0, 1)
        return Materials(albedo, *(np.ascontiguousarray(v) for v in np.moveaxis(np.clip(rest, 0, 1), -1, 0)))


def find_filling(
    albedo: Array, photo: Array, hole: Array, label: Array, depth: Array, camera: Camera, *,
    seed: int = 0, usable: Array | None = None,
) -> Filling:  # fmt: skip
    """Find places that are alike in albedo and photo, on the same surface.

    Args:
        albedo, photo: [H, W, 3] linear; not read in the hole.
        hole: [H, W] bool. label: [H, W] int, depth: [H, W]: surfaces in and around the hole (see `behind.Behind`).
        seed: of the patch search. usable: [H, W] bool: what may be copied, None for anything.
    """
    usable = np.ones(hole.shape, bool) if usable is None else usable
    paint = linear_to_srgb(albedo)
    features = np.concatenate([paint, linear_to_srgb(photo)], -1)
    known = repeated_sources(paint, features, hole, usable, label, depth, camera)
    source = patch_sources(features, hole, usable, label, known=known, seed=seed)
    return Filling(hole, label, source, hole & (known >= 0))


@dataclass(frozen=True)
class BlendSettings:
    """How levels follow the hole's borders; logarithms of radiance, tuned by eye on six photos."""

    floor: float = 0.05  # radiance added before the logarithm; below it levels change by a sum, not by a factor
    alike: float = 0.25  # largest step to what is known beside a piece; more: other things set the level, too
    most: float = 0.5  # largest change of a level; more: pieces that do not fit each other turn dark or bright
    held: float = 1e-4  # weight of a piece's own level beside one gradient; less: borders reach farther in
    exact: float = 1.0  # the same where a symmetric plane gives the level, which the border knows less well


SETTINGS = BlendSettings()


def seamless(
    radiance: Array, hole: Array, source: Array, label: Array, exact: Array | None = None
) -> Array:  # fmt: skip
    """Radiance or albedo [H, W, C] with a hole filled by pieces, their levels as the hole's borders say; float32.

    Gradients are those of logarithms, so that light changes a pattern as a factor. None is kept where two surfaces
    meet. hole: [H, W] bool. source, label: [H, W] int row-major sources and surfaces (see `patches.patch_sources`).
    exact: [H, W] bool: sources that a symmetry gives; None for nowhere.
    """
    from scipy.sparse import coo_matrix, diags
    from scipy.sparse.linalg import splu

    values = np.log(np.maximum(np.asarray(radiance, np.float64), 0) + SETTINGS.floor)
    pieces = copied(values, source)[hole].astype(np.float64)
    first, second, step = _steps(values, hole, source, label, SETTINGS.alike)
    # Differences of unknowns, `matrix` [N, P], are the steps less what is known of them.
    number = np.where(hole, np.cumsum(hole).reshape(hole.shape) - 1, -1).ravel()
    rows: list[Array] = []
    columns: list[Array] = []
    signs: list[Array] = []
    for pixels, sign in ((second, 1.0), (first, -1.0)):
        inside = number[pixels] >= 0
        rows, columns = [*rows, np.flatnonzero(inside)], [*columns, number[pixels[inside]]]
        signs.append(np.full(int(inside.sum()), sign))
        step = step - sign * np.where(inside[:, None], 0, values.reshape(hole.size, -1)[pixels])
    places = np.concatenate(rows), np.concatenate(columns)
    matrix = coo_matrix((np.concatenate(signs), places), (len(first), len(pieces))).tocsr()
    held = (
        np.full(len(pieces), SETTINGS.held) if exact is None else np.where(exact[hole], SETTINGS.exact, SETTINGS.held)
    )
    normal = (matrix.T @ matrix + diags(held, dtype=float)).tocsc()
    solver = splu(normal, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    solved = solver.solve(matrix.T @ step + held[:, None] * pieces)
    levels = np.clip(solved - pieces, -SETTINGS.most, SETTINGS.most)
    out = np.asarray(radiance, np.float32).copy()
    out[hole] = np.maximum(np.exp(pieces + levels) - SETTINGS.floor, 0)
    return out


def _steps(values: Array, hole: Array, source: Array, label: Array, alike: float) -> tuple[Array, Array, Array]:
    """Neighbours of which one at least is in the hole: row-major first [N] and second [N], and second - first [N, C].

    A hidden pixel expects to its neighbour the step that its source has there; two hidden ones take the mean.
    """
    flat, inside = values.reshape(hole.size, -1), hole.ravel()
    own, label, source = copied(values, source).reshape(hole.size, -1), label.ravel(), source.ravel()
    grid = np.arange(hole.size).reshape(hole.shape)
    first = np.concatenate([grid[:-1].ravel(), grid[:, :-1].ravel()])
    second = np.concatenate([grid[1:].ravel(), grid[:, 1:].ravel()])
    near = (inside[first] | inside[second]) & (label[first] == label[second])
    first, second = first[near], second[near]
    total, count, off = np.zeros((len(first), flat.shape[1])), np.zeros((len(first), 1)), np.zeros(len(first))
    for here, there, sign in ((first, second, 1), (second, first, -1)):
        beside = np.clip(source[here] + there - here, 0, hole.size - 1)
        # A source at the frame has its neighbour beyond it: in a row-major picture that is far away.
        together = np.abs(beside % hole.shape[1] - source[here] % hole.shape[1]) <= 1
        told = inside[here] & ~inside[beside] & together & (label[source[here]] == label[here])
        told = (told & (label[beside] == label[here]))[:, None]
        total += np.where(told, sign * (flat[beside] - flat[source[here]]), 0)
        count += told
        expected = np.where(told, flat[beside], own[here])
        off = np.where(inside[here] & ~inside[there], np.abs(expected - flat[there]).max(-1), off)
    step = np.where(count > 0, total / np.maximum(count, 1), own[second] - own[first])
    same = off <= alike  # what differs more is another thing, and says nothing about the level
    return first[same], second[same], step[same]
