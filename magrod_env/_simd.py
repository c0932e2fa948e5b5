"""Numbers that are several rods wide: SIMD vectors as a numba type.

A kernel is written once, with ``+ - * /``, for one rod. Its numbers come from :func:`load`, which reads the same
quantity of ``len(lanes)`` neighbouring rods as one LLVM vector, so every operation in the kernel is a packed
instruction, whatever the loop vectoriser thinks. Every lane is computed with the same IEEE operations in the same order
for every lane count; a batch therefore gives the same bits as single rods, and a rod that turns to NaN stays in its
lane.

Functions built only from arithmetic, :func:`square_root`, :func:`minimum`, :func:`maximum` and :func:`where_above` also
accept plain floats.
"""

import operator

from llvmlite import ir
from numba.core import types
from numba.core.cgutils import get_or_insert_function
from numba.extending import intrinsic, lower_builtin, models, overload, register_model, type_callable


class LaneType(types.Type):
    """numba type: ``count`` floats of one scalar type, one for each rod of a lane block."""

    def __init__(self, scalar, count):
        self.scalar = scalar
        self.count = count
        super().__init__(name=f"lanes({scalar} x {count})")


@register_model(LaneType)
class LaneModel(models.PrimitiveModel):
    """Lane numbers live in LLVM vector registers."""

    def __init__(self, dmm, fe_type):
        bits = ir.DoubleType() if fe_type.scalar == types.float64 else ir.FloatType()
        super().__init__(dmm, fe_type, ir.VectorType(bits, fe_type.count))


def _spread(context, builder, value, from_type, lane_type):
    """A scalar of any numeric type as a vector with that value in every lane."""
    if isinstance(from_type, LaneType):
        return value
    scalar = context.cast(builder, value, from_type, lane_type.scalar)
    vector = context.get_value_type(lane_type)
    if isinstance(scalar, ir.Constant):
        return ir.Constant(vector, [scalar] * lane_type.count)
    index = ir.Constant(ir.IntType(32), 0)
    first = builder.insert_element(ir.Constant(vector, ir.Undefined), scalar, index)
    mask = ir.Constant(ir.VectorType(ir.IntType(32), lane_type.count), [0] * lane_type.count)
    return builder.shuffle_vector(first, ir.Constant(vector, ir.Undefined), mask)


def _lane_result(a, b):
    """Type of a binary operation with at least one lane number, else None."""
    if isinstance(a, LaneType) and isinstance(b, LaneType):
        return a if a == b else None
    if isinstance(a, LaneType) and isinstance(b, types.Number):
        return a
    if isinstance(b, LaneType) and isinstance(a, types.Number):
        return b
    return None


def _define_binary(operation, instruction):
    @type_callable(operation)
    def type_binary(context):
        return _lane_result

    def lower_binary(context, builder, signature, arguments):
        lane_type = signature.return_type
        a, b = (
            _spread(context, builder, value, kind, lane_type)
            for value, kind in zip(arguments, signature.args, strict=True)
        )
        return getattr(builder, instruction)(a, b, flags=("contract",))

    for left, right in ((LaneType, LaneType), (LaneType, types.Number), (types.Number, LaneType)):
        lower_builtin(operation, left, right)(lower_binary)


for _operation, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _define_binary(_operation, _instruction)


@type_callable(operator.neg)
def _type_negate(context):
    return lambda a: a if isinstance(a, LaneType) else None


@lower_builtin(operator.neg, LaneType)
def _lower_negate(context, builder, signature, arguments):
    return builder.fneg(arguments[0])


def _is_real(kind):
    return isinstance(kind, (LaneType, types.Float))


def _call_llvm(name, context, builder, signature, arguments):
    """Call an LLVM intrinsic that is overloaded on floats and vectors, such as ``llvm.sqrt.v8f64``."""
    kind = signature.return_type
    prefix = f"v{kind.count}f{kind.scalar.bitwidth}" if isinstance(kind, LaneType) else f"f{kind.bitwidth}"
    value = context.get_value_type(kind)
    function_type = ir.FunctionType(value, [value] * len(arguments))
    return builder.call(get_or_insert_function(builder.module, function_type, f"{name}.{prefix}"), arguments)


@intrinsic
def square_root(typingctx, x):
    """IEEE square root of a float or of every lane."""
    if not _is_real(x):
        return None
    return x(x), lambda *call: _call_llvm("llvm.sqrt", *call)


def _extremum(name):
    def define(typingctx, a, b):
        kind = a if _is_real(a) and a == b else _lane_result(a, b)
        if kind is None:
            return None

        def lower(context, builder, signature, arguments):
            lane_type = signature.return_type
            if isinstance(lane_type, LaneType):
                arguments = [
                    _spread(context, builder, value, k, lane_type)
                    for value, k in zip(arguments, signature.args, strict=True)
                ]
            return _call_llvm(name, context, builder, signature, arguments)

        return kind(a, b), lower

    return define


minimum = intrinsic(_extremum("llvm.minnum"))
maximum = intrinsic(_extremum("llvm.maxnum"))


@intrinsic
def where_above(typingctx, a, b, above, otherwise):
    """``above`` where a > b, else ``otherwise``: all floats, or all lanes."""
    if not _is_real(a) or not a == b == above == otherwise:
        return None

    def lower(context, builder, signature, arguments):
        return builder.select(builder.fcmp_ordered(">", arguments[0], arguments[1]), arguments[2], arguments[3])

    return a(a, b, above, otherwise), lower


def _constant(context, kind, value):
    """An LLVM constant of a real type."""
    return ir.Constant(context.get_value_type(kind), [value] * kind.count if isinstance(kind, LaneType) else value)


def polynomial(double, single):
    """A polynomial of a float or of every lane, coefficients from the constant on; float32 lanes take ``single``.

    Evaluated in pairs, in double also pairs of pairs, which do not wait for each other (Estrin), then as a polynomial
    in x^2 or x^4 by Horner's scheme. Higher powers would underflow: where a rod is almost straight, x^8 of a float32 is
    a subnormal number, on which processors take a hundred times as long.
    """

    @intrinsic
    def evaluate(typingctx, x):
        if not _is_real(x):
            return None

        def lower(context, builder, signature, arguments):
            single_precision = getattr(x, "scalar", x) == types.float32
            terms = [_constant(context, x, value) for value in (single if single_precision else double)]
            power = arguments[0]

            def add_product(low, factor, high):
                return builder.fadd(low, builder.fmul(factor, high, flags=("contract",)), flags=("contract",))

            for _ in range(1 if single_precision else 2):
                pairs = [add_product(low, power, high) for low, high in zip(terms[::2], terms[1::2], strict=False)]
                terms = pairs + terms[2 * len(pairs) :]
                power = builder.fmul(power, power, flags=("contract",))
            while len(terms) > 1:
                terms[-2:] = [add_product(terms[-2], power, terms[-1])]
            return terms[0]

        return x(x), lower

    return evaluate


def _address(context, builder, array_type, array, index, vector):
    data = context.make_array(array_type)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), vector.as_pointer())


@intrinsic
def _load(typingctx, buffer, index, lanes):
    lane_type = LaneType(buffer.dtype, len(lanes))

    def lower(context, builder, signature, arguments):
        vector = context.get_value_type(lane_type)
        pointer = _address(context, builder, signature.args[0], arguments[0], arguments[1], vector)
        return builder.load(pointer, align=buffer.dtype.bitwidth // 8)

    return lane_type(buffer, types.intp, lanes), lower


@intrinsic
def _store(typingctx, buffer, index, value):
    lane_type = LaneType(buffer.dtype, value.count) if isinstance(value, LaneType) else None
    if lane_type != value:
        return None

    def lower(context, builder, signature, arguments):
        vector = context.get_value_type(lane_type)
        pointer = _address(context, builder, signature.args[0], arguments[0], arguments[1], vector)
        # what is stored is rounded: no product may be fused with a sum that loads it again, as it would be only where
        # the compiler keeps it in a register, which depends on the lane count
        stored = _call_llvm("llvm.arithmetic.fence", context, builder, value(value), [arguments[2]])
        builder.store(stored, pointer, align=buffer.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.void(buffer, types.intp, value), lower


@intrinsic
def constant(typingctx, value, like):
    """The scalar ``value`` in every lane of a number like ``like`` (or as a plain float)."""
    target = like if isinstance(like, LaneType) else types.float64

    def lower(context, builder, signature, arguments):
        if isinstance(target, LaneType):
            return _spread(context, builder, arguments[0], signature.args[0], target)
        return context.cast(builder, arguments[0], signature.args[0], target)

    return target(value, like), lower


def load(buffer, row, lanes):
    """Row ``row`` of a lane block: ``buffer[row*L : (row+1)*L]`` with ``L = len(lanes)``, as one number."""
    raise NotImplementedError("only inside compiled code")


def store(buffer, row, value, lanes):
    """Write one lane number to row ``row`` of a lane block."""
    raise NotImplementedError("only inside compiled code")


@overload(load, inline="never")
def _load_overload(buffer, row, lanes):
    width = len(lanes)
    return lambda buffer, row, lanes: _load(buffer, row * width, lanes)


@overload(store, inline="never")
def _store_overload(buffer, row, value, lanes):
    width = len(lanes)
    return lambda buffer, row, value, lanes: _store(buffer, row * width, value)
