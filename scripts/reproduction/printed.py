"""Numbers of Tariverdi et al. 2020 as printed, where the scenes' records do not hold them."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

from magrod_env.scenes import paper_scene

MASS_UNIT = 1e-6  # kg: the milligram that Tables 3 to 7 are in, all but M
FORCE_PER_LENGTH = MASS_UNIT  # mg/s^2
FORCE = MASS_UNIT * 1e-3  # mg mm/s^2, N
STIFFNESS = FORCE * 1e-6  # mg mm^3/s^2, N m^2
INERTIA = MASS_UNIT * 1e-3  # mg mm, kg m

Stated = TypeVar("Stated")


class PrintedTable(NamedTuple):
    """One of Tables 3 to 7: M in g/mm, the others in mg, mm and s (printed: g)."""

    source: str
    mass: float
    inertia: float
    weight: float
    stretch: float
    shear: float
    twist: float
    bend: float


TABLES = {
    "paper1_aluminium_in_plane": PrintedTable(
        "Table 3", 8.45e-3, 2.11, 8.29e4, stretch=2.35e14, shear=0.88e14, twist=4.42e13, bend=5.89e13
    ),
    "paper2_aluminium_out_of_plane": PrintedTable(
        "Table 4", 2.11e-3, 0.13, 2.07e4, stretch=5.89e13, shear=2.21e13, twist=2.76e12, bend=3.68e12
    ),
    "paper3_pdms_no_magnet": PrintedTable(
        "Table 5", 21.62e-3, 33.78, 2.12e5, stretch=7.17e9, shear=2.39e9, twist=0.75e10, bend=1.12e10
    ),
    "paper4_pdms_tip_magnet": PrintedTable(
        "Table 6", 13.83e-3, 13.83, 1.357e5, stretch=4.58e9, shear=1.53e9, twist=3.06e9, bend=4.59e9
    ),
    "paper6_two_magnets": PrintedTable(
        "Table 7", 4.40e-3, 1.47, 4.32e4, stretch=1.46e10, shear=0.49e10, twist=3.25e9, bend=4.87e9
    ),
}

TIP_WEIGHT = 1.36e5  # Table 6: F^c of the last node, mg/s^2

SHARES = {  # Table 8: the largest errors in per cent of a range of motion, in the order of the records' errors
    "paper1_aluminium_in_plane": (2.50,),
    "paper2_aluminium_out_of_plane": (2.12,),
    "paper3_pdms_no_magnet": (4.87, 4.89),
    "paper4_pdms_tip_magnet": (3.35, 1.16),
    "paper5_circle": (1.43,),
    "paper6_two_magnets": (2.24, 5.13, 2.05, 3.68),
}


def stated(value: Stated | None) -> Stated:
    """A number of a scene's record that the paper states.

    Raises:
        ValueError: where it does not.
    """
    if value is None:
        raise ValueError("a number of the record must be stated by the paper, but got None: choose another scene.")
    return value


def implied_ranges(name: str) -> dict[tuple[str, str], float]:
    """Range of motion, m, by (point, direction): the largest error of Table 8 over its printed share."""
    errors = paper_scene(name).reported_errors
    return {
        (error.point, error.direction): error.largest / (1e-2 * share) for error, share in zip(errors, SHARES[name])
    }
