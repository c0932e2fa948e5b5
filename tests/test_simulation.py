"""The simulation as its users meet it: shapes, starts, states, bad input, and scenes from soft to stiff."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from term_sets import damped, dragged

from magrod_env import Magnet, Rod, Scene, Simulation, SimulationDiverged, StabilityError, load_scene, scene_names

SOFT = load_scene("paper4_pdms_tip_magnet").replace(drag_rate=5.0)
FIELDS = np.array([[0.0, 0.0, 8e-3], [2e-3, 3e-3, 5e-3], [1e-3, -4e-3, 7e-3]])

GENTLE = 0.2 * np.array([[1.0, 0.3, 0.0], [0.3, -0.6, 0.1], [0.0, 0.1, -0.4]])  # T/m


def batch(scene=SOFT, **options):
    return Simulation(scene, **{"num_rods": 3, "num_elements": 4, **options})


def everything(simulation):
    """All state that a user can see."""
    return (
        simulation.positions,
        simulation.rotations,
        simulation.velocities,
        simulation.angular_velocities,
        simulation.field,
        simulation.status,
        np.array(simulation.time),
    )


def assert_same(a, b):
    for one, other in zip(everything(a), everything(b), strict=True):
        np.testing.assert_array_equal(one, other)


# ---- what it shows


def test_shapes_of_everything_it_shows():
    simulation = batch()
    simulation.advance(0.02, field=FIELDS)
    shapes = {
        "positions": (3, 5, 3),
        "velocities": (3, 5, 3),
        "rotations": (3, 5, 3, 3),
        "angular_velocities": (3, 5, 3),
        "tip_position": (3, 3),
        "field": (3, 3),
        "status": (3,),
        "arc_lengths": (5,),
        "node_masses": (3, 5),
    }
    for name, shape in shapes.items():
        value = getattr(simulation, name)
        assert value.shape == shape, name
        assert value.dtype == (np.int64 if name == "status" else np.float64), name
    assert simulation.energy().shape == (3,)
    assert simulation.linear_momentum().shape == simulation.angular_momentum().shape == (3, 3)
    assert {part: energy.shape for part, energy in simulation.energies().items()} == dict.fromkeys(
        ("kinetic", "elastic", "gravitational", "magnetic"), (3,)
    )
    assert simulation.magnet_nodes == (4,)
    np.testing.assert_array_equal(simulation.tip_position, simulation.positions[:, -1])
    np.testing.assert_array_equal(simulation.field, FIELDS)


def test_what_it_shows_is_a_copy():
    simulation = batch()
    before = simulation.positions
    for name in (
        "positions",
        "velocities",
        "rotations",
        "angular_velocities",
        "tip_position",
        "field",
        "status",
        "arc_lengths",
    ):
        getattr(simulation, name)[...] = 7
    np.testing.assert_array_equal(simulation.positions, before)
    assert np.all(simulation.status == 0)
    assert np.all(simulation.field == 0.0)


def test_what_was_shown_does_not_change_with_the_simulation():
    simulation = batch()
    shown = [np.copy(x) for x in everything(simulation)]
    kept = everything(simulation)
    simulation.advance(0.01, field=FIELDS)
    for before, now in zip(shown, kept, strict=True):
        np.testing.assert_array_equal(before, now)


def test_rotations_are_rotations_and_the_clamp_stays():
    simulation = batch()
    simulation.advance(0.3, field=FIELDS)
    rotations = simulation.rotations
    np.testing.assert_allclose(
        rotations @ np.swapaxes(rotations, -1, -2), np.broadcast_to(np.eye(3), rotations.shape), atol=1e-14
    )
    np.testing.assert_array_equal(simulation.positions[:, 0], 0.0)
    np.testing.assert_array_equal(rotations[:, 0], np.broadcast_to(np.eye(3), (3, 3, 3)))
    np.testing.assert_array_equal(simulation.velocities[:, 0], 0.0)


def test_velocities_are_the_rates_of_positions_and_rotations():
    simulation = Simulation(SOFT, num_elements=4)
    simulation.advance(0.1, field=FIELDS[1])
    step = simulation.time_step
    states = []
    for _ in range(3):
        states.append(
            (
                simulation.positions[0],
                simulation.rotations[0],
                simulation.velocities[0],
                simulation.angular_velocities[0],
            )
        )
        simulation.advance(step)
    rate = (states[2][0] - states[0][0]) / (2 * step)
    np.testing.assert_allclose(states[1][2], rate, atol=0.02 * np.abs(rate).max())  # differences over two steps
    hat = np.swapaxes(states[1][1], -1, -2) @ (states[2][1] - states[0][1]) / (2 * step)
    spin = np.stack([hat[:, 2, 1], hat[:, 0, 2], hat[:, 1, 0]], axis=-1)
    np.testing.assert_allclose(states[1][3], spin, atol=0.1 * np.abs(spin).max())


# ---- starts


def test_it_starts_straight_and_at_rest():
    simulation = batch()
    assert simulation.time == 0.0
    np.testing.assert_allclose(simulation.positions[..., 0], np.tile(simulation.arc_lengths, (3, 1)), rtol=1e-15)
    assert np.all(simulation.positions[..., 1:] == 0.0)
    assert np.all(simulation.velocities == 0.0)
    assert np.all(simulation.angular_velocities == 0.0)


def test_reset_forgets_everything():
    fresh, used = batch(), batch()
    used.advance(0.05, field=FIELDS, gradient=0.1 * np.diag([1.0, -0.5, -0.5]))
    used.reset()
    assert_same(used, fresh)
    for simulation in (fresh, used):
        simulation.advance(0.02, field=FIELDS)
    np.testing.assert_allclose(used.positions, fresh.positions, atol=1e-13)


def test_reset_in_a_field_is_at_rest_there():
    simulation = batch()
    simulation.reset(field=FIELDS)
    before = simulation.positions
    np.testing.assert_array_equal(simulation.field, FIELDS)
    simulation.advance(0.1)
    np.testing.assert_allclose(simulation.positions, before, atol=1e-10)


def test_reset_where_no_stable_equilibrium_is_reached_says_so():
    scene = SOFT.replace(gravity=(0.0, 0.0, 0.0))
    with pytest.raises(StabilityError, match=r"at \[-0\.02, 0\.0, 0\.0\] T the rod loses stability .* % of the field"):
        Simulation(scene, num_elements=4).reset(field=(-20e-3, 0.0, 0.0))


STANDING = Rod.circular(length=0.15, diameter=4e-3, density=1100.0, youngs_modulus=1.48e6, poissons_ratio=0.5)


def test_gravity_that_buckles_the_rod_alone_is_what_is_blamed():
    """It stands 1.25 times as long as the longest column that bears its weight, 7.837 EI/(rho A g) = L^3."""
    simulation = Simulation(Scene(rod=STANDING, gravity=(-9.81, 0.0, 0.0)), num_elements=4)
    for start in (dict(field=(0.0, 0.0, 0.0)), dict(gradient=np.zeros((3, 3)))):
        with pytest.raises(
            StabilityError, match=r"gravity must not buckle .* at \d+\.?\d* % of \[-9.81.* shorter or stiffer"
        ):
            simulation.reset(**start)


def test_a_gradient_that_buckles_the_rod_is_named():
    """A dipole along -x in dB_x/dx > 0 is pulled back along the rod."""
    magnet = Magnet.dipole(position=SOFT.rod.length, moment=1e-2, direction=(-1.0, 0.0, 0.0))
    simulation = Simulation(SOFT.replace(magnets=(magnet,), gravity=(0.0, 0.0, 0.0)), num_elements=4)
    slope = 20.0 * np.diag([1.0, -0.5, -0.5])
    with pytest.raises(
        StabilityError, match=r"^gradient must lead .* up to 20 T/m .* % of the gradient: start from a weak"
    ):
        simulation.reset(gradient=slope)
    with pytest.raises(
        StabilityError, match=r"^field and gradient must .* T and a gradient of up to 20 T/m .* weaker field"
    ):
        simulation.reset(field=(0.0, 0.0, 1e-3), gradient=slope)


def test_a_start_that_is_refused_leaves_everything_as_it_was():
    simulation = batch()
    simulation.advance(0.02, field=FIELDS, gradient=GENTLE)
    before = everything(simulation)
    refused = [
        (StabilityError, dict(field=(-30e-3, 0.0, 30e-3))),
        (ValueError, dict(field=(0.0, 0.0, np.nan))),
        (ValueError, dict(field=(0.0, 0.0, 5e-3), gradient=np.eye(3))),
        (ValueError, dict(shape=(np.zeros((5, 3)), np.zeros((5, 4))))),
    ]
    for error, start in refused:
        with pytest.raises(error):
            simulation.reset(**start)
        for one, other in zip(everything(simulation), before, strict=True):
            np.testing.assert_array_equal(one, other)


def test_reset_in_a_gradient_is_at_rest_there():
    simulation = batch()
    slopes = np.array([1.0, -0.5, 0.2])[:, None, None] * GENTLE
    simulation.reset(field=FIELDS, gradient=slopes)
    before = simulation.positions
    for rod in range(3):
        np.testing.assert_array_equal(before[rod], simulation.equilibrium(FIELDS[rod], slopes[rod]).positions)
    simulation.advance(0.1)
    np.testing.assert_allclose(simulation.positions, before, atol=1e-10)


def test_set_motion_gives_the_velocities_it_was_given():
    simulation = batch()
    rng = np.random.default_rng(0)
    velocities, spins = rng.normal(size=(2, 3, 5, 3))
    simulation.set_motion(velocities, spins)
    velocities[:, 0] = spins[:, 0] = 0.0  # the clamp does not move
    np.testing.assert_allclose(simulation.velocities, velocities, rtol=1e-15)
    np.testing.assert_allclose(simulation.angular_velocities, spins, rtol=1e-14)
    simulation.set_motion(velocities)
    assert np.all(simulation.angular_velocities == 0.0)


# ---- time


def test_time_is_the_sum_of_durations():
    simulation = batch()
    for duration in (0.01, 0.0, 0.0137, 1e-5):
        simulation.advance(duration)
    assert simulation.time == pytest.approx(0.0237 + 1e-5, rel=1e-12)


def test_a_constant_function_is_a_constant_field():
    called, constant = batch(), batch()
    called.advance(0.02, field=lambda t: FIELDS)
    constant.advance(0.02, field=FIELDS)
    # a function cuts every free rotation at the steps' ends, which in discrete time is not quite the same rotation
    np.testing.assert_allclose(called.positions, constant.positions, atol=1e-7)


def test_a_function_is_asked_in_the_middle_of_every_step():
    simulation, asked = Simulation(SOFT, num_elements=4, time_step=5e-5), []
    simulation.advance(0.01)
    simulation.advance(5 * 5e-5, field=lambda t: asked.append(t) or np.zeros(3))
    np.testing.assert_allclose(asked, 0.01 + 5e-5 * (np.arange(5) + 0.5), rtol=1e-12)


def test_a_gradient_in_time_is_that_of_the_middle_of_every_step():
    """Step by step with the same numbers; a field in time, of one kind or the other, beside it."""
    options = dict(num_elements=4, time_step=5e-5)
    called, by_hand = (Simulation(SOFT, **options) for _ in range(2))
    called.advance(0.01, field=lambda t: FIELDS[0] * t, gradient=lambda t: GENTLE * np.sin(20.0 * t))
    for k in range(200):
        middle = (k + 0.5) * 5e-5
        by_hand.advance(5e-5, field=FIELDS[0] * middle, gradient=GENTLE * np.sin(20.0 * middle))
    np.testing.assert_allclose(called.positions, by_hand.positions, atol=1e-13)  # the steps' lengths differ by rounding
    assert called.time == pytest.approx(0.01, rel=1e-12)
    np.testing.assert_allclose(called._gradient[0], GENTLE * np.sin(20.0 * (0.01 - 2.5e-5)))


def test_a_gradient_in_time_is_exact_to_second_order():
    """A gradient that pulls a rod without a field: half the step, a quarter of the distance from the fine solution."""
    ends = []
    for step in (5e-5, 2.5e-5, 3.125e-6):
        simulation = Simulation(SOFT, num_elements=2, time_step=step)
        simulation.reset(field=(0.0, 0.0, 0.0))
        simulation.advance(0.02, gradient=lambda t: 5.0 * GENTLE * np.sin(60.0 * t))
        ends.append(simulation.tip_position[0])
    coarse, half = (np.linalg.norm(end - ends[-1]) for end in ends[:2])
    assert np.log2(coarse / half) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize("gradient", [lambda t: np.eye(3), lambda t: [np.nan], lambda t: GENTLE if t < 1e-3 else None])
def test_a_function_that_returns_a_bad_gradient_is_refused(gradient):
    with pytest.raises(ValueError, match="gradient must"):
        batch().advance(0.01, gradient=gradient)


def test_a_moving_gradient_is_no_gain_of_energy_to_the_watchdog():
    """It turns round ten times a second and pulls with a quarter of the rod's weight."""
    simulation = Simulation(SOFT, num_elements=4)
    simulation.advance(0.5, field=FIELDS[0], gradient=lambda t: 2.0 * GENTLE * np.sin(60.0 * t))
    assert simulation.status[0] == 0


def test_a_field_is_kept_until_another_is_given():
    given, kept = batch(), batch()
    for _ in range(2):
        given.advance(0.01, field=FIELDS)
    kept.advance(0.01, field=FIELDS)
    kept.advance(0.01)
    assert_same(given, kept)


# ---- states and copies


@pytest.mark.parametrize(
    ("precision", "scene"), [("float64", SOFT), ("float32", damped(SOFT))], ids=["double", "single"]
)
def test_a_state_goes_back_to_the_same_bits(precision, scene):
    simulation = batch(scene, precision=precision)
    simulation.advance(0.05, field=FIELDS)
    state = simulation.state()
    simulation.advance(0.05, field=-FIELDS)
    first = everything(simulation)
    simulation.set_state(state)
    simulation.advance(0.05, field=-FIELDS)
    for one, other in zip(everything(simulation), first, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_state_goes_to_another_simulation_with_its_field_and_gradient():
    source, target = batch(), batch()
    source.advance(0.05, field=FIELDS, gradient=GENTLE)
    target.set_state(source.state())
    assert_same(source, target)
    for simulation in (source, target):
        simulation.advance(0.05)
    assert_same(source, target)


@pytest.mark.parametrize("plane", [None, "xz", "xy"])
def test_a_state_says_what_the_simulation_says(plane):
    scene = SOFT if plane != "xy" else SOFT.replace(gravity=(0.0, -9.81, 0.0))
    simulation = Simulation(scene, num_rods=3, num_elements=4, plane=plane)
    simulation.advance(0.05, field=np.eye(3)[1 if plane == "xy" else 2] * 1e-3)
    state = simulation.state()
    assert len(state) == 3
    for name in ("positions", "rotations", "tip_position", "velocities", "angular_velocities", "field", "time"):
        np.testing.assert_array_equal(getattr(state, name), getattr(simulation, name), err_msg=name)


def test_one_state_goes_to_all_rods_and_some_states_to_some():
    source, many = batch(), batch(num_rods=20)
    source.advance(0.05, field=FIELDS)
    state = source.state()
    many.set_state(state[1])
    np.testing.assert_array_equal(many.positions, np.repeat(source.positions[1:2], 20, axis=0))
    np.testing.assert_array_equal(many.field, np.repeat(FIELDS[1:2], 20, axis=0))
    assert many.time == source.time
    many.set_state(state, rods=[19, 0, 7])
    np.testing.assert_array_equal(many.velocities[[19, 0, 7]], source.velocities)
    np.testing.assert_array_equal(many.velocities[5], source.velocities[1])
    many.set_state(type(state).stack([state[2], state[0]]), rods=[3, 4])
    np.testing.assert_array_equal(many.positions[[3, 4]], source.positions[[2, 0]])
    for simulation in (source, many):
        simulation.advance(0.05)
    np.testing.assert_array_equal(many.positions[[19, 0, 7]], source.positions)


def test_a_state_can_be_changed_by_replace():
    simulation = batch()
    simulation.advance(0.05, field=FIELDS)
    velocities = np.random.default_rng(0).normal(size=simulation.velocities.shape)
    velocities[:, 0] = 0.0
    spins = 0.1 * velocities[..., ::-1]
    simulation.set_state(simulation.state().replace(velocities=velocities, angular_velocities=spins))
    np.testing.assert_array_equal(simulation.velocities, velocities)
    np.testing.assert_allclose(simulation.angular_velocities, spins, rtol=1e-14)


def test_a_state_is_not_touched_by_what_follows():
    simulation = batch()
    state = simulation.state()
    kept = copy.deepcopy(state)
    simulation.advance(0.05, field=FIELDS)
    assert state.made_with == kept.made_with
    for name in ("nodes", "loads", "watch", "status", "travel", "field", "gradient"):
        np.testing.assert_array_equal(getattr(state, name), getattr(kept, name))


def test_a_state_from_before_a_gradient_goes_on_with_its_bits():
    simulation, fresh = batch(), batch()
    state = simulation.state()
    simulation.advance(0.02, field=FIELDS, gradient=GENTLE)
    simulation.set_state(state)
    for each in (simulation, fresh):
        each.advance(0.02, field=FIELDS)
    assert_same(simulation, fresh)


def test_a_state_keeps_what_a_field_may_yet_put_in():
    """Turned on and looked at only after the state is set, a field accounts for the energy that it brings."""
    simulation = Simulation(SOFT.replace(gravity=(0.0, 0.0, 0.0)), num_elements=4)
    simulation.reset(field=(5e-3, 0.0, 0.0))
    simulation.advance(0.0, field=(-5e-3, 0.0, 0.0))
    simulation.set_state(simulation.state())
    simulation.advance(1e-3)
    assert simulation.status[0] == 0


def test_a_state_can_be_pickled_and_is_small():
    stored = pickle.dumps(batch().state())
    assert len(stored) < 2 * batch().rods.batch.blocks.nbytes + 5000
    batch().set_state(pickle.loads(stored))


OTHERS = {
    "scene": lambda: Simulation(SOFT.replace(drag_rate=6.0), num_rods=3, num_elements=4),
    "num_elements": lambda: batch(num_elements=5),
    "element": lambda: batch(element="nodal"),
    "precision": lambda: batch(precision="float32"),
    "plane": lambda: batch(plane="xz"),
    "integrator": lambda: batch(integrator="implicit"),
    "axial_softening": lambda: batch(axial_softening=2.0),
    "rotary_scaling": lambda: batch(rotary_scaling=2.0),
}


@pytest.mark.parametrize("name", OTHERS)
def test_a_state_of_another_simulation_is_refused(name):
    simulation = batch()
    before = everything(simulation)
    with pytest.raises(ValueError, match=f"state must come from a simulation of the same .* but its {name} differs"):
        simulation.set_state(OTHERS[name]().state())
    for one, other in zip(everything(simulation), before, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_state_goes_where_only_the_step_and_the_threads_differ():
    source, target = batch(), batch(time_step=1e-5, num_threads=1, on_failure="report")
    source.advance(0.02, field=FIELDS)
    target.set_state(source.state())
    assert_same(source, target)
    assert target.time_step == 1e-5


NO_STATES = [
    (lambda s: {}, "state must be what state.. returned, but got dict"),
    (lambda s: None, "but got NoneType"),
    (lambda s: s[:2], "state must be of one rod or of 3, but is of 2"),
    (lambda s: replace(s, made_with=None), "state must be what"),
    (lambda s: replace(s, nodes=s.nodes[:, :-1]), "nodes of a state must be finite, float64"),
    (lambda s: replace(s, nodes=s.nodes.tolist()), "nodes of a state must be finite, float64"),
    (lambda s: replace(s, nodes=s.nodes.astype(np.float32)), "nodes of a state must be .* but got float32"),
    (lambda s: replace(s, status=s.status + 0.5), "status of a state must be finite, int64"),
    (lambda s: replace(s, time=np.nan), "time of a state must be a finite time .* but got nan"),
    (lambda s: replace(s, time=-1.0), "time of a state must be"),
    (lambda s: replace(s, time="0"), "time of a state must be"),
    (lambda s: replace(s, field=np.full((3, 3), np.inf)), "field of a state must be finite"),
    (lambda s: replace(s, gradient=np.zeros((3, 3))), "gradient of a state must be"),
]


@pytest.mark.parametrize(("spoilt", "sentence"), NO_STATES)
def test_what_is_no_state_is_refused(spoilt, sentence):
    simulation = batch()
    with pytest.raises(ValueError, match=sentence):
        simulation.set_state(spoilt(simulation.state()))


@pytest.mark.parametrize("rods", [[0, 0, 1], [3, 1, 2], [-1, 0, 1], 0.5, []])
def test_rods_that_are_none_are_refused(rods):
    simulation = batch()
    with pytest.raises(ValueError, match="rods must be different indices between 0 and 2"):
        simulation.set_state(simulation.state(), rods=rods)


@pytest.mark.parametrize("copied", [lambda s: pickle.loads(pickle.dumps(s)), copy.deepcopy], ids=["pickle", "deepcopy"])
def test_a_copy_goes_on_with_the_same_bits(copied):
    original = batch()
    original.advance(0.05, field=FIELDS)
    other = copied(original)
    assert_same(original, other)
    for simulation in (original, other):
        simulation.advance(0.05)
    assert_same(original, other)
    other.advance(0.01)
    assert other.time > original.time  # they share nothing


# ---- bad input

BAD_ARGUMENTS = [
    (dict(num_rods=0), "num_rods must be a whole number of 1 or more, but got 0"),
    (dict(num_rods=2.5), "num_rods must be a whole number"),
    (dict(num_elements=0), "num_elements must be a whole number of 1 or more, but got 0"),
    (dict(num_elements=True), "num_elements must be a whole number"),
    (dict(element="cubic"), "element must be one of 'helical', 'nodal', but got 'cubic'"),
    (dict(precision="float16"), "precision must be one of 'float64', 'float32', but got 'float16'"),
    (dict(on_failure="ignore"), "on_failure must be one of 'raise', 'report'"),
    (dict(plane="yz"), 'plane must be "xy", "xz" or None'),
    (dict(plane="xy"), "gravity must lie in the plane 'xy'"),
    (dict(time_step=1.0), "time_step must be at most"),
    (dict(time_step=0.0), "time_step must be a finite number > 0"),
    (dict(time_step=np.nan), "time_step must be a finite number > 0"),
    (dict(time_step=1e-300), "time_step must be at least"),
    (dict(num_rods=10**12), "num_rods must be at most 10000000, but got 1e+12"),
    (dict(num_elements=10**9), "num_elements must be at most 2000, but got 1000000000"),
    (dict(axial_softening=1e300), "axial_softening must be at most 1e+12, but got 1e+300"),
    (dict(rotary_scaling=1e300), "rotary_scaling must be at most 1e+12, but got 1e+300"),
    (dict(expected_field=1e300), "expected_field must be at most 1000000, but got 1e+300"),
    (dict(frequency_shaping=True), "frequency_shaping must be False with element='helical'"),
]


@pytest.mark.parametrize(("options", "sentence"), BAD_ARGUMENTS)
def test_a_bad_argument_gets_one_sentence(options, sentence):
    with pytest.raises(ValueError) as error:
        batch(**options)
    assert str(error.value).startswith(sentence)
    assert str(error.value).endswith(".")


BAD_STEPS = [
    (0.0, "time_step must be a finite number > 0, but got 0.0"),
    (-1e-5, "time_step must be a finite number > 0, but got -1e-05"),
    (np.nan, "time_step must be a finite number > 0, but got nan"),
    (True, "time_step must be a finite number > 0, but got True"),
    ("1e-5", "time_step must be a finite number > 0, but got '1e-5'"),
    (1.0, "time_step must be at most .* s, the stability bound"),
    (1e-300, "time_step must be at least .* s, below which rounding"),
]


@pytest.mark.parametrize(("step", "sentence"), BAD_STEPS)
@pytest.mark.parametrize("integrator", ["explicit", "implicit"])
def test_a_bad_time_step_is_refused_by_assignment_as_by_the_constructor(step, sentence, integrator):
    if integrator == "implicit" and step == 1.0:
        return  # it has no bound
    simulation = batch(integrator=integrator)
    before = simulation.time_step
    for give in (lambda: setattr(simulation, "time_step", step), lambda: batch(integrator=integrator, time_step=step)):
        with pytest.raises(ValueError, match=sentence):
            give()
    assert simulation.time_step == before


def test_a_good_time_step_is_taken_by_assignment():
    simulation = batch()
    default = simulation.time_step
    simulation.time_step = 0.5 * default
    assert simulation.time_step == 0.5 * default
    simulation.time_step = None
    assert simulation.time_step == default


def test_a_time_step_that_the_present_field_does_not_allow_is_refused_when_it_is_to_be_taken():
    simulation = Simulation(SOFT, num_elements=4)
    simulation.advance(0.0, field=(0.0, 0.0, 2.0))
    simulation.time_step = simulation.stable_time_step
    with pytest.raises(ValueError, match=r"time_step must be at most .* s in a field of 2 T"):
        simulation.advance(0.01)


@pytest.mark.parametrize("duration", [1e300, 1e9])
def test_more_steps_than_can_be_waited_for_are_refused(duration):
    with pytest.raises(ValueError, match=r"duration must be at most .* time steps"):
        batch().advance(duration)


def test_fields_beyond_any_are_refused():
    for field in ((1e300, 0.0, 0.0), lambda t: (0.0, 1e200, 0.0)):
        with pytest.raises(ValueError, match=r"field must be at most 1e\+06 T, but got"):
            batch().advance(0.01, field=field)
    with pytest.raises(ValueError, match="field must be at most"):
        batch().equilibrium((1e300, 0.0, 0.0))
    with pytest.raises(ValueError, match="gradient must be finite"):
        batch().equilibrium(gradient=1e300 * np.diag([1.0, -0.5, -0.5]))


def test_a_rod_too_thin_for_single_precision_is_told_so():
    rod = Rod.circular(length=1e-3, diameter=1e-8, density=1e-9, youngs_modulus=1.0, poissons_ratio=0.3)
    with pytest.raises(ValueError, match='use precision="float64"'):
        Simulation(Scene(rod=rod), precision="float32")
    assert Simulation(Scene(rod=rod)).time_step > 0.0


def test_what_is_no_scene_is_refused():
    with pytest.raises(ValueError, match="scene must be a Scene, but got 'paper4"):
        Simulation("paper4_pdms_tip_magnet")


def test_internal_damping_needs_the_helical_element():
    with pytest.raises(ValueError, match='internal_damping must be None with element="nodal"'):
        Simulation(SOFT.replace(internal_damping=1e-3), element="nodal")


def test_fewer_elements_than_segments_are_refused():
    with pytest.raises(ValueError, match="num_elements must be at least 2"):
        Simulation(load_scene("paper6_two_magnets"), num_elements=1)


def test_a_magnet_across_the_plane_is_refused():
    scene = SOFT.replace(magnets=(Magnet.dipole(position=SOFT.rod.length, moment=1e-3, direction=(0, 1, 0)),))
    with pytest.raises(ValueError, match="direction of a magnet must lie in the plane 'xz'"):
        Simulation(scene, plane="xz")


BAD_FIELDS = [
    [np.nan, 0.0, 0.0],
    [np.inf, 0.0, 0.0],
    [0.0, 0.0],
    np.zeros((2, 3)),
    np.zeros((3, 3, 1)),
    np.zeros((5, 3)),
]


@pytest.mark.parametrize("field", BAD_FIELDS, ids=["nan", "inf", "two_numbers", "two_rods", "three_axes", "five_rods"])
def test_a_bad_field_is_refused_and_nothing_moves(field):
    simulation = batch()
    for act in (simulation.advance, lambda d, field: simulation.reset(field=field)):
        with pytest.raises(ValueError, match=r"field must be finite of shape \(3,\) or \(3, 3\)"):
            act(0.01, field=field)
        assert simulation.time == 0.0
        np.testing.assert_array_equal(simulation.field, 0.0)


def test_a_function_that_returns_a_bad_field_is_refused():
    with pytest.raises(ValueError, match="field must be finite"):
        batch().advance(0.01, field=lambda t: [np.nan] * 3)


def test_a_field_that_leaves_the_plane_is_refused():
    simulation = Simulation(SOFT, num_elements=4, plane="xz")
    with pytest.raises(ValueError, match="field must lie in the plane 'xz'"):
        simulation.advance(0.01, field=(0.0, 1e-3, 0.0))
    simulation.advance(0.01, field=(1e-3, 0.0, 1e-3))


@pytest.mark.parametrize("gradient", [np.zeros(3), np.full((3, 3), np.nan), np.zeros((2, 3, 3))])
def test_a_bad_gradient_is_refused(gradient):
    with pytest.raises(ValueError, match=r"gradient must be finite of shape \(3, 3\)"):
        batch().advance(0.01, gradient=gradient)


def test_a_gradient_that_leaves_the_plane_is_refused():
    simulation = Simulation(SOFT, num_elements=4, plane="xz")
    slope = np.array([[0.0, 0.5, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.0]])
    for act in (lambda g: simulation.advance(0.01, gradient=g), lambda g: simulation.reset(gradient=g)):
        with pytest.raises(ValueError, match=r"gradient must not couple the plane 'xz' .* up to 0.5 T/m"):
            act(slope)
    simulation.advance(0.01, gradient=0.5 * np.diag([1.0, -1.0, 0.0]))  # what the plane lacks makes the trace zero


GRADIENT_TAKERS = {
    "advance": lambda s, g: s.advance(0.01, gradient=g),
    "advance_in_time": lambda s, g: s.advance(0.01, gradient=lambda t: g),
    "reset": lambda s, g: s.reset(gradient=g),
    "equilibrium": lambda s, g: s.equilibrium(gradient=g),
    "frequencies": lambda s, g: s.natural_frequencies(gradient=g),
}
CURLED = 0.5 * np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


@pytest.mark.parametrize("take", GRADIENT_TAKERS.values(), ids=GRADIENT_TAKERS)
@pytest.mark.parametrize("plane", [None, "xz"])
def test_a_gradient_that_breaks_maxwells_equations_is_refused(take, plane):
    simulation = Simulation(SOFT, num_elements=4, plane=plane)
    with pytest.raises(ValueError, match=r"gradient must be symmetric, .* dB_x/dy and dB_y/dx differ by up to 0.5 T/m"):
        take(simulation, CURLED)
    with pytest.raises(ValueError, match=r"gradient must have trace zero, .* its trace is 0.3 T/m"):
        take(simulation, np.diag([0.1, 0.1, 0.1]))


@pytest.mark.parametrize("duration", [-0.01, np.nan, np.inf, "1"])
def test_a_bad_duration_is_refused(duration):
    with pytest.raises(ValueError, match="duration must be a finite number >= 0"):
        batch().advance(duration)


@pytest.mark.parametrize("shape", [(5, 3), (3, 4, 3), (3, 5)])
def test_a_motion_of_another_shape_is_refused(shape):
    with pytest.raises(ValueError, match=r"velocities must be finite of shape \(3, 5, 3\)"):
        batch().set_motion(np.zeros(shape))


def test_a_motion_that_leaves_the_plane_is_refused():
    simulation = Simulation(SOFT, num_elements=4, plane="xz")
    velocities = np.zeros((1, 5, 3))
    velocities[0, 2, 1] = 0.1
    with pytest.raises(ValueError, match="velocities"):
        simulation.set_motion(velocities)


# ---- from soft to stiff


@pytest.mark.parametrize("name", scene_names())
def test_every_scene_runs(name):
    """Under its own weight and, with magnets, in 5 mT."""
    scene = load_scene(name)
    scene = dragged(scene) if scene.magnets else scene.replace(gravity=scene.gravity or (0.0, 0.0, 0.0))
    simulation = Simulation(scene, num_elements=4)
    simulation.advance(3000 * simulation.time_step, field=(0.0, 2e-3, 5e-3) if scene.magnets else None)
    assert simulation.status[0] == 0
    reach = np.linalg.norm(simulation.positions[0], axis=1)
    assert np.all(reach <= 1.05 * simulation.arc_lengths)


def test_a_guidewire_comes_to_rest_in_the_arc_of_its_tip_couple():
    """theta = m B L cos(theta)/EI, at steps of a microsecond; the field rises in parts so that it rings little."""
    scene = load_scene("niti_guidewire").replace(gravity=(0.0, 0.0, 0.0), drag_rate=190.0)
    simulation = Simulation(scene, num_elements=3)
    for part in np.linspace(0.05, 1.0, 20):
        simulation.advance(4e-3, field=(0.0, 0.0, part * 20e-3))
    simulation.advance(0.12)
    strength = scene.magnets[0].moment * 20e-3 * scene.rod.length / scene.rod.bending_stiffness
    theta = strength
    for _ in range(50):
        theta = strength * np.cos(theta)
    exact = scene.rod.length / theta * np.array([np.sin(theta), 0.0, 1.0 - np.cos(theta)])
    np.testing.assert_allclose(simulation.tip_position[0], exact, atol=2e-6)


@pytest.mark.parametrize(("precision", "terms"), [("float64", dragged), ("float32", damped)])
def test_a_field_that_turns_round_snaps_the_rod_over(precision, terms):
    """From aligned to opposed: the straight rod is unstable there and swings over to the mirror image of its arc."""
    scene = terms(SOFT.replace(gravity=(0.0, 0.0, 0.0), drag_rate=40.0))
    simulation = Simulation(scene, num_elements=6, precision=precision)
    simulation.advance(0.2, field=(10e-3, 0.0, 0.5e-3))
    simulation.advance(2.0, field=(-10e-3, 0.0, 0.5e-3))
    assert simulation.status[0] == 0
    moment, L, stiffness = scene.magnets[0].moment, scene.rod.length, scene.rod.bending_stiffness
    strength, alpha = np.hypot(10e-3, 0.5e-3) * moment * L / stiffness, np.arctan2(0.5e-3, -10e-3)
    assert strength > 1.0
    theta = alpha
    for _ in range(200):
        theta -= (theta - strength * np.sin(alpha - theta)) / (1.0 + strength * np.cos(alpha - theta))
    exact = L / theta * np.array([np.sin(theta), 0.0, 1.0 - np.cos(theta)])
    np.testing.assert_allclose(simulation.tip_position[0], exact, atol=2e-5)


def test_one_element_without_gravity_swings_like_a_pendulum_of_its_stiffness():
    """A small push in plane: the first natural frequency, by the time between zeros of the tip's height."""
    scene = SOFT.replace(gravity=(0.0, 0.0, 0.0), drag_rate=0.0)
    simulation = Simulation(scene, num_elements=1)
    stiffness, inertia = simulation.rods.model.static.linearise(None)
    velocities = np.zeros((1, 2, 3))
    keep = [2, 4]
    shape = np.linalg.solve(stiffness[np.ix_(keep, keep)], [1.0, 0.0])  # nearly the first mode
    velocities[0, 1, 2] = 1e-3
    spins = np.zeros((1, 2, 3))
    spins[0, 1, 1] = 1e-3 * shape[1] / shape[0]
    simulation.set_motion(velocities, spins)
    frequency = simulation.natural_frequencies()[0]
    step, seen = 0.002 / frequency, []
    for _ in range(5000):
        simulation.advance(step)
        seen.append(simulation.tip_position[0, 2])
    seen = np.array(seen)
    up = np.flatnonzero((seen[:-1] < 0) & (seen[1:] >= 0))
    crossings = up + seen[up] / (seen[up] - seen[up + 1])
    np.testing.assert_allclose(1.0 / (np.diff(crossings).mean() * step), frequency, rtol=2e-3)


def test_a_field_far_too_strong_is_refused_or_reported_never_wrong():
    simulation = Simulation(SOFT, num_elements=4)
    with pytest.raises((ValueError, SimulationDiverged)):
        simulation.advance(0.5, field=(0.0, 10.0, 0.0))


def jelly(modulus):
    rod = Rod.circular(length=0.06, diameter=4e-3, density=1000.0, youngs_modulus=modulus, poissons_ratio=0.3)
    magnet = Magnet.dipole(position=0.06, moment=1e-6, mass=1e-6)
    return Scene(rod=rod, magnets=(magnet,), gravity=(0.0, 0.0, -9.81), drag_rate=5.0)


@pytest.mark.parametrize("modulus", [5e3, 1e12])
def test_moduli_from_jelly_to_beyond_steel_run(modulus):
    """The step follows the stiffness; the jelly hangs down, stretched by a tenth, the steel stays straight."""
    simulation = Simulation(jelly(modulus), num_elements=10)
    simulation.advance(2000 * simulation.time_step)
    assert simulation.status[0] == 0
    tip = simulation.tip_position[0]
    assert (tip[2] < -0.02) if modulus < 1e5 else (abs(tip[2]) < 1e-6)


def test_a_jelly_that_its_weight_stretches_by_more_than_half_is_reported():
    """1 kPa: rho g L/E = 0.59 at the clamp of a rod that only hangs."""
    with pytest.raises(SimulationDiverged, match="left the stable range"):
        Simulation(jelly(1e3), num_elements=10).advance(2.0)
