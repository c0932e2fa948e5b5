"""Both elements against the gradient of their energy, closed forms of uniform strain, and rigid motions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from magrod_env.rod.helical import helical_loads, helical_strain, helical_strain_rates, helical_stress
from magrod_env.rod.nodal import nodal_loads, nodal_strain
from magrod_env.rod.planar import (
    planar_helical_loads,
    planar_helical_strain,
    planar_helical_stress,
    planar_nodal_loads,
    planar_nodal_strain,
)
from rod.truth import exact_loads, exact_strain_rates, exact_strains, helical_energy, nodal_energy

LENGTH = 6e-3  # m
STIFFNESS = EA, GA, GJ, EI = 4.6, 1.53, 3.06e-6, 4.59e-6  # about those of a polymer rod of 4 mm, N and N m^2
TILTING = 12.0 * EI / LENGTH**2
SHARE = GA / (GA + TILTING)
SWAY = TILTING * SHARE**2 / 30.0 + (TILTING * SHARE) ** 2 / (12.0 * EA)
RNG = np.random.default_rng(7)
# rotation across the element (rad) and strain of its chord
BENDS = {"none": 0.0, "tiny": 1e-9, "small": 1e-4, "moderate": 0.3, "right_angle": 1.6, "large": 2.8, "near_pi": 3.1}
STRETCHES = {"none": 0.0, "small": 1e-3, "strong": 0.5}


def quaternion(rotation):
    x, y, z, w = rotation.as_quat()
    return float(w), float(x), float(y), float(z)


def pose(position, rotation):
    return tuple(float(x) for x in position), quaternion(rotation)


def random_poses(bend, stretch, seed):
    """Two poses, b turned by ``bend`` against a, their chord that of a straight element but for about ``stretch``."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    a = Rotation.random(random_state=seed)
    b = a * Rotation.from_rotvec(bend * axis / np.linalg.norm(axis))
    start = rng.normal(size=3) * 0.01
    middle = a * Rotation.from_rotvec(0.5 * bend * axis / np.linalg.norm(axis))
    chord = middle.apply([1.0, 0.0, 0.0] + stretch * rng.normal(size=3))
    return pose(start, a), pose(start + LENGTH * chord, b)


# poses of an element: bends and stretches that are special, and any
poses_of_elements = st.builds(
    random_poses,
    st.sampled_from(list(BENDS.values())) | st.floats(0.0, 3.1),
    st.sampled_from(list(STRETCHES.values())) | st.floats(0.0, 0.5),
    st.integers(0, 9),
)
all_poses = given(poses=poses_of_elements)


def stiff(vector, axial, across):
    return axial * vector[0], across * vector[1], across * vector[2]


def helical(pose_a, pose_b):
    """Loads of the helical element, as float arrays."""
    gamma, phi, geometry = helical_strain(pose_a, pose_b, 1.0 / LENGTH)
    section = (EA, GA, EI / LENGTH, GJ / LENGTH, TILTING, SWAY)
    stress, moment = helical_stress(gamma, phi, LENGTH, 1.0 / LENGTH, section)
    return tuple(np.array(load) for load in helical_loads(gamma, phi, geometry, stress, moment, LENGTH))


def nodal(pose_a, pose_b):
    """Loads of the paper's element, as float arrays."""
    gamma_a, gamma_b, g, frames = nodal_strain(pose_a, pose_b, 1.0 / LENGTH)
    stresses = [stiff((gamma[0] - 1.0, gamma[1], gamma[2]), EA, GA) for gamma in (gamma_a, gamma_b)]
    moment = stiff(g, 2.0 * GJ / LENGTH, 2.0 * EI / LENGTH)
    return tuple(np.array(load) for load in nodal_loads(gamma_a, gamma_b, g, frames, *stresses, moment, LENGTH))


ELEMENTS = {"helical": (helical, helical_energy), "nodal": (nodal, nodal_energy)}
both_elements = pytest.mark.parametrize("element", ELEMENTS)


def rounding(loads):
    """What rounding leaves of a force: a few last places of the stiffness and of the loads themselves.

    Strains near 1 are differences of poses; the nodal element's bending strain, tan(theta/2), is steep near pi.
    """
    largest = max(np.abs(loads[0]).max(), np.abs(np.concatenate(loads[1:])).max() / LENGTH)
    return 3e-15 * EA + 5e-15 * largest


@both_elements
@all_poses
def test_loads_are_minus_the_gradient_of_the_energy(element, poses):
    loads_of, energy = ELEMENTS[element]
    expected = exact_loads(energy, *poses, LENGTH, STIFFNESS)
    steep = 30.0 if element == "nodal" else 1.0  # 1/cos(theta/2) at 3.1 rad is 48
    tolerance = steep * rounding(expected)
    for got, want, unit in zip(loads_of(*poses), expected, (1.0, LENGTH, LENGTH), strict=True):
        np.testing.assert_allclose(got, want, rtol=0, atol=tolerance * unit)


@both_elements
@all_poses
def test_loads_of_one_element_balance(element, poses):
    """Forces are opposite by construction; the torques and the couple of the forces add to zero."""
    (position_a, a), (position_b, b) = poses
    force, torque_a, torque_b = ELEMENTS[element][0](*poses)
    rotation_a, rotation_b = (Rotation.from_quat(np.roll(q, -1)) for q in (a, b))
    couple = np.cross(np.subtract(position_b, position_a), -force)
    total = rotation_a.apply(torque_a) + rotation_b.apply(torque_b) + couple
    scale = 30.0 * LENGTH * rounding((force, torque_a, torque_b))
    np.testing.assert_allclose(total, 0.0, atol=scale)


@both_elements
@all_poses
def test_a_rigid_motion_turns_the_force_and_keeps_the_torques(element, poses):
    loads_of, _ = ELEMENTS[element]
    turn, shift = Rotation.random(random_state=9), np.array([0.02, -0.01, 0.03])
    moved = [pose(turn.apply(p) + shift, turn * Rotation.from_quat(np.roll(q, -1))) for p, q in poses]
    before, after = loads_of(*poses), loads_of(*moved)
    tolerance = 30.0 * rounding(before)
    np.testing.assert_allclose(after[0], turn.apply(before[0]), atol=tolerance)
    np.testing.assert_allclose(after[1], before[1], atol=tolerance * LENGTH)
    np.testing.assert_allclose(after[2], before[2], atol=tolerance * LENGTH)


@both_elements
def test_no_loads_where_the_rod_only_moves(element):
    for seed in range(5):
        a = Rotation.random(random_state=seed)
        start = RNG.normal(size=3) * 0.05
        loads = ELEMENTS[element][0](pose(start, a), pose(start + a.apply([LENGTH, 0.0, 0.0]), a))
        np.testing.assert_allclose(loads[0], 0.0, atol=1e-14 * EA)
        np.testing.assert_allclose(loads[1:], 0.0, atol=1e-14 * EA * LENGTH)


@both_elements
def test_the_sign_of_a_quaternion_does_not_matter_to_a_pose_alone(element):
    """Both ends may flip together; a section turned by 2 pi against its neighbour is another state."""
    (position_a, a), (position_b, b) = poses = random_poses(0.3, 1e-3, 0)
    flipped = ((position_a, tuple(-x for x in a)), (position_b, tuple(-x for x in b)))
    for got, want in zip(ELEMENTS[element][0](*flipped), ELEMENTS[element][0](*poses), strict=True):
        np.testing.assert_array_equal(got, want)


# ---- uniform strain: closed forms of the helical element


@pytest.mark.parametrize("angle", [1e-8, 0.2, np.pi / 2, 3.0])
@pytest.mark.parametrize("stretch", [1.0, 1.3])
def test_a_circular_arc_has_uniform_strain_and_a_pure_couple(angle, stretch):
    """An arc of length stretch*h has the strain (stretch, 0, 0); unstretched, its loads are the couples EI angle/h."""
    radius = stretch * LENGTH / angle
    b = Rotation.from_rotvec([0.0, 0.0, angle])
    poses = (
        pose((0, 0, 0), Rotation.identity()),
        pose(radius * np.array([np.sin(angle), 2 * np.sin(angle / 2) ** 2, 0]), b),
    )
    gamma, phi, _ = helical_strain(*poses, 1.0 / LENGTH)
    np.testing.assert_allclose(gamma, [stretch, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(phi, [0.0, 0.0, angle], rtol=1e-15)
    if stretch == 1.0:
        force, torque_a, torque_b = helical(*poses)
        couple = [0.0, 0.0, EI * angle / LENGTH]
        np.testing.assert_allclose(force, 0.0, atol=1e-14 * EA)
        np.testing.assert_allclose(torque_a, couple, atol=1e-14 * EA * LENGTH)
        np.testing.assert_allclose(torque_b, np.negative(couple), atol=1e-14 * EA * LENGTH)


@pytest.mark.parametrize("turns", [0.01, 0.2, 0.45])
def test_a_helix_has_uniform_strain(turns):
    """A coil of given radius and pitch angle has the curvature cos^2/r and the twist sin cos/r."""
    radius, slope = 2e-3, 0.6
    along = np.array(
        [np.sin(slope), 0.0, np.cos(slope)]
    )  # of the coil's axis z, in the frame (tangent, inward, binormal)
    start = Rotation.from_matrix(
        np.column_stack([[0, np.cos(slope), np.sin(slope)], [-1, 0, 0], [0, -np.sin(slope), np.cos(slope)]])
    )
    angle = 2 * np.pi * turns
    length = radius * angle / np.cos(slope)
    end = np.array([radius * np.cos(angle), radius * np.sin(angle), length * np.sin(slope)])
    b = Rotation.from_rotvec([0, 0, angle]) * start
    gamma, phi, _ = helical_strain(pose([radius, 0, 0], start), pose(end, b), 1.0 / length)
    np.testing.assert_allclose(gamma, [1.0, 0.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(phi, angle * along, atol=1e-14)
    curvature = np.cos(slope) ** 2 / radius
    np.testing.assert_allclose(phi[2] / length, curvature, rtol=1e-13)
    np.testing.assert_allclose(phi[0] / length, np.sin(slope) * np.cos(slope) / radius, rtol=1e-13)


@all_poses
def test_helical_strains_are_the_logarithm_of_the_screw_motion(poses):
    gamma, phi, _ = helical_strain(*poses, 1.0 / LENGTH)
    expected_gamma, expected_phi = exact_strains(*poses, LENGTH)
    np.testing.assert_allclose(phi, expected_phi, atol=2e-15 * np.pi)
    np.testing.assert_allclose(gamma, expected_gamma, atol=2e-14)  # poses of about 1 cm, elements of 6 mm


def test_nodal_strains_are_the_chord_seen_from_either_end():
    (position_a, a), (position_b, b) = poses = random_poses(1.6, 0.5, 1)
    gamma_a, gamma_b, g, _ = nodal_strain(*poses, 1.0 / LENGTH)
    chord = np.subtract(position_b, position_a) / LENGTH
    rotation_a, rotation_b = (Rotation.from_quat(np.roll(q, -1)) for q in (a, b))
    np.testing.assert_allclose(gamma_a, rotation_a.inv().apply(chord), atol=1e-15)
    np.testing.assert_allclose(gamma_b, rotation_b.inv().apply(chord), atol=1e-15)
    phi = (rotation_a.inv() * rotation_b).as_rotvec()
    angle = np.linalg.norm(phi)
    np.testing.assert_allclose(g, np.tan(angle / 2) * phi / angle, rtol=1e-13)


# ---- strain rates

VELOCITIES = RNG.normal(size=(2, 3)) * 0.3
SPINS = RNG.normal(size=(2, 3)) * 20.0


def rates(pose_a, pose_b, velocity_a, spin_a, velocity_b, spin_b):
    gamma, phi, geometry = helical_strain(pose_a, pose_b, 1.0 / LENGTH)
    motions = [tuple(float(x) for x in motion) for motion in (velocity_a, spin_a, velocity_b, spin_b)]
    return helical_strain_rates(gamma, phi, geometry, *motions, 1.0 / LENGTH)


@all_poses
def test_helical_strain_rates_are_the_derivatives_of_the_strains(poses):
    gamma_rate, phi_rate = rates(*poses, VELOCITIES[0], SPINS[0], VELOCITIES[1], SPINS[1])
    want_gamma, want_phi = exact_strain_rates(*poses, LENGTH, VELOCITIES[1] - VELOCITIES[0], *SPINS)
    size = np.abs(SPINS).max() * 5.0 + np.abs(VELOCITIES).max() / LENGTH
    np.testing.assert_allclose(phi_rate, want_phi, atol=1e-14 * size)
    np.testing.assert_allclose(gamma_rate, want_gamma, atol=1e-14 * size)


@all_poses
def test_stress_times_strain_rate_is_the_power_of_the_loads(poses):
    gamma, phi, geometry = helical_strain(*poses, 1.0 / LENGTH)
    stress, moment = (0.7, -0.3, 0.2), (1e-3, 2e-3, -1.5e-3)  # N, N m: any pair
    force, torque_a, torque_b = helical_loads(gamma, phi, geometry, stress, moment, LENGTH)
    gamma_rate, phi_rate = rates(*poses, VELOCITIES[0], SPINS[0], VELOCITIES[1], SPINS[1])
    stored = LENGTH * np.dot(stress, gamma_rate) + np.dot(moment, phi_rate)
    given = np.dot(force, VELOCITIES[0] - VELOCITIES[1]) + np.dot(torque_a, SPINS[0]) + np.dot(torque_b, SPINS[1])
    np.testing.assert_allclose(given, -stored, rtol=1e-12, atol=1e-14)


def test_a_rigid_motion_has_no_strain_rate():
    (position_a, a), (position_b, b) = poses = random_poses(0.3, 0.5, 1)
    spin, velocity = np.array([3.0, -2.0, 5.0]), np.array([0.1, 0.2, -0.3])  # world
    rotation_a, rotation_b = (Rotation.from_quat(np.roll(q, -1)) for q in (a, b))
    velocity_b = velocity + np.cross(spin, np.subtract(position_b, position_a))
    gamma_rate, phi_rate = rates(
        *poses, velocity, rotation_a.inv().apply(spin), velocity_b, rotation_b.inv().apply(spin)
    )
    np.testing.assert_allclose(gamma_rate, 0.0, atol=1e-13)
    np.testing.assert_allclose(phi_rate, 0.0, atol=1e-13)


# ---- the plane


def planar_case(bend, seed):
    """The same two poses in the plane and in space (plane xy)."""
    rng = np.random.default_rng(seed)
    start, chord = rng.normal(size=2) * 0.01, np.array([1.0, 0.0]) + 0.2 * rng.normal(size=2)
    angles = rng.uniform(-2, 2) + np.array([0.0, bend])
    turn = angles.mean()
    end = start + LENGTH * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ chord
    flat = [
        (tuple(float(x) for x in p), (np.cos(t / 2), np.sin(t / 2))) for p, t in ((start, angles[0]), (end, angles[1]))
    ]
    space = [((*p, 0.0), (w, 0.0, 0.0, z)) for p, (w, z) in flat]
    return flat, space


def planar_helical(pose_a, pose_b):
    gamma, phi, geometry = planar_helical_strain(pose_a, pose_b, 1.0 / LENGTH)
    stress, moment = planar_helical_stress(gamma, phi, LENGTH, (EA, GA, EI / LENGTH, TILTING, SWAY))
    return planar_helical_loads(phi, geometry, stress, moment)


def planar_nodal(pose_a, pose_b):
    gamma_a, gamma_b, g, frames = planar_nodal_strain(pose_a, pose_b, 1.0 / LENGTH)
    stresses = [(EA * (gamma[0] - 1.0), GA * gamma[1]) for gamma in (gamma_a, gamma_b)]
    return planar_nodal_loads(gamma_a, gamma_b, g, frames, *stresses, 2.0 * EI / LENGTH * g, LENGTH)


@pytest.mark.parametrize(("element", "planar"), [("helical", planar_helical), ("nodal", planar_nodal)])
@given(bend=st.sampled_from([0.0, 1e-9, -1e-4]) | st.floats(-3.1, 3.1), seed=st.integers(0, 9))
def test_planar_loads_are_minus_the_gradient_of_the_energy(element, planar, bend, seed):
    flat, space = planar_case(bend, seed)
    force, torque_a, torque_b = exact_loads(ELEMENTS[element][1], *space, LENGTH, STIFFNESS)
    tolerance = (30.0 if element == "nodal" else 1.0) * rounding((force, torque_a, torque_b))
    got = planar(*flat)
    np.testing.assert_allclose(got[0], force[:2], atol=tolerance)
    np.testing.assert_allclose(got[1:], (torque_a[2], torque_b[2]), atol=tolerance * LENGTH)
    np.testing.assert_allclose([force[2], *torque_a[:2], *torque_b[:2]], 0.0, atol=1e-25)  # nothing leaves the plane
