"""The drawn curve against the circular arc that it stands for, and faces that look outwards."""

import numpy as np
import pytest

pytest.importorskip("PIL")

from bent_rod import LENGTH, PICTURE, arc

from magrod_env.rendering import Picture
from magrod_env.rendering.mesh import build_mesh, centreline


@pytest.mark.parametrize("num_nodes", [3, 5, 11])
def test_centreline_follows_an_arc_between_nodes(num_nodes):
    curvature = 12.0
    points, frames = centreline(*arc(curvature, num_nodes), LENGTH / (num_nodes - 1))
    radii = np.hypot(points[:, 0], points[:, 2] - 1 / curvature)
    # A cubic misses a circle by order h^4 kappa^3: 30 micrometres with two elements.
    np.testing.assert_allclose(radii, 1 / curvature, atol=40e-6 * (2 / (num_nodes - 1)) ** 4)
    np.testing.assert_allclose(np.swapaxes(frames, 1, 2) @ frames, np.eye(3) + np.zeros_like(frames), atol=1e-12)


def test_centreline_passes_through_the_nodes():
    nodes, rotations = arc(12.0)
    points, _ = centreline(nodes, rotations, LENGTH / 10)
    np.testing.assert_allclose(points[:: (len(points) - 1) // 10], nodes, atol=1e-15)


@pytest.mark.parametrize("section", ["circular", "square"])
def test_rod_faces_look_away_from_the_centreline(section):
    picture = Picture(length=LENGTH, radius=2e-3, section=section)
    mesh = build_mesh(picture, *arc(1e-3), LENGTH / 10)
    offsets = mesh.corners.mean(axis=1)
    sideways = np.abs(mesh.normals[:, 0]) < 0.5
    assert np.all(np.sum(offsets[sideways, 1:] * mesh.normals[sideways, 1:], axis=1) > 0)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-12)


def test_magnets_on_missing_nodes_are_left_out():
    nodes, rotations = arc(12.0)
    picture = Picture(
        length=LENGTH,
        radius=2e-3,
        magnet_nodes=(10,),
        magnet_lengths=(4e-3,),
        magnet_radii=(1e-3,),
        magnet_directions=((0.0, 0.0, -1.0),),
    )
    whole = build_mesh(picture, nodes, rotations, LENGTH / 10)
    cut = build_mesh(picture, nodes[:9], rotations[:9], LENGTH / 10)
    assert np.any(whole.lift > 0) and not np.any(cut.lift > 0)


def test_tip_magnet_lies_along_its_dipole():
    nodes, rotations = arc(12.0)
    mesh = build_mesh(PICTURE, nodes, rotations, LENGTH / 10)
    along = (mesh.corners[mesh.lift > 0] - nodes[-1]) @ rotations[-1]
    np.testing.assert_allclose([along[..., 0].min(), along[..., 0].max()], [-2e-3, 2e-3], atol=1e-12)
    np.testing.assert_allclose(np.hypot(along[..., 1], along[..., 2]).max(), 1e-3, atol=1e-12)
