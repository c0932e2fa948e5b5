"""Where compiled kernels are kept, whose files are read, and how they are written.

numba keys a cached kernel by the source file of the outermost function only: after an edit to a helper in another file
it would go on serving stale machine code. Kernels are therefore cached in a folder named by a digest of the sources
that they can be made of (their own subpackage, the rod's and the lane type), under ``MAGROD_CACHE_DIR``, else
``NUMBA_CACHE_DIR``, else the user's cache folder.

To read a kernel is to unpickle it, which runs whatever its writer wanted. Folders and files must therefore belong to
the user or to root, and nobody else may write them; others are left alone, with a warning. Where the cache cannot be
written, new kernels go to a folder of the user's own for temporary files.
"""

import atexit
import contextlib
import hashlib
import os
import pickle
import shutil
import stat
import tempfile
import warnings
from functools import lru_cache
from pathlib import Path

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator
from numba.core.serialize import dumps

ROOT = Path(__file__).parent
SHARED = ("_cache.py", "_jit.py", "_simd.py", "rod/**/*.py")  # what kernels anywhere may call, and how they are kept
DIGEST_SIZE = hashlib.sha256().digest_size
WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


# ---- folders


def _source_digest(module: str) -> str:
    """Hex digest over the Python sources of a module's folder in this package and of what is shared."""
    folder = "/".join(module.split(".")[1:-1]) if module.split(".")[0] == ROOT.name else "rod"
    digest = hashlib.sha256()
    for path in sorted({path for pattern in (*SHARED, f"{folder}/*.py") for path in ROOT.glob(pattern.lstrip("/"))}):
        digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


@lru_cache
def cache_folders(module: str) -> tuple[str, ...]:
    """Folders in which the kernels of a module, by its name, are looked for in turn; the last takes new ones.

    None where the cache cannot be trusted, nor a temporary folder be made: kernels then live as long as the process.
    """
    name = f"kernels-{_source_digest(module)}"
    regular = _regular_folder(name)
    if regular is not None and os.access(regular, os.W_OK | os.X_OK):
        return (regular,)
    return tuple(folder for folder in (regular, _temporary_folder(name)) if folder is not None)


def cache_folder(module: str) -> str:
    """The folder that takes the new kernels of a module; "" where there is none."""
    folders = cache_folders(module)
    return folders[-1] if folders else ""


def _regular_folder(name: str) -> str | None:
    """A folder in the user's cache, made where it is missing; None where it cannot be made or trusted."""
    base = os.environ.get("MAGROD_CACHE_DIR") or os.environ.get("NUMBA_CACHE_DIR")
    if not base:
        home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
        base = os.path.join(home, "magrod")
    try:
        return _own_folder(base, name)
    except Untrusted as error:
        _tell_once(
            "folder",
            f"the folder of compiled kernels must be yours or root's and writable by nobody else, but {error}: "
            "kernels go to temporary files instead; correct its owner and mode (chmod go-w), or set MAGROD_CACHE_DIR "
            "to a folder of your own.",
        )
    except OSError:  # a home that is read-only, full or missing is common, and a temporary folder does as well
        pass
    return None


def _temporary_folder(name: str) -> str | None:
    """A folder in the user's own among temporary files; where that cannot be trusted, in a fresh one."""
    user = os.geteuid() if hasattr(os, "geteuid") else "kernels"
    with contextlib.suppress(OSError, Untrusted):
        folder = _own_folder(os.path.join(tempfile.gettempdir(), f"magrod-{user}"), name, follow=False)
        if os.access(folder, os.W_OK | os.X_OK):
            return folder
    _tell_once(
        "process",
        "compiled kernels must be kept in a folder that is yours alone, but neither your cache nor one for temporary "
        "files is: every process compiles them again; set MAGROD_CACHE_DIR to a folder of your own.",
    )
    with contextlib.suppress(OSError):
        return _own_folder(_fresh_folder(), name)
    return None


@lru_cache(maxsize=1)
def _fresh_folder() -> str:
    """A new private folder, removed when this process ends."""
    folder, process = tempfile.mkdtemp(prefix="magrod-"), os.getpid()

    def remove():
        if os.getpid() == process:  # and not when a forked child ends
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    return folder


# ---- trust


class Untrusted(Exception):
    """Somebody else could have written what lies here; the text says why."""


def _own_folder(base: str, name: str, *, follow: bool = True) -> str:
    """Folder ``name`` in ``base``, both made where they are missing and checked; ``base`` may be a link to follow.

    Others may write ``base`` if its sticky bit keeps them from renaming what is not theirs, as in /tmp.
    """
    base = os.path.realpath(base) if follow else base
    folder = os.path.join(base, name)
    _make(base)
    _check(base, os.lstat(base), sticky=follow)
    _make(folder)
    _check(folder, os.lstat(folder))
    return folder


def _make(folder: str) -> None:
    """Make a folder that only the user may enter, unless something of its name is there."""
    if not os.path.lexists(folder):
        os.makedirs(os.path.dirname(folder), exist_ok=True)
        with contextlib.suppress(FileExistsError):  # another process was faster
            os.mkdir(folder, 0o700)


def _check(path: str, found: os.stat_result, *, sticky: bool = False, kind=stat.S_ISDIR) -> None:
    """Raise Untrusted unless a path is of its kind and nobody but the user and root could have written it."""
    if not kind(found.st_mode):
        raise Untrusted(f"{path} is something else")
    if not hasattr(os, "geteuid"):  # Windows: profile and temporary folders are the user's own
        return
    if found.st_uid not in (os.geteuid(), 0):
        raise Untrusted(f"{path} belongs to the user with number {found.st_uid}")
    if found.st_mode & WRITABLE_BY_OTHERS and not (sticky and found.st_mode & stat.S_ISVTX):
        raise Untrusted(f"{path} has the mode {stat.S_IMODE(found.st_mode):o}")


_told: set[str] = set()


def _tell_once(subject: str, text: str) -> None:
    """Warn, once a process about each subject."""
    if subject not in _told:
        _told.add(subject)
        warnings.warn(text, RuntimeWarning, stacklevel=3)


# ---- files


class _Locator(UserProvidedCacheLocator):
    """numba's description of a source file, without its test that a folder can be written."""

    @classmethod
    def from_function(cls, function, path):
        """None for a function that is not in a file of its own, as in a zip archive: numba has locators for those."""
        return cls(function, path) if os.path.exists(path) else None


class _CompileResult(CompileResultCacheImpl):
    """numba's way to turn a kernel into bytes and back."""

    _locator_classes = [_Locator, *CompileResultCacheImpl._locator_classes]


class KernelCache(FunctionCache):
    """numba's cache of a function, with one file for each signature, named by a digest of all that it is made from.

    numba itself keeps an index of numbered files, which two processes that compile at once can mix up, and stops where
    a file is damaged or cannot be written. Here a file carries its own key and checksum: one that does not fit is
    compiled again.
    """

    _impl_class = _CompileResult

    def __init__(self, function):
        super().__init__(function)
        self._folders = cache_folders(function.__module__)
        self._cache_path = cache_folder(function.__module__)

    def load_overload(self, sig, target_context):
        """The kernel of a signature from the first folder that has it whole, or None."""
        target_context.refresh()
        key = self._index_key(sig, target_context.codegen())
        for folder in self._folders if self._enabled else ():
            path = os.path.join(folder, self._name_of(key))
            try:
                return self._impl.rebuild(target_context, _read(path, key))
            except FileNotFoundError:
                continue
            except Exception as error:  # what a damaged pickle raises can be anything
                _tell_once(
                    "read", f"the compiled kernel {path} cannot be used ({_words(error)}): it is compiled again."
                )
        return None

    def save_overload(self, sig, data):
        """Keep the kernel of a signature, if it can be kept."""
        if not (self._enabled and self._folders and self._impl.check_cachable(data)):
            return
        key = self._index_key(sig, data.codegen)
        try:
            _write(os.path.join(self._folders[-1], self._name_of(key)), dumps((key, self._impl.reduce(data))))
        except OSError as error:
            _tell_once(
                "write",
                f"compiled kernels cannot be saved in {self._folders[-1]} ({_words(error)}): every process compiles "
                "them again; make room there, or set MAGROD_CACHE_DIR to another folder.",
            )

    def flush(self):
        """Forget the kept kernels of this function."""
        for path in Path(self._cache_path).glob(f"{self._impl.filename_base}.*.nbc"):
            path.unlink(missing_ok=True)

    def _name_of(self, key):
        made_from = (numba.__version__, self._impl.locator.get_source_stamp(), key)
        return f"{self._impl.filename_base}.{hashlib.sha256(str(made_from).encode()).hexdigest()[:32]}.nbc"


def _read(path, key):
    """What was written under a key.

    Raises:
        FileNotFoundError: where there is none, or one of another key.
        ValueError: on a damaged file.
        Untrusted: where somebody else could have written it.
    """
    with open(path, "rb") as file:
        _check("it", os.fstat(file.fileno()), kind=stat.S_ISREG)
        checksum, content = file.read(DIGEST_SIZE), file.read()
    if hashlib.sha256(content).digest() != checksum:
        raise ValueError("its checksum is wrong")
    kept, data = pickle.loads(content)
    if kept != key:
        raise FileNotFoundError(path)
    return data


def _write(path, content):
    """Write a file under another name and rename it, so that a reader finds all of it or none."""
    _make(os.path.dirname(path))
    descriptor, partial = tempfile.mkstemp(dir=os.path.dirname(path), suffix=".tmp")
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(hashlib.sha256(content).digest() + content)
        os.replace(partial, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(partial)
        raise


def _words(error):
    return str(error) or type(error).__name__
