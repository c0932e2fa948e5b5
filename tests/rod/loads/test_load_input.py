"""What is refused, in one sentence each, and loads that differ from rod to rod."""

import numpy as np
import pytest

from magrod_env import DistributedForce, FluidDrag, PointLoad, Rod, Scene, Simulation, TipWrench

ROD = Rod.circular(length=0.1, diameter=4e-3, density=1100.0, youngs_modulus=1e6, poissons_ratio=0.5)
WATER = {"density": 1000.0, "normal_coefficient": 1.1, "tangential_coefficient": 0.02}


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: TipWrench(force=(1.0, 2.0)), "force of the TipWrench must be three finite numbers"),
        (lambda: TipWrench(moment=(0.0, np.nan, 0.0)), "moment of the TipWrench must be three finite numbers"),
        (lambda: TipWrench(force=(1e13, 0.0, 0.0)), "force of the TipWrench must be between"),
        (lambda: TipWrench(follows=1), "follows of the TipWrench must be True or False"),
        (lambda: DistributedForce(force_per_length=3.0), "force_per_length of the DistributedForce must be three"),
        (lambda: PointLoad(position=0.0, force=(1.0, 0.0, 0.0)), "position of the PointLoad must be .* > 0"),
        (lambda: FluidDrag(**{**WATER, "density": -1.0}), "density of the FluidDrag must be .* >= 0"),
        (lambda: FluidDrag(**WATER, diameter=0.0), "diameter of the FluidDrag must be .* > 0"),
        (lambda: FluidDrag(**WATER, flow=(0.0, 0.0, 1e9)), "flow of the FluidDrag must be between"),
        (lambda: Scene(rod=ROD, loads=(1.0,)), "loads of the scene must be a tuple or list of TipWrench"),
        (lambda: Scene(rod=ROD, loads=(TipWrench(), TipWrench())), "at most one TipWrench, but got 2"),
        (
            lambda: Scene(rod=ROD, loads=(PointLoad(position=0.2, force=(1.0, 0.0, 0.0)),)),
            "position of a PointLoad must be at most the rod's length",
        ),
    ],
)
def test_a_load_is_refused_in_one_sentence(make, words):
    with pytest.raises(ValueError, match=words):
        make()


@pytest.mark.parametrize(
    ("load", "words"),
    [
        (TipWrench(force=(0.0, 1.0, 0.0)), "force of the TipWrench must lie in the plane 'xz'"),
        (TipWrench(moment=(1.0, 0.0, 0.0)), "moment of the TipWrench must be across the plane 'xz'"),
        (DistributedForce(force_per_length=(0.0, 1.0, 0.0), follows=True), "must lie in the plane 'xz'"),
        (PointLoad(position=0.05, force=(0.0, 1.0, 0.0)), "force of the PointLoad must lie in the plane 'xz'"),
        (FluidDrag(**WATER, flow=(0.0, 0.1, 0.0)), "flow of the FluidDrag must lie in the plane 'xz'"),
    ],
)
def test_a_planar_simulation_refuses_loads_that_leave_the_plane(load, words):
    with pytest.raises(ValueError, match=words):
        Simulation(Scene(rod=ROD, loads=(load,)), plane="xz")


def test_steps_that_go_back_in_time_refuse_a_fluid():
    with pytest.raises(ValueError, match=r"loads must hold no FluidDrag with integrator=.implicit4."):
        Simulation(Scene(rod=ROD, loads=(FluidDrag(**WATER),)), integrator="implicit4")


def test_every_rod_may_have_values_of_its_own():
    loads = (TipWrench(force=(0.0, 0.0, 1e-3)), FluidDrag(**WATER))
    batch = Simulation(Scene(rod=ROD, loads=loads), num_rods=3, time_step=1e-6).rods.batch
    first, water = batch.layout.loads.tip_wrench, batch.layout.loads.fluid_drag
    batch.write_load(0, rods=[2], force=(1.0, 2.0, 3.0))
    batch.write_load(1, rods=[0, 1], density=[500.0, 2000.0])
    np.testing.assert_allclose(batch.gather(first, 3), [[0, 0, 1e-3], [0, 0, 1e-3], [1, 2, 3]])
    across = 0.5 * 1.1 * ROD.width * np.array([500.0, 2000.0, 1000.0])
    np.testing.assert_allclose(batch.gather(water, 1)[:, 0], across)
    for number, values, words in (
        (0, {"force": (1.0, 2.0)}, "force of the TipWrench must have shape"),
        (0, {"force": (np.inf, 0.0, 0.0)}, "force of the TipWrench must be finite"),
        (0, {"moment": (1.0, 0.0, 0.0)}, "moment of the TipWrench must be zero where the scene's has none"),
        (0, {"flow": 1.0}, "values of the TipWrench must be force or moment"),
        (1, {"flow": (1.0, 0.0, 0.0)}, "flow of the FluidDrag must be zero where the scene's fluid is at rest"),
        (1, {"density": -1.0}, "density of the FluidDrag must be finite and from 0"),
    ):
        with pytest.raises(ValueError, match=words):
            batch.write_load(number, **values)


def test_other_diameters_follow_the_rod():
    scene = Scene(rod=ROD, loads=(FluidDrag(**WATER),))
    wide = scene.replace(
        rod=Rod.circular(length=0.1, diameter=8e-3, density=1100.0, youngs_modulus=1e6, poissons_ratio=0.5)
    )
    assert wide.acting_loads[0].diameter == 8e-3
    assert wide.replace(loads=(FluidDrag(**WATER, diameter=5e-3),)).acting_loads[0].diameter == 5e-3
