"""Listed loads in motion: forces and energy, work, fluid, order in time, lanes, precision, plane, implicit steps."""

import numpy as np
import pytest

from magrod_env import DistributedForce, FluidDrag, PointLoad, Rod, Scene, Simulation, TipWrench
from magrod_env.rod.energy import ENERGETIC, OK
from magrod_env.rod.layout import AXIAL, BENDING, SHEAR, SPATIAL, SWAY, TORSION
from magrod_env.rod.loads.hub import WORK
from rod.loads.loaded import listed

ROD = Rod.circular(length=0.1, diameter=4e-3, density=1100.0, youngs_modulus=1e6, poissons_ratio=0.5)
FORCE = ROD.bending_stiffness / ROD.length**2
WATER = {"density": 1000.0, "normal_coefficient": 1.1, "tangential_coefficient": 0.02}


def every(plane=None, flow=(0.1, 0.0, 0.4)):
    """Every load, following ones and a flow among them; within the plane xz where one is given."""
    across = 0.0 if plane else 1.0
    return Scene(
        rod=ROD,
        drag_rate=1.0,
        loads=(
            TipWrench(
                force=(0.3 * FORCE, 0.4 * across * FORCE, 0.6 * FORCE),
                moment=(0.0, 0.5 * FORCE * ROD.length, 0.2 * across * FORCE * ROD.length),
                follows=True,
            ),
            DistributedForce(force_per_length=(0.0, 2.0 * across * FORCE, -3.0 * FORCE / ROD.length)),
            PointLoad(position=0.041, force=(0.5 * FORCE, -0.3 * across * FORCE, 1.5 * FORCE)),
            FluidDrag(**WATER, flow=flow),
        ),
    )


def moved(time=0.02, scene=None, **options):
    simulation = Simulation(scene or every(options.get("plane")), **{"num_elements": 4, "time_step": 2e-5, **options})
    simulation.advance(time)
    return simulation


def state(simulation):
    return np.concatenate([simulation.positions, simulation.velocities, simulation.angular_velocities], axis=-1)


@pytest.fixture(scope="module")
def double():
    return moved()


def test_forces_are_minus_the_gradient_of_the_energy():
    """m times the acceleration that a kick gives a rod at rest, against differences of energies()["loads"]."""
    loads = listed(tip={"force": (0.2, -0.1, 0.3)}, line=(1.0, 2.0, -3.0), point=(0.3, 0.1, -0.2), place=0.04)
    simulation = Simulation(Scene(rod=ROD, loads=loads), num_elements=4)
    bare = Simulation(Scene(rod=ROD, loads=listed(place=0.04)), num_elements=4)
    positions, quaternions = simulation.positions[0], np.tile([1.0, 0.0, 0.0, 0.0], (5, 1))
    forces = []
    for each in (simulation, bare):
        each.rods.batch.run(1, 1e-9)
        forces.append(each.node_masses[0, :, None] * each.velocities[0] / 1e-9)
    for node in range(1, 5):
        for axis in range(3):
            energies = []
            for sign in (1.0, -1.0):
                shifted = positions.copy()
                shifted[node, axis] += sign * 1e-3
                simulation.rods.motion.write(shifted[None], quaternions[None])
                energies.append(simulation.energies()["loads"][0])
            slope = -(energies[0] - energies[1]) / 2e-3
            np.testing.assert_allclose(forces[0][node, axis] - forces[1][node, axis], slope, rtol=1e-6, atol=1e-9)


def test_the_work_of_loads_without_potential_is_the_change_of_energy(double):
    """Energy less the work counted stays, up to the second order of the step; drag (linear) is left out here."""
    gains, works = [], []
    for step in (4e-5, 2e-5):
        simulation = Simulation(every().replace(drag_rate=0.0), num_elements=4, time_step=step)
        before, row = simulation.energy()[0], simulation.rods.batch.layout.loads.own + WORK
        simulation.rods.batch.run(round(0.02 / step), step)
        gains.append(simulation.energy()[0] - before)
        works.append(simulation.rods.batch.gather(row, 1)[0, 0])
    errors = np.abs(np.array(gains) - works)
    assert abs(gains[1]) > 0.05 * FORCE * ROD.length
    assert errors[1] < 1e-4 * abs(gains[1])
    np.testing.assert_allclose(errors[0] / errors[1], 4.0, rtol=0.15)


def test_batch_equals_singles_bitwise():
    together = moved(num_rods=3)
    forces = FORCE * np.random.default_rng(0).normal(size=(3, 3))
    together.rods.batch.write_load(0, force=forces)
    together.rods.batch.write_load(3, rods=[1, 2], density=np.array([500.0, 800.0]))
    together.advance(0.01)
    for rod in range(3):
        alone = moved()
        alone.rods.batch.write_load(0, force=forces[rod])
        if rod > 0:
            alone.rods.batch.write_load(3, density=500.0 if rod == 1 else 800.0)
        alone.advance(0.01)
        np.testing.assert_array_equal(state(together)[rod], state(alone)[0])


def test_single_precision_follows_double(double):
    single = moved(precision="float32")
    np.testing.assert_allclose(single.positions, double.positions, atol=5e-6)


def test_planar_motion_equals_spatial_motion():
    flat, space = moved(plane="xz"), moved(scene=every("xz"))
    np.testing.assert_allclose(flat.positions, space.positions, atol=1e-12)
    np.testing.assert_allclose(flat.velocities, space.velocities, atol=1e-9)
    for part, energy in flat.energies().items():
        np.testing.assert_allclose(energy, space.energies()[part], atol=1e-12, err_msg=part)


def test_steps_are_of_second_order(double):
    """Halving the step divides the error by four, fluid, following loads and all."""
    ends = [moved(time_step=step).positions[0, -1] for step in (8e-5, 4e-5)] + [double.positions[0, -1]]
    errors = np.linalg.norm(ends[0] - ends[1]), np.linalg.norm(ends[1] - ends[2])
    np.testing.assert_allclose(errors[0] / errors[1], 4.0, rtol=0.1)


def test_implicit_steps_agree_with_explicit_ones_and_are_of_second_order(double):
    ends = [moved(integrator="implicit", time_step=step).positions[0, -1] for step in (8e-5, 4e-5, 2e-5)]
    np.testing.assert_allclose(ends[2], double.positions[0, -1], atol=1e-5 * ROD.length)
    errors = np.linalg.norm(ends[0] - ends[1]), np.linalg.norm(ends[1] - ends[2])
    np.testing.assert_allclose(errors[0] / errors[1], 4.0, rtol=0.15)


def test_work_that_loads_put_in_is_no_alarm():
    """A follower force beyond flutter and a flow feed a rod for seconds; the watchdog counts it and stays silent."""
    tip = {"force": (-25.0 * FORCE, 0.0, 0.1 * FORCE), "follows": True}
    loads = listed(tip=tip, fluid={**WATER, "density": 30.0, "flow": (0.0, 0.2, 0.0)}, place=0.041)
    simulation = Simulation(Scene(rod=ROD, loads=loads, drag_rate=0.0), num_elements=8, on_failure="report")
    highest = 0.0
    for _ in range(12):
        simulation.advance(0.25)
        highest = max(highest, simulation.energy()[0])
    assert simulation.status[0] == OK
    assert highest > FORCE * ROD.length  # it swings far

    simulation.reset()
    batch = simulation.rods.batch
    batch.run(8000, simulation.time_step)
    batch.rows[:, batch.layout.loads.own + WORK] = 0.0
    batch.watch()
    assert simulation.status[0] == ENERGETIC  # what it would say if it did not count


def free_tip(loads, **options):
    """One node that nothing holds: the tip of a rod without any stiffness, of a third of its mass and length."""
    simulation = Simulation(Scene(rod=ROD, loads=loads), num_elements=1, on_failure="report", **options)
    for stiffness in (AXIAL, SHEAR, BENDING, TORSION, SWAY):
        simulation.rods.batch.rows[:, simulation.rods.batch.layout.elements + stiffness] = 0.0
    return simulation


@pytest.mark.parametrize(("axis", "coefficient"), [(0, np.pi * 0.02), (1, 1.1), (2, 1.1)])
def test_a_pulled_section_reaches_its_terminal_velocity(axis, coefficient):
    """m v' = F - k v^2 from rest: v = v_inf tanh(t k v_inf/m), v_inf = sqrt(F/k); k of the length L/3 of one node."""
    force = np.zeros(3)
    force[axis] = 1e-3
    loads = listed(tip={"force": tuple(force)}, fluid=WATER, place=ROD.length)
    simulation = free_tip(loads, time_step=1e-4)
    k, mass = 0.5 * 1000.0 * ROD.width * coefficient * ROD.length / 3.0, simulation.node_masses[0, 1]
    last = np.sqrt(1e-3 / k)
    for time in (0.01, 0.1, 3.0):
        simulation.reset()
        simulation.rods.batch.run(round(time / 1e-4), 1e-4)
        exact = last * np.tanh(time * k * last / mass)
        np.testing.assert_allclose(simulation.velocities[0, 1, axis], exact, rtol=1e-4)
        np.testing.assert_allclose(np.delete(simulation.velocities[0, 1], axis), 0.0, atol=1e-12)


@pytest.mark.parametrize("step", [1e-4, 1e-1, 1e3])
def test_the_fluid_never_makes_a_rod_faster_whatever_the_step(step):
    """The speed of a free section in a fluid at rest falls in every step, however long."""
    simulation = free_tip(listed(fluid=WATER, place=ROD.length))
    simulation.set_motion(np.array([[[0.0, 0.0, 0.0], [0.5, -2.0, 1.0]]]))
    speed = np.inf
    for _ in range(30):
        simulation.rods.batch.run(1, step)
        now = np.linalg.norm(simulation.velocities[0, 1])
        assert now < speed
        speed = now
        place = simulation.rods.batch.layout.nodes + SPATIAL.size
        simulation.rods.batch.rows[:, place : place + 3] = 0.0  # it would leave all bounds


def test_a_free_section_drifts_off_with_the_flow():
    flow = (0.3, -0.2, 0.4)
    simulation = free_tip(listed(fluid={**WATER, "flow": flow}, place=ROD.length), time_step=1e-3)
    simulation.rods.batch.run(200_000, 1e-3)
    np.testing.assert_allclose(simulation.velocities[0, 1], flow, atol=0.03)


def test_the_default_step_carries_sudden_loads():
    """Loads that bend the rod far, and a pull of its own stiffness' size, there at once: stable at the step chosen."""
    for tip in ({"force": (0.0, 0.0, 5.0 * FORCE)}, {"force": (40.0 * FORCE, 0.0, 2.0 * FORCE)}):
        loads = listed(tip=tip, place=0.041)
        simulation = Simulation(Scene(rod=ROD, loads=loads, drag_rate=0.0), num_elements=8)
        start = simulation.energy()[0]
        simulation.advance(1.0)
        np.testing.assert_allclose(simulation.energy()[0], start, atol=0.02 * FORCE * ROD.length)
