"""Where the numbers of a lane block lie: structure of arrays, one row of ``len(terms.lanes)`` rods for each quantity.

A block holds its rods' loads, magnets, nodes and elements, constants beside state, so that a step touches one piece of
memory and every rod may have its own material, magnets, gravity and field. SI units; node 0 is the clamp.
"""

from typing import NamedTuple

import numpy as np

from magrod_env._jit import Present

CACHE_LINE = 64  # bytes

# rows of a block that belong to the whole rod
GRAVITY = 0  # 3, m/s^2, world
FIELD = 3  # 3, T, world: the field that acts now
REFERENCE = 6  # 3, T: slew-limited command, where the coils have a slew limit
TARGET = 9  # 3, T: commanded field
GRADIENT = 12  # 9, T/m: dB_i/dx_j, row by row
DRAG = 21  # 1, 1/s
DAMPING = 22  # 1, s: Kelvin-Voigt time
LEAST_COSINE = 23  # 1: least cos(theta/2) of any element since it was last set: 0 is a bend of pi in one element
ENERGY = 24  # 1, J: least energy that the watchdog saw, plus what the field may have put in since
SPIN_DRAG = 25  # 1, 1/s
ROD_ROWS = 26

# rows of an element: m, 1/m, EA, GA (N), EI/h, GJ/h (N m); of the helical element
# also 12 EI/h^2 and the sway of ``write_rod`` (N)
LENGTH, INVERSE_LENGTH, AXIAL, SHEAR, BENDING, TORSION, TILT, SWAY = range(8)
ELEMENT_ROWS = 8


class NodeRows(NamedTuple):
    """Offsets inside a node: position (m, world), rotation, velocity (m/s), momentum (body, kg m^2/s), then
    constants.
    """

    position: int
    rotation: int
    velocity: int
    momentum: int
    inverse_mass: int  # 1/kg
    compliance: int  # 1/(2 J): axial and transverse (planar: transverse only), 1/(kg m^2)
    size: int


SPATIAL = NodeRows(position=0, rotation=3, velocity=7, momentum=10, inverse_mass=13, compliance=14, size=16)
PLANAR = NodeRows(position=0, rotation=2, velocity=4, momentum=6, inverse_mass=7, compliance=8, size=9)


class Terms(NamedTuple):
    """What a scene contains: ``PRESENT``, or ``None`` for a term whose code is not in the compiled kernel."""

    lanes: tuple  # (0,) * L: a type, so that L is known to the compiler
    planar: Present | None = None
    nodal: Present | None = None
    gravity: Present | None = None
    magnets: Present | None = None
    gradient: Present | None = None
    drag: Present | None = None
    spin_drag: Present | None = None
    internal_damping: Present | None = None
    slew: Present | None = None
    lag: Present | None = None
    turned: Present | None = None  # coils with a slew limit, turned against the world or of another gain
    node_damping: Present | None = None  # a viscous force on every node, of its own for each world axis
    loads: tuple = ()  # or LoadTerms, where the scene lists loads (loads/hub.py)


class Layout(NamedTuple):
    """Row numbers of a block's parts, for one number of elements and one set of magnet nodes."""

    num_elements: int
    magnet_nodes: tuple  # node of each magnet
    magnets: int  # first row of the magnets: 3 a magnet, dipole moment in the body frame (A m^2)
    nodes: int
    elements: int
    mixing: int  # 9, from the coils' reference to the field, row by row, where the coils are turned
    node_damping: int  # 3 (planar: 2) a node, kg/s, world axes, where the nodes have a damping of their own
    size: int
    loads: tuple = ()  # or LoadRows, where the scene lists loads


def make_layout(num_elements: int, magnet_nodes: tuple[int, ...], terms: Terms) -> Layout:
    """Rows of a block with these elements and magnets.

    Compiled code cannot index an empty tuple: without magnets there is one with no moment on the clamp, which nothing
    reads.
    """
    magnet_nodes = magnet_nodes or (0,)
    node_rows = SPATIAL.size if terms.planar is None else PLANAR.size
    magnets = ROD_ROWS
    nodes = magnets + 3 * len(magnet_nodes)
    elements = nodes + node_rows * (num_elements + 1)
    mixing = elements + ELEMENT_ROWS * num_elements
    node_damping = mixing + (0 if terms.turned is None else 9)
    axes = 3 if terms.planar is None else 2
    size = node_damping + (0 if terms.node_damping is None else axes * (num_elements + 1))
    return Layout(num_elements, magnet_nodes, magnets, nodes, elements, mixing, node_damping, size)


def make_blocks(num_rods: int, layout: Layout, terms: Terms, dtype) -> np.ndarray:
    """Zeroed lane blocks for ``num_rods`` rods, shape (num_blocks, layout.size * L).

    They begin on a cache line: a row that straddles two lines takes twice as long to read and to write.
    """
    lanes = len(terms.lanes)
    shape = (-(-num_rods // lanes), layout.size * lanes)
    room = np.zeros(shape[0] * shape[1] + CACHE_LINE, dtype)
    start = -room.ctypes.data % CACHE_LINE // room.itemsize
    return room[start : start + shape[0] * shape[1]].reshape(shape)


def rows_of(blocks: np.ndarray, lanes: int) -> np.ndarray:
    """View of the blocks as (num_blocks, rows, L)."""
    return blocks.reshape(len(blocks), -1, lanes)
