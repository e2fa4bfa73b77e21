"""Block-sparse Jacobian of residuals, one block per channel and run: most parameters change only a few of them.

A gain changes its own channel, a release its own run; columns that are zero in a block are neither kept nor
multiplied.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Block:
    rows: slice
    columns: NDArray[np.intp]
    values: FloatArray


@dataclass(frozen=True, eq=False)
class BlockJacobian:
    """A matrix of derivatives, shape (sum of the sizes of the blocks, n_columns).

    Attributes
    ----------
    n_columns : int
    blocks : tuple
        With the columns that are not zero throughout.
    """

    n_columns: int
    blocks: tuple[_Block, ...]

    @classmethod
    def of_columns(cls, columns: Sequence[FloatArray], sizes: Sequence[int]) -> BlockJacobian:
        """From dense columns.

        Parameters
        ----------
        columns : sequence of ndarray, shape (sum of sizes,)
        sizes : sequence of int
            Rows of each block.
        """
        ends = np.cumsum([0, *sizes]).tolist()
        rows = [slice(first, end) for first, end in pairwise(ends)]
        return cls.of_blocks([dict(enumerate(column[row] for row in rows)) for column in columns], sizes)

    @classmethod
    def of_blocks(cls, columns: Sequence[Mapping[int, FloatArray]], sizes: Sequence[int]) -> BlockJacobian:
        """From those parts of columns that may not be zero.

        Parameters
        ----------
        columns : sequence of mapping
            Of each the derivatives in some blocks by their number, shape (rows of the block,).
        sizes : sequence of int
            Rows of each block.
        """
        blocks, first = [], 0
        for number, size in enumerate(sizes):
            # The pattern of zeros is found from the numbers, as an effect need not say which runs it changes.
            seen = [i for i, column in enumerate(columns) if number in column and column[number].any()]
            values = np.empty((size, len(seen)))
            for place, i in enumerate(seen):
                values[:, place] = columns[i][number]
            blocks.append(_Block(slice(first, first + size), np.array(seen, np.intp), values))
            first += size
        return cls(len(columns), tuple(blocks))

    def beside(self, more: BlockJacobian) -> BlockJacobian:
        """With the columns of another one after its own; both have the same rows in the same blocks."""
        blocks = tuple(
            _Block(
                own.rows,
                np.concatenate([own.columns, new.columns + self.n_columns]),
                np.ascontiguousarray(np.hstack([own.values, new.values])),
            )
            for own, new in zip(self.blocks, more.blocks, strict=True)
        )
        return BlockJacobian(self.n_columns + more.n_columns, blocks)

    def mean_with(self, other: BlockJacobian) -> BlockJacobian:
        """Of two sets of derivatives; a column that is zero throughout in one of them counts as in the other.

        Parameters
        ----------
        other : BlockJacobian
            Of the same residuals by the same parameters.
        """
        blocks = []
        for one, two in zip(self.blocks, other.blocks, strict=True):
            columns = np.union1d(one.columns, two.columns).astype(np.intp)
            total, n = np.zeros((one.values.shape[0], columns.size)), np.zeros(columns.size)
            for block in (one, two):
                places = np.searchsorted(columns, block.columns)
                total[:, places] += block.values
                n[places] += 1
            blocks.append(_Block(one.rows, columns, total / n))
        return BlockJacobian(self.n_columns, tuple(blocks))

    def part(self, chosen: Sequence[int], columns: Sequence[int]) -> BlockJacobian:
        """Some blocks, one after another, and some columns alone.

        Parameters
        ----------
        chosen : sequence of int
            Blocks in their order.
        columns : sequence of int
            In the order that they have then; all that the blocks see must be among them.
        """
        place = {column: i for i, column in enumerate(columns)}
        blocks, first = [], 0
        for block in (self.blocks[i] for i in chosen):
            size = block.values.shape[0]
            own = np.array([place[column] for column in block.columns.tolist()], np.intp)
            # A copy, as `correct` changes values in place.
            blocks.append(_Block(slice(first, first + size), own, block.values.copy()))
            first += size
        return BlockJacobian(len(columns), tuple(blocks))

    def without(self, column: int) -> BlockJacobian:
        """A copy that has one column less.

        Parameters
        ----------
        column : int
        """
        left = []
        for block in self.blocks:
            seen = block.columns != column
            others = block.columns[seen]
            left.append(replace(block, columns=others - (others > column), values=block.values[:, seen]))
        return BlockJacobian(self.n_columns - 1, tuple(left))

    def weighted(self, weights: FloatArray) -> BlockJacobian:
        """Every row times its weight."""
        return BlockJacobian(
            self.n_columns,
            tuple(replace(block, values=block.values * weights[block.rows, None]) for block in self.blocks),
        )

    def normal_equations(self, weights: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Jᵀ W² J and Jᵀ W² r, block by block, as one block fits into the cache of the processor.

        Parameters
        ----------
        weights : ndarray, shape (n_rows,)
            Diagonal of W.
        residual : ndarray, shape (n_rows,)
        """
        normal, gradient = np.zeros((self.n_columns, self.n_columns)), np.zeros(self.n_columns)
        for block in self.blocks:
            own = weights[block.rows]
            values = block.values * own[:, None]
            normal[np.ix_(block.columns, block.columns)] += values.T @ values
            gradient[block.columns] += values.T @ (own * residual[block.rows])
        return normal, gradient

    def normal(self) -> FloatArray:
        """Jᵀ J, shape (n_columns, n_columns)."""
        found = np.zeros((self.n_columns, self.n_columns))
        for block in self.blocks:
            found[np.ix_(block.columns, block.columns)] += block.values.T @ block.values
        return found

    def slopes(self) -> FloatArray:
        """Euclidean norms of all columns, shape (n_columns,)."""
        squares = np.zeros(self.n_columns)
        for block in self.blocks:
            squares[block.columns] += np.einsum("ij,ij->j", block.values, block.values)
        return np.asarray(np.sqrt(squares))

    def transposed_times(self, vector: FloatArray) -> FloatArray:
        """Jᵀ r, shape (n_columns,)."""
        found = np.zeros(self.n_columns)
        for block in self.blocks:
            found[block.columns] += block.values.T @ vector[block.rows]
        return found

    def times(self, vector: FloatArray) -> FloatArray:
        """J s, one value per row."""
        return np.concatenate([block.values @ vector[block.columns] for block in self.blocks] or [np.zeros(0)])

    def correct(self, steps: FloatArray, changes: FloatArray) -> None:
        """Broyden update: the least change with which the matrix reproduces some steps, zeros kept; in place.

        Parameters
        ----------
        steps : ndarray, shape (n_columns,) or (n_columns, n)
            Of those that a block cannot tell apart it reproduces the mean.
        changes : ndarray, shape (n_rows,) or (n_rows, n)
            Of the residuals by each step.

        Notes
        -----
        Broyden (1965), doi:10.1090/S0025-5718-1965-0198670-6; with a pattern of zeros, Schubert (1970),
        doi:10.1090/S0025-5718-1970-0258276-9; of several steps at once, Schnabel (1983), CU-CS-247-83.

        Examples
        --------
        >>> found = BlockJacobian.of_columns([np.array([2.0, 0.0]), np.array([1.0, 3.0])], [1, 1])
        >>> found.correct(np.array([1.0, 1.0]), np.array([5.0, 4.0]))
        >>> found.times(np.array([1.0, 1.0])).tolist(), found.times(np.array([1.0, 0.0])).tolist()
        ([5.0, 4.0], [3.0, 0.0])
        """
        steps, changes = steps.reshape(self.n_columns, -1), changes.reshape(len(changes), -1)
        for block in self.blocks:
            own = steps[block.columns]
            if own.any():
                # Each block divides by the length of its own part of the step: the update of Schubert, row by
                # row the least change that leaves zeros alone. Broyden's update would fill them.
                missed = changes[block.rows] - block.values @ own
                block.values[...] += missed @ (np.linalg.pinv(own.T @ own, hermitian=True) @ own.T)
