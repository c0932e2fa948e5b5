"""Starts from a shape: arcs of known energy, rotations of any angle, what is refused, and the filters' starts."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from term_sets import dragged, loaded

from magrod_env import Rod, Scene, Simulation, load_scene
from magrod_env.estimation import EnsembleFilter, PredictionFilter, UnscentedFilter
from magrod_env.simulation.starts import checked_shape

ROD = Rod.circular(length=0.1, diameter=2e-3, density=1100.0, youngs_modulus=1e6, poissons_ratio=0.5)
SCENE = Scene(rod=ROD)


def arc(angle, nodes, across=(0.0, 1.0, 0.0)):
    """Positions (nodes, 3) and rotations (nodes, 3, 3) of a circular arc of length 0.1 that turns by `angle`."""
    turns = Rotation.from_rotvec(np.linspace(0.0, angle, nodes)[:, None] * np.array(across))
    share = np.linspace(0.0, 1.0, nodes) * angle
    along, aside = np.sin(share) * ROD.length / angle, (1.0 - np.cos(share)) * ROD.length / angle
    return np.outer(along, (1.0, 0.0, 0.0)) + np.outer(aside, np.cross(across, (1.0, 0.0, 0.0))), turns.as_matrix()


@pytest.mark.parametrize("plane, axis", [(None, (0, 0.6, -0.8)), ("xz", (0, 1, 0)), ("xy", (0, 0, -1))])
@pytest.mark.parametrize("angle", [0.3, 3.0, 6.0])
def test_an_arc_holds_the_energy_of_the_closed_form(angle, plane, axis):
    """EI angle^2/(2 L), whatever the number of elements: the helical element is exact for it."""
    simulation = Simulation(SCENE, num_elements=4, plane=plane)
    simulation.reset(shape=arc(angle, 5, axis))
    assert simulation.energy()[0] == pytest.approx(ROD.bending_stiffness * angle**2 / (2.0 * ROD.length), rel=1e-10)
    assert simulation.time == 0.0 and not simulation.velocities.any() and not simulation.angular_velocities.any()


def test_a_simulation_starts_again_in_a_shape_of_its_own():
    scene = dragged(load_scene("paper5_circle"))
    moving, again = (Simulation(scene, num_rods=2, num_elements=6) for _ in range(2))
    moving.advance(0.05, field=[(0.0, 0.0, 10e-3), (0.0, 5e-3, 0.0)])
    again.advance(0.01, field=(0.0, 0.0, 1e-3))
    again.reset(shape=(moving.positions, moving.rotations))
    np.testing.assert_allclose(again.positions, moving.positions, atol=1e-15)
    np.testing.assert_allclose(again.rotations, moving.rotations, atol=1e-14)
    assert not again.field.any() and not again.velocities.any()


def test_an_equilibrium_stays_where_it_is_put():
    scene, field = dragged(load_scene("paper4_pdms_tip_magnet")), (0.0, 0.0, 5e-3)
    still = Simulation(scene, num_elements=5)
    still.reset(field=field)
    put = Simulation(scene, num_elements=5)
    put.reset(shape=(still.positions[0], still.rotations[0]))
    put.advance(0.2, field=field)
    np.testing.assert_allclose(put.positions, still.positions, atol=1e-9)


@pytest.mark.parametrize("plane", [None, "xz"])
def test_an_equilibrium_is_a_shape_as_it_is_and_by_its_parts(plane):
    simulation = Simulation(dragged(load_scene("paper4_pdms_tip_magnet")), num_rods=2, num_elements=4, plane=plane)
    case = simulation.equilibrium((2e-3, 0.0, 5e-3))
    both = np.stack([case.quaternions, -case.quaternions])  # either sign is the same rotation
    for shape in (
        case,
        (case.positions, case.rotations),
        (case.positions, case.quaternions),
        (case.positions, both),
        (np.stack([case.positions] * 2), both),
    ):
        simulation.reset()
        simulation.reset(shape=shape)
        np.testing.assert_allclose(simulation.positions, [case.positions] * 2, atol=1e-15)
        np.testing.assert_allclose(simulation.rotations, [case.rotations] * 2, atol=1e-14)
        assert not simulation.field.any()
    simulation.advance(0.1, field=case.field, gradient=case.gradient if plane is None else None)
    np.testing.assert_allclose(simulation.positions, [case.positions] * 2, atol=1e-9)


def test_quaternions_of_rotations_by_any_angle():
    random = np.random.default_rng(3)
    angles = np.concatenate([[1e-9, np.pi, np.pi - 1e-7], random.uniform(0.0, np.pi, 300)])
    axes = random.normal(size=(len(angles), 3))
    axes[:3] = np.eye(3)
    turns = Rotation.from_rotvec(angles[:, None] * axes / np.linalg.norm(axes, axis=1, keepdims=True)).as_matrix()
    turns[0] = np.eye(3)
    _, found = checked_shape((np.zeros((len(turns), 3)), turns), 1, len(turns), 1.0, None)
    back = Rotation.from_quat(np.roll(found[0], -1, axis=-1)).as_matrix()
    np.testing.assert_allclose(back, turns, atol=1e-14)


POSITIONS, ROTATIONS = arc(1.0, 5, (0.0, 0.6, 0.8))


@pytest.mark.parametrize(
    "shape, sentence",
    [
        (POSITIONS, "shape must be a pair of positions and rotations"),
        ((POSITIONS[1:], ROTATIONS), r"positions of a shape must be finite of shape \(5, 3\) or \(2, 5, 3\)"),
        ((np.full((5, 3), np.nan), ROTATIONS), "positions of a shape must be finite"),
        ((POSITIONS, POSITIONS), "rotations of a shape must be finite of shape"),
        ((POSITIONS, 1.01 * ROTATIONS), "rotations of a shape must be rotation matrices"),
        ((POSITIONS, ROTATIONS * np.array([1.0, 1.0, -1.0])), "rotations of a shape must be rotation matrices"),
        ((POSITIONS, ROTATIONS[..., 0]), "rotations of a shape must be finite of shape .* as quaternions"),
        ((POSITIONS, np.full((5, 4), 0.6)), "rotations of a shape must be unit quaternions, but their length is off"),
        ((POSITIONS, np.full((5, 4), np.nan)), "rotations of a shape must be finite"),
        ((POSITIONS, np.tile([0.6, 0.8, 0.0, 0.0], (5, 1))), "shape must be clamped at the origin"),
        ((POSITIONS, [[1.0], 2.0]), "rotations of a shape must be finite"),
        ((POSITIONS, "straight"), "rotations of a shape must be finite"),
        ((POSITIONS + 1e-3, ROTATIONS), "shape must be clamped at the origin"),
    ],
)
def test_a_shape_of_no_clamped_rod_is_refused_and_nothing_has_changed(shape, sentence):
    simulation = Simulation(SCENE, num_rods=2, num_elements=4)
    with pytest.raises(ValueError, match=sentence):
        simulation.reset(shape=shape)
    assert simulation.positions[0, -1, 0] == ROD.length


def test_a_shape_across_the_plane_or_beside_a_field_is_refused():
    with pytest.raises(ValueError, match="shape must lie in the plane"):
        Simulation(SCENE, num_elements=4, plane="xz").reset(shape=(POSITIONS, ROTATIONS))
    with pytest.raises(ValueError, match="shape must be None beside a field"):
        Simulation(SCENE, num_elements=4).reset(field=(0.0, 0.0, 0.0), shape=(POSITIONS, ROTATIONS))
    with pytest.raises(ValueError, match="shape must be None beside a gradient"):
        Simulation(SCENE, num_elements=4).reset(gradient=np.zeros((3, 3)), shape=(POSITIONS, ROTATIONS))


def test_a_shape_in_a_plane_but_for_rounding_stays_in_it_by_implicit_steps_too():
    positions, rotations = arc(1.0, 5, (0.0, 1.0, 0.0))
    off = Rotation.from_rotvec((1e-9, 0.0, 1e-9)).as_matrix()
    rotations[1:] = rotations[1:] @ off
    simulation = Simulation(loaded(SCENE), num_elements=4, plane="xz", integrator="implicit")
    simulation.reset(shape=(positions + (0.0, 1e-12, 0.0), rotations))
    simulation.advance(0.1)
    assert not simulation.positions[..., 1].any() and not simulation.rotations[..., 1, [0, 2]].any()


# ---- filters

BENT = Simulation(dragged(load_scene("paper4_pdms_tip_magnet")), num_elements=4)
BENT.reset(field=(0.0, 3e-3, 6e-3))
SHAPE = (BENT.positions[0], BENT.rotations[0])


@pytest.mark.parametrize("kind, options", [(EnsembleFilter, {"num_members": 8}), (UnscentedFilter, {"num_modes": 2})])
def test_filters_of_members_start_about_a_shape(kind, options):
    settings = {"num_rods": 2, "num_elements": 4, "tip_deviation": 0.0, **options}
    estimator = kind(BENT.scene, **settings)
    estimator.reset(shape=SHAPE, mask=[False, True])
    np.testing.assert_allclose(estimator.positions[1], SHAPE[0], atol=1e-10)
    np.testing.assert_allclose(estimator.positions[0, -1], (BENT.scene.rod.length, 0.0, 0.0), atol=1e-10)
    estimator.reset(shape=BENT.equilibrium((0.0, 3e-3, 6e-3)))
    np.testing.assert_allclose(estimator.positions[0], SHAPE[0], atol=1e-9)
    spread = kind(BENT.scene, **(settings | {"tip_deviation": 1e-3}))
    spread.reset(shape=SHAPE)
    assert np.all(spread.uncertainty[:, -1].max(axis=-1) > 2e-4)
    np.testing.assert_allclose(spread.positions[:, -1], [SHAPE[0][-1]] * 2, atol=1e-3)
    with pytest.raises(ValueError, match="shape must be None beside a field"):
        spread.reset(field=(0.0, 0.0, 0.0), shape=SHAPE)


def test_the_prediction_filter_starts_in_a_shape():
    estimator = PredictionFilter(BENT.scene, num_rods=2, num_elements=4)
    estimator.reset(shape=SHAPE, mask=np.array([False, True]))
    np.testing.assert_allclose(estimator.positions[1], SHAPE[0], atol=1e-12)
    np.testing.assert_allclose(estimator.positions[0, -1], (BENT.scene.rod.length, 0.0, 0.0), atol=1e-12)
