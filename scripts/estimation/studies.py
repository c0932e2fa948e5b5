"""What is run on the twins: every run's figures under a name, kept in a file as they come."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from scripts.common.store import Store
from scripts.estimation.follow import Course, follow
from scripts.estimation.twins import CASES, Case, Truth, make

WAYS = {
    "model": "model alone",
    "held": "last frame held",
    "extended": "last two frames extended",
    "printed": "paper's law as printed",
    "paper": "paper's filter",
    "ensemble": "ensemble filter",
}
HELICAL = (Truth(0.8), Truth(1.0), Truth(1.2))
TRUTHS = (*HELICAL, Truth(1.0, "nodal"))
POLYMER = (3, 4, 5, 6)
TROUBLES: dict[str, dict[str, Any]] = {
    "none": {},
    "a third of the frames lost": {"drops": 0.33},
    "frames 100 ms late": {"delay": 0.1},
    "started straight at rest": {"known_start": False},
    "a fifth of the mass hung to the tip": {"load": True},
}
TROUBLED = (4, 5)
MEMBERS = (8, 16, 32, 64, 128)
ELEMENTS = (2, 4, 6, 10)  # even: with a node in the middle
RATES = (25, 50, 100, 200)
WORKED = (3, 5)
METAL_RATES = (100, 250, 500, 1000)
TIMED = 1.0  # s
POINTS_KEPT = 400  # of a course, for figures
Figures = dict[str, Any]  # plain JSON types


class Runs:
    """Figures of runs by name, in a file where one is given, so that a run that is there is not made again."""

    def __init__(self, path: Path | None, quick: bool) -> None:
        self.store, self.quick = Store[Figures](path, dict), quick
        self.num_rods = 1 if quick else 4

    def get(self, name: str, make: Callable[[], Figures]) -> Figures:
        """Figures of this name, made if they are not there."""
        return self.store.get(f"quick/{name}" if self.quick else name, make)

    def twin(self, case: Case, truth: Truth, way: str, course: bool = False, **options: Any) -> Figures:
        """An estimator on a twin; options as in `follow`."""
        name = f"{case.number}/{truth.name}/{way}/{_told(options)}"
        if self.quick and way == "ensemble":
            options["options"] = {"num_members": 16, **options.get("options", {})}
        options = {"num_rods": self.num_rods, **options}
        run = partial(follow, case, make(case, truth, self.quick), way, **options)
        return self.get(name, lambda: figures(run(), course))


def _told(options: dict[str, Any]) -> str:
    return " ".join(f"{key}={value}" for key, value in sorted(options.items()))


def figures(run: Course, course: bool = False) -> Figures:
    """Errors, mm and m/s, as plain numbers; None where nothing can be said.

    "mean" and "largest" are by point (tip, middle) and x, y, z, distance, over instants and noises, between frames too;
    "frames" the mean at the instants of frames. "velocity" is the tip's RMS. "residual" is estimate minus frame.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of nothing but NaN
        errors = 1e3 * np.abs(run.positions)
        errors = np.concatenate([errors, 1e3 * np.linalg.norm(run.positions, axis=-1, keepdims=True)], axis=-1)
        speeds = np.linalg.norm(run.velocities[:, :, 0], axis=-1)
        half = len(errors) // 2
        told: Figures = {
            "mean": np.nanmean(errors, axis=(0, 1)).tolist(),
            "largest": np.nanmax(errors, axis=(0, 1)).tolist(),
            "frames": np.nanmean(errors[run.at_frames], axis=(0, 1)).tolist(),
            "half": np.nanmean(errors[half:], axis=(0, 1)).tolist(),
            "velocity": float(np.sqrt(np.nanmean(speeds**2))),
            "residual": (1e3 * np.nanmean(np.abs(run.residuals), axis=(0, 1))).tolist() if len(run.residuals) else None,
            "lost": float(np.isnan(errors[:, :, 0, 0]).mean()),
            "speed": float(run.times[-1] / max(run.seconds, 1e-9)),
            "parameters": run.parameters,
        }
        if course:
            kept = slice(None, None, math.ceil(len(errors) / POINTS_KEPT))
            told["times"] = run.times[kept].tolist()
            told["tip"] = errors[kept, 0, 0, 3].tolist()
    return _plain(told)


def _plain(value: Any) -> Any:
    """The same without NaN and infinite numbers, for JSON."""
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_plain(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def cases(runs: Runs) -> tuple[Case, ...]:
    """Those of a run."""
    return (CASES[0], CASES[3]) if runs.quick else CASES


def truths(runs: Runs) -> tuple[Truth, ...]:
    """Those of a run."""
    return (Truth(0.8), Truth(1.0, "nodal")) if runs.quick else TRUTHS


def experiments(runs: Runs) -> dict[tuple[int, str, str], Figures]:
    """Every way on every twin: by number, truth's name and way."""
    wanted = [(case, truth, way) for case in cases(runs) for truth in truths(runs) for way in WAYS]
    return {
        (case.number, truth.name, way): runs.twin(case, truth, way, course=True)
        for case, truth, way in tqdm(wanted, desc="experiments")
    }


def metal_rates(runs: Runs) -> list[tuple[Case, int, str, Figures]]:
    """The aluminium rods at several frame rates."""
    chosen = [(case, rate) for case in CASES[:2] for rate in METAL_RATES]
    chosen = [(CASES[0], 250)] if runs.quick else chosen
    return [
        (case, rate, way, runs.twin(case, Truth(0.8), way, rate=rate))
        for case, rate in tqdm(chosen, desc="rates, aluminium")
        for way in ("held", "extended", "paper", "ensemble")
    ]


def troubles(runs: Runs) -> list[tuple[Case, str, str, Figures]]:
    """Lost and late frames, a wrong start and a load; the modulus is right, for these errors alone."""
    chosen = [(CASES[number - 1], trouble) for number in TROUBLED for trouble in TROUBLES]
    chosen = [(CASES[3], "frames 100 ms late")] if runs.quick else chosen
    found = []
    for case, trouble in tqdm(chosen, desc="troubles"):
        options = dict(TROUBLES[trouble])
        truth = Truth(load=options.pop("load", False))
        found += [(case, trouble, way, runs.twin(case, truth, way, course=True, **options)) for way in WAYS]
    return found


def why(runs: Runs) -> list[tuple[Case, float, int, float | None, str, Figures]]:
    """The paper's filter, as it is and as printed, where frames are many and where they are exact."""
    rates = [(100, None), (100, 5e-5), (400, None), (400, 5e-5)]
    chosen = [(case, factor, *rate) for case in CASES[2:4] for factor in (1.0, 0.9, 0.8) for rate in rates]
    return [
        (case, factor, rate, noise, way, runs.twin(case, Truth(factor), way, rate=rate, noise=noise))
        for case, factor, rate, noise in tqdm([(CASES[2], 0.9, *rates[1])] if runs.quick else chosen, desc="paper's")
        for way in ("printed", "paper")
    ]


def work(runs: Runs) -> list[tuple[Case, str, str, int | str, Figures]]:
    """Error and speed of one filter on one core, against members, elements and frame rate; case, way, what, value."""
    settings: list[tuple[str, str, int | str, dict[str, Any]]] = [
        ("ensemble", "members", count, {"options": {"num_members": count}}) for count in MEMBERS
    ]
    settings.append(("ensemble", "float32, members", 64, {"options": {"precision": "float32"}}))
    settings.append(("unscented", "sigma points", "", {}))
    for way in ("ensemble", "paper"):
        settings += [(way, "elements", count, {"options": {"num_elements": count}}) for count in ELEMENTS]
        settings += [(way, "frames a second", rate, {"rate": rate}) for rate in RATES]
    cases, settings = (WORKED[:1], settings[:2]) if runs.quick else (WORKED, settings)
    found = []
    for number, (way, what, value, options) in tqdm([(n, each) for n in cases for each in settings], desc="work"):
        error = runs.twin(CASES[number - 1], Truth(0.8), way, num_rods=min(2, runs.num_rods), **options)
        speed = speed_of(runs, CASES[number - 1], way, **options)
        found.append((CASES[number - 1], way, what, value, {**error, "speed": speed}))
    return found


def speed_of(runs: Runs, case: Case, way: str, **options: Any) -> float:
    """Simulated over wall time of one filter that predicts once a frame, the best of three runs of `TIMED` s."""
    rate = options.get("rate", case.rate)
    together = round(case.rate * case.ticks / rate)

    def best() -> Figures:
        twin = make(case, Truth(0.8), runs.quick)
        twin = replace(twin, times=twin.times[: 1 + round(TIMED * case.rate * case.ticks)])
        done = [follow(case, twin, way, ticks_at_once=together, **options) for _ in range(1 if runs.quick else 3)]
        return {"speed": max(float(run.times[-1]) / run.seconds for run in done)}

    return runs.get(f"speed/{case.number}/{way}/{_told(options)}", best)["speed"]


def speeds(runs: Runs) -> list[tuple[Case, str, float]]:
    """Of one filter on one core, with its usual settings."""
    chosen = [(case, way) for case in cases(runs) for way in ("printed", "paper", "ensemble")]
    return [(case, way, speed_of(runs, case, way)) for case, way in tqdm(chosen, desc="speed")]
