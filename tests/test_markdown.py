"""Every Python block of the README and of the pages under docs/ runs as it stands."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from magrod_env import Simulation, load_scene

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCKS = {
    f"{page.relative_to(ROOT)}, block {number}": block
    for page in PAGES
    for number, block in enumerate(re.findall(r"```python\n(.*?)```", page.read_text(), re.S))
}
RUN_EACH = """
import json, os, sys, tempfile, traceback
import gymnasium, numba, numpy  # loaded once; a block finds nothing of this package loaded

def run(block):
    os.chdir(tempfile.mkdtemp(dir=os.getcwd()))
    try:
        exec(block, {"__name__": "__main__"})
    except BaseException:
        traceback.print_exc()
        os._exit(1)
    os._exit(0)

failed = 0
for name, block in json.load(sys.stdin).items():
    child = os.fork() or run(block)
    if os.waitpid(child, 0)[1]:
        failed = 1
        print(f"failed: {name}", file=sys.stderr)
sys.exit(failed)
"""


def test_every_python_block_runs(tmp_path):
    """Each in a process and a folder of its own, forked from one that has loaded what all need."""
    command = [sys.executable, "-c", RUN_EACH]
    done = subprocess.run(command, input=json.dumps(BLOCKS), cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_to_files_resolve(page):
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text()):
        if not target.startswith(("http://", "https://", "mailto:")):
            assert (page.parent / target).exists(), target


# ---- what the recipe for real coils is worth


def rest_in_coils(coils, currents, simulation):
    """Where one tip magnet rests in the coils' own field and gradient at its place, m: a damped fixed point."""
    place = np.array([simulation.scene.rod.length, 0.0, 0.0])
    for _ in range(80):
        field, gradient = coils.field(place, currents), coils.gradient(place, currents)
        place = 0.5 * place + 0.5 * simulation.equilibrium(field - gradient @ place, gradient).tip_position
    return place


def test_recipe_for_real_coils_finds_where_the_magnet_rests_in_them():
    """To 0.01 mm, at rest by statics and after two seconds of damped motion, in fields of 15 to 22 mT."""
    page = (ROOT / "docs" / "magnetics.md").read_text()
    static, moving = (block for block in re.findall(r"```python\n(.*?)```", page, re.S) if "linear_field" in block)
    simulation = Simulation(load_scene("paper5_circle", modulus="effective"))
    names: dict = {}
    for want in ((0.0, 0.02, 0.01), (0.0, 0.0, 0.015), (0.01, 0.0, 0.02)):
        changed = static.replace("(0.0, 0.02, 0.01)", str(want))
        assert want == (0.0, 0.02, 0.01) or changed != static
        exec(changed, names)
        exact = rest_in_coils(names["coils"], names["currents"], simulation)
        np.testing.assert_allclose(names["place"], exact, atol=1e-5)
    exec(moving, names)
    for rod in range(2):
        exact = rest_in_coils(names["coils"], names["currents"][rod], simulation)
        np.testing.assert_allclose(names["simulation"].tip_position[rod], exact, atol=1e-5)
