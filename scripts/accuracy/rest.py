"""Rods at rest: equilibria against the reference and closed forms, and the locking of the paper's element."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from tqdm import tqdm

from magrod_env import Magnet, Rod, Scene, Simulation
from magrod_env.scenes import nodal_stiffening, paper_scene
from scripts.common.cases import LOADED, ROUND, STATICS, STIFFER, stored
from scripts.common.report import Report
from scripts.common.run import least_time, slope

LOADED_COUNTS = (1, 2, 3, 4, 6, 8, 10, 16, 20)
LOADED_ORDERS = {"static_twist": 3.7, "static_tilted_magnet": 3.4}  # at least; the second has its weight at the nodes
LOCKING_SCENES = (
    "paper3_pdms_no_magnet",
    "paper4_pdms_tip_magnet",
    "paper6_two_magnets",
    "paper1_aluminium_in_plane",
    "paper2_aluminium_out_of_plane",
)


def off(tip: np.ndarray, name: str) -> float:
    """Distance of a tip from that of a reference case, mm."""
    return 1e3 * float(np.linalg.norm(tip - stored()[f"{name}_tip"]))


def statics(report: Report, quick: bool) -> None:
    """Equilibria against the reference, and the order in space that they show."""
    counts, errors = (2, 3, 6, 10) if quick else (1, 2, 3, 4, 6, 10, 20), {}
    with report.table(
        "statics",
        "Equilibria of the rod of 1.48 MPa under gravity: distance of the tip, mm",
        "element | N | no field | 14.5 mT up | 10 mT up and 10 mT aside | ms for the last",
    ) as table:
        for element, elements in [("helical", n) for n in counts] + [("nodal", 10)]:
            simulation = Simulation(STIFFER, num_elements=elements, element=element)
            row = [off(simulation.equilibrium(field).tip_position, name) for name, field in STATICS.items()]
            wall = least_time(partial(simulation.equilibrium, STATICS["static_field_yz"]), repeats=3)
            table.add(element, elements, *row, 1e3 * wall)
            if element == "helical":
                errors[elements] = float(np.mean(row))
        fitted = [n for n in errors if n >= 3]
        order = -slope(fitted, [errors[n] for n in fitted])
        table.note = f"Order in space, fitted for N >= 3 to the mean of the three: {order:.2f}."
    report.check("d", "order in space, equilibria", order, 3.5, at_least=True)


def arc(report: Report, quick: bool) -> None:
    """(e) A field across a rod without weight loads it with a couple alone: one element gives the exact arc."""
    rod, moment, largest = ROUND.rod, ROUND.magnets[0].moment, 0.0
    weightless = ROUND.replace(gravity=(0.0, 0.0, 0.0))
    simulations = [Simulation(weightless, num_elements=1, element=element) for element in ("helical", "nodal")]
    with report.table(
        "arc",
        "(e) Couple on the tip, one element: distance of the tip from the exact arc, mm",
        "field, mT | angle, degrees | helical | nodal",
        "Exact: angle = m B L cos(angle) / EI, tip at L sin(angle)/angle and L (1 - cos(angle))/angle.",
    ) as table:
        for field in (1e-3, 5e-3, 15e-3, 45e-3):
            angle = _couple_angle(moment * field * rod.length / rod.bending_stiffness)
            exact = rod.length / angle * np.array([math.sin(angle), 0.0, 1.0 - math.cos(angle)])
            found = [simulation.equilibrium((0.0, 0.0, field)).tip_position for simulation in simulations]
            errors = [1e3 * float(np.linalg.norm(tip - exact)) for tip in found]
            table.add(1e3 * field, math.degrees(angle), *errors)
            largest = max(largest, errors[0])
    report.check("e", "arc of one element: tip", largest, 1e-9, "mm")


def _couple_angle(load: float) -> float:
    """The angle (rad) that is `load` times its own cosine, by bisection."""
    low, high = 0.0, 0.5 * math.pi
    for _ in range(60):
        angle = 0.5 * (low + high)
        low, high = (angle, high) if angle < load * math.cos(angle) else (low, angle)
    return angle


def couple_scene(rod: Rod) -> Scene:
    """A rod that a field loads by a couple on its tip alone."""
    return Scene(rod=rod, magnets=(Magnet.dipole(position=rod.length, moment=1e-3),), gravity=(0.0, 0.0, 0.0))


def tip_stiffness(rod: Rod, element: str, elements: int) -> float:
    """Bending stiffness over the true one, from a couple that turns the tip by about a milliradian."""
    scene, flexibility = couple_scene(rod), rod.length / rod.bending_stiffness
    field = 1e-3 / (scene.magnets[0].moment * flexibility)
    tangent = Simulation(scene, num_elements=elements, element=element).equilibrium((0.0, 0.0, field)).tangents[-1]
    angle = math.atan2(tangent[2], tangent[0])
    return 1e-3 * math.cos(angle) / angle


def first_frequency(rod: Rod, element: str, elements: int) -> float:
    """Lowest natural frequency of the straight rod, Hz."""
    return float(Simulation(couple_scene(rod), num_elements=elements, element=element).natural_frequencies()[0])


def locking(report: Report, quick: bool) -> None:
    """(f) By what factor the paper's element is too stiff in bending."""
    largest = 0.0
    with report.table(
        "locking",
        "(f) Locking of the paper's element: bending stiffness over the true one",
        "scene | N | 1 + GA h²/(4 EI) | nodal, tip couple | nodal, first frequency squared | helical, tip couple",
        "The first frequency is over that of 40 helical elements; it also has the element's lumped mass in it.",
    ) as table:
        for name in tqdm(LOCKING_SCENES[:2] if quick else LOCKING_SCENES, desc="locking", leave=False):
            rod, elements = paper_scene(name).scene.rod, paper_scene(name).num_elements or 0
            closed, found = nodal_stiffening(rod, elements), tip_stiffness(rod, "nodal", elements)
            squared = (first_frequency(rod, "nodal", elements) / first_frequency(rod, "helical", 40)) ** 2
            table.add(name, elements, closed, found, squared, tip_stiffness(rod, "helical", elements))
            largest = max(largest, abs(found / closed - 1.0))
    report.check("f", "locking factor: largest relative distance", largest, 0.02)


def loaded_error(case: str, elements: int) -> float:
    """Distance from the tip's reference, mm, of the equilibrium or of the last stable shape on the way to it."""
    loaded = LOADED[case]
    found = Simulation(loaded.scene, num_elements=elements).equilibrium(loaded.field, loaded.gradient)
    return off(found.tip_position, case)


def fitted_order(errors: dict[int, float]) -> float | None:
    """Order in space for N >= 4; None where rounding is all there is."""
    fine = {n: error for n, error in errors.items() if n >= 4}
    return -slope(list(fine), list(fine.values())) if min(fine.values()) > 1e-9 else None


def loaded_rods(report: Report, quick: bool) -> None:
    """(g) Rods that twist while they bend and rods under tension: equilibria against the reference."""
    counts = (4, 6) if quick else LOADED_COUNTS
    about = "; ".join(f"{case}: {loaded.about}" for case, loaded in LOADED.items())
    with report.table(
        "loaded_rods",
        "(g) Rods that twist while they bend, and rods under tension: distance of the tip at rest, mm",
        f"case | {' | '.join(f'N = {n}' for n in counts)} | order",
        f"{about}. Order in space: fitted for N >= 4. Where stability is lost on the way to the full load: the "
        "distance of the last stable shape.",
    ) as table:
        for case, loaded in tqdm(LOADED.items(), desc="twist and tension", leave=False):
            errors = {n: loaded_error(case, n) for n in counts if n >= len(loaded.scene.magnets)}
            order = fitted_order(errors)
            table.add(case, *(errors.get(n) for n in counts), order)
            for n, limit in loaded.limits.items():
                if n in errors:
                    report.check("g", f"{case}, N={n}: tip", errors[n], limit, "mm")
            if case in LOADED_ORDERS and not quick:
                report.check("g", f"order in space, {case}", order, LOADED_ORDERS[case], at_least=True)
