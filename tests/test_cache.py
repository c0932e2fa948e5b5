"""Kernels on disk: whose files are read, what becomes of damaged ones, and of several processes at once."""

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

import magrod_env
from magrod_env import _cache
from magrod_env._cache import KernelCache, Untrusted, cache_folder

UNIX = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="Windows has no owners and modes of this kind")
ROOT = pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can act as someone else")
NOBODY = 65534

KERNEL = """
from magrod_env._jit import jit

@jit
def kernel(x):
    return x + x
"""
RUN = """
import sys
from magrod_env import _cache
from magrod_env.kernel import kernel
kinds = {"float": float, "int": int, "complex": complex}
print(*(kernel(kinds[name](1)) for name in sys.argv[1:]))
print(sum(kernel.stats.cache_hits.values()), _cache.cache_folder("magrod_env.kernel"))
"""


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """A copy of the package's cache with one small kernel."""
    parent = tmp_path_factory.mktemp("package")
    folder = parent / "magrod_env"
    folder.mkdir()
    for name in ("_cache.py", "_jit.py"):
        shutil.copy(Path(magrod_env.__file__).parent / name, folder)
    (folder / "__init__.py").write_text("")
    (folder / "kernel.py").write_text(KERNEL)
    return folder


def start(package, cache, *kinds, **options):
    """Begin a fresh process that runs the kernel on numbers of some kinds."""
    variables = {"MAGROD_CACHE_DIR": str(cache), "PYTHONPATH": str(package.parent), "PYTHONDONTWRITEBYTECODE": "1"}
    env = {**os.environ, **variables, **options.pop("env", {})}
    command = [sys.executable, "-c", options.pop("first", "") + RUN, *(kinds or ["float"])]
    options |= {"cwd": package.parent, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, env=env, **options)


def finish(process):
    """Its results, cache hits, cache folder and what it said."""
    out, said = process.communicate(timeout=120)
    assert process.returncode == 0, said
    results, facts = out.splitlines()
    hits, folder = facts.split(maxsplit=1)
    return results, int(hits), Path(folder), said


def run(package, cache, *kinds, **options):
    return finish(start(package, cache, *kinds, **options))


@pytest.fixture(scope="module")
def filled(package, tmp_path_factory):
    """A cache with three kernels, to copy."""
    cache = tmp_path_factory.mktemp("filled")
    results, hits, _, said = run(package, cache, "float", "int", "complex")
    assert (results, hits, said) == ("2.0 2 (2+0j)", 0, "")
    return cache


@pytest.fixture
def cache(filled, tmp_path):
    """A copy of a cache with three kernels."""
    return Path(shutil.copytree(filled, tmp_path / "cache"))


def files(cache):
    return sorted(Path(cache).rglob("*.nbc"))


# ---- whose files


def as_found(mode, owner):
    """What the system says of a path with a mode and an owner."""
    return os.stat_result((mode, 1, 1, 1, owner, owner, 0, 0, 0, 0))


@UNIX
def test_only_the_user_and_root_may_have_written_a_folder(monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    for owner, mode in ((1000, 0o700), (1000, 0o755), (0, 0o755)):
        _cache._check("here", as_found(stat.S_IFDIR | mode, owner))
    for owner, mode in ((1001, 0o700), (1001, 0o755), (1000, 0o775), (1000, 0o777), (0, 0o1777)):
        with pytest.raises(Untrusted, match="here"):
            _cache._check("here", as_found(stat.S_IFDIR | mode, owner))


@UNIX
def test_root_trusts_nobody_else(monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    with pytest.raises(Untrusted, match="1000"):
        _cache._check("here", as_found(stat.S_IFDIR | 0o700, 1000))


@UNIX
@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFREG, stat.S_IFIFO])
def test_a_link_or_a_file_is_no_folder(kind):
    with pytest.raises(Untrusted, match="something else"):
        _cache._check("here", as_found(kind | 0o700, os.geteuid()))


@UNIX
def test_new_folders_are_closed_to_others(package, tmp_path):
    old = os.umask(0)
    try:
        _, _, folder, _ = run(package, tmp_path / "cache")
    finally:
        os.umask(old)
    assert folder.parent == tmp_path / "cache"
    (kernel,) = files(folder)
    assert [stat.S_IMODE(path.stat().st_mode) for path in (folder.parent, folder, kernel)] == [0o700, 0o700, 0o600]


@UNIX
@pytest.mark.parametrize("mode", [0o777, 0o775, 0o722])
def test_a_folder_that_others_may_write_is_left_alone_with_a_word(package, tmp_path, mode):
    cache = tmp_path / "cache"
    cache.mkdir()
    cache.chmod(mode)
    (tmp_path / "temporary").mkdir()
    results, _, folder, said = run(package, cache, env={"TMPDIR": str(tmp_path / "temporary")})
    assert results == "2.0"
    assert tmp_path / "temporary" in folder.parents
    assert said.count("RuntimeWarning") == 1 and f"mode {mode:o}" in said and "chmod go-w" in said
    assert not list(cache.iterdir())


@UNIX
def test_a_folder_inside_tmp_may_be_named_and_a_link_there_may_not_stand_for_it(package, tmp_path):
    """/tmp, where everybody may write and the sticky bit keeps everybody's folders theirs."""
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o1777)
    _, _, folder, said = run(package, shared)
    assert folder.parent == shared and not said
    folder.rename(tmp_path / "elsewhere")
    folder.symlink_to(tmp_path / "elsewhere")
    _, hits, other, said = run(package, shared, env={"TMPDIR": str(tmp_path)})
    assert hits == 0 and other.parent != shared and "something else" in said


@ROOT
def test_the_cache_of_someone_else_is_left_alone(package, cache, tmp_path):
    for path in (cache, *cache.rglob("*")):
        os.chown(path, NOBODY, NOBODY)
    _, hits, folder, said = run(package, cache, env={"TMPDIR": str(tmp_path)})
    assert hits == 0 and cache not in folder.parents and f"number {NOBODY}" in said


@ROOT
def test_files_of_someone_else_are_not_even_unpickled(package, cache):
    """As when the folder is exchanged after it was checked."""
    for kernel in files(cache):
        os.chown(kernel, NOBODY, NOBODY)
    results, hits, _, said = run(package, cache)
    assert (results, hits) == ("2.0", 0)
    assert f"number {NOBODY}" in said


@ROOT
@pytest.mark.parametrize("squatter", ["folder", "link"])
def test_a_foreign_folder_among_temporary_files_is_not_entered(package, tmp_path, squatter):
    tmp_path.chmod(0o1777)
    taken = tmp_path / f"magrod-{os.geteuid()}"
    if squatter == "folder":
        taken.mkdir()
        os.chown(taken, NOBODY, NOBODY)
    else:
        (tmp_path / "target").mkdir(mode=0o700)
        taken.symlink_to(tmp_path / "target")
    _, _, folder, said = run(package, "/dev/null/cache", env={"TMPDIR": str(tmp_path)})
    assert folder.parent.parent == tmp_path and folder.parent != taken
    assert "every process compiles them again" in said
    assert not folder.parent.exists()  # removed at exit
    assert not list(taken.iterdir())


# ---- no place to write


def test_a_cache_folder_that_cannot_be_written_is_replaced_by_one_that_is_kept(package, tmp_path):
    temporary = {"TMPDIR": str(tmp_path)}
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    results, hits, folder, said = run(package, blocked / "cache", env=temporary)
    assert (results, hits, said) == ("2.0", 0, "")
    assert folder.parent.parent == tmp_path
    if hasattr(os, "geteuid"):
        assert stat.S_IMODE(folder.parent.stat().st_mode) == 0o700
    assert run(package, blocked / "cache", env=temporary) == ("2.0", 1, folder, "")


READ_ONLY = """
import os
access = os.access
os.access = lambda path, mode: access(path, mode) and not str(path).startswith(os.environ["MAGROD_CACHE_DIR"])
"""  # root may write everywhere


def test_a_read_only_cache_serves_and_new_kernels_go_elsewhere(package, cache, tmp_path):
    for path in files(cache)[1:]:
        path.unlink()
    for path in (*cache.rglob("*"), cache):
        path.chmod(0o555 if path.is_dir() else 0o444)
    kinds = ("float", "int", "complex")
    results, hits, folder, said = run(package, cache, *kinds, first=READ_ONLY, env={"TMPDIR": str(tmp_path)})
    assert (results, hits, said) == ("2.0 2 (2+0j)", 1, "")
    assert folder.parent.parent == tmp_path and folder.parent != cache
    assert run(package, cache, *kinds, first=READ_ONLY, env={"TMPDIR": str(tmp_path)})[1] == 3
    assert len(files(cache)) == 1 and len(files(folder)) == 2


LIMITED = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))  # a write beyond fails, as on a full disk
"""


@UNIX
def test_a_disk_without_room_costs_a_warning_only(package, tmp_path):
    results, hits, _, said = run(package, tmp_path, "float", "int", first=LIMITED)
    assert (results, hits) == ("2.0 2", 0)
    assert said.count("RuntimeWarning") == 1 and "cannot be saved" in said
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]  # no halves are left


# ---- damaged files


def flip(content):
    """One bit in the machine code."""
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


DAMAGES = [
    (lambda content: b"", lambda content: content[:20], lambda content: content[:-1]),
    (flip, lambda content: content + b"x", lambda content: b"\x80\x04." * 50),
]


@pytest.mark.parametrize("damages", DAMAGES, ids=["cut short", "altered"])
def test_damaged_kernels_are_compiled_again_saying_so_once(package, cache, damages):
    for path, damage in zip(files(cache), damages, strict=True):
        path.write_bytes(damage(path.read_bytes()))
    results, hits, _, said = run(package, cache, "float", "int", "complex")
    assert (results, hits) == ("2.0 2 (2+0j)", 0)
    assert said.count("RuntimeWarning") == 1 and "compiled again" in said
    assert run(package, cache, "float", "int", "complex")[1::2] == (3, "")


def test_a_folder_in_place_of_a_kernel_does_no_harm(package, cache):
    for kernel in files(cache):
        kernel.unlink()
        kernel.mkdir()
    results, hits, _, said = run(package, cache)
    assert (results, hits) == ("2.0", 0)
    assert "cannot be used" in said and "cannot be saved" in said


def test_a_kernel_under_the_name_of_another_is_not_taken_for_it(package, cache):
    """A collision of names, and what numba's numbered files come to when two processes compile at once."""
    first, second, third = files(cache)
    content = first.read_bytes()
    shutil.copy(second, first)
    shutil.copy(third, second)
    third.write_bytes(content)
    assert run(package, cache, "float", "int", "complex")[:2] == ("2.0 2 (2+0j)", 0)


def test_processes_that_compile_at_once_leave_whole_kernels(package, tmp_path):
    kinds = [("float",), ("int",), ("complex",), ("int", "float")]
    for started, kind in [(start(package, tmp_path, *kind), kind) for kind in kinds]:
        results, _, _, said = finish(started)
        assert results == " ".join({"float": "2.0", "int": "2", "complex": "(2+0j)"}[name] for name in kind)
        assert not said
    results, hits, _, said = run(package, tmp_path, "float", "int", "complex")
    assert (results, hits, said) == ("2.0 2 (2+0j)", 3, "")
    assert len(files(tmp_path)) == 3


# ---- what a folder is named by


def test_kernels_are_cached_in_a_folder_named_by_the_sources_of_their_subpackage():
    folders = {cache_folder(f"magrod_env.{module}") for module in ("rod.energy", "envs.observing", "scene")}
    assert len(folders) == 3
    assert cache_folder("magrod_env.rod.stepping") == cache_folder("magrod_env.rod.energy")
    assert all(Path(folder).name.startswith("kernels-") and Path(folder).is_dir() for folder in folders)


def test_forgetting_a_kernel_removes_its_files_and_no_others(tmp_path, monkeypatch):
    def first(x):
        return x

    cache = KernelCache(first)
    cache._cache_path = str(tmp_path)
    own, other = tmp_path / f"{cache._impl.filename_base}.12.nbc", tmp_path / "other.12.nbc"
    own.touch()
    other.touch()
    cache.flush()
    assert list(tmp_path.iterdir()) == [other]
