"""Which blocks of samples came out of order: as few samples as possible, an intruder and not its victims."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

IntArray = NDArray[np.int64]


def out_of_order(counter: IntArray, n_samples: IntArray) -> NDArray[np.bool_]:
    """Blocks that must be left out for the others to be in order.

    Parameters
    ----------
    counter, n_samples : ndarray of int64, shape (n_blocks,)
        First counter and length of each block, in order of arrival.

    Returns
    -------
    ndarray of bool, shape (n_blocks,)
        The blocks outside the heaviest chain of blocks in which each begins where the one before ends or
        later. Where two chains hold as many samples, the block that came late is the one left out.
        Samples at the beginning of a block that the block before it also has are repeats and no disorder.

    Notes
    -----
    A block that is damaged unnoticed, and so in a wrong place far ahead, makes all that follow it late if
    lateness is judged by the highest counter so far. By the heaviest chain it is itself the one out of order.

    Examples
    --------
    >>> late = out_of_order(np.array([0, 8, 4, 12]), np.array([4, 4, 4, 4]))
    >>> early = out_of_order(np.array([0, 40, 4, 8]), np.array([4, 4, 4, 4]))
    >>> repeated = out_of_order(np.array([0, 4]), np.array([8, 8]))
    >>> late.tolist(), early.tolist(), repeated.any()
    ([False, False, True, False], [False, True, False, False], np.False_)
    """
    stop = counter + n_samples
    start = counter.copy()
    # a frame that was sent twice must not make all that follows it in its block look late
    is_repeat = (counter[1:] >= counter[:-1]) & (counter[1:] < stop[:-1])
    start[1:][is_repeat] = np.minimum(stop[:-1], stop[1:])[is_repeat]
    # in order, as nearly always: the chain is not needed
    if (start[1:] >= np.maximum.accumulate(stop)[:-1]).all():
        return np.zeros(len(counter), np.bool_)
    stops, rank = np.unique(stop, return_inverse=True)
    n_before = np.searchsorted(stops, start, side="right")
    # by samples and not by blocks: one long block outweighs many short ones that contradict it
    is_outside: NDArray[np.bool_] = ~_chain(stop - start, rank.astype(np.int64), n_before)
    return is_outside & (stop > start)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _chain(weight: IntArray, rank: IntArray, n_before: IntArray) -> NDArray[np.bool_]:
    """The heaviest chain; block j may follow block i if rank[i] < n_before[j]. A Fenwick tree of maxima."""
    n = len(weight)
    # the best chain that ends below a rank is found in log n: comparing all pairs would be n²
    tree = np.full(rank.max() + 2, -1, np.int64)
    total = np.zeros(n, np.int64)
    before = np.full(n, -1, np.int64)
    last = -1
    for j in range(n):
        best = -1
        node = n_before[j]
        while node > 0:
            best = _better(best, tree[node], total, rank)
            node -= node & -node
        before[j] = best
        total[j] = weight[j] + (total[best] if best >= 0 else 0)
        last = _better(last, j, total, rank)
        node = rank[j] + 1
        while node < len(tree):
            tree[node] = _better(tree[node], j, total, rank)
            node += node & -node
    is_inside = np.zeros(n, np.bool_)
    while last >= 0:
        is_inside[last] = True
        last = before[last]
    return is_inside


@njit(cache=True)  # type: ignore[untyped-decorator]
def _better(first: int, second: int, total: IntArray, rank: IntArray) -> int:
    """The block whose chain is heavier; where they are equal, the one further ahead, then the earlier."""
    if first < 0 or second < 0:
        return max(first, second)
    if total[first] != total[second]:
        return first if total[first] > total[second] else second
    return second if rank[second] > rank[first] else first
