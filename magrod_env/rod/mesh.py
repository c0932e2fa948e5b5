"""From a rod and its magnets to the constants of a lane block: element lengths, stiffness, lumped masses.

A node sits at every magnet, so elements may differ in length from segment to segment (a segment lies between
neighbouring magnets or ends). Derived in docs/physics.md.
"""

from typing import NamedTuple

import numpy as np

from magrod_env._jit import jit
from magrod_env.rod.layout import (
    AXIAL,
    BENDING,
    ELEMENT_ROWS,
    INVERSE_LENGTH,
    LENGTH,
    PLANAR,
    SHEAR,
    SPATIAL,
    SWAY,
    TILT,
    TORSION,
)
from magrod_env.rod.loads.hub import write_carried


class RodValues(NamedTuple):
    """What a rod is made of, as kernels take it (SI, floats and arrays)."""

    ends: np.ndarray  # (num_segments,) arc length of each segment's end, m; the last is the rod's length
    axial: float  # EA, N
    shear: float  # GA, N
    bending: float  # EI, N m^2
    torsion: float  # GJ, N m^2
    mass_per_length: float  # kg/m
    rotary: float  # rotary inertia per length about a transverse axis, rho I, kg m
    polar: float  # rotary inertia per length about the tangent, 2 rho I, kg m
    magnet_masses: np.ndarray  # (num_magnets,), kg
    magnet_moments: np.ndarray  # (num_magnets, 3), A m^2, body frame


def split_elements(ends, num_elements: int) -> np.ndarray:
    """Number of elements of each segment, so that the longest element is as short as it can be.

    ``ends`` (num_segments,) m, increasing. Raises ValueError if a segment would be left without an element.
    """
    lengths = np.diff(np.concatenate(([0.0], np.asarray(ends, float))))
    if num_elements < len(lengths):
        raise ValueError(
            f"num_elements must be at least {len(lengths)}, one for each segment between magnets, but is {num_elements}"
        )
    counts = np.ones(len(lengths), np.int64)
    while counts.sum() < num_elements:
        counts[np.argmax(lengths / counts)] += 1
    return counts


@jit
def arc_lengths(ends, counts):
    """Arc length of every node, shape (num_elements + 1,), m."""
    arc = np.zeros(counts.sum() + 1)
    node, start = 0, 0.0
    for segment in range(len(counts)):
        for k in range(1, counts[segment] + 1):
            arc[node + k] = start + (ends[segment] - start) * k / counts[segment]
        node += counts[segment]
        start = ends[segment]
    return arc


@jit
def add_end_correction(weights, arc):
    """Add the Euler-Maclaurin term -(h^2/12) df + (h^4/720) d3f of the free end to quadrature weights, in place.

    The derivatives are those of the polynomial through the four nearest nodes; where these are not evenly spaced, which
    a magnet among them may bring about, or the clamp is one of them, through the three nearest, and df alone.
    """
    last = len(arc) - 1
    h = arc[last] - arc[last - 1]
    even = last > 3 and abs(arc[last] - arc[last - 3] - 3.0 * h) < 1e-9 * h
    count = 4 if even else 3
    for k in range(count):
        beside, slope = 1.0, 0.0 if k == 0 else 1.0
        for j in range(count):
            if j == k:
                continue
            beside *= arc[last - k] - arc[last - j]
            if k == 0:
                slope += 1.0 / (arc[last] - arc[last - j])
            elif j > 0:
                slope *= arc[last] - arc[last - j]
        first = slope if k == 0 else slope / beside
        third = 6.0 / beside if count == 4 else 0.0
        weights[last - k] += h * h * (-first / 12.0 + h * h * third / 720.0)


@jit
def lumped_lengths(arc, corrected):
    """Length of rod that each node carries, shape (num_nodes,), m: weights of a quadrature along the rod.

    Plain: the trapezoidal rule. Corrected: with the Euler-Maclaurin terms of every piece of constant h, between pieces
    -(h^2/12) df with the slope from the three nearest nodes, at the free end ``add_end_correction``, which gives
    Gregory's weights 251/720, 299/240, 211/240, 739/720 to a uniform rod. At the clamp the slope is zero; with one
    element the integrand's zero and zero slope there take the missing nodes' place.
    """
    last = len(arc) - 1
    weights = np.zeros(last + 1)
    for element in range(last):
        h = arc[element + 1] - arc[element]
        weights[element] += 0.5 * h
        weights[element + 1] += 0.5 * h
    if not corrected:
        return weights
    if last == 1:
        weights[1] = arc[1] / 3.0
        return weights
    plain = weights.copy()
    for node in range(1, last):
        before, after = arc[node] - arc[node - 1], arc[node + 1] - arc[node]
        factor = (after * after - before * before) / (12.0 * (before + after))
        weights[node + 1] += factor * before / after
        weights[node - 1] -= factor * after / before
        weights[node] += factor * (after / before - before / after)
    add_end_correction(weights, arc)
    share = 1.0  # of the correction: all of it unless a short segment beside a long one would make a node too light
    for node in range(1, last + 1):
        if weights[node] < 0.5 * plain[node]:
            share = min(share, 0.5 * plain[node] / (plain[node] - weights[node]))
    return plain + share * (weights - plain)


@jit
def write_rod(rows, lane, layout, counts, values, planar, nodal):
    """Write one rod's constants into a lane of a block ``rows`` (num_rows, L), and lay it straight and at rest."""
    write_constants(rows, lane, layout, counts, values, planar, nodal)
    write_straight(rows, lane, layout, planar)


@jit
def write_constants(rows, lane, layout, counts, values, planar, nodal):
    """Write one rod's constants into lane ``lane`` of a block ``rows`` (num_rows, L); its motion stays.

    The helical element gets corrected masses, the nodal element those of the paper. In the plane of its bend, shear
    meets less stiffness, by ``sway`` (N) of the bend squared (docs/physics.md).
    """
    arc = arc_lengths(values.ends, counts)
    carried = lumped_lengths(arc, nodal is None)
    write_carried(rows, lane, layout, layout.loads, carried)
    node_rows = SPATIAL if planar is None else PLANAR
    for node in range(len(arc)):
        row = layout.nodes + node_rows.size * node
        mass = values.mass_per_length * carried[node]
        for magnet in range(len(layout.magnet_nodes)):
            if layout.magnet_nodes[magnet] == node:
                mass += values.magnet_masses[magnet]
        rows[row + node_rows.inverse_mass, lane] = 1.0 / mass
        inertia = values.rotary * carried[node]
        if planar is None:
            rows[row + node_rows.compliance, lane] = 0.5 / (values.polar * carried[node])
            rows[row + node_rows.compliance + 1, lane] = 0.5 / inertia
        else:
            rows[row + node_rows.compliance, lane] = 0.5 / inertia
    for element in range(len(arc) - 1):
        row = layout.elements + ELEMENT_ROWS * element
        h = arc[element + 1] - arc[element]
        rows[row + LENGTH, lane] = h
        rows[row + INVERSE_LENGTH, lane] = 1.0 / h
        rows[row + AXIAL, lane] = values.axial
        rows[row + SHEAR, lane] = values.shear
        rows[row + BENDING, lane] = values.bending / h
        rows[row + TORSION, lane] = values.torsion / h
        if nodal is None:
            tilting = 12.0 * values.bending / (h * h)
            corrected = values.shear * tilting / (values.shear + tilting)
            tilted = corrected / tilting
            rows[row + TILT, lane] = tilting
            rows[row + SWAY, lane] = corrected * (
                tilted / 30.0 + corrected / (12.0 * max(values.axial, 2.0 * values.shear))
            )
    for magnet in range(len(layout.magnet_nodes)):
        for axis in range(3):
            rows[layout.magnets + 3 * magnet + axis, lane] = values.magnet_moments[magnet, axis]


@jit
def write_straight(rows, lane, layout, planar):
    """Lay one rod straight along +x, at rest."""
    node_rows = SPATIAL if planar is None else PLANAR
    arc = 0.0
    for node in range(layout.num_elements + 1):
        row = layout.nodes + node_rows.size * node
        for k in range(node_rows.inverse_mass):
            rows[row + k, lane] = 0.0
        rows[row + node_rows.position, lane] = arc
        rows[row + node_rows.rotation, lane] = 1.0
        if node < layout.num_elements:
            arc += rows[layout.elements + ELEMENT_ROWS * node + LENGTH, lane]
