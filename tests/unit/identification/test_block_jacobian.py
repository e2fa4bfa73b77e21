"""Products of a Jacobian in blocks against the dense matrix, and its correction against what defines it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from sloshlab.identification.block_jacobian import BlockJacobian

SIZES = (4, 3, 5)
PATTERN = np.array([[1, 0, 1, 0], [0, 1, 1, 0], [1, 1, 1, 0]])
"""Which of four columns three blocks see; the last one is seen by none."""


def dense(seed: int = 0) -> np.ndarray:
    generator = np.random.default_rng(seed)
    return generator.normal(size=(sum(SIZES), 4)) * np.repeat(PATTERN, SIZES, axis=0)


def in_blocks(matrix: np.ndarray) -> BlockJacobian:
    return BlockJacobian.of_columns(list(matrix.T), SIZES)


def as_dense(jacobian: BlockJacobian) -> np.ndarray:
    return np.column_stack([jacobian.times(unit) for unit in np.eye(jacobian.n_columns)])


def test_products_are_those_of_the_dense_matrix() -> None:
    matrix, generator = dense(), np.random.default_rng(1)
    across, along = generator.normal(size=4), generator.normal(size=sum(SIZES))
    jacobian = in_blocks(matrix)
    np.testing.assert_allclose(jacobian.times(across), matrix @ across, rtol=1e-13)
    np.testing.assert_allclose(jacobian.transposed_times(along), matrix.T @ along, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(jacobian.normal(), matrix.T @ matrix, rtol=1e-13, atol=1e-15)


def test_normal_equations_are_those_of_weighted_rows() -> None:
    matrix, generator = dense(), np.random.default_rng(2)
    weights, residual = generator.uniform(0.1, 2.0, sum(SIZES)), generator.normal(size=sum(SIZES))
    normal, pull = in_blocks(matrix).normal_equations(weights, residual)
    of_rows = matrix * weights[:, None]
    np.testing.assert_allclose(normal, of_rows.T @ of_rows, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(pull, of_rows.T @ (weights * residual), rtol=1e-13, atol=1e-15)


def test_columns_are_made_of_the_blocks_that_are_given() -> None:
    """Blocks that are not given, and those that are zero, are not kept."""
    first, last = np.array([1.0, 2.0, 3.0, 4.0]), np.array([5.0, 6.0, 7.0, 8.0, 9.0])
    found = BlockJacobian.of_blocks([{0: first, 1: np.zeros(3)}, {2: last}, {}], SIZES)
    expected = np.zeros((sum(SIZES), 3))
    expected[:4, 0], expected[7:, 1] = first, last
    np.testing.assert_array_equal(as_dense(found), expected)
    assert [block.columns.tolist() for block in found.blocks] == [[0], [], [1]]


@pytest.mark.parametrize("column", range(4))
def test_without_a_column_it_is_a_copy_of_all_others(column: int) -> None:
    matrix = dense()
    jacobian = in_blocks(matrix)
    found = jacobian.without(column)
    np.testing.assert_array_equal(as_dense(found), np.delete(matrix, column, axis=1))
    found.correct(np.ones(3), np.ones(sum(SIZES)))
    np.testing.assert_array_equal(as_dense(jacobian), matrix)


def test_a_part_has_some_blocks_and_the_columns_in_the_order_asked_for() -> None:
    """Blocks 0 and 2 see columns 0, 1 and 2; the last one is left out."""
    matrix = dense()
    found = in_blocks(matrix).part((0, 2), (2, 0, 1))
    rows = [*range(4), *range(7, 12)]
    np.testing.assert_array_equal(as_dense(found), matrix[rows][:, [2, 0, 1]])
    along = np.random.default_rng(3).normal(size=len(rows))
    np.testing.assert_allclose(found.transposed_times(along), matrix[rows][:, [2, 0, 1]].T @ along, rtol=1e-13)


def test_a_part_is_changed_alone() -> None:
    matrix = dense()
    whole = in_blocks(matrix)
    whole.part((0,), (0, 2)).correct(np.ones(2), np.full(4, 9.0))
    np.testing.assert_array_equal(as_dense(whole), matrix)


def test_weights_go_to_rows_and_leave_the_matrix_as_it_was() -> None:
    matrix = dense()
    jacobian, weights = in_blocks(matrix), np.random.default_rng(2).uniform(0.1, 3.0, sum(SIZES))
    weighted = jacobian.weighted(weights)
    np.testing.assert_allclose(as_dense(weighted), np.diag(weights) @ matrix, rtol=1e-13)
    np.testing.assert_array_equal(as_dense(jacobian), matrix)


def test_columns_that_a_block_does_not_see_are_not_kept() -> None:
    blocks = in_blocks(dense()).blocks
    assert [block.columns.tolist() for block in blocks] == [[0, 2], [1, 2], [0, 1, 2]]
    assert [block.values.shape for block in blocks] == [(4, 2), (3, 2), (5, 3)]


def test_a_matrix_without_columns_or_rows_is_one() -> None:
    without_columns = BlockJacobian.of_columns([], SIZES)
    assert without_columns.times(np.zeros(0)).tolist() == [0.0] * sum(SIZES)
    assert without_columns.normal().shape == (0, 0)
    assert BlockJacobian(2, ()).times(np.ones(2)).size == 0
    assert BlockJacobian(2, ()).normal().tolist() == [[0.0, 0.0], [0.0, 0.0]]


def test_a_correction_is_the_least_change_that_says_what_was_seen() -> None:
    """min ‖D‖ with (J + D) s = y and D zero where the pattern is: solved row by row by another route."""
    matrix, generator = dense(3), np.random.default_rng(4)
    step, change = generator.normal(size=4), generator.normal(size=sum(SIZES))
    jacobian = in_blocks(matrix)
    jacobian.correct(step, change)
    found = as_dense(jacobian)
    np.testing.assert_allclose(found @ step, change, rtol=1e-12)
    assert not found[np.repeat(PATTERN, SIZES, axis=0) == 0].any()
    for row, seen in enumerate(np.repeat(PATTERN, SIZES, axis=0).astype(bool)):
        least = minimize(
            lambda d: float(d @ d),
            np.zeros(int(seen.sum())),
            jac=lambda d: 2 * d,
            constraints={
                "type": "eq",
                "fun": lambda d, row=row, seen=seen: (matrix[row, seen] + d) @ step[seen] - change[row],
            },
            method="SLSQP",
            options={"ftol": 1e-14},
        )
        np.testing.assert_allclose(found[row, seen] - matrix[row, seen], least.x, rtol=1e-6, atol=1e-8)


def test_a_step_that_a_block_does_not_see_changes_nothing_there() -> None:
    matrix = dense(5)
    jacobian = in_blocks(matrix)
    jacobian.correct(np.array([0.0, 2.0, 0.0, 1.0]), np.ones(sum(SIZES)))
    found = as_dense(jacobian)
    np.testing.assert_array_equal(found[:4], matrix[:4])
    np.testing.assert_allclose(found[4:, 1], 0.5)


def test_steps_along_every_column_make_the_matrix_of_a_linear_problem() -> None:
    """From the right pattern alone, one correction per unit step; each leaves the columns before it alone."""
    matrix = dense(6)
    jacobian = in_blocks(dense(7))
    for unit in np.eye(4):
        jacobian.correct(unit, matrix @ unit)
    np.testing.assert_allclose(as_dense(jacobian), matrix, rtol=1e-13, atol=1e-15)


def test_a_correction_by_several_steps_says_all_that_was_seen() -> None:
    """One after the other they would spoil each other; of two that a block cannot tell apart it takes the mean."""
    generator = np.random.default_rng(5)
    steps, changes = generator.normal(size=(4, 2)), generator.normal(size=(sum(SIZES), 2))
    jacobian = in_blocks(dense(3))
    jacobian.correct(steps, changes)
    found = as_dense(jacobian)
    seen = np.repeat(PATTERN, SIZES, axis=0).astype(bool)
    tell = seen.sum(axis=1) > 1
    assert tell.any()
    np.testing.assert_allclose((found @ steps)[tell], changes[tell], rtol=1e-10)
    assert not found[~seen].any()
    twice = in_blocks(dense(3))
    twice.correct(steps[:, [0, 0]], changes)
    np.testing.assert_allclose(as_dense(twice) @ steps[:, 0], changes.mean(axis=1), rtol=1e-10)


@pytest.mark.parametrize("scale", [1e-8, 1e8])
def test_a_correction_does_not_depend_on_the_units_of_the_residuals(scale: float) -> None:
    matrix, step = dense(8), np.array([0.3, -1.0, 0.7, 0.2])
    change = np.random.default_rng(9).normal(size=sum(SIZES))
    jacobian, other = in_blocks(matrix), in_blocks(scale * matrix)
    jacobian.correct(step, change)
    other.correct(step, scale * change)
    np.testing.assert_allclose(as_dense(other), scale * as_dense(jacobian), rtol=1e-12)


def test_the_mean_of_two_counts_what_only_one_of_them_sees() -> None:
    """A column without derivatives is one whose simulation failed on that side."""
    one = BlockJacobian.of_blocks([{0: np.array([2.0, 4.0])}, {}, {1: np.array([6.0])}], [2, 1])
    two = BlockJacobian.of_blocks(
        [{0: np.array([4.0, 0.0])}, {0: np.array([1.0, 1.0])}, {1: np.array([8.0])}], [2, 1]
    )
    mean = one.mean_with(two)
    assert [mean.times(unit).tolist() for unit in np.eye(3)] == [[3.0, 2.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 7.0]]
