"""Rod, magnets and clamp as coloured quadrilaterals in the world frame."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from magrod_env.rendering import palette
from magrod_env.rendering.palette import Colour
from magrod_env.rendering.picture import Picture

Array = NDArray[np.float64]

_ROD_SEGMENTS: Final = 40  # at least, over the whole rod
_ROUND_SIDES: Final = 24


class Mesh(NamedTuple):
    """F faces of solids, world frame.

    corners: (F, 4, 3), m. normals: (F, 3), unit, outwards. colours: (F, 3), 0..255.
    lift: (F,), m, how far each face is moved towards the viewer when faces are sorted by depth.
    """

    corners: Array
    normals: Array
    colours: Array
    lift: Array


def centreline(nodes: Array, rotations: Array, element_length: float) -> tuple[Array, Array]:
    """Smooth curve through the nodes: cubic Hermite, with the rotations' first columns as tangents.

    nodes: (num_nodes, 3), m, world. rotations: (num_nodes, 3, 3), body to world.
    element_length: rest length, m.
    Returns points (num_points, 3) and frames (num_points, 3, 3), body to world.
    """
    u = np.linspace(0.0, 1.0, -(-_ROD_SEGMENTS // (len(nodes) - 1)), endpoint=False)[:, None]
    position = [1 - u * u * (3 - 2 * u), u * u * (3 - 2 * u), u * (1 - u) ** 2, u * u * (u - 1)]
    slope = [6 * u * (u - 1), 6 * u * (1 - u), (1 - u) * (1 - 3 * u), u * (3 * u - 2)]
    tangents = element_length * rotations[:, :, 0]
    controls = [x[:, None] for x in (nodes[:-1], nodes[1:], tangents[:-1], tangents[1:])]
    points, along = (
        np.add.reduce([w * c for w, c in zip(weights, controls, strict=True)]).reshape(-1, 3)
        for weights in (position, slope)
    )
    across = ((1 - u) * rotations[:-1, None, :, 1] + u * rotations[1:, None, :, 1]).reshape(-1, 3)
    points, along = np.vstack([points, nodes[-1:]]), np.vstack([along, tangents[-1:]])
    return points, _frames(along, np.vstack([across, rotations[-1:, :, 1]]))


def build_mesh(picture: Picture, nodes: Array, rotations: Array, element_length: float) -> Mesh:
    """All faces of clamp, rod and magnets; magnets on nodes beyond the given ones are left out."""
    points, frames = centreline(nodes, rotations, element_length)
    rod_profile = _profile(picture.radius, picture.section)
    parts = [
        *_clamp(picture),
        _tube(points, frames, rod_profile, palette.ROD),
        _cap(points[-1], frames[-1], rod_profile, palette.ROD),
        *_magnets(picture, nodes, rotations),
    ]
    return Mesh(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _clamp(picture: Picture) -> list[Mesh]:
    """A short stout cylinder that ends at the origin, where the rod begins."""
    profile = _profile(max(2.0 * picture.radius, 0.035 * picture.length), "circular")
    points = np.array([[-0.1 * picture.length, 0.0, 0.0], [0.0, 0.0, 0.0]])
    return _cylinder(points, np.eye(3), profile, (palette.CLAMP,))


def _magnets(picture: Picture, nodes: Array, rotations: Array) -> list[Mesh]:
    """Two-tone cylinders along the dipoles, lifted by the rod's radius as if seen through clear silicone."""
    parts = []
    sizes = zip(picture.magnet_lengths, picture.magnet_radii, picture.magnet_directions, strict=True)
    for node, (length, radius, direction) in zip(picture.magnet_nodes, sizes, strict=True):
        if not -len(nodes) <= node < len(nodes):
            continue
        along = rotations[node] @ np.asarray(direction, dtype=float)
        across = rotations[node][:, np.argmin(np.abs(direction))]
        frame = _frames(along[None], across[None])[0]
        points = nodes[node] + np.linspace(-0.5, 0.5, 3)[:, None] * length * frame[:, 0]
        colours = (palette.SOUTH, palette.NORTH)
        parts += _cylinder(points, frame, _profile(radius, "circular"), colours, lift=picture.radius)
    return parts


def _cylinder(
    points: Array, frame: Array, profile: Array, colours: tuple[Colour, ...], lift: float = 0.0
) -> list[Mesh]:
    """A closed straight tube through the points, one colour for each stretch between two of them."""
    frames = np.broadcast_to(frame, (len(points), 3, 3))
    backwards = frame * (-1.0, 1.0, -1.0)
    sides = [_tube(points[i : i + 2], frames[i : i + 2], profile, c, lift) for i, c in enumerate(colours)]
    south = _cap(points[0], backwards, profile, colours[0], lift)
    north = _cap(points[-1], frame, profile, colours[-1], lift)
    return [*sides, south, north]


def _tube(points: Array, frames: Array, profile: Array, colour: Colour, lift: float = 0.0) -> Mesh:
    """Side faces of a profile (K, 2) swept along points (P, 3): (P - 1) K faces."""
    offsets = np.einsum("pij,kj->pki", frames[:, :, 1:], profile)
    quads = _ring_quads(offsets)
    normals = _unit(quads.sum(axis=1))
    return _mesh(_ring_quads(points[:, None] + offsets), normals, colour, lift)


def _cap(point: Array, frame: Array, profile: Array, colour: Colour, lift: float = 0.0) -> Mesh:
    """End face of a tube as a fan of K faces, facing along the frame's first column."""
    rim = point + profile @ frame[:, 1:].T
    centre = np.broadcast_to(point, rim.shape)
    corners = np.stack([centre, rim, np.roll(rim, -1, axis=0), centre], axis=1)
    return _mesh(corners, np.broadcast_to(frame[:, 0], rim.shape), colour, lift)


def _mesh(corners: Array, normals: Array, colour: Colour, lift: float) -> Mesh:
    count = len(corners)
    return Mesh(corners, normals, np.tile(np.asarray(colour, dtype=float), (count, 1)), np.full(count, lift))


def _ring_quads(rings: Array) -> Array:
    """Quadrilaterals ((P - 1) K, 4, 3) between neighbouring rings of points (P, K, 3)."""
    turned = np.roll(rings, -1, axis=1)
    return np.stack([rings[:-1], turned[:-1], turned[1:], rings[1:]], axis=2).reshape(-1, 4, 3)


def _profile(radius: float, section: str) -> Array:
    """Corners (K, 2) of a cross-section, m, on the body's second and third axes."""
    if section == "square":
        return radius * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    angles = np.linspace(0.0, 2 * np.pi, _ROUND_SIDES, endpoint=False)
    return radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _frames(along: Array, across: Array) -> Array:
    """Right-handed frames (P, 3, 3): first column along (P, 3), second as near to across (P, 3) as can be."""
    first = _unit(along)
    second = _unit(across - np.sum(across * first, axis=1, keepdims=True) * first)
    return np.stack([first, second, np.cross(first, second)], axis=2)


def _unit(vectors: Array) -> Array:
    lengths: Array = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None]
    unit: Array = vectors / np.maximum(lengths, 1e-30)
    return unit
