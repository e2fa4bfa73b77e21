"""Eight numbers at once in compiled code: one of each lane, added and multiplied by one instruction.

Loops over arrays are not turned into such instructions where the compiler cannot know that arrays do not overlap.
Each of the eight results is that of the same operation on single numbers, bit for bit.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, Final

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, overload, register_model
from numba.np.arrayobj import make_array, populate_array

N_LANES: Final = 8
"""Doubles in the widest registers of present processors, 512 bits; narrower ones take several instructions."""
_BYTES: Final = 8
"""Alignment that is promised to the compiler, that of one double."""


class _LaneVector(types.Type):  # type: ignore[misc]
    """Eight numbers, one of every lane."""

    def __init__(self) -> None:
        super().__init__(name="LaneVector")


LANE_VECTOR: Final = _LaneVector()
_NUMBERS: Final = ir.VectorType(ir.DoubleType(), N_LANES)
_FLAT: Final = types.Array(types.float64, 1, "C")


@register_model(_LaneVector)  # type: ignore[untyped-decorator]
class _LaneVectorModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, type_: Any) -> None:
        super().__init__(manager, type_, _NUMBERS)


def _place(context: Any, builder: Any, array: Any, row: Any) -> Any:
    """Pointer to the eight numbers of a row."""
    data = cgutils.create_struct_proxy(_FLAT)(context, builder, array).data
    first = builder.mul(row, ir.Constant(row.type, N_LANES))
    return builder.bitcast(builder.gep(data, [first]), _NUMBERS.as_pointer())


@intrinsic  # type: ignore[untyped-decorator]
def numbers_of(typing: Any, array: Any, row: Any) -> Any:
    """The eight numbers of a row of a flat array."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_place(context, builder, *arguments), align=_BYTES)

    return LANE_VECTOR(_FLAT, types.int64), code


@intrinsic  # type: ignore[untyped-decorator]
def put(typing: Any, array: Any, row: Any, numbers: Any) -> Any:
    """Write eight numbers into a row of a flat array."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(arguments[2], _place(context, builder, *arguments[:2]), align=_BYTES)
        return context.get_dummy_value()

    return types.void(_FLAT, types.int64, LANE_VECTOR), code


@intrinsic  # type: ignore[untyped-decorator]
def alike(typing: Any, number: Any) -> Any:
    """Eight times the same number."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        vector = ir.Constant(_NUMBERS, ir.Undefined)
        for lane in range(N_LANES):
            vector = builder.insert_element(vector, arguments[0], ir.Constant(ir.IntType(32), lane))
        return vector

    return LANE_VECTOR(types.float64), code


class _LaneColumns(types.Type):  # type: ignore[misc]
    """Rows of eight numbers."""

    def __init__(self) -> None:
        super().__init__(name="LaneColumns")


LANE_COLUMNS: Final = _LaneColumns()
"""Rows of eight numbers as a law sees them: by the same index it would find one number."""


@register_model(_LaneColumns)  # type: ignore[untyped-decorator]
class _LaneColumnsModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, type_: Any) -> None:
        super().__init__(manager, type_, ir.DoubleType().as_pointer())


@intrinsic  # type: ignore[untyped-decorator]
def _row_of(typing: Any, columns: Any, row: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        first = builder.mul(arguments[1], ir.Constant(ir.IntType(64), N_LANES))
        place = builder.bitcast(builder.gep(arguments[0], [first]), _NUMBERS.as_pointer())
        return builder.load(place, align=_BYTES)

    return LANE_VECTOR(LANE_COLUMNS, types.int64), code


@intrinsic  # type: ignore[untyped-decorator]
def call_law_together(typing: Any, address: Any, arrays: Any, rows: Any) -> Any:
    """Call a law of eight lanes at `address` with motion and parameters, flat arrays, each from a row on."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointers = []
        for array, row in zip(*(cgutils.unpack_tuple(builder, packed) for packed in arguments[1:]), strict=True):
            place = _place(context, builder, array, row)
            pointers.append(builder.bitcast(place, ir.DoubleType().as_pointer()))
        # laws of this kind have no memory: they never look at its place
        nowhere = ir.Constant(ir.DoubleType().as_pointer(), None)
        function = ir.FunctionType(_NUMBERS, [nowhere.type] * 4).as_pointer()
        return builder.call(builder.inttoptr(arguments[0], function), [*pointers, nowhere, nowhere])

    return LANE_VECTOR(types.int64, types.UniTuple(_FLAT, 2), types.UniTuple(types.int64, 2)), code


def _operation(name: str, n_numbers: int = 2) -> Callable[..., Any]:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return getattr(builder, name)(*arguments)

    @intrinsic  # type: ignore[untyped-decorator]
    def of_one(typing: Any, a: Any) -> Any:
        return LANE_VECTOR(LANE_VECTOR), code

    @intrinsic  # type: ignore[untyped-decorator]
    def of_two(typing: Any, a: Any, b: Any) -> Any:
        return LANE_VECTOR(LANE_VECTOR, LANE_VECTOR), code

    return of_one if n_numbers == 1 else of_two  # type: ignore[no-any-return]


@intrinsic  # type: ignore[untyped-decorator]
def _size(typing: Any, a: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        of_vector = ir.FunctionType(_NUMBERS, [_NUMBERS])
        function = cgutils.get_or_insert_function(builder.module, of_vector, f"llvm.fabs.v{N_LANES}f64")
        return builder.call(function, arguments)

    return LANE_VECTOR(LANE_VECTOR), code


# The functions below are without annotations, which numba would compare with those of the functions they return.
def _make_known(sign: Callable[..., Any], of_each: Callable[..., Any]) -> None:
    @overload(sign)  # type: ignore[untyped-decorator]
    def of_two(a, b):  # type: ignore[no-untyped-def]
        if a == LANE_VECTOR and b == LANE_VECTOR:
            return lambda a, b: of_each(a, b)
        if a == LANE_VECTOR and isinstance(b, types.Float):
            return lambda a, b: of_each(a, alike(b))
        if b == LANE_VECTOR and isinstance(a, types.Float):
            return lambda a, b: of_each(alike(a), b)
        return None


for _sign, _name in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul")):
    _make_known(_sign, _operation(_name))
_negative: Final = _operation("fneg", 1)


@overload(operator.neg)  # type: ignore[untyped-decorator]
def _neg(a):  # type: ignore[no-untyped-def]
    return (lambda a: _negative(a)) if a == LANE_VECTOR else None


@overload(abs)  # type: ignore[untyped-decorator]
def _abs(a):  # type: ignore[no-untyped-def]
    return (lambda a: _size(a)) if a == LANE_VECTOR else None


@overload(operator.getitem)  # type: ignore[untyped-decorator]
def _getitem(columns, row):  # type: ignore[no-untyped-def]
    return (lambda columns, row: _row_of(columns, row)) if columns == LANE_COLUMNS else None


@intrinsic  # type: ignore[untyped-decorator]
def table_at(typing: Any, address: Any, n_rows: Any, n_columns: Any) -> Any:
    """A view of rows of inputs at an address: tables that differ from lane to lane cannot be one argument."""
    table = types.Array(types.float64, 2, "C")

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = make_array(table)(context, builder)
        number = ir.Constant(ir.IntType(64), _BYTES)
        populate_array(
            view,
            data=builder.inttoptr(arguments[0], ir.DoubleType().as_pointer()),
            shape=cgutils.pack_array(builder, arguments[1:]),
            strides=cgutils.pack_array(builder, [builder.mul(arguments[2], number), number]),
            itemsize=number,
            meminfo=None,
        )
        return view._getvalue()

    return table(types.int64, types.int64, types.int64), code
