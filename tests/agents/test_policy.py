"""Policy files: what is read, and what is refused."""

import pickle
import zipfile

import numpy as np
import pytest

from agents.policy import Policy
from scripts.evaluate import WEIGHTS

NAN = float("nan")


def arrays_of(seed=0):
    """Arrays of a small policy file: 3 entries seen, 4 hidden, 2 actions."""
    rng = np.random.default_rng(seed)
    shapes = {"weights_0": (4, 3), "biases_0": 4, "weights_1": (2, 4 + 3), "biases_1": 2}
    return {name: rng.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}


def test_a_policy_is_what_was_saved(tmp_path):
    """By hand: two tanh layers of one unit, and the linear path."""
    layers = ((np.array([[0.5]]), np.array([0.25])), (np.array([[0.5, -0.25]]), np.array([0.125])))
    Policy(layers).save(tmp_path / "policy.npz", args="{}")
    policy = Policy.load(tmp_path / "policy.npz")
    expected = 0.5 * np.tanh(0.5 * 0.5 + 0.25) - 0.25 * 0.5 + 0.125  # all of it exact in float32 but the tanh
    np.testing.assert_allclose(policy(np.array([[0.5]])), [[expected]], rtol=1e-15)
    assert [path.name for path in tmp_path.iterdir()] == ["policy.npz"]


def test_the_shipped_policy_loads():
    assert Policy.load(WEIGHTS)(np.zeros((3, 20))).shape == (3, 2)


def without(*names):
    return {name: array for name, array in arrays_of().items() if name not in names}


def with_entry(name, value):
    changed = arrays_of()
    changed[name].flat[0] = value
    return changed


REFUSED = {
    "no weights": {},
    "no biases": without("biases_1"),
    "no first layer": without("weights_0", "biases_0"),
    "no last layer": without("weights_1", "biases_1"),
    "extra": arrays_of() | {"other": np.zeros(3)},
    "odd name": without("weights_1") | {"weights_x": np.zeros((2, 7), np.float32)},
    "NaN": with_entry("weights_0", NAN),
    "infinity": with_entry("biases_1", np.inf),
    "no linear path": arrays_of() | {"weights_1": np.zeros((2, 4), np.float32)},
    "biases too long": arrays_of() | {"biases_0": np.zeros(5, np.float32)},
    "flat weights": arrays_of() | {"weights_0": np.zeros(12, np.float32)},
    "scalar weights": arrays_of() | {"weights_0": np.float32(1.0)},
    "text": arrays_of() | {"biases_0": np.array(list("abcd"))},
    "complex": arrays_of() | {"biases_0": np.zeros(4, complex)},
    "objects": arrays_of() | {"biases_0": np.array([None] * 4)},
}


@pytest.mark.parametrize("arrays", REFUSED.values(), ids=REFUSED)
def test_a_file_without_a_whole_finite_policy_is_refused_in_one_sentence(tmp_path, arrays):
    path = tmp_path / "policy.npz"
    np.savez(path, **arrays)
    with pytest.raises(ValueError, match="must be a policy file") as refused:
        Policy.load(path)
    assert str(path) in str(refused.value) and "\n" not in str(refused.value)


def shipped_without_its_end():
    return WEIGHTS.read_bytes()[:-200]


def shipped_with_another_byte():
    content = bytearray(WEIGHTS.read_bytes())
    content[len(content) // 2] ^= 0xFF
    return bytes(content)


CONTENTS = {
    "empty": lambda: b"",
    "text": lambda: b"weights: none\n" * 20,
    "a pickle": lambda: pickle.dumps({"weights_0": 1}),
    "cut": shipped_without_its_end,
    "altered": shipped_with_another_byte,
}


@pytest.mark.parametrize("content", CONTENTS.values(), ids=CONTENTS)
def test_a_file_of_another_format_is_refused_in_one_sentence(tmp_path, content):
    path = tmp_path / "policy.npz"
    path.write_bytes(content())
    with pytest.raises(ValueError, match="must be a policy file") as refused:
        Policy.load(path)
    assert "\n" not in str(refused.value)


def test_a_zip_archive_or_an_array_of_something_else_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        archive.writestr("weights_0", "text")
    np.save(tmp_path / "array.npy", np.zeros(3))
    for name in ("other.zip", "array.npy", "."):
        with pytest.raises(ValueError, match="must be a policy file"):
            Policy.load(tmp_path / name)


def test_observations_of_another_environment_are_refused():
    with pytest.raises(ValueError, match=r"observations must have shape \(num_envs, 20\), but got \(3, 38\)"):
        Policy.load(WEIGHTS)(np.zeros((3, 38)))
