"""Calling a law by its address from compiled code."""

from __future__ import annotations

from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic  # type: ignore[untyped-decorator]
def call_law(
    typing: Any,
    address: Any,
    motion: Any,
    i: Any,
    parameters: Any,
    k: Any,
    memory: Any,
    m: Any,
    rates: Any,
    r: Any,
) -> Any:
    """Call the law at `address` with four flat arrays, each from its own offset on."""
    flat = types.Array(types.float64, 1, "C")
    signature = types.float64(types.int64, *(flat, types.int64) * 4)

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double, pointers = ir.DoubleType(), []
        for array in (1, 3, 5, 7):
            data = cgutils.create_struct_proxy(signature.args[array])(context, builder, arguments[array]).data
            pointers.append(builder.gep(data, [arguments[array + 1]]))
        function = ir.FunctionType(double, [double.as_pointer()] * 4).as_pointer()
        return builder.call(builder.inttoptr(arguments[0], function), pointers)

    return signature, code
