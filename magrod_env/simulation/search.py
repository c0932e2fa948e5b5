"""From a tolerance at the tip to the cheapest resolution of a scene that pilot runs find good enough.

The finer of two runs is never itself taken on trust. Reasons and limits are in docs/resolution.md.
"""

from __future__ import annotations

import dataclasses
import heapq
import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from magrod_env.simulation.integrators import cost_rate
from magrod_env.simulation.pilots import CONTROL_TIME, Pilots, TooDear, pilot_fields
from magrod_env.simulation.resolution import NUM_ELEMENTS, Resolution

LADDER = (3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 80, 96, 128, 160)  # elements to choose from
FINER = 1.5  # elements of the run that judges another, over that one's
WITHIN = 0.65  # of the tolerance: what the run that judges a choice may find; the rest is for loads that no pilot has
UNSEEN = 0.3  # of an error, at most, that the run which judges a choice has as well

# explicit steps
LARGEST_SOFTENING = 4096.0
FAR = 12.0  # times its share: from there on, the error of the conditioning is told by proportion
ROTARY_PER_AXIAL = 2.0  # at this ratio the axial wave and the shear-rotation wave bound the step alike
SPACE, CONDITIONING = 0.4, 0.25  # shares of the tolerance in the first guess
LESS = 4.0  # times less conditioning in the run that judges another
SOFTER = (64.0, 16.0, 8.0, 4.0, 2.0, 1.0)  # times the conditioning of a choice that holds, tried from the soft end

# implicit steps
SHORTER = 4  # times as many implicit steps in the run that judges another
FIRST_STEPS = 24.0  # a slowest period
STEPS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512)  # in CONTROL_TIME, to choose from

# both
FIRST_TURN, TURN_GROWTH = 2e6, 2.0  # of the cost of a search's pilot runs, explicit elements times steps a second

Setting = TypeVar("Setting")


def choose_resolution(
    simulate: Callable[..., Any],
    *,
    tolerance: float,
    least_elements: int,
    magnitude: float,
    axes: tuple[int, ...],
    load: float,
    hanging: bool = False,
    implicit: tuple[str, ...] = (),
) -> Resolution:
    """The cheapest resolution whose tip error in every pilot is estimated to be within ``tolerance`` (m, RMS).

    Args:
        simulate: makes the simulation of a batch: num_rods, and what a `Resolution` holds.
        tolerance: m.
        least_elements: as many as there are segments between magnets.
        magnitude: of the pilots' field, T; where it is zero, pilots swing freely instead.
        axes: world axes of the motion.
        load: moments of the magnets across that field over EI/L.
        hanging: pilots start in equilibrium under gravity; else straight, so that gravity acts suddenly.
        implicit: integrators that may be chosen beside the explicit one, the most exact first.

    Raises:
        ValueError: if no resolution of the ladder is good enough.
    """
    pilots = Pilots(simulate, pilot_fields(magnitude, axes, load), axes, hanging)
    rungs = [rung for rung in LADDER if rung >= max(LADDER[0], least_elements)]
    searches: list[_ExplicitSearch | _ImplicitSearch] = [_ExplicitSearch(pilots, rungs, tolerance, least_elements)]
    if implicit:
        searches.append(_ImplicitSearch(pilots, implicit, rungs, tolerance))
    return _race(pilots, searches)


def _race(pilots: Pilots, searches: list[_ExplicitSearch | _ImplicitSearch]) -> Resolution:
    """The cheapest of what the searches find.

    They take turns, each until its runs have cost as much as the others' and then twice that, so that none waits for
    one that is slow. When one has found something, the others have a last turn, without runs too dear to lead to
    something cheaper. A search that begins anew repeats no run, since all are kept.
    """
    waiting = [(FIRST_TURN, place) for place in range(len(searches))]
    spent = [0.0] * len(searches)
    found: Resolution | None = None
    failure: ValueError | None = None
    while waiting:
        turn, place = heapq.heappop(waiting)
        pilots.limit = math.inf if found is None else searches[place].dearest * _cost(pilots, found)
        before = pilots.spent
        pilots.budget = before + turn - spent[place]
        try:
            one = searches[place].choice()
        except TooDear:
            if found is None:
                heapq.heappush(waiting, (TURN_GROWTH * turn, place))
        except ValueError as error:
            failure = error
        else:
            if one is not None and (found is None or _cost(pilots, one) < _cost(pilots, found)):
                found = one
            waiting = [(max(each, TURN_GROWTH * pilots.spent), other) for each, other in waiting]
        spent[place] += pilots.spent - before
    if found is None:
        raise failure or ValueError("no search was given")
    return found


def _cost(pilots: Pilots, resolution: Resolution) -> float:
    """Elements times steps a second, in explicit ones."""
    return cost_rate(resolution.integrator, resolution.num_elements, pilots.step(resolution))


def cheapest_pair(
    rungs: Sequence[int],
    looser: Sequence[Setting],
    cost: Callable[[int, Setting], float],
    good: Callable[[int, Setting], bool],
    most: float,
) -> tuple[int, Setting] | None:
    """The cheapest good choice of elements and another setting, given from loose to exact; None if all cost ``most``.

    Taking fewer elements and a looser setting to be less exact, one walk along the border between good enough and not
    finds it: from loose to exact and from many elements to few.
    """
    fewer, settings, best = list(rungs), list(looser), None
    while fewer and settings:
        price = cost(fewer[-1], settings[0])
        if price >= most:
            fewer.pop()
        elif good(fewer[-1], settings[0]):
            best, most = (fewer.pop(), settings[0]), price
        else:
            settings.pop(0)
    return best


Conditioning = tuple[float, float]
"""axial_softening and rotary_scaling."""


def _both(softening: float) -> Conditioning:
    return softening, 1.0 + ROTARY_PER_AXIAL * (softening - 1.0)


def _explicit(num_elements: int, conditioning: Conditioning) -> Resolution:
    return Resolution(num_elements=num_elements, axial_softening=conditioning[0], rotary_scaling=conditioning[1])


class _ExplicitSearch:
    """Elements and conditioning at the default step, which follows from them.

    Errors of space, conditioning and time add up, so each is measured while the others are coarse, and an error
    whose order is known is measured where it is large and runs are cheap.
    """

    dearest = 10.0  # run that it needs, over what it finds

    def __init__(self, pilots: Pilots, rungs: list[int], tolerance: float, least_elements: int) -> None:
        self.pilots, self.rungs, self.tolerance = pilots, rungs, tolerance
        self.coarse = next((rung for rung in rungs if rung >= max(5, 2 * least_elements)), rungs[-1])
        self.distance, self.allowed = pilots.distance, (1.0 - UNSEEN) * WITHIN * tolerance

    def tips(self, num_elements: int, conditioning: Conditioning) -> np.ndarray:
        """Tips of the pilots, m."""
        return self.pilots.tips(_explicit(num_elements, conditioning))

    def default_step(self, num_elements: int, conditioning: Conditioning) -> float:
        """The step, s, that a simulation would take."""
        return self.pilots.step(_explicit(num_elements, conditioning))

    def choice(self) -> Resolution:
        """The cheapest resolution that a finer run confirms."""
        tried, errors = self.conditioning(self.coarse)
        num_elements = self.elements(tried)
        return self.cheapest(*self.holding(num_elements, self.longest_step(num_elements, tried, errors)))

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

    def longest_step(self, num_elements: int, tried: Conditioning, errors: tuple[float, float]) -> Conditioning:
        """The conditioning within its share that allows the longest default step."""
        longest, best, share = 0.0, (1.0, 1.0), CONDITIONING * self.tolerance
        for part in (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0):
            axial, rotary = (
                1.0 + min(portion * share / error, 3.0 * (most - 1.0))
                for portion, error, most in zip((part, 1.0 - part), errors, tried, strict=True)
            )
            step = self.default_step(num_elements, (axial, rotary))
            if step > 1.02 * longest:
                longest, best = step, (axial, rotary)
        return best

    def elements(self, conditioning: Conditioning) -> int:
        """Fewest elements within their share: third order, judged by a run with half as many more."""
        error = math.inf
        for rung in self.rungs:
            finer = next((other for other in self.rungs if other >= FINER * rung), None)
            if finer is None:
                break
            distance = self.distance(self.tips(rung, conditioning), self.tips(finer, conditioning))
            error = distance / (1.0 - (rung / finer) ** 3)
            if error <= SPACE * self.tolerance:
                return rung
        raise ValueError(_out_of_reach(self.rungs[-1], self.tolerance, error))

    def holding(self, num_elements: int, chosen: Conditioning) -> tuple[int, Conditioning, np.ndarray]:
        """The choice, refined until a run that is finer in all respects confirms it, and the tips of that run.

        Errors need not add up: a mode that rings with the field's steps does so in fine runs only, and coarse ones that
        all lack it agree with each other.
        """
        while True:
            truth = self.tips(math.ceil(FINER * num_elements), _eased(chosen, 1.0 / LESS))
            error = self.distance(self.tips(num_elements, chosen), truth)
            if error <= self.allowed:
                return num_elements, chosen, truth
            if num_elements == self.rungs[-1]:
                raise ValueError(_out_of_reach(self.rungs[-1], self.tolerance, error))
            num_elements = self.rungs[self.rungs.index(num_elements) + 1]
            chosen = _eased(chosen, 1.0 / LESS)

    def cheapest(self, num_elements: int, chosen: Conditioning, truth: np.ndarray) -> Resolution:
        """The cheapest resolution, of no more elements and no less conditioning, that the run of `holding` confirms."""
        best = cheapest_pair(
            [rung for rung in self.rungs if rung <= num_elements],
            [_eased(chosen, factor) for factor in SOFTER],
            lambda rung, softer: _cost(self.pilots, _explicit(rung, softer)),
            lambda rung, softer: self.distance(self.tips(rung, softer), truth) <= self.allowed,
            _cost(self.pilots, _explicit(num_elements, chosen)),
        ) or (num_elements, chosen)
        error = self.distance(self.tips(*best), truth) / (1.0 - UNSEEN)
        return dataclasses.replace(_explicit(*best), time_step=self.default_step(*best), error=error)


def _eased(conditioning: Conditioning, factor: float) -> Conditioning:
    axial, rotary = conditioning
    return 1.0 + factor * (axial - 1.0), 1.0 + factor * (rotary - 1.0)


def _out_of_reach(most: int, tolerance: float, error: float) -> str:
    return (
        f"tolerance must be within reach of {most} elements, but got {tolerance:.3g} m and the tip still "
        f"differs by {error:.3g} m: ask for less, or state a weaker expected_field; in a strong one the rod may "
        "jump, and its path then depends on the least difference."
    )


class _ImplicitSearch:
    """Elements, implicit scheme and its step, a whole part of CONTROL_TIME."""

    dearest = 100.0  # run that it needs, over what it finds

    def __init__(self, pilots: Pilots, schemes: tuple[str, ...], rungs: list[int], tolerance: float) -> None:
        self.pilots, self.schemes, self.rungs = pilots, schemes, rungs
        self.distance, self.allowed = pilots.distance, (1.0 - UNSEEN) * WITHIN * tolerance

    def resolution(self, scheme: str, num_elements: int, steps: int) -> Resolution:
        """With so many steps in CONTROL_TIME."""
        return Resolution(num_elements=num_elements, integrator=scheme, time_step=CONTROL_TIME / steps)

    def tips(self, num_elements: int, steps: int) -> np.ndarray:
        """Tips of the pilots by the most exact scheme, m."""
        return self.pilots.tips(self.resolution(self.schemes[0], num_elements, steps))

    def choice(self) -> Resolution | None:
        """The cheapest resolution that a finer run confirms; None if none is worth it."""
        rod = self.pilots.simulation(Resolution(num_elements=max(NUM_ELEMENTS, self.rungs[0])))
        steps = FIRST_STEPS * CONTROL_TIME * float(rod.natural_frequencies()[0])
        held = self.holding(math.ceil(max(steps, self.least_steps(self.schemes[0]))))
        return None if held is None else self.cheapest(*held)

    def least_steps(self, scheme: str) -> float:
        """Steps in CONTROL_TIME of the longest stable step."""
        rod = self.pilots.simulation(Resolution(num_elements=self.rungs[0], integrator=scheme))
        return CONTROL_TIME / float(rod.stable_time_step)

    def holding(self, steps: int) -> tuple[int, int, np.ndarray] | None:
        """Elements and steps that a run finer in both confirms, and its tips; None where explicit steps are as long."""
        num_elements = next((rung for rung in self.rungs if rung > self.rungs[0]), self.rungs[-1])
        while CONTROL_TIME / (SHORTER * steps) > self.pilots.step(Resolution(num_elements=num_elements)):
            more, finer = math.ceil(FINER * num_elements), SHORTER * steps
            found, truth = self.tips(num_elements, steps), self.tips(more, finer)
            if self.distance(found, truth) <= self.allowed:
                return num_elements, steps, truth
            between = self.tips(num_elements, finer)
            in_time, in_space = self.distance(found, between), self.distance(between, truth)
            if in_time >= min(in_space, self.allowed):
                steps = finer
            if in_space > min(in_time, self.allowed):
                higher = [rung for rung in self.rungs if rung >= more]
                if not higher:
                    return None
                num_elements = higher[0]
        return None

    def cheapest(self, num_elements: int, steps: int, truth: np.ndarray) -> Resolution:
        """The cheapest resolution of no more elements, by any of the schemes, that the run of `holding` confirms."""
        best = self.resolution(self.schemes[0], num_elements, steps)
        fewer = [rung for rung in self.rungs if rung <= num_elements]
        for scheme in self.schemes:
            least = self.least_steps(scheme)

            def cost(rung: int, parts: int, scheme: str = scheme) -> float:
                return _cost(self.pilots, self.resolution(scheme, rung, parts))

            def good(rung: int, parts: int, scheme: str = scheme) -> bool:
                tips = self.pilots.tips(self.resolution(scheme, rung, parts))
                return self.distance(tips, truth) <= self.allowed

            short_enough = [each for each in STEPS if each >= least]
            found = cheapest_pair(fewer, short_enough, cost, good, _cost(self.pilots, best))
            best = best if found is None else self.resolution(scheme, *found)
        error = self.distance(self.pilots.tips(best), truth) / (1.0 - UNSEEN)
        return dataclasses.replace(best, error=error)
