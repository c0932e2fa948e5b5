"""The one place for numba options; compiled kernels are kept on disk by :mod:`magrod_env._cache`."""

import importlib

import numba
from numba.core import types
from numba.extending import NativeValue, models, register_model, typeof_impl, unbox

from magrod_env._cache import KernelCache


def _compile(function, **options):
    dispatcher = numba.njit(error_model="numpy", nogil=True, **options)(function)
    dispatcher._cache = KernelCache(function)  # what numba's enable_caching does with its own
    return dispatcher


def jit(function):
    """Compile ``function`` on first use: no Python objects, IEEE division, the GIL released, cached on disk."""
    return _compile(function)


def inline_jit(function):
    """Like :func:`jit`, and always inlined by LLVM into its caller: for the small functions that a step is made of."""
    return _compile(function, forceinline=True)


class Bound:
    """A kernel bound to the argument types of its first call, which later calls must repeat.

    For named tuples numba infers the argument types anew at every call, in Python, which takes 0.1 ms: as long as ten
    steps of a rod. A bound kernel does so once.
    """

    def __init__(self, kernel):
        self.kernel, self._entry = kernel, None

    def __call__(self, *arguments):
        if self._entry is None:
            self._entry = self.kernel.compile(tuple(numba.typeof(argument) for argument in arguments))
        return self._entry(*arguments)

    def __reduce__(self):
        return _bind, (self.kernel.__module__, self.kernel.__name__)


def _bind(module, name):
    return Bound(getattr(importlib.import_module(module), name))


class Present:
    """The type of :data:`PRESENT`, which marks a term that a kernel has; ``None`` marks one that it leaves out.

    numba prunes ``if term is None`` before it types a function only where the term's type says that it is, or is not,
    ``None``; a plain ``True`` does not. Both branches may then differ in types and shapes.
    """

    __slots__ = ()

    def __repr__(self):
        return "PRESENT"

    def __reduce__(self):
        return "PRESENT"


PRESENT = Present()


class PresentType(types.Type):
    """numba type of :data:`PRESENT`."""

    def __init__(self):
        super().__init__(name="present")

    @property
    def literal_type(self):
        """What numba's branch pruning compares with ``None``."""
        return self


@typeof_impl.register(Present)
def _type_of_present(value, context):
    return PresentType()


register_model(PresentType)(models.OpaqueModel)


@unbox(PresentType)
def _unbox_present(kind, value, context):
    return NativeValue(context.context.get_dummy_value())
