"""From a tolerance at the tip to elements, time step and conditioning of stiff modes, by pilot runs of the scene.

A pilot is a batch of eight equal rods under eight loads. What a coarser choice costs is the distance between its tip
and that of a finer one; the finer of two is never itself taken on trust. Every pilot run is logged, at level INFO,
before it starts. Reasons and limits are in docs/resolution.md.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from magrod_env.magnetics import _checks

LOGGER = logging.getLogger(__name__)
NUM_ELEMENTS = 6  # where nothing is said
EXPECTED_FIELD = 45e-3  # T: the limit of the paper's coils
LADDER = (3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 80, 96, 128, 160)  # elements to choose from
FINER = 1.5  # elements of the run that judges another, over that one's
LARGEST_SOFTENING = 4096.0
FAR = 12.0  # times its share: from there on, the error of the conditioning is told by proportion
ROTARY_PER_AXIAL = 2.0  # at this ratio the axial wave and the shear-rotation wave bound the step alike
SPACE, CONDITIONING = 0.4, 0.25  # shares of the tolerance in the first guess
DURATION, CONTROL_TIME = 2.0, 0.01  # s: of a pilot, between its field's values
RISES = (0.4, 0.4, 0.4, 0.4, 0.15, 0.15, 0.1, 0.1)  # s: of each load
HELD = (1, 1, 1, 2, 2, 2, 2, 1)  # CONTROL_TIMEs for which each load's field is held: its steps ring higher modes
NUM_LOADS = 8
AGAINST, BELOW_BUCKLING = 0.5, 0.6  # largest field against the dipoles, of the magnitude and of EI/(m L)
PLUCK = 0.1  # of the length: the largest swing of the tip in the pilots of a rod that no field moves
WITHIN = 0.65  # of the tolerance: what the run that judges a choice may find; the rest is for loads that no pilot has
UNSEEN = 0.3  # of an error, at most, that a run with FINER elements and LESS conditioning has as well
LESS = 4.0
SOFTER = (64.0, 16.0, 8.0, 4.0, 2.0, 1.0)  # times the conditioning of a choice that holds, tried from the soft end


@dataclass(frozen=True, kw_only=True, slots=True)
class Resolution:
    """What a simulation resolves a scene with.

    Args:
        num_elements: elements along the rod.
        time_step: s; None leaves it to the simulation.
        axial_softening: divides the axial stiffness.
        rotary_scaling: multiplies the rotary inertia of the sections.
        error: RMS error of the tip, m, that the pilots estimate; None where none were run.
    """

    num_elements: int
    time_step: float | None = None
    axial_softening: float = 1.0
    rotary_scaling: float = 1.0
    error: float | None = None


def checked_expected_field(value: Any) -> float:
    """The strongest field that is likely, T; ValueError where it is none."""
    return _checks.number("expected_field", value, at_least=0.0, advice="give its magnitude in tesla, 45 mT is 45e-3")


def checked_resolution(
    num_elements: Any, time_step: Any, axial_softening: Any, rotary_scaling: Any, tolerance: Any
) -> Resolution:
    """What the user has said about the resolution; with a tolerance, nothing else may be said.

    Raises:
        ValueError: on a number out of range, or a tolerance beside another choice.
    """
    given = {
        "num_elements": num_elements,
        "time_step": time_step,
        "axial_softening": axial_softening,
        "rotary_scaling": rotary_scaling,
    }
    if tolerance is not None:
        _checks.number("tolerance", tolerance, above=0.0, advice="give the tip's RMS error in metres, 0.1 mm is 1e-4")
        for name, value in given.items():
            if value is not None:
                raise ValueError(
                    f"{name} must be None beside a tolerance, which chooses it, but got {value!r}: give one of them."
                )
        return Resolution(num_elements=NUM_ELEMENTS)
    count = NUM_ELEMENTS if num_elements is None else num_elements
    advice = "1 leaves the rod as it is; larger allows longer steps"
    return Resolution(
        num_elements=int(_checks.count("num_elements", count, advice="6 is a good start")),
        time_step=time_step,
        **{
            name: 1.0 if given[name] is None else _checks.number(name, given[name], at_least=1.0, advice=advice)
            for name in ("axial_softening", "rotary_scaling")
        },
    )


def pilot_fields(magnitude: float, axes: tuple[int, ...], load: float) -> np.ndarray:
    """Fields of the pilots, T, (num_times, NUM_LOADS, 3): none, ramps, and fields that turn or swing.

    ``axes`` are the world axes of the motion, the first along the rod. A field against the dipoles makes the rod
    limp, and errors large: one load has a share of it, well below that at which a rod under ``load`` (moments of the
    magnets across the strongest field over EI/L) buckles.
    """
    count = round(DURATION / CONTROL_TIME)
    along, across = np.eye(3)[axes[0]], np.eye(3)[axes[1]]
    aside = np.eye(3)[axes[2]] if len(axes) > 2 else -across
    against = min(AGAINST, BELOW_BUCKLING / load) if load > 0.0 else AGAINST
    fields = np.zeros((count, NUM_LOADS, 3))
    for load in range(1, NUM_LOADS):
        time = CONTROL_TIME * HELD[load] * (np.arange(count) // HELD[load] + 0.5)
        share = np.clip(time / RISES[load], 0.0, 1.0)
        rise, angle = share * share * (3.0 - 2.0 * share), 2.0 * np.pi * time
        fields[:, load] = (
            magnitude
            * (
                np.outer(rise, across),
                np.outer(rise, -0.7 * aside),
                np.outer(rise * np.cos(1.3 * angle), 0.6 * across - against * along),
                np.outer(rise * np.cos(0.5 * angle), across) + np.outer(rise * np.sin(0.5 * angle), aside),
                0.7 * np.outer(rise * np.cos(angle), across) + 0.7 * np.outer(rise * np.sin(angle), aside),
                0.6 * np.outer(rise * np.sin(1.5 * angle), across) + 0.3 * np.outer(rise, along),
                np.outer(rise * np.cos(1.5 * angle), across),
            )[load - 1]
        )
    return fields


def choose_resolution(
    simulate: Callable[..., Any],
    *,
    tolerance: float,
    least_elements: int,
    magnitude: float,
    axes: tuple[int, ...],
    load: float,
    hanging: bool = False,
) -> Resolution:
    """The cheapest resolution whose tip error in every pilot is estimated to be within ``tolerance`` (m, RMS).

    Args:
        simulate: makes the simulation of a batch: num_rods, num_elements, axial_softening, rotary_scaling.
        tolerance: m.
        least_elements: as many as there are segments between magnets.
        magnitude: of the pilots' field, T; where it is zero, pilots swing freely instead.
        axes: world axes of the motion.
        load: moments of the magnets across that field over EI/L.
        hanging: pilots start in equilibrium under gravity; else straight, so that gravity acts suddenly.

    Raises:
        ValueError: if no resolution of the ladder is good enough.
    """
    search = _Search(simulate, pilot_fields(magnitude, axes, load), axes, tolerance, hanging)
    rungs = [rung for rung in LADDER if rung >= max(LADDER[0], least_elements)]
    coarse = next((rung for rung in rungs if rung >= max(5, 2 * least_elements)), rungs[-1])
    tried, errors = search.conditioning(coarse)
    num_elements, space_error = search.elements(rungs, tried)
    _, chosen, _ = search.longest_step(num_elements, tried, errors)
    return search.cheapest(rungs, *search.holding(rungs, num_elements, chosen))


def elements_for(load: float, longest_element: float) -> float:
    """How many times as many elements a rod should have for its loads; 1 or less where it has enough.

    An element has to be short against the length sqrt(EI/(EI/L + moments)) over which the loads bend the rod: at most
    half of it. An estimate before any run, for sudden loads; `scripts.stability` counts what it misses and what it
    tells of in vain.

    Args:
        load: moments of the loads at the clamp over EI/L.
        longest_element: over the rod's length.
    """
    return 2.0 * longest_element * math.sqrt(1.0 + load)


Conditioning = tuple[float, float]
"""axial_softening and rotary_scaling."""


def _both(softening: float) -> Conditioning:
    return softening, 1.0 + ROTARY_PER_AXIAL * (softening - 1.0)


class _Search:
    """Pilot runs, each done once.

    Errors of space, conditioning and time add up, so each is measured while the others are coarse, and an error
    whose order is known is measured where it is large and runs are cheap.
    """

    def __init__(
        self,
        simulate: Callable[..., Any],
        fields: np.ndarray,
        axes: tuple[int, ...],
        tolerance: float,
        hanging: bool,
    ) -> None:
        self.simulate, self.axes, self.tolerance, self.hanging = simulate, axes, tolerance, hanging
        self.fields = fields
        self.swing: float | None = None  # largest speed of the tip in a plucked pilot, lengths a second
        self.known: dict[tuple[int, Conditioning, float], tuple[np.ndarray, float]] = {}

    def tips(self, num_elements: int, conditioning: Conditioning, finer_steps: float = 1.0) -> np.ndarray:
        """Tip of every pilot, m, (num_times, NUM_LOADS, 3); NaN from where one was lost."""
        return self._run(num_elements, conditioning, finer_steps)[0]

    def _run(self, num_elements: int, conditioning: Conditioning, finer_steps: float) -> tuple[np.ndarray, float]:
        key = (num_elements, conditioning, finer_steps)
        if key not in self.known:
            axial, rotary = conditioning
            simulation = self.simulate(
                num_rods=NUM_LOADS, num_elements=num_elements, axial_softening=axial, rotary_scaling=rotary
            )
            simulation.time_step /= finer_steps
            words = "pilot run: %d elements, axial_softening %.4g, rotary_scaling %.4g, %.0f steps"
            LOGGER.info(words, num_elements, axial, rotary, DURATION / simulation.time_step)
            simulation.reset(field=np.zeros(3) if self.hanging else None)
            if not self.fields.any():
                self._pluck(simulation)
            tips = np.empty((len(self.fields), NUM_LOADS, 3))
            for k, field in enumerate(self.fields):
                simulation.advance(CONTROL_TIME, field=field)
                tips[k] = np.where(simulation.status[:, None] == 0, simulation.tip_position, np.nan)
            self.known[key] = tips, simulation.time_step
        return self.known[key]

    def _pluck(self, simulation: Any) -> None:
        """Start all but the first pilot with the velocities of a swing in the first bending mode, across the rod."""
        if self.swing is None:
            self.swing = 2.0 * math.pi * float(np.nanmin(simulation.natural_frequencies())) * PLUCK
        length = simulation.arc_lengths[-1]
        share = simulation.arc_lengths / length
        shape = (6.0 * share**2 - 4.0 * share**3 + share**4) / 3.0  # of a rod under its own weight
        slope = (12.0 * share - 12.0 * share**2 + 4.0 * share**3) / (3.0 * length)
        velocities, spins = (np.zeros((NUM_LOADS, len(share), 3)) for _ in range(2))
        for load in range(1, NUM_LOADS):
            speed = self.swing * length * load / (NUM_LOADS - 1)
            across = self.axes[1 + load % (len(self.axes) - 1)]
            velocities[load, :, across] = speed * shape
            spins[load, :, 3 - across] = speed * slope * (1.0 if across == 1 else -1.0)
        simulation.set_motion(velocities, spins)

    def distance(self, one: np.ndarray, other: np.ndarray) -> float:
        """Largest RMS distance of two runs in any pilot, m; infinite where one was lost."""
        rms = np.sqrt(((one - other) ** 2).sum(axis=2).mean(axis=0))
        return float(np.where(np.isnan(rms), np.inf, rms).max())

    def conditioning(self, num_elements: int) -> tuple[Conditioning, tuple[float, float]]:
        """A conditioning that was tried, and its two errors per unit of axial_softening - 1 and rotary_scaling - 1, m.

        From the soft end, since stiff runs are dear, until the error is within its share of the tolerance, or small
        enough to have become proportional: what is within the share can then be told from it.
        """
        share, before = CONDITIONING * self.tolerance, math.inf
        soft = LARGEST_SOFTENING
        while soft > 1.0:
            less = max(soft / 4.0, 1.0)
            tried, tips = _both(soft), self.tips(num_elements, _both(soft))
            error = self.distance(tips, self.tips(num_elements, _both(less))) * (soft - 1.0) / (soft - less)
            if error <= FAR * share and (error <= share or 2.5 < before / error < 6.5):
                lighter = 1.0 + (tried[1] - 1.0) / 4.0
                rotary = self.distance(tips, self.tips(num_elements, (soft, lighter))) / (tried[1] - lighter)
                axial = max(error - rotary * (tried[1] - 1.0), 0.1 * error) / (soft - 1.0)
                return tried, (axial, max(rotary, 0.1 * error / (tried[1] - 1.0)))
            soft, before = soft / 4.0, error
        return (1.0, 1.0), (math.inf, math.inf)

    def longest_step(
        self, num_elements: int, tried: Conditioning, errors: tuple[float, float]
    ) -> tuple[float, Conditioning, float]:
        """Longest default step, s, that conditioning within its share allows, that conditioning and its error, m."""
        best, share = (0.0, (1.0, 1.0), 0.0), CONDITIONING * self.tolerance
        for part in (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0):
            axial, rotary = (
                1.0 + min(portion * share / error, 3.0 * (most - 1.0))
                for portion, error, most in zip((part, 1.0 - part), errors, tried, strict=True)
            )
            step = self.simulate(
                num_rods=1, num_elements=num_elements, axial_softening=axial, rotary_scaling=rotary
            ).time_step
            if step > 1.02 * best[0]:
                parts = zip(errors, (axial, rotary), strict=True)
                error = sum(each * (factor - 1.0) for each, factor in parts if factor > 1.0)
                best = step, (axial, rotary), error
        return best

    def elements(self, rungs: list[int], conditioning: Conditioning) -> tuple[int, float]:
        """Fewest elements within their share, and their error: third order, judged by a run with half as many more."""
        error = math.inf
        for rung in rungs:
            finer = next((other for other in rungs if other >= FINER * rung), None)
            if finer is None:
                break
            distance = self.distance(self.tips(rung, conditioning), self.tips(finer, conditioning))
            error = distance / (1.0 - (rung / finer) ** 3)
            if error <= SPACE * self.tolerance:
                return rung, error
        raise ValueError(_out_of_reach(rungs[-1], self.tolerance, error))

    def holding(
        self, rungs: list[int], num_elements: int, chosen: Conditioning
    ) -> tuple[int, Conditioning, np.ndarray]:
        """The choice, refined until a run that is finer in all respects confirms it, and the tips of that run.

        Errors need not add up: a mode that rings with the field's steps does so in fine runs only, and coarse ones that
        all lack it agree with each other.
        """
        while True:
            truth = self.tips(math.ceil(FINER * num_elements), _eased(chosen, 1.0 / LESS))
            error = self.distance(self.tips(num_elements, chosen), truth)
            if error <= (1.0 - UNSEEN) * WITHIN * self.tolerance:
                return num_elements, chosen, truth
            if num_elements == rungs[-1]:
                raise ValueError(_out_of_reach(rungs[-1], self.tolerance, error))
            num_elements, chosen = rungs[rungs.index(num_elements) + 1], _eased(chosen, 1.0 / LESS)

    def cheapest(self, rungs: list[int], num_elements: int, chosen: Conditioning, truth: np.ndarray) -> Resolution:
        """The cheapest resolution, of no more elements and no less conditioning, that the run of `holding` confirms.

        Taking fewer elements and more conditioning to be less exact, one walk along the border between good enough and
        not finds it: from soft to stiff and from many elements to few.
        """
        allowed = (1.0 - UNSEEN) * WITHIN * self.tolerance
        best, least = (num_elements, chosen), num_elements / self.default_step(num_elements, chosen)
        fewer = [rung for rung in rungs if rung <= num_elements]
        softer = [_eased(chosen, factor) for factor in SOFTER]
        while fewer and softer:
            cost = fewer[-1] / self.default_step(fewer[-1], softer[0])
            if cost >= least:
                fewer.pop()
            elif self.distance(self.tips(fewer[-1], softer[0]), truth) <= allowed:
                best, least = (fewer.pop(), softer[0]), cost
            else:
                softer.pop(0)
        error = self.distance(self.tips(*best), truth) / (1.0 - UNSEEN)
        step = self.default_step(*best)
        return Resolution(
            num_elements=best[0], time_step=step, axial_softening=best[1][0], rotary_scaling=best[1][1], error=error
        )

    def default_step(self, num_elements: int, conditioning: Conditioning) -> float:
        """The step, s, that a simulation would take."""
        axial, rotary = conditioning
        return self.simulate(
            num_rods=1, num_elements=num_elements, axial_softening=axial, rotary_scaling=rotary
        ).time_step


def _eased(conditioning: Conditioning, factor: float) -> Conditioning:
    axial, rotary = conditioning
    return 1.0 + factor * (axial - 1.0), 1.0 + factor * (rotary - 1.0)


def _out_of_reach(most: int, tolerance: float, error: float) -> str:
    return (
        f"tolerance must be within reach of {most} elements, but got {tolerance:.3g} m and the tip still "
        f"differs by {error:.3g} m: ask for less, or state a weaker expected_field; in a strong one the rod may "
        "jump, and its path then depends on the least difference."
    )
