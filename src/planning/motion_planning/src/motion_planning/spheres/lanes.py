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
    below(v, w)             # int32, bit i is set where v[i] < w[i]
"""
import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import register_default
from numba.core.datamodel.models import PrimitiveModel
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin

WIDTH = 16

_VECTOR = ir.VectorType(ir.FloatType(), WIDTH)
_MASK = ir.VectorType(ir.IntType(1), WIDTH)
# A product and a sum may become one instruction. No other fast-math option: NaN must stay NaN.
_FLAGS = ("contract",)


class Lanes(types.Type):
    """The type of a vector of 16 floats in compiled code."""

    def __init__(self):
        super().__init__(name="lanes16")


lanes = Lanes()


@register_default(Lanes)
class _Model(PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, _VECTOR)


def _arithmetic(function, build):
    """Give lanes an operator of two arguments."""

    class Template(ConcreteTemplate):
        cases = [signature(lanes, lanes, lanes)]

    infer_global(function)(Template)

    @lower_builtin(function, lanes, lanes)
    def lower(context, builder, sig, args):
        return build(builder, *args)


_arithmetic(operator.add, lambda builder, a, b: builder.fadd(a, b, flags=_FLAGS))
_arithmetic(operator.sub, lambda builder, a, b: builder.fsub(a, b, flags=_FLAGS))
_arithmetic(operator.mul, lambda builder, a, b: builder.fmul(a, b, flags=_FLAGS))
_arithmetic(operator.truediv, lambda builder, a, b: builder.fdiv(a, b, flags=_FLAGS))


@infer_global(operator.neg)
class _Negation(ConcreteTemplate):
    cases = [signature(lanes, lanes)]


@lower_builtin(operator.neg, lanes)
def _negate(context, builder, sig, args):
    return builder.fneg(args[0])


def _pointer(context, builder, array_type, array, index):
    view = context.make_array(array_type)(context, builder, array)
    place = builder.gep(view.data, [index])
    return builder.bitcast(place, _VECTOR.as_pointer())


@intrinsic
def load(typingctx, array, index):
    """array[index : index + 16]."""
    def build(context, builder, sig, args):
        return builder.load(_pointer(context, builder, sig.args[0], *args), align=4)

    return lanes(array, types.intp), build


@intrinsic
def store(typingctx, array, index, value):
    """array[index : index + 16] = value."""
    def build(context, builder, sig, args):
        builder.store(args[2], _pointer(context, builder, sig.args[0], *args[:2]), align=4)
        return context.get_dummy_value()

    return types.void(array, types.intp, lanes), build


@intrinsic
def fill(typingctx, value):
    """The same float32 in all lanes."""
    def build(context, builder, sig, args):
        one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), args[0], cgutils.int32_t(0))
        order = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
        return builder.shuffle_vector(one, ir.Constant(_VECTOR, ir.Undefined), order)

    return lanes(types.float32), build


@intrinsic
def ramp(typingctx):
    """0, 1, ... 15."""
    def build(context, builder, sig, args):
        return ir.Constant(_VECTOR, [float(i) for i in range(WIDTH)])

    return lanes(), build


def _library(name, count):
    """An intrinsic function of LLVM's on lanes."""
    def build(context, builder, sig, args):
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(_VECTOR, [_VECTOR] * count), "%s.v%df32" % (name, WIDTH))
        return builder.call(function, args)

    return lanes(*[lanes] * count), build


@intrinsic
def root(typingctx, v):
    """Square roots."""
    return _library("llvm.sqrt", 1)


@intrinsic
def magnitude(typingctx, v):
    """Absolute values."""
    return _library("llvm.fabs", 1)


@intrinsic
def whole(typingctx, v):
    """The nearest whole numbers."""
    return _library("llvm.rint", 1)


def _choice(sign):
    def build(context, builder, sig, args):
        return builder.select(builder.fcmp_ordered(sign, *args), *args)

    return lanes(lanes, lanes), build


@intrinsic
def least(typingctx, v, w):
    """The lesser of each two."""
    return _choice("<")


@intrinsic
def greatest(typingctx, v, w):
    """The greater of each two."""
    return _choice(">")


@intrinsic
def below(typingctx, v, w):
    """Bit i of the answer is set where v[i] < w[i]."""
    def build(context, builder, sig, args):
        found = builder.fcmp_ordered("<", *args)
        return builder.zext(builder.bitcast(found, ir.IntType(WIDTH)), ir.IntType(32))

    return types.int32(lanes, lanes), build
