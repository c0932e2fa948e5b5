"""Conditioning of stiff modes: what it changes is what docs/physics.md says, and nothing else."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from term_sets import damped, dragged, loaded

from magrod_env import Rod, Scene, Simulation, load_scene
from magrod_env.rod.layout import AXIAL, BENDING, SHEAR, SWAY

ROD = Rod.circular(length=0.1, diameter=1e-3, density=1100.0, youngs_modulus=50e6, poissons_ratio=0.5)
SLENDER = Scene(rod=ROD)
N = 20


def frequencies(**conditioning):
    return Simulation(SLENDER, num_elements=N, **conditioning).natural_frequencies()


def nearest(found, value):
    return found[np.argmin(np.abs(found - value))]


def slope_over_deflection(beta):
    """Integral of w'^2 over that of w^2 for a clamped-free beam's mode of number beta (1/m)."""
    x = beta * ROD.length
    ratio = (math.cosh(x) + math.cos(x)) / (math.sinh(x) + math.sin(x))

    def w(s):
        return math.cosh(beta * s) - math.cos(beta * s) - ratio * (math.sinh(beta * s) - math.sin(beta * s))

    def slope(s):
        return beta * (math.sinh(beta * s) + math.sin(beta * s) - ratio * (math.cosh(beta * s) - math.cos(beta * s)))

    return quad(lambda s: slope(s) ** 2, 0, ROD.length)[0] / quad(lambda s: w(s) ** 2, 0, ROD.length)[0]


@pytest.mark.parametrize(("mode", "root"), [(0, 1.8751), (2, 4.6941)])
def test_rotary_scaling_lowers_a_bending_mode_by_rayleighs_quotient(mode, root):
    """Kinetic energy gains (s_J - 1) rho I w'^2; w is nearly that of the unscaled beam."""
    scaling = 40.0
    gain = (scaling - 1.0) * ROD.second_moment / ROD.area * slope_over_deflection(root / ROD.length)
    plain, scaled = frequencies()[mode], frequencies(rotary_scaling=scaling)[mode]
    assert (plain / scaled) ** 2 - 1.0 == pytest.approx(gain, rel=0.05)


def test_torsion_and_axial_waves_slow_down_by_the_roots_of_their_factors():
    torsional = math.sqrt(ROD.shear_modulus / ROD.density) / (4.0 * ROD.length)
    axial = math.sqrt(ROD.youngs_modulus / ROD.density) / (4.0 * ROD.length)
    found = frequencies(rotary_scaling=9.0, axial_softening=4.0)
    assert nearest(found, torsional / 3.0) == pytest.approx(torsional / 3.0, rel=1e-3)
    assert nearest(found, axial / 2.0) == pytest.approx(axial / 2.0, rel=1e-3)


@pytest.mark.parametrize("softening", [1.0, 10.0])
def test_hanging_rod_stretches_by_the_softening_times_its_weight(softening):
    scene = SLENDER.replace(gravity=(9.81, 0.0, 0.0))
    tip = Simulation(scene, num_elements=N, axial_softening=softening).equilibrium().tip_position[0]
    stretch = ROD.mass_per_length * 9.81 * ROD.length**2 / (2.0 * ROD.axial_stiffness)
    assert tip - ROD.length == pytest.approx(softening * stretch, rel=1e-3)


def test_rotary_scaling_leaves_equilibria_alone():
    scene = load_scene("paper5_circle")
    field = (0.0, 5e-3, 10e-3)
    plain, scaled = (Simulation(scene, rotary_scaling=s).equilibrium(field).positions for s in (1.0, 50.0))
    np.testing.assert_array_equal(plain, scaled)


def test_conditioning_lengthens_the_stable_step_of_a_wire_by_its_root():
    wire = load_scene("niti_guidewire")
    plain = Simulation(wire, num_elements=8).stable_time_step
    eased = Simulation(wire, num_elements=8, axial_softening=100.0, rotary_scaling=100.0).stable_time_step
    assert eased == pytest.approx(10.0 * plain, rel=0.02)


def test_energy_stays_bounded_under_conditioning():
    scene = dragged(load_scene("paper4_pdms_tip_magnet"))
    simulation = Simulation(scene, axial_softening=2.0, rotary_scaling=16.0)
    start, kinetic, total = simulation.energy()[0], [], []
    for _ in range(100):
        simulation.advance(0.02)
        kinetic.append(simulation.energies()["kinetic"][0])
        total.append(simulation.energy()[0] - start)
    assert np.abs(total).max() < 2e-3 * max(kinetic)


def test_spin_drag_keeps_its_torque():
    """The rate of a section's braking falls as its inertia grows."""
    scene = damped(loaded(SLENDER.replace(spin_drag_rate=80.0)))
    rates = []
    for scaling in (1.0, 8.0):
        simulation = Simulation(scene, num_elements=1, rotary_scaling=scaling, plane="xz", time_step=1e-6)
        spin = np.zeros((1, 2, 3))
        spin[0, 1, 1] = 1e-3
        simulation.set_motion(np.zeros((1, 2, 3)), spin)
        for stiffness in (AXIAL, SHEAR, BENDING, SWAY):  # no elastic loads
            simulation.rods.batch.rows[:, simulation.rods.batch.layout.elements + stiffness] = 0.0
        simulation.rods.batch.run(1000, 1e-6)
        rates.append(-math.log(simulation.angular_velocities[0, 1, 1] / 1e-3) / 1e-3)
    np.testing.assert_allclose(rates, [80.0, 10.0], rtol=1e-6)


@pytest.mark.parametrize("name", ["axial_softening", "rotary_scaling"])
@pytest.mark.parametrize("value", [0.5, 0.0, -1.0, math.nan, math.inf, "large"])
def test_conditioning_below_one_is_refused(name, value):
    with pytest.raises(ValueError, match=f"{name} must be"):
        Simulation(SLENDER, **{name: value})
