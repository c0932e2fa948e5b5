"""The folder of a training run: whatever ends the run, a file in it is whole."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

Model = TypeVar("Model")
ARGUMENTS, PARTIAL = "args.json", ".partial"


def write_whole(path: Path, content: bytes) -> None:
    """Write a file under another name, flush it to the disk and rename it: a reader finds the old file or the new."""
    descriptor, partial = tempfile.mkstemp(dir=path.parent, prefix=f"{path.name}.", suffix=PARTIAL)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(partial, 0o666 & ~_umask())  # mkstemp's files are closed to others
        os.replace(partial, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(partial)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_arguments(folder: Path, arguments: dict[str, object]) -> None:
    """Write the arguments of a run as JSON, paths as text."""
    write_whole(folder / ARGUMENTS, (json.dumps(arguments, indent=2, default=str) + "\n").encode())


def read_arguments(folder: Path) -> dict[str, object]:
    """The arguments of the run in a folder.

    Raises:
        ValueError: if there are none, or they are not a JSON object.
    """
    path = folder / ARGUMENTS
    if not path.is_file():
        raise ValueError(f"resume must be the folder of a run, but {folder} has no {ARGUMENTS}: start a new run.")
    try:
        arguments = json.loads(path.read_bytes())
    except ValueError as error:  # of JSON or of UTF-8
        arguments = f"{error}"
    if not isinstance(arguments, dict):
        raise ValueError(
            f"{path} must hold the arguments of a run as a JSON object, but got {str(arguments)[:100]!r}: "
            "restore it, or start a new run."
        )
    return arguments


def require_free(folder: Path) -> None:
    """Make a folder for a new run, and remove what an interrupted write left.

    Raises:
        ValueError: if the folder holds anything else.
    """
    folder.mkdir(parents=True, exist_ok=True)
    remove_partial(folder)
    names = sorted(path.name for path in folder.iterdir())
    if names:
        raise ValueError(
            f"folder of a new run must be empty, but {folder} holds {', '.join(names[:3])}: "
            "go on with its run by --resume, or choose another by --folder."
        )


def remove_partial(folder: Path) -> None:
    """Remove files of which a killed run had written a part."""
    for path in folder.glob(f"*{PARTIAL}"):
        path.unlink(missing_ok=True)


def checkpoint_path(folder: Path, steps: int) -> Path:
    """Where the checkpoint after a number of steps is."""
    return folder / f"checkpoint_{steps}_steps.zip"


def checkpoints(folder: Path) -> list[Path]:
    """The checkpoints of a run, newest first."""
    found = {path: path.stem.split("_")[1] for path in folder.glob("checkpoint_*_steps.zip")}
    return sorted((path for path in found if found[path].isdecimal()), key=lambda path: -int(found[path]))


def load_newest(folder: Path, load: Callable[[Path], Model]) -> Model | None:
    """The newest checkpoint that can be loaded, or None where there is none yet; says which were skipped.

    Raises:
        ValueError: if there are some and none can be loaded.
    """
    paths = checkpoints(folder)
    for path in paths:
        try:
            return load(path)
        except Exception as error:  # what a damaged zip archive or pickle raises can be anything
            reason = (str(error) or type(error).__name__).splitlines()[0]
            print(f"skipped {path.name}, which cannot be loaded: {reason}", file=sys.stderr)
    if paths:
        raise ValueError(
            f"resume must be the folder of a run with a whole checkpoint, but none of the {len(paths)} in {folder} can "
            "be loaded: restore one, or start a new run."
        )
    return None
