"""Calling a law by its address from compiled code."""

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
