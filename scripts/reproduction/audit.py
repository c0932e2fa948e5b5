"""The audit of the paper's numbers and equations, with its arithmetic done here (docs/audit.md gives the reasons)."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from magrod_env import Simulation, load_scene
from magrod_env.magnetics import dipole_moment
from magrod_env.scenes import nodal_stiffening, paper_scene
from scripts.accuracy.rest import tip_stiffness
from scripts.common.cases import GRAVITY as G
from scripts.common.report import Report
from scripts.reproduction.printed import (
    FORCE,
    FORCE_PER_LENGTH,
    INERTIA,
    STIFFNESS,
    TABLES,
    TIP_WEIGHT,
    implied_ranges,
    stated,
)

ROUND = "paper4_pdms_tip_magnet"
Row = tuple[str, str, str, str]


def spread(values: list[float], digits: int = 3) -> str:
    """Least to largest of some numbers."""
    return " to ".join(f"{value:.{digits}g}" for value in (min(values), max(values)))


def table_ratios() -> dict[str, list[float]]:
    """Printed entry over the one recomputed from the rod's size and density, by table: M in g/mm, the others in mg."""
    found = {}
    for name, table in TABLES.items():
        rod = load_scene(name).rod
        found[table.source] = [
            table.mass / rod.mass_per_length,
            table.inertia * INERTIA / rod.rotary_inertia_per_length,
            table.weight * FORCE_PER_LENGTH / (G * rod.mass_per_length),
            table.stretch * FORCE / rod.axial_stiffness,
            table.shear * FORCE / rod.shear_stiffness,
            table.twist * STIFFNESS / rod.torsional_stiffness,
            table.bend * STIFFNESS / rod.bending_stiffness,
        ]
    return found


def moduli(name: str) -> list[float]:
    """Young's modulus, Pa, in the entries EA and EI of a table."""
    table, rod = TABLES[name], load_scene(name).rod
    return [table.stretch * FORCE / rod.area, table.bend * STIFFNESS / rod.second_moment]


def nodal(name: str, *, shaped: bool = False) -> Simulation:
    """The paper's element at the paper's number of elements."""
    count = paper_scene(name).num_elements
    return Simulation(load_scene(name), num_elements=count, element="nodal", frequency_shaping=shaped)


def cayley_error(half: float) -> float:
    """Angle gained, rad, on the way from 2 (R - I)/(R + I) back to R by (I + half psi^)/(I - half psi^), at 0.5 rad."""
    angle, unit = 0.5, np.eye(2)
    R = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    psi = 2.0 * (R - unit) @ np.linalg.inv(R + unit)
    back = (unit + half * psi) @ np.linalg.inv(unit - half * psi)
    return math.atan2(back[1, 0], back[0, 0]) - angle


# ---- the rows


def design_rows() -> Iterator[Row]:
    """The findings that change what one simulates."""
    ratios = [ratio for some in table_ratios().values() for ratio in some]
    yield (
        "Tables 3-7, units",
        "C1, C2, J_d, F^c in g, mm, s",
        "in mg, mm, s; only M is in g/mm",
        f"printed over recomputed with mg: {spread(ratios)} in {len(ratios)} entries",
    )
    soft = [value for name in ("paper3_pdms_no_magnet", ROUND) for value in moduli(name)]
    stiff = moduli("paper6_two_magnets")
    yield (
        "section 4.2, Young's modulus",
        "365.12 MPa",
        "365.12 kPa; Table 7: 3.65 MPa",
        f"EA and EI of Tables 5, 6: {spread([1e-3 * x for x in soft], 4)} kPa; "
        f"of Table 7: {spread([1e-6 * x for x in stiff])} MPa",
    )
    yield ("section 4.3, remanence", "1.32 to 1.37 mT", "T (N45)", _remanence())
    rod = load_scene(ROUND).rod
    without = ", ".join(f"{nodal_stiffening(rod, n) - 1.0:.3g} at N = {n}" for n in (10, 100, 1000))
    yield (
        "eq. 6",
        "no bending term",
        "+ psi^T C2 psi/(2 l)",
        f"without it only false shear resists bending, as a share of EI: {without}",
    )
    yield (
        "eq. 14-16",
        "2 p^j + p^(j-1)",
        "2 p^j - p^(j-1)",
        f"a free node at 1, then 2: printed {2 * 2 + 1}, with minus {2 * 2 - 1}",
    )
    yield (
        "section 2 against tables",
        "E3 = [0, 0, 1], C1 = diag(GA, GA, EA)",
        "first axis is the tangent",
        "C1[1]/C1[2] - 2 (1 + nu): "
        + ", ".join(f"{table.stretch / table.shear - stretch_ratio(name):.2f}" for name, table in TABLES.items()),
    )
    for name, table in TABLES.items():
        step = stated(paper_scene(name).paper_time_step)
        bounds = [nodal(name, shaped=shaped).stable_time_step for shaped in (False, True)]
        yield (
            f"{table.source}, time step",
            f"{step:g} s",
            f"at most {bounds[0]:.3g} s",
            f"{step / bounds[0]:.2f} of the bound; with frequency shaping {step / bounds[1]:.2f} of {bounds[1]:.3g} s",
        )
    yield ("remark 1, eq. 5 and 16, tip magnet", "M + m/l", "M + 2 m/l, a point mass m", _tip_mass())
    yield ("Table 6, F^c of the last node", f"{TIP_WEIGHT:.3g}", "with the magnet's 0.096 g", _tip_weight())
    for name in TABLES:
        record = paper_scene(name)
        closed = stated(record.stiffening)
        found = tip_stiffness(record.scene.rod, "nodal", stated(record.num_elements))
        yield (
            f"section 5, frequency shaping, rod of {TABLES[name].source}",
            "gamma, fitted",
            "1/(1 + GA h²/(4 EI)): shear locking",
            f"1/{closed:.4g}; bending stiffness found with a tip couple: {found:.4g}",
        )


def stretch_ratio(name: str) -> float:
    """EA/GA = 2 (1 + nu) of a scene."""
    return 2.0 * (1.0 + load_scene(name).rod.poissons_ratio)


def _remanence() -> str:
    scene, record = load_scene("paper5_circle", modulus="effective"), paper_scene("paper5_circle")
    magnet, rod = scene.magnets[0], scene.rod
    volume, field = math.pi / 4.0 * stated(magnet.diameter) ** 2 * stated(magnet.length), stated(record.rotating_field)
    lever = field * rod.length**2 / (2.0 * rod.bending_stiffness)
    radii = [
        f"{1e3 * lever * dipole_moment(remanence, volume):.2g} mm with {unit}"
        for remanence, unit in ((1.345e-3, "mT"), (1.345, "T"))
    ]
    return f"linear radius of the circle in {1e3 * field:g} mT: {', '.join(radii)}"


def _tip_mass() -> str:
    scene = load_scene(ROUND)
    rod, magnet, simulation = scene.rod, scene.magnets[0], nodal(ROUND)
    h = rod.length / simulation.num_elements
    printed = 0.5 * h * (rod.mass_per_length + magnet.mass / h)
    extra = [1e6 * (mass - 0.5 * h * rod.mass_per_length) for mass in (printed, float(simulation.node_masses[0, -1]))]
    return f"of {1e6 * magnet.mass:g} mg the last node gets {extra[0]:.3g} mg as printed, {extra[1]:.3g} mg here"


def _tip_weight() -> str:
    scene = load_scene(ROUND)
    h = scene.rod.length / stated(paper_scene(ROUND).num_elements)
    weights = [
        f"{G * (scene.rod.mass_per_length + mass / h) / FORCE_PER_LENGTH:.4g} with {words}"
        for mass, words in ((scene.magnets[0].mass, "0.096 g"), (1e-3 * scene.magnets[0].mass, "0.096 mg"))
    ]
    return f"g (M + m/l): {', '.join(weights)}"


def other_rows() -> Iterator[Row]:
    """Further findings of docs/audit.md that are arithmetic."""
    record = paper_scene("paper2_aluminium_out_of_plane")
    first, second = stated(record.initial_tip_offset)
    angles = ", ".join(f"{math.degrees(math.asin(x / record.scene.rod.length)):.2f}" for x in (first, second))
    yield (
        "section 4.1, start of experiment 2",
        "-5.53 and 6.52 degrees; 8 and 10 mm",
        "unknown",
        f"ratios {5.53 / 6.52:.2f} and {first / second:.2f}; the offsets are chords at {angles} degrees",
    )
    for name in ("paper1_aluminium_in_plane", "paper2_aluminium_out_of_plane"):
        rod, table = load_scene(name).rod, TABLES[name]
        sag = G * rod.mass_per_length * rod.length**4 / (8.0 * rod.bending_stiffness)
        yield (
            f"{table.source}, direction of F^c",
            "third axis, across the rod",
            "unknown",
            f"across the rod gravity would bend it by {1e3 * sag:.1f} mm",
        )
    ranges = [1e3 * value for value in implied_ranges(ROUND).values()]
    record = paper_scene(ROUND)
    angle = stated(record.initial_tip_deflection_deg)
    rise = abs(1e3 * record.scene.rod.length * math.sin(math.radians(angle)))
    yield (
        "section 4.2, axes of experiment 4",
        "E2 and E3",
        "E3 is across the rod",
        f"error over its share: {ranges[0]:.1f} mm along E2, {ranges[1]:.1f} mm along E3; "
        f"a chord at {-angle} degrees needs {rise:.1f} mm",
    )
    scene, record = load_scene("paper5_circle"), paper_scene("paper5_circle")
    magnet, rod = scene.magnets[0], scene.rod
    level = G * rod.length * (rod.mass_per_length * rod.length / 6.0 + magnet.mass / 2.0) / magnet.moment
    yield (
        "section 4.3, field against gravity",
        f"{1e3 * stated(record.gravity_compensation_field):g} mT, no direction",
        "upwards",
        f"w L²/6 + W L/2 = m B levels the tip at {1e3 * level:.2f} mT",
    )
    for number, name, words in ((1, "paper1_aluminium_in_plane", "< 0.01 %"), (6, "paper6_two_magnets", "< 1 %")):
        record = paper_scene(name)
        share = max(error.largest for error in record.reported_errors) / record.scene.rod.length
        yield (f"section 5, largest error of experiment {number}", words, "of the length:", f"{100 * share:.3g} %")
    errors = [1e3 * error.largest for error in paper_scene(ROUND).reported_errors]
    yield (
        "abstract, largest error of experiment 4",
        "0.58 mm",
        "0.61 and 0.55 mm (Table 8)",
        f"their mean: {np.mean(errors):.2f} mm",
    )
    yield (
        "Cayley map, after eq. 12",
        "(I + psi^)/(I - psi^)",
        "(I + psi^/2)/(I - psi^/2)",
        f"0.5 rad come back as {0.5 + cayley_error(1.0):.3g} rad, with the half as {0.5 + cayley_error(0.5):.3g} rad",
    )


def audit(report: Report) -> None:
    """Both tables, and checks of what they rest on."""
    columns = "where | printed | what holds | arithmetic"
    for key, title, rows in (
        ("audit", "Audit: what changes the simulations", design_rows()),
        ("audit_more", "Audit: more that is arithmetic", other_rows()),
    ):
        with report.table(key, title, columns) as table:
            table.rows += rows
    worst = max(abs(ratio - 1.0) for some in table_ratios().values() for ratio in some)
    report.check("audit", "Tables 3-7 in mg: largest relative distance of an entry", worst, 0.02)
