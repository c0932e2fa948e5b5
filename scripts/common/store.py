"""Finished results, one JSON line each, so that a run that stopped goes on where it was."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Generic, TypeVar

Result = TypeVar("Result")


class Store(Generic[Result]):
    """Results by key, in a file where one is given: a line [key, result] each.

    Args:
        path: of the file, or None.
        kind: makes a result from its fields: a dataclass, or `dict`.
    """

    def __init__(self, path: Path | None, kind: Callable[..., Result]) -> None:
        self.path, self.results = path, dict[str, Result]()
        if path is not None and path.exists():
            lines = map(json.loads, path.read_text().splitlines())
            self.results = {key: kind(**fields) for key, fields in lines}

    def get(self, key: str, make: Callable[[], Result]) -> Result:
        """The result of this key, made and kept if it is not there."""
        if key not in self.results:
            self.keep(key, make())
        return self.results[key]

    def keep(self, key: str, result: Result) -> None:
        """Add a result to the file."""
        self.results[key] = result
        if self.path is not None:
            fields = asdict(result) if is_dataclass(result) and not isinstance(result, type) else result
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a") as lines:
                lines.write(json.dumps([key, fields], allow_nan=False) + "\n")
