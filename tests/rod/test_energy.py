"""Energies by their definitions, and a watchdog that tells a diverged rod from a lively one."""

import mpmath
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from magrod_env import Simulation, SimulationDiverged, load_scene
from magrod_env.rod.energy import BENT, ENERGETIC, NOT_FINITE, OK, STRETCHED, rod_status
from magrod_env.rod.layout import SPATIAL
from rod.truth import DIGITS, exact, frames_and_difference, helical_energy, nodal_energy

SOFT = load_scene("paper4_pdms_tip_magnet").replace(drag_rate=5.0)
FIELD = np.array([2e-3, 4e-3, 9e-3])


def lively(element="helical", **options):
    """A bent, twisting rod in a field."""
    simulation = Simulation(SOFT, num_elements=4, element=element, **options)
    rng, shape = np.random.default_rng(1), (simulation.num_rods, 5, 3)
    simulation.set_motion(0.1 * rng.normal(size=shape), 10.0 * rng.normal(size=shape))
    simulation.advance(0.05, field=FIELD)
    return simulation


@pytest.mark.parametrize("element", ["helical", "nodal"])
def test_energies_are_those_of_their_definitions(element):
    simulation = lively(element)
    rod, positions, rotations = SOFT.rod, simulation.positions[0], simulation.rotations[0]
    found = {part: value[0] for part, value in simulation.energies().items()}

    masses, velocities, spins = simulation.node_masses[0], simulation.velocities[0], simulation.angular_velocities[0]
    carried = masses.copy()
    carried[-1] -= SOFT.magnets[0].mass
    inertia = carried[:, None] / rod.area * rod.second_moment * np.array([2.0, 1.0, 1.0])
    kinetic = 0.5 * np.sum(masses[:, None] * velocities**2) + 0.5 * np.sum(inertia * spins**2)
    np.testing.assert_allclose(found["kinetic"], kinetic, rtol=1e-12)
    np.testing.assert_allclose(found["gravitational"], 9.81 * np.sum(masses * positions[:, 2]), rtol=1e-12)
    moment = rotations[-1] @ SOFT.magnets[0].dipole_moment
    np.testing.assert_allclose(found["magnetic"], -moment @ FIELD, rtol=1e-12)

    elastic, energy = 0.0, helical_energy if element == "helical" else nodal_energy
    with mpmath.workdps(DIGITS):
        for e, h in enumerate(np.diff(simulation.arc_lengths)):
            stiffness = (rod.axial_stiffness, rod.shear_stiffness, rod.torsional_stiffness, rod.bending_stiffness)
            quaternions = [np.roll(Rotation.from_matrix(rotations[n]).as_quat(), 1) for n in (e, e + 1)]
            poses = [(positions[n], q) for n, q in zip((e, e + 1), quaternions, strict=True)]
            elastic += float(energy(*frames_and_difference(*poses), mpmath.mpf(float(h)), exact(stiffness)))
    np.testing.assert_allclose(found["elastic"], elastic, rtol=1e-9)
    np.testing.assert_allclose(simulation.energy()[0], sum(found.values()), rtol=1e-15)


@pytest.mark.parametrize(
    ("numbers", "status"),
    [
        ((1.0, 1.0, 0.01, 0.9, 1.0, 0.1), OK),
        ((np.nan, 1.0, 0.01, 0.9, 1.0, 0.1), NOT_FINITE),
        ((np.inf, np.inf, 0.01, 0.9, 1.0, 0.1), NOT_FINITE),
        ((1.0, 1.0, 0.01, -0.1, 1.0, 0.1), BENT),
        ((1.0, 1.0, 0.26, 0.9, 1.0, 0.1), STRETCHED),
        ((1.0, 1.2, 0.01, 0.9, 1.0, 0.1), ENERGETIC),
        ((1.0, 0.2, 0.01, 0.9, 1.0, 0.1), OK),
    ],
)
def test_status_of_one_rod(numbers, status):
    """Kinetic and elastic energy, all energy, squared strain, least cosine, energy before, allowance."""
    assert rod_status(*numbers) == status


def test_a_lively_rod_is_well():
    """Strong fields that turn at once, of any direction, for a second: much energy, no alarm."""
    simulation = Simulation(SOFT, num_rods=8, num_elements=6)
    rng = np.random.default_rng(3)
    for _ in range(20):
        simulation.advance(0.05, field=rng.uniform(-25e-3, 25e-3, (8, 3)))
    assert np.all(simulation.status == OK)
    assert np.abs(simulation.velocities).max() > 0.5


def test_a_diverging_rod_leaves_the_others_as_they_were():
    """One of eight rods is set spinning far beyond any rod; with on_failure="report" the others never notice."""
    calm, mixed = (Simulation(SOFT, num_rods=8, num_elements=4, on_failure="report") for _ in range(2))
    fields = 10e-3 * np.random.default_rng(1).normal(size=(8, 3))
    shape = (8, 5, 3)
    velocities = np.zeros(shape)
    calm.set_motion(velocities)
    velocities[3] = 300.0  # m/s
    mixed.set_motion(velocities)
    for simulation in (calm, mixed):
        simulation.advance(0.1, field=fields)
    others = np.arange(8) != 3
    assert mixed.status[3] != OK
    assert np.all(mixed.status[others] == OK)
    assert np.all(calm.status == OK)
    np.testing.assert_array_equal(mixed.positions[others], calm.positions[others])
    np.testing.assert_array_equal(mixed.velocities[others], calm.velocities[others])


def test_a_rod_that_is_not_a_number_stays_in_its_lane():
    calm, mixed = (Simulation(SOFT, num_rods=8, num_elements=4, on_failure="report") for _ in range(2))
    poisoned = mixed.state()
    poisoned.nodes[5, 1, SPATIAL.velocity] = np.nan
    mixed.set_state(poisoned)
    for simulation in (calm, mixed):
        simulation.advance(0.05, field=FIELD)
    others = np.arange(8) != 5
    assert mixed.status[5] == NOT_FINITE
    assert np.isnan(mixed.positions[5, 1:]).all()
    np.testing.assert_array_equal(mixed.positions[others], calm.positions[others])
    assert np.all(mixed.status[others] == OK)


def test_a_failure_names_the_rod_the_time_and_the_way_out():
    simulation = Simulation(SOFT, num_rods=8, num_elements=4)
    velocities = np.zeros((8, 5, 3))
    velocities[6] = 300.0
    simulation.set_motion(velocities)
    with pytest.raises(SimulationDiverged, match=r"rod 6 left the stable range by t = 0\.\d+ s: .* lower time_step"):
        simulation.advance(0.1)
    simulation.reset()  # and it is well again
    assert np.all(simulation.status == OK)
    simulation.advance(0.01)


def test_a_bend_of_half_a_turn_in_one_element_is_reported():
    """One element and a field that swings it over: the numbers stay finite, but mean another rod."""
    scene = SOFT.replace(gravity=(0.0, 0.0, 0.0), drag_rate=0.0)
    simulation = Simulation(scene, num_elements=1, on_failure="report")
    simulation.advance(0.5, field=(-20e-3, 0.0, 2e-3))
    assert simulation.status[0] == BENT
    assert np.isfinite(simulation.positions).all()


def test_small_rises_of_energy_add_up():
    """A run that gains five per cent a look, as one just beyond its bound may, is told before it has doubled."""
    scene = load_scene("paper4_pdms_tip_magnet").replace(drag_rate=0.0)
    simulation = Simulation(scene, on_failure="report")
    simulation.advance(0.1)
    looks = 0
    while not simulation.status[0] and looks < 15:
        rows = simulation.rods.batch.node_rows
        simulation.rods.batch.set_nodes(rows.velocity, 1.05 * simulation.rods.batch.nodes(rows.velocity, 3))
        simulation.rods.batch.watch()
        looks += 1
    assert 1 < looks < 8
