"""Compiled code is never older than the sources, and an absent term leaves no code behind."""

import ast
import copy
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import magrod_env
from magrod_env._jit import PRESENT, jit

HELPER = """
from magrod_env._jit import jit

@jit
def helper(x):
    return x + {added}
"""
KERNEL = """
from magrod_env._jit import jit
from magrod_env.helper import helper

@jit
def kernel(x):
    return helper(x)
"""
RUN = """
from magrod_env import _cache
from magrod_env.kernel import kernel
print(kernel(1.0), sum(kernel.stats.cache_hits.values()), _cache.cache_folder('magrod_env.kernel'))
"""


@pytest.fixture
def package(tmp_path):
    """A copy of the package with two small kernels, of which one calls the other."""
    copy_of = tmp_path / "magrod_env"
    shutil.copytree(Path(magrod_env.__file__).parent, copy_of, ignore=shutil.ignore_patterns("__pycache__"))
    (copy_of / "__init__.py").write_text("")  # the kernels alone: no need to load what they do not use
    (copy_of / "helper.py").write_text(HELPER.format(added=1))
    (copy_of / "kernel.py").write_text(KERNEL)
    return copy_of


def run(package, cache):
    """Result, cache hits and cache folder of the copied package's kernel, in a fresh process."""
    env = {**os.environ, "MAGROD_CACHE_DIR": str(cache), "PYTHONPATH": str(package.parent)}
    done = subprocess.run(
        [sys.executable, "-c", RUN], env=env, cwd=package.parent, capture_output=True, text=True, check=True
    )
    value, hits, folder = done.stdout.split()
    return float(value), int(hits), Path(folder)


def test_an_edit_to_a_helper_reaches_the_kernels_that_call_it(package, tmp_path):
    cache = tmp_path / "cache"
    first, hits, folder = run(package, cache)
    assert (first, hits) == (2.0, 0)
    assert folder.parent == cache
    assert run(package, cache) == (2.0, 1, folder)  # the second process compiles nothing
    (package / "helper.py").write_text(HELPER.format(added=10))
    edited, hits, new_folder = run(package, cache)
    assert (edited, hits) == (11.0, 0)
    assert new_folder != folder


SOURCES = Path(magrod_env.__file__).parent


def foreign_sources(path):
    """Modules that a file with kernels imports from beyond what the name of its cache folder depends on."""
    modules = {
        node.module: {name.name for name in node.names}
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and node.module.startswith("magrod_env")
    }
    if not {"jit", "inline_jit"} & modules.get("magrod_env._jit", set()):
        return []
    own = ".".join(["magrod_env", *path.relative_to(SOURCES).parts[:-1]])
    shared = ("magrod_env._jit", "magrod_env._simd", "magrod_env.rod")
    return [(path.name, module) for module in modules if not module.startswith((own + ".", *shared))]


def test_kernels_are_made_only_of_sources_that_their_cache_folder_is_named_by():
    assert [found for path in sorted(SOURCES.rglob("*.py")) for found in foreign_sources(path)] == []


def test_present_is_one_object_that_pickles_and_copies_to_itself():
    assert pickle.loads(pickle.dumps(PRESENT)) is PRESENT
    assert copy.copy(PRESENT) is PRESENT
    assert copy.deepcopy(PRESENT) is PRESENT
    assert repr(PRESENT) == "PRESENT"


@jit
def first_or_sum(term, numbers):
    """With the term a pair of floats, without it one float: the types of the branches differ."""
    if term is None:
        return numbers[0]
    return numbers[0], numbers[1]


@jit
def touches_what_is_not_there(term, numbers):
    """Indexes a number where the term is present: numba refuses to type this branch unless it is left out."""
    if term is not None:
        return numbers[0][0]
    return numbers[0]


def test_branches_of_absent_and_present_terms_may_differ_in_type():
    assert first_or_sum(None, (1.0, 2.0)) == 1.0
    assert first_or_sum(PRESENT, (1.0, 2.0)) == (1.0, 2.0)


def test_the_branch_of_an_absent_term_is_not_even_typed():
    assert touches_what_is_not_there(None, (1.0, 2.0)) == 1.0
    assert touches_what_is_not_there(PRESENT, ((1.0, 3.0), 2.0)) == 1.0


def test_kernels_divide_like_ieee():
    @jit
    def divide(a, b):
        return a / b

    assert divide(1.0, 0.0) == np.inf
    assert np.isnan(divide(0.0, 0.0))
