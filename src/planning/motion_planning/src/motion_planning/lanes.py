# SPDX-License-Identifier: BSD-3-Clause
"""Sixteen floats at once, for numba: the type ``lanes`` with its arithmetic.

LLVM does not vectorize loops over short arrays here; an explicit vector type makes it do so.
Sixteen single floats are one register of AVX-512, two of AVX, four of SSE or NEON: LLVM splits wider vectors. Only
inside compiled functions:

    v = load(array, i)      # array[i : i + 16], float32, one axis; without a bounds check
    store(array, i, v)
    fill(x)                 # x in every lane; x is a float32
    ramp()                  # 0, 1, ... 15
    v + w, v - w, v * w, -v, v / w
    least(v, w), greatest(v, w), magnitude(v), root(v), whole(v)    # whole: the nearest whole number
    sine_and_cosine(v)
    below(v, w)             # int32, bit i is set where v[i] < w[i]
"""
from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel.models import PrimitiveModel
from numba.core.datamodel.registry import register_default
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic as _intrinsic
from numba.extending import lower_builtin, register_jitable

if TYPE_CHECKING:
    from numba.core.typing.templates import Signature

    Intrinsic = tuple[Signature, Callable[..., ir.Value]]

    class Vector(Protocol):
        """Sixteen floats in a compiled function."""

        def __add__(self, other: Vector) -> Vector: ...
        def __sub__(self, other: Vector) -> Vector: ...
        def __mul__(self, other: Vector) -> Vector: ...
        def __truediv__(self, other: Vector) -> Vector: ...
        def __neg__(self) -> Vector: ...

WIDTH = 16
# numba's own types say that the function itself is called, and nothing.
intrinsic = cast("Callable[[Callable[..., Intrinsic]], Callable[..., Any]]", _intrinsic)
_infer = cast("Callable[..., Any]", infer_global)

_VECTOR = ir.VectorType(ir.FloatType(), WIDTH)
_MASK = ir.VectorType(ir.IntType(1), WIDTH)
# A product and a sum may become one instruction. No other fast-math option: NaN must stay NaN.
_FLAGS = ("contract",)


class Lanes(types.Type):
    """The type of a vector of 16 floats in compiled code."""

    def __init__(self) -> None:
        super().__init__(name="lanes16")


lanes = Lanes()


@register_default(Lanes)
class _Model(PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: types.Type) -> None:
        super().__init__(dmm, fe_type, _VECTOR)


def _arithmetic(function: Callable[..., object], build: Callable[..., ir.Value]) -> None:
    """Give lanes an operator of two arguments."""

    class Template(ConcreteTemplate):
        cases = [signature(lanes, lanes, lanes)]

    _infer(function)(Template)

    @lower_builtin(function, lanes, lanes)
    def lower(context: Any, builder: Any, sig: Signature, args: Sequence[ir.Value]) -> ir.Value:
        return build(builder, *args)


_arithmetic(operator.add, lambda builder, a, b: builder.fadd(a, b, flags=_FLAGS))
_arithmetic(operator.sub, lambda builder, a, b: builder.fsub(a, b, flags=_FLAGS))
_arithmetic(operator.mul, lambda builder, a, b: builder.fmul(a, b, flags=_FLAGS))
_arithmetic(operator.truediv, lambda builder, a, b: builder.fdiv(a, b, flags=_FLAGS))


@_infer(operator.neg)
class _Negation(ConcreteTemplate):
    cases = [signature(lanes, lanes)]


@lower_builtin(operator.neg, lanes)
def _negate(context: Any, builder: Any, sig: Signature, args: Sequence[ir.Value]) -> ir.Value:
    return builder.fneg(args[0])


def _pointer(context: Any, builder: Any, array_type: types.Type, array: ir.Value, index: ir.Value) -> ir.Value:
    view = context.make_array(array_type)(context, builder, array)
    place = builder.gep(view.data, [index])
    return builder.bitcast(place, _VECTOR.as_pointer())


@intrinsic
def load(typingctx: Any, array: types.Type, index: types.Type) -> Intrinsic:
    """array[index : index + 16]."""
    def build(context: Any, builder: Any, sig: Signature, args: Sequence[ir.Value]) -> ir.Value:
        return builder.load(_pointer(context, builder, sig.args[0], *args), align=4)

    return lanes(array, types.intp), build


@intrinsic
def store(typingctx: Any, array: types.Type, index: types.Type, value: types.Type) -> Intrinsic:
    """array[index : index + 16] = value."""
    def build(context: Any, builder: Any, sig: Signature, args: Sequence[ir.Value]) -> ir.Value:
        builder.store(args[2], _pointer(context, builder, sig.args[0], *args[:2]), align=4)
        return context.get_dummy_value()

    return types.void(array, types.intp, lanes), build


@intrinsic
def fill(typingctx: Any, value: types.Type) -> Intrinsic:
    """The same float32 in all lanes."""
    def build(context: Any, builder: Any, sig: Signature, args: Sequence[ir.Value]) -> ir.Value:
        one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), args[0], cgutils.int32_t(0))
        order = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
        return builder.shuffle_vector(one, ir.Constant(_VECTOR, ir.Undefined), order)

    return lanes(types.float32), build


@intrinsic
def ramp(typingctx: Any) -> Intrinsic:
    """0, 1, ... 15."""
    def build(context: Any, builder: Any, sig: Signature, args: Sequence[ir.Value]) -> ir.Value:
        return ir.Constant(_VECTOR, [float(i) for i in range(WIDTH)])

    return lanes(), build


def _library(name: str, count: int) -> Intrinsic:
    """An intrinsic function of LLVM's on lanes."""
    def build(context: Any, builder: Any, sig: Signature, args: Sequence[ir.Value]) -> ir.Value:
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(_VECTOR, [_VECTOR] * count), "%s.v%df32" % (name, WIDTH))
        return builder.call(function, args)

    return lanes(*[lanes] * count), build


@intrinsic
def root(typingctx: Any, v: types.Type) -> Intrinsic:
    """Square roots."""
    return _library("llvm.sqrt", 1)


@intrinsic
def magnitude(typingctx: Any, v: types.Type) -> Intrinsic:
    """Absolute values."""
    return _library("llvm.fabs", 1)


@intrinsic
def whole(typingctx: Any, v: types.Type) -> Intrinsic:
    """The nearest whole numbers."""
    return _library("llvm.rint", 1)


def _choice(sign: str) -> Intrinsic:
    def build(context: Any, builder: Any, sig: Signature, args: Sequence[ir.Value]) -> ir.Value:
        return builder.select(builder.fcmp_ordered(sign, *args), *args)

    return lanes(lanes, lanes), build


@intrinsic
def least(typingctx: Any, v: types.Type, w: types.Type) -> Intrinsic:
    """The lesser of each two."""
    return _choice("<")


@intrinsic
def greatest(typingctx: Any, v: types.Type, w: types.Type) -> Intrinsic:
    """The greater of each two."""
    return _choice(">")


@intrinsic
def below(typingctx: Any, v: types.Type, w: types.Type) -> Intrinsic:
    """Bit i of the answer is set where v[i] < w[i]."""
    def build(context: Any, builder: Any, sig: Signature, args: Sequence[ir.Value]) -> ir.Value:
        found = builder.fcmp_ordered("<", *args)
        return builder.zext(builder.bitcast(found, ir.IntType(WIDTH)), ir.IntType(32))

    return types.int32(lanes, lanes), build


_PI_HIGH, _PI_LOW = np.float32(3.140625), np.float32(np.pi - 3.140625)
_ONE_OVER_PI, _HALF, _FOUR, _ONE = np.float32(1.0 / np.pi), np.float32(0.5), np.float32(4.0), np.float32(1.0)
# Taylor's series of sine and cosine, to the precision of single floats on [-pi/2, pi/2].
_S3, _S5, _S7 = np.float32(-1.0 / 6.0), np.float32(1.0 / 120.0), np.float32(-1.0 / 5040.0)
_S9, _S11 = np.float32(1.0 / 362880.0), np.float32(-1.0 / 39916800.0)
_C2, _C4, _C6 = np.float32(-0.5), np.float32(1.0 / 24.0), np.float32(-1.0 / 720.0)
_C8, _C10, _C12 = np.float32(1.0 / 40320.0), np.float32(-1.0 / 3628800.0), np.float32(1.0 / 479001600.0)


@register_jitable
def sine_and_cosine(x: Vector) -> tuple[Vector, Vector]:
    """Both share the turns that are taken off: x = turns pi + rest, |rest| <= pi / 2; odd turns change the signs."""
    turns = whole(x * fill(_ONE_OVER_PI))
    rest = (x - turns * fill(_PI_HIGH)) - turns * fill(_PI_LOW)
    square = rest * rest
    s = fill(_S9) + square * fill(_S11)
    s = fill(_S7) + square * s
    s = fill(_S5) + square * s
    s = fill(_S3) + square * s
    c = fill(_C10) + square * fill(_C12)
    c = fill(_C8) + square * c
    c = fill(_C6) + square * c
    c = fill(_C4) + square * c
    c = fill(_C2) + square * c
    halves = turns * fill(_HALF)
    sign = fill(_ONE) - magnitude(halves - whole(halves)) * fill(_FOUR)
    return (rest + rest * square * s) * sign, (fill(_ONE) + square * c) * sign
