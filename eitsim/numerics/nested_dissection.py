"""Nested dissection of a mesh: its elements are halved again and again; unknowns that halves share come after theirs.

Source: George, SIAM J. Numer. Anal. 10 (1973) 345, doi:10.1137/0710032.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from touchcal.arrays import Array
from touchcal.jit import compiled

Indices = NDArray[np.integer]

# Unknowns of the elements of a part that is not halved, each counted once an element, at most.
_LEAF = 96
# Parts are cut across one of these: eight take 10 to 30 per cent less arithmetic in the elimination than four.
_DIRECTIONS = np.column_stack([np.cos(np.arange(8) * np.pi / 8), np.sin(np.arange(8) * np.pi / 8)])


@dataclass(frozen=True, eq=False)
class Dissection:
    """A complete binary tree of fronts, children before parents: what each eliminates and what it passes on."""

    order: Indices  # (size,) unknowns in the order of their elimination; the last one stays
    height: Indices  # (fronts,) height of each front in the tree; the children of front t are t - 2**height and t - 1
    first: Indices  # (fronts + 1,) place in `order` of the first unknown that each front eliminates
    # (members,) places in `order` of each front's unknowns, ascending: eliminated ones, then passed on ones
    member: Indices
    begin: Indices  # (fronts + 1,) where each front begins in `member`
    into: Indices  # (members,) where unknowns that are passed on are in the parent's front
    blocks: tuple[Indices, ...]  # (elements, k) unknowns of the elements, block by block
    # (pairs,) pairs sorted by the leaf that takes them, and their places in its front, a square array row by row
    source: Indices
    target: Indices
    leaf: Indices  # (leaves + 1,) where each leaf begins in `source`

    @cached_property
    def place(self) -> Indices:
        """(size,) place in `order` of each unknown."""
        return np.argsort(self.order)

    @cached_property
    def pairs(self) -> Indices:
        """(pairs, 2) unknowns of every pair within an element, element by element, block by block."""
        return np.concatenate([block[:, np.triu_indices(block.shape[1], 1)].swapaxes(1, 2).reshape(-1, 2)
                               for block in self.blocks])


def dissect(points: Array, blocks: list[Indices], last: int, directions: Array = _DIRECTIONS) -> Dissection:
    """Dissection of the unknowns of elements, the last unknowns being shared by all and eliminated last. A block
    (elements, k) holds numbers of unknowns; points (cells, d) are where the elements of the first block are, which hold
    none of the last unknowns; parts are cut across directions (n, d). ValueError where an unknown before the last ones
    belongs to no element of the first block."""
    cells, size = blocks[0], 1 + max(int(block.max()) for block in blocks)
    depth = int(np.ceil(np.log2(max(1.0, cells.size / _LEAF))))
    cell = np.arange(len(cells))
    _halve(np.ascontiguousarray(points), cells, directions, depth, cell, np.zeros(size, dtype=np.int64))
    leaf = np.repeat(np.arange(1 << depth), np.diff((len(cells) * np.arange((1 << depth) + 1)) >> depth))
    low, high = _range(cells[cell], leaf, size - last)
    element, leaves = [cell], [leaf]
    for block in blocks[1:]:
        own = block < size - last
        leaves.append(np.max(low[np.where(own, block, 0)], axis=1, where=own, initial=0))
        unknown, where = block[own], np.repeat(leaves[-1], own.sum(axis=1))
        np.minimum.at(low, unknown, where)
        np.maximum.at(high, unknown, where)
        element.append(sum(map(len, element)) + np.arange(len(block)))
    return _tree(depth, low, high, blocks, np.concatenate(element), np.concatenate(leaves), last)


def _range(cells: Indices, leaf: Indices, size: int) -> tuple[Indices, Indices]:
    """First and last leaf (size,) of each unknown, of cells in the order of their leaves."""
    low, high = np.full(size, -1), np.full(size, -1)
    high[cells.ravel()] = np.repeat(leaf, cells.shape[1])
    low[cells[::-1].ravel()] = np.repeat(leaf[::-1], cells.shape[1])
    if low.min(initial=0) < 0:
        raise ValueError(f"node {int(np.argmin(low))} (from 0) belongs to no element; leave it out of the mesh.")
    return low, high


def _tree(depth: int, low: Indices, high: Indices, blocks: list[Indices], element: Indices, leaf: Indices,
          last: int) -> Dissection:
    """An unknown is eliminated in the smallest subtree that holds all its leaves, the last unknowns at the root."""
    height = np.zeros(1, dtype=np.int64)
    for h in range(1, depth + 1):
        height = np.concatenate([height, height, [h]])
    number = np.empty((depth + 1, 1 << depth), dtype=np.int64)
    number[height, (np.cumsum(height == 0) - 1) >> height] = np.arange(len(height))
    above = np.frexp((low ^ high).astype(float))[1]
    owner = np.append(number[above, low >> above], np.full(last, len(height) - 1))
    order = np.argsort(owner, kind="stable")
    first = np.searchsorted(owner[order], np.arange(len(height) + 1))
    first[-1] -= 1
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    by_leaf = np.argsort(leaf, kind="stable")
    starts = np.searchsorted(leaf[by_leaf], np.arange((1 << depth) + 1))
    sizes = np.concatenate([np.full(len(block), block.shape[1]) for block in blocks])
    offset, unknown = np.append(0, np.cumsum(sizes)), place[np.concatenate([block.ravel() for block in blocks])]
    most = len(unknown) * (depth + 1)
    member, into, begin = np.empty(most, np.int64), np.empty(most, np.int64), np.zeros(len(height) + 1, np.int64)
    mark = np.full(len(order), -1)
    _collect(height, first, starts, element[by_leaf], offset, unknown, mark, member, into, begin)
    used = begin[-1]
    pairs = int(np.sum(sizes * (sizes - 1) // 2))
    source, target, leaves = np.empty(pairs, np.int64), np.empty(pairs, np.int64), np.empty_like(starts)
    _place(height, begin, member, starts, element[by_leaf], offset, unknown, mark, source, target, leaves)
    return Dissection(order, height, first, member[:used].copy(), begin, into[:used].copy(), tuple(blocks), source,
                      target, leaves)


@compiled
def _halve(points, cells, directions, depth, order, mark):
    """Order cells so that each half, and each half of it, lies on one side of a line: of lines across the directions,
    the one that leaves the fewest unknowns on both sides."""
    count = len(order)
    key, trial, best = np.empty(count), np.empty_like(order), np.empty_like(order)
    stamp = 0
    for level in range(depth):
        for part in range(1 << level):
            start, stop = (count * part) >> level, (count * (part + 1)) >> level
            middle = (count * (2 * part + 1)) >> (level + 1)
            fewest = -1
            for direction in directions:
                for c in range(start, stop):
                    trial[c] = order[c]
                    key[c] = direction[0] * points[order[c], 0] + direction[1] * points[order[c], 1]
                    for axis in range(2, len(direction)):
                        key[c] += direction[axis] * points[order[c], axis]
                _split(key, trial, start, stop, middle)
                stamp += 1
                for c in trial[start:middle]:
                    for unknown in cells[c]:
                        mark[unknown] = stamp
                shared = 0
                for c in trial[middle:stop]:
                    for unknown in cells[c]:
                        if mark[unknown] == stamp:
                            mark[unknown] = 0
                            shared += 1
                if fewest < 0 or shared < fewest:
                    fewest = shared
                    for c in range(start, stop):
                        best[c] = trial[c]
            for c in range(start, stop):
                order[c] = best[c]


@compiled
def _split(key, order, start, stop, middle):
    """Bring the smallest keys of a range, and what is ordered with them, before its middle."""
    left, right = start, stop - 1
    while left < right:
        pivot = key[(left + right) // 2]
        i, j = left, right
        while i <= j:
            while key[i] < pivot:
                i += 1
            while key[j] > pivot:
                j -= 1
            if i <= j:
                key[i], key[j] = key[j], key[i]
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if middle <= j:
            right = j
        elif middle >= i:
            left = i
        else:
            break


@compiled
def _sort(numbers, start, stop):
    """Sort a short range by insertion."""
    for i in range(start + 1, stop):
        number, j = numbers[i], i
        while j > start and numbers[j - 1] > number:
            numbers[j] = numbers[j - 1]
            j -= 1
        numbers[j] = number


@compiled
def _collect(height, first, starts, element, offset, unknown, mark, member, into, begin):
    """Members of all fronts: those of a leaf's elements, or what both children pass on, merged."""
    leaf = used = 0
    for t in range(len(height)):
        begin[t] = start = used
        if height[t] == 0:
            for e in element[starts[leaf]:starts[leaf + 1]]:
                for u in unknown[offset[e]:offset[e + 1]]:
                    if mark[u] != t:
                        mark[u] = t
                        member[used] = u
                        used += 1
            _sort(member, start, used)
            leaf += 1
        else:
            left, right = t - (1 << height[t]), t - 1
            i, i_end = begin[left] + first[left + 1] - first[left], begin[left + 1]
            j, j_end = begin[right] + first[right + 1] - first[right], start
            while i < i_end or j < j_end:
                from_left = j == j_end or (i < i_end and member[i] <= member[j])
                from_right = i == i_end or (j < j_end and member[j] <= member[i])
                if from_left:
                    member[used], into[i] = member[i], used - start
                    i += 1
                if from_right:
                    member[used], into[j] = member[j], used - start
                    j += 1
                used += 1
        into[start:used] = -1
    begin[-1] = used


@compiled
def _place(height, begin, member, starts, element, offset, unknown, position, source, target, leaves):
    first_pair = np.zeros(len(offset), np.int64)
    for e in range(len(offset) - 1):
        first_pair[e + 1] = first_pair[e] + (offset[e + 1] - offset[e]) * (offset[e + 1] - offset[e] - 1) // 2
    leaf = used = 0
    for t in range(len(height)):
        if height[t] > 0:
            continue
        leaves[leaf] = used
        size = begin[t + 1] - begin[t]
        for i in range(size):
            position[member[begin[t] + i]] = i
        for e in element[starts[leaf]:starts[leaf + 1]]:
            pair = first_pair[e]
            for a in range(offset[e], offset[e + 1]):
                for b in range(a + 1, offset[e + 1]):
                    i, j = position[unknown[a]], position[unknown[b]]
                    source[used], target[used] = pair, min(i, j) * size + max(i, j)
                    pair += 1
                    used += 1
        leaf += 1
    leaves[leaf] = used
