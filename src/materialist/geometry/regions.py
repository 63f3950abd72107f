"""Regions of a picture's graph of neighbours, without strays: what is too small joins the neighbour it fits best."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from materialist.types import Array


def regions_without_strays(
    pairs: tuple[Array, Array], linked: Array, step: Array, least: float, count: int
) -> tuple[Array, Array]:
    """Region of each of `count` members [N], and which pairs [P] bool now hold together.

    pairs: [P] and [P], the members that neighbour each other. linked: [P] bool, pairs within one region. step: [P] >= 0
    how far apart a pair is. A region with fewer members than `least` joins the neighbour at the least mean step along
    their border; one without neighbours stays. It is held by the nearer part of that border alone: the blurred rim of a
    thing touches its back and its front, which may be one region.
    """
    first, second = pairs
    region = connected_regions(pairs, linked, count)
    linked = linked.copy()
    # Only pairs across a border can come to hold: the others are not looked at again.
    apart = np.flatnonzero(region[first] != region[second])
    first, second, step = first[apart], second[apart], step[apart]
    while True:
        # A round: every stray joins a larger neighbour. It ends when none is left to join.
        ends = region[first], region[second]
        size = np.bincount(region)
        target, limit = _targets(ends, step, size, least)
        if (target == np.arange(len(size))).all():
            return region, linked
        for one, other in (ends, ends[::-1]):
            linked[apart] |= (target[one] == other) & (step <= limit[one])
        while (target[target] != target).any():  # one that joins may be joined itself
            target = target[target]
        _, number = np.unique(target, return_inverse=True)
        region = number[region]


def connected_regions(pairs: tuple[Array, Array], linked: Array, count: int) -> Array:
    """[N] region of each of `count` members, by the pairs that are linked [P] bool."""
    first, second = (ends[linked] for ends in pairs)
    graph = coo_matrix((np.ones(len(first), bool), (first, second)), (count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def _targets(
    ends: tuple[Array, Array], step: Array, size: Array, least: float
) -> tuple[Array, Array]:
    """[R] region that each joins, itself where it stays, and [R] the mean step there.

    A small one goes to one larger than itself, never in circles.
    """
    # Each border twice, once from either side.
    owners = np.concatenate(ends)
    other = np.concatenate(ends[::-1])
    step = np.tile(step, 2)
    larger = (size[other] > size[owners]) | ((size[other] == size[owners]) & (other > owners))
    border = (owners != other) & (size[owners] < least) & larger
    # The mean step along the border of each stray with each neighbour.
    key, place = np.unique(owners[border] * len(size) + other[border], return_inverse=True)
    mean = np.bincount(place, step[border], len(key)) / np.bincount(place, minlength=len(key))
    order = np.argsort(-mean, kind="stable")  # the last one written is the nearest
    small = key[order] // len(size)
    target = np.arange(len(size))
    target[small] = key[order] % len(size)
    limit = np.full(len(size), -1.0)
    limit[small] = mean[order] * (1 + 1e-9)
    return target, limit
