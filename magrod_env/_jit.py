"""The one place for numba options and for where compiled kernels are cached.

numba keys a cached kernel by the source file of the outermost function only: after an edit to a helper in another file
it would go on serving stale machine code. Kernels are therefore cached in a folder named by a digest of the sources
that they can be made of (their own subpackage, the rod's and the lane type), under ``MAGROD_CACHE_DIR``, else
``NUMBA_CACHE_DIR``, else the user's cache folder.
"""

import hashlib
import importlib
import os
import tempfile
from functools import lru_cache
from pathlib import Path

import numba
from numba.core import types
from numba.extending import NativeValue, models, register_model, typeof_impl, unbox

ROOT = Path(__file__).parent
SHARED = ("_jit.py", "_simd.py", "rod/*.py")  # what kernels anywhere may call


def _source_digest(module: str) -> str:
    """Hex digest over the Python sources of a module's folder in this package and of what is shared."""
    folder = "/".join(module.split(".")[1:-1]) if module.split(".")[0] == ROOT.name else "rod"
    digest = hashlib.sha256()
    for path in sorted({path for pattern in (*SHARED, f"{folder}/*.py") for path in ROOT.glob(pattern.lstrip("/"))}):
        digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


@lru_cache
def cache_folder(module: str) -> str:
    """A writable folder for the kernels of a module, by its name, in this version of the sources; a temporary one where
    the user's cache cannot be written.
    """
    base = os.environ.get("MAGROD_CACHE_DIR") or os.environ.get("NUMBA_CACHE_DIR")
    if not base:
        base = os.path.join(
            os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache"), "magrod"
        )
    folder = os.path.join(base, f"kernels-{_source_digest(module)}")
    try:
        os.makedirs(folder, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        folder = os.path.join(tempfile.gettempdir(), os.path.basename(folder))
    return folder


def _compile(function, **options):
    dispatcher = numba.njit(error_model="numpy", nogil=True, **options)(function)
    shared = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = cache_folder(function.__module__)  # read once, when the function's cache is created
    try:
        dispatcher.enable_caching()
    finally:
        numba.config.CACHE_DIR = shared
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
