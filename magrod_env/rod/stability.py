"""Linearised rod: natural frequencies and the largest stable time step."""

import numpy as np

from magrod_env.rod.layout import AXIAL, BENDING, ELEMENT_ROWS, LENGTH, SHEAR, SPATIAL, TILT, Layout, Terms
from magrod_env.rod.loads.hub import nodal_sizes
from magrod_env.rod.tangent import BAND, LANES, assemble, band_width

ROUNDING = 1e-13  # of the largest eigenvalue
NEARLY_REAL = 1e-6  # of an eigenvalue: its imaginary part
ACTIVE = {None: [0, 1, 2, 3, 4, 5], "xy": [0, 1, 5], "xz": [0, 2, 4]}  # degrees of freedom of a node


def linearise(column, layout: Layout, terms: Terms, positions, rotations):
    """Dense stiffness (6 N, 6 N) and lumped inertia (6 N,) of one rod at a configuration.

    ``column`` (rows,) holds the rod's constants and loads; ``positions`` (N + 1, 3) m, ``rotations`` (N + 1, 4).
    """
    size, width = 6 * layout.num_elements, len(LANES)
    block = np.repeat(column, width)
    nodes = block.reshape(-1, width)[layout.nodes : layout.elements].reshape(-1, SPATIAL.size, width)
    nodes[:, SPATIAL.position : SPATIAL.position + 3] = positions[..., None]
    nodes[:, SPATIAL.rotation : SPATIAL.rotation + 4] = rotations[..., None]
    wide = band_width(terms)
    system, out = np.zeros((size + wide * size) * width), np.zeros(18 * width)
    assemble(block, layout, terms, terms.nodal, terms.gradient, np.ones(2 * width), system, out, 4)
    band = system.reshape(-1, width)[size:, 0].reshape(size, wide)
    stiffness = np.zeros((size, size))
    for i in range(size):
        for k in range(max(0, BAND - 1 - i), BAND):
            j = i - (BAND - 1 - k)
            stiffness[i, j] = stiffness[j, i] = band[i, k]
            if wide > BAND:
                stiffness[j, i] = band[j, BAND - 1 + i - j]
    places = layout.nodes + SPATIAL.size * np.arange(1, layout.num_elements + 1)
    mass = 1.0 / column[places + SPATIAL.inverse_mass]
    axial, transverse = 0.5 / column[places + SPATIAL.compliance], 0.5 / column[places + SPATIAL.compliance + 1]
    return stiffness, np.stack([mass, mass, mass, axial, transverse, transverse], axis=1).ravel()


def straight(column, layout: Layout):
    """Positions (N + 1, 3) and rotations (N + 1, 4) of the straight rod of a column of constants."""
    lengths = column[layout.elements + LENGTH + ELEMENT_ROWS * np.arange(layout.num_elements)]
    positions, rotations = np.zeros((layout.num_elements + 1, 3)), np.zeros((layout.num_elements + 1, 4))
    positions[1:, 0] = np.cumsum(lengths)
    rotations[:, 0] = 1.0
    return positions, rotations


def angular_frequencies(stiffness, inertia, plane: str | None):
    """Natural angular frequencies, rad/s, increasing; NaN for the directions in which the rod is unstable: where its
    stiffness is negative or, under loads without a potential, where it flutters.
    """
    keep = [6 * (i // 6) + i % 6 for i in range(len(inertia)) if i % 6 in ACTIVE[plane]]
    root = 1.0 / np.sqrt(inertia[keep])
    scaled = root[:, None] * stiffness[np.ix_(keep, keep)] * root
    if np.array_equal(scaled, scaled.T):
        squares = np.linalg.eigvalsh(scaled)
    else:
        squares = np.sort(real_parts(np.linalg.eigvals(scaled)))
    return np.sqrt(np.where(squares >= 0.0, squares, np.nan))


def real_parts(values):
    """Those of the eigenvalues that are real, NaN for the others."""
    largest = np.abs(values).max()
    return np.where(np.abs(values.imag) <= NEARLY_REAL * np.abs(values) + ROUNDING * largest, values.real, np.nan)


def diverges(stiffness) -> bool:
    """Whether a stiffness that is not symmetric has a negative eigenvalue: a displacement then grows by itself."""
    values = real_parts(np.linalg.eigvals(stiffness))
    return bool((values < 0.0).any())


def stable_time_step(
    column, layout: Layout, terms: Terms, field_magnitude: float, plane: str | None, added=0.0, pull: float = 0.0
) -> float:
    """Largest stable time step of the straight rod, s, in a field of any direction up to ``field_magnitude`` T.

    2/omega_max of the linearised rod; a dipole adds at most |m||B| to its node's rotational stiffness (Rayleigh's
    bound). ``added`` (6 N,) is further stiffness on the diagonal. ``pull`` (T/m) is the largest entry of a field
    gradient, which may pull every magnet along the rod with |m| times as much: tension stiffens the sections' rotation.
    Internal damping does not shorten the step. Listed loads count with their sizes, in whatever direction: forces pull
    the rod along, moments and forces that follow add stiffness (``load_stiffness``).
    """
    positions, rotations = straight(column, layout)
    sizes = nodal_sizes(column, layout, terms)
    stretched = positions
    if pull > 0.0 or sizes.any():
        stretched = stretch(column, layout, positions, pull, sizes[:, 0] + sizes[:, 1])
    stiffness, inertia = linearise(column, layout, terms._replace(magnets=None, loads=()), stretched, rotations)
    stiffness += np.diag(load_stiffness(positions, sizes))
    for number, node in enumerate(layout.magnet_nodes):
        for k in (3, 4, 5):
            i = 6 * (node - 1) + k
            stiffness[i, i] += moment_of(column, layout, number) * field_magnitude
    return time_step_bound(stiffness + np.diag(np.zeros(len(inertia)) + added), inertia, plane)


def moment_of(column, layout: Layout, magnet: int) -> float:
    """Dipole moment of a magnet, A m^2."""
    return float(np.linalg.norm(column[layout.magnets + 3 * magnet :][:3]))


def load_stiffness(positions, sizes):
    """Diagonal stiffness (6 N,) that bounds what loads of ``sizes`` (see ``nodal_sizes``) add to the tangent.

    A moment M couples rotations, by |M| at most. A following force F couples a node's displacement with its rotation by
    |F|; 2 ab <= a^2 + b^2 makes that |F|/h and |F| h of the length h of the element before it.
    """
    added = np.zeros((len(sizes) - 1, 6))
    length = np.diff(positions[:, 0])[:, None]
    added[:, :3] += sizes[1:, 1:2] / length
    added[:, 3:] += sizes[1:, 1:2] * length + sizes[1:, 2:3]
    return added.ravel()


def stretch(column, layout: Layout, positions, pull: float, forces):
    """Positions (N + 1, 3) of the straight rod whose magnets are pulled along it with ``pull`` times their moments, and
    its nodes with ``forces`` (N + 1,) N.
    """
    elements = layout.elements + ELEMENT_ROWS * np.arange(layout.num_elements)
    tension = np.cumsum(forces[:0:-1])[::-1]
    for number, node in enumerate(layout.magnet_nodes):
        tension[:node] += pull * moment_of(column, layout, number)
    stretched = positions.copy()
    stretched[1:, 0] += np.cumsum(tension * column[elements + LENGTH] / column[elements + AXIAL])
    return stretched


def time_step_bound(stiffness, inertia, plane: str | None) -> float:
    """Largest stable step of a linearised rod, s."""
    return float(2.0 / np.nanmax(angular_frequencies(stiffness, inertia, plane)))


def shock_stiffness(column, layout: Layout, field_magnitude: float):
    """Diagonal stiffness (6 N,), N m, that a sudden field of ``field_magnitude`` T may add to the sections' rotations.

    The field turns a magnet's section before its neighbours move: to twice the angle at which its elements hold it, so
    d = 2 m B/k with k = sum of GA* h/4 + EI/h. A turned element is shorter than its chord by a part of d^2, and its
    axial stiffness then adds to both ends' rotational stiffness; the diagonal bounds the matrix (docs/physics.md).
    """
    added = np.zeros((layout.num_elements + 1, 6))
    for number, node in enumerate(layout.magnet_nodes):
        moment = moment_of(column, layout, number)
        elements = {node - 1, min(node, layout.num_elements - 1)} - {-1}
        parts = {e: column[layout.elements + ELEMENT_ROWS * e :][:ELEMENT_ROWS] for e in elements}
        hold = sum(sheared(part) * part[LENGTH] / 4.0 + part[BENDING] for part in parts.values())
        turn = min(2.0 * moment * field_magnitude / hold, np.pi)
        for element, part in parts.items():
            squeeze = part[AXIAL] * part[LENGTH] * turn**2
            neighbour = element if element != node else element + 1
            added[node, 4:] += squeeze * (1.0 / 24.0 + 1.0 / 12.0)
            added[neighbour, 4:] += squeeze * (1.0 / 8.0 + 1.0 / 12.0)
    return added[1:].ravel()


def sheared(part) -> float:
    """Shear stiffness GA* of an element, N, from its rows; the nodal element's is GA."""
    return 1.0 / (1.0 / part[SHEAR] + (1.0 / part[TILT] if part[TILT] > 0.0 else 0.0))
