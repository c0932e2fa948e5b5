"""A scene without listed loads has kernels without a trace of them."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import magrod_env
from magrod_env import Magnet, Rod, Scene, Simulation

CALLS = re.compile(r"^ *(force, torque = |motion = )?(add_loads|add_resistance|count_power|settle_work)\(.*\)\n", re.M)
MNEMONICS = """
import sys
import numba
from magrod_env import Magnet, Rod, Scene, Simulation
from magrod_env.rod.stepping import run_blocks

rod = Rod.circular(length=60e-3, diameter=4e-3, density=1100.0, youngs_modulus=1.5e6, poissons_ratio=0.5)
magnet = Magnet.dipole(position=60e-3, moment=0.013)
for scene, options in (
    (Scene(rod=rod, magnets=(magnet,), gravity=(0.0, 0.0, -9.81)), {"num_rods": 8, "precision": "float32"}),
    (Scene(rod=rod, drag_rate=1.0), {"plane": "xz"}),
):
    batch = Simulation(scene, num_elements=4, time_step=1e-6, **options).rods.batch
    one = batch.dtype.type(1.0)
    arguments = (batch.blocks, 0, 1, batch.layout, batch.terms, 1, one, one, one, None)
    signature = tuple(numba.typeof(argument) for argument in arguments)
    run_blocks.compile(signature)
    wrapper = False  # of Python's arguments, which the named tuples shape
    for line in run_blocks.inspect_asm(signature).splitlines():
        if line.endswith(":") and not line.startswith((" ", ".", "#")):
            wrapper = "cpython" in line
        elif line.startswith("\\t") and not line.startswith("\\t.") and not wrapper:
            print(line.split()[0])
"""


def mnemonics(package, cache):
    """Instructions of two stepping kernels of a copy of the package, operands left out."""
    env = {**os.environ, "MAGROD_CACHE_DIR": str(cache), "PYTHONPATH": str(package.parent)}
    done = subprocess.run(
        [sys.executable, "-c", MNEMONICS], env=env, cwd=package.parent, capture_output=True, text=True, check=True
    )
    return done.stdout.split()


@pytest.mark.slow
def test_kernels_of_scenes_without_listed_loads_are_those_without_the_hub(tmp_path):
    """The stepping module, once as it is and once with its calls of the hub cut out: the same instructions."""
    found = []
    for name in ("whole", "cut"):
        package = tmp_path / name / "magrod_env"
        shutil.copytree(Path(magrod_env.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
        if name == "cut":
            stepping = package / "rod" / "stepping.py"
            text, count = CALLS.subn("", stepping.read_text())
            assert count == 4
            stepping.write_text(text)
        found.append(mnemonics(package, tmp_path / f"cache-{name}"))
    assert len(found[0]) > 1000
    assert found[0] == found[1]


def test_rows_of_listed_loads_are_there_only_where_a_scene_lists_them():
    rod = Rod.circular(length=60e-3, diameter=4e-3, density=1100.0, youngs_modulus=1.5e6, poissons_ratio=0.5)
    batch = Simulation(Scene(rod=rod, magnets=(Magnet.dipole(position=60e-3, moment=0.01),)), time_step=1e-6).rods.batch
    assert batch.terms.loads == () and batch.layout.loads == ()
