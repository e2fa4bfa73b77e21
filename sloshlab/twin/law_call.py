"""Calling by address from compiled code: laws, and the engine, so that no caller compiles it again."""

from __future__ import annotations

from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic  # type: ignore[untyped-decorator]
def call_law(typing: Any, address: Any, arrays: Any, offsets: Any) -> Any:
    """Call the law at `address` with motion, parameters, memory and rates, flat arrays, each from an offset on."""
    # a pointer, not a typed callee: a new force compiles nothing but itself, and the engine stays as it is
    flat = types.Array(types.float64, 1, "C")
    signature = types.float64(types.int64, types.UniTuple(flat, 4), types.UniTuple(types.int64, 4))

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double, pointers = ir.DoubleType(), []
        places = (cgutils.unpack_tuple(builder, packed) for packed in arguments[1:])
        for array, offset in zip(*places, strict=True):
            data = cgutils.create_struct_proxy(flat)(context, builder, array).data
            pointers.append(builder.gep(data, [offset]))
        function = ir.FunctionType(double, [double.as_pointer()] * 4).as_pointer()
        return builder.call(builder.inttoptr(arguments[0], function), pointers)

    return signature, code


@intrinsic  # type: ignore[untyped-decorator]
def call_begin(typing: Any, address: Any, arguments: Any) -> Any:
    """Call `begin`, compiled for the types of these arguments, at its `address`; see `address_of`."""
    return _calling(types.int64, arguments)


@intrinsic  # type: ignore[untyped-decorator]
def call_integrate(typing: Any, address: Any, arguments: Any) -> Any:
    """Call `integrate`, likewise."""
    return _calling(types.UniTuple(types.int64, 3), arguments)


def _calling(returned: Any, arguments: Any) -> Any:
    # numba optimises what a loop calls once more within the loop, even what it hardly ever calls
    given = tuple(arguments)

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        convention = context.call_conv
        function = convention.get_function_type(returned, given).as_pointer()
        callee, unpacked = builder.inttoptr(values[0], function), cgutils.unpack_tuple(builder, values[1])
        # the engine raises nothing, so that there is no status to be looked at
        return convention.call_function(builder, callee, returned, given, unpacked)[1]

    return returned(types.int64, types.Tuple(given)), code
