"""What users install: the wheel's content, its few dependencies, and the layers inside it."""

import ast
import os
import subprocess
import sys
import venv
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "magrod_env"
MODULES = sorted(PACKAGE.rglob("*.py"))

# Each part of the package, and the parts it may import.
KERNELS = {"_jit", "_simd", "_checks"}
PHYSICS = {*KERNELS, "rod", "magnetics"}
SCENES = {*PHYSICS, "scene", "scenes"}
MAY_IMPORT = {
    "_cache": set(),
    "_checks": set(),
    "_jit": {"_cache"},
    "_simd": {"_jit"},
    "rod": {*KERNELS, "rotations"},
    "magnetics": KERNELS,
    "scene": PHYSICS,
    "scenes": {*PHYSICS, "scene"},
    "rotations": set(),
    "simulation": {*SCENES, "rotations"},
    "estimation": {*SCENES, "rotations", "simulation"},
    "envs": {*SCENES, "rotations", "simulation", "estimation", "rendering"},
    "rendering": set(),
    "registration": {"envs"},
    "__init__": {*SCENES, "simulation", "estimation", "envs", "registration"},
}
NUMERICAL = {*sys.stdlib_module_names, "numpy", "numba", "llvmlite"}
THIRD_PARTY = {
    "envs": {"gymnasium"},
    "registration": {"gymnasium"},
    "__init__": {"gymnasium"},
    "rendering": {"PIL", "matplotlib", "imageio"},
}
HEAVY = ["torch", "stable_baselines3", "matplotlib", "PIL"]

TRY_INSTALLED = """
import importlib.util, sys
import gymnasium, magrod_env
assert "site-packages" in magrod_env.__file__, magrod_env.__file__
from magrod_env.envs import Randomization
everything = Randomization(modulus=0.1, field_misalignment=0.05, gravity_direction=0.05)
for env_id, settings in [
    ("MagRod/Circle-v0", {}),
    ("MagRod/Circle-v0", {"randomization": everything}),
    ("MagRod/PlanarReach-v0", {"randomization": everything}),
]:
    env = gymnasium.make(env_id, **settings)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.close()
for name in ["torch", "stable_baselines3", "matplotlib", "scipy", "agents", "scripts"]:
    assert name not in sys.modules, name
    assert importlib.util.find_spec(name) is None, name
"""


def run(*command: str | Path, cwd: Path = ROOT, timeout: float = 900) -> None:
    """Run a command without this checkout on its path; on failure show all it printed."""
    env = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    done = subprocess.run(command, cwd=cwd, env=env, timeout=timeout, text=True, capture_output=True)
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}\n{done.stderr}"


def part(path: Path) -> str:
    """Name the part of the package that a module belongs to, such as "rod" for rod/so3.py."""
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def imports(path: Path) -> Iterator[tuple[str, int, bool]]:
    """Yield (absolute dotted name, line, whether it is put off) for every import in a module."""
    package = path.relative_to(ROOT).parent.parts

    def walk(node: ast.AST, lazy: bool) -> Iterator[tuple[str, int, bool]]:
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno, lazy) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            start = package[: len(package) - node.level + 1] if node.level else ()
            source = ".".join([*start, *([node.module] if node.module else [])])
            yield from ((f"{source}.{alias.name}", node.lineno, lazy) for alias in node.names)
        for child in ast.iter_child_nodes(node):
            put_off = isinstance(node, ast.FunctionDef) or (
                isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
            )
            yield from walk(child, lazy or put_off)

    return walk(ast.parse(path.read_text(encoding="utf-8")), False)


def breaches(path: Path) -> Iterator[str]:
    """Say of every import of a module that its layer may not make where it is."""
    here = part(path)
    for name, line, lazy in imports(path):
        top, *rest = name.split(".")
        where = f"{path.relative_to(ROOT)}:{line} imports {name}"
        if top != "magrod_env":
            if top not in NUMERICAL | THIRD_PARTY.get(here, set()):
                yield where
        elif rest and rest[0] in MAY_IMPORT and rest[0] != here:  # else a name of magrod_env/__init__.py
            if rest[0] not in MAY_IMPORT[here]:
                yield where
            elif rest[0] == "rendering" and not lazy:
                yield f"{where} at module level"


def test_modules_import_only_from_the_layers_to_their_left():
    assert [breach for path in MODULES for breach in breaches(path)] == []


FOREIGN = {  # private names of numba and SoRoMoX
    ("_jit.py", "_cache"),
    ("soromox.py", "_forward_kinematics"),
    ("soromox.py", "_jacobian_and_time_derivative_bodyframe_terms"),
    ("soromox.py", "_body_jacobian_time_derivative_to_inertial"),
}


def private_names(tree: ast.Module) -> set[str]:
    """Names that a module's own classes and functions define."""
    names = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ("self", "cls"):
            names.add(node.attr)
        elif isinstance(node, ast.Assign):
            names |= {target.id for target in node.targets if isinstance(target, ast.Name)}
    return names


def reaches(path: Path) -> Iterator[str]:
    """Say of every use of a private name that the module does not define itself."""
    tree = ast.parse(path.read_text())
    known = private_names(tree) | {"_replace", "_fields", "_asdict"}
    for node in ast.walk(tree):
        name = node.attr if isinstance(node, ast.Attribute) else ""
        if name.startswith("_") and not name.startswith("__") and name not in known:
            if (path.name, name) not in FOREIGN:
                yield f"{path.relative_to(ROOT)}:{node.lineno} reaches for {ast.unparse(node)}"


def test_no_part_reaches_into_private_members_of_another():
    files = [*MODULES, *(ROOT / "agents").glob("*.py"), *(ROOT / "scripts").rglob("*.py")]
    assert [reach for path in files for reach in reaches(path)] == []


def test_import_of_the_package_loads_no_training_or_plotting_library():
    run(
        sys.executable,
        "-c",
        f"import sys, magrod_env; assert sys.modules.keys().isdisjoint({HEAVY}), sys.modules",
    )


def test_import_of_the_package_registers_the_ids_without_the_environments_kernels():
    kernels = [f"magrod_env.envs.{name}" for name in ("commanding", "core", "observing", "resetting", "streams")]
    run(
        sys.executable,
        "-c",
        f"import sys, gymnasium, magrod_env; assert 'MagRod/Circle-v0' in gymnasium.registry; "
        f"assert sys.modules.keys().isdisjoint({kernels}), sys.modules",
    )


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    run(sys.executable, "-m", "pip", "wheel", "-q", ".", "--no-deps", "-w", folder)
    (path,) = folder.glob("*.whl")
    return path


def test_wheel_holds_the_whole_package_and_nothing_else(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    ours = {name for name in names if name.startswith("magrod_env/")}
    assert {name.split("/")[0] for name in names - ours} == {wheel.name.rsplit("-", 3)[0] + ".dist-info"}
    assert ours >= {str(path.relative_to(ROOT)) for path in [*MODULES, PACKAGE / "py.typed"]}
    assert not [name for name in ours if name.endswith((".pyc", ".nbi", ".nbc"))]


@pytest.mark.slow
def test_installed_wheel_makes_an_env_with_its_runtime_dependencies_only(wheel, tmp_path):
    venv.create(tmp_path / "venv", with_pip=True)
    python = tmp_path / "venv" / ("Scripts" if os.name == "nt" else "bin") / "python"
    run(python, "-m", "pip", "install", "-q", "-c", ROOT / "constraints.txt", wheel)
    (tmp_path / "elsewhere").mkdir()
    run(python, "-c", TRY_INSTALLED, cwd=tmp_path / "elsewhere")
