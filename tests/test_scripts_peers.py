"""The adapters to other simulators: without the simulator they say what to install; with it they follow the rod."""

import dataclasses
from importlib import metadata

import numpy as np
import pytest

from scripts.common.cases import CASES, TIMES, reference
from scripts.common.run import whole_steps
from scripts.peers import PeerRun, Problem, missing, mujoco_chain, pyelastica, soromox

PEERS = {"mujoco": mujoco_chain, "pyelastica": pyelastica, "soromox": soromox}
SHORT = TIMES[:51]  # the field's ramp, and the rod's first fall


def problem(name):
    """A reference case with one magnet."""
    return Problem(*CASES[name])


def error(peer, setting, name, times=SHORT):
    """RMS distance, mm, from the reference tip, and the run."""
    truth = reference(name)[: len(times), 0]
    found = peer.run(problem(name), setting, times, repeats=1)
    assert found.tip.shape == (len(times), 3) and found.wall_per_second > 0.0 and found.peer == peer.NAME
    return found.error(truth)


def need(peer):
    if reason := peer.available():
        pytest.skip(reason)


@pytest.mark.parametrize("package", PEERS)
def test_peer_that_is_not_installed_says_what_to_install(package, monkeypatch):
    def absent(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", absent)
    reason = PEERS[package].available()
    assert reason.startswith(f'{package} is not installed: pip install "{package}>=')


def test_peer_that_is_too_old_says_so(monkeypatch):
    monkeypatch.setattr(metadata, "version", lambda name: "3.2.1")
    assert missing("mujoco", "4.0") == 'mujoco 3.2.1 is too old: pip install "mujoco>=4.0"'
    assert missing("mujoco", "3.2") is None


def test_whole_steps_fill_an_interval_without_exceeding_the_step():
    assert whole_steps(0.01, 0.005) == 2 and whole_steps(0.01, 0.0049) == 3 and whole_steps(0.01, 0.02) == 1


def test_error_is_a_root_mean_square_in_millimetres_and_none_if_diverged():
    tip = np.zeros((4, 3))
    found = PeerRun("peer", "label", "resolution", np.arange(4.0), tip, 1.0, False)
    assert found.error(tip + [1e-3, 0.0, 0.0]) == pytest.approx(1.0)
    assert dataclasses.replace(found, diverged=True).error(tip) is None


@pytest.mark.parametrize("name, bound", [("free_decay", 1.0), ("rotating_field", 0.1)])
def test_mujoco_chain_with_all_strains_follows_the_rod(name, bound):
    need(mujoco_chain)
    setting = mujoco_chain.settings(problem(name), quick=True)[-1]
    assert error(mujoco_chain, setting, name) < bound


def test_mujoco_with_implicit_springs_takes_large_steps():
    need(mujoco_chain)
    setting = mujoco_chain.Setting(5, mujoco_chain.BENDING, "discrete", 5e-3)
    assert error(mujoco_chain, setting, "rotating_field") < 1.0
    assert mujoco_chain.run_batch(problem("rotating_field"), setting, 4, 1) > 0.0


def test_mujoco_run_beyond_the_stable_step_is_reported_as_diverged():
    need(mujoco_chain)
    found = mujoco_chain.run(
        problem("free_decay"), mujoco_chain.Setting(10, "bending", "Euler", 5e-3), SHORT, repeats=1
    )
    assert found.diverged and np.all(np.isnan(found.tip))


@pytest.mark.parametrize("name, bound", [("free_decay", 1.0), ("rotating_field", 0.1)])
def test_pyelastica_follows_the_rod(name, bound):
    need(pyelastica)
    (setting,) = pyelastica.settings(problem(name), quick=True)
    assert error(pyelastica, setting, name) < bound


def test_pyelastica_needs_the_half_element_at_the_clamp():
    need(pyelastica)
    plain, half = (pyelastica.at_limit(problem("free_decay"), 10, care) for care in (pyelastica.PLAIN, pyelastica.HALF))
    assert error(pyelastica, plain, "free_decay", TIMES[:21]) > 3 * error(pyelastica, half, "free_decay", TIMES[:21])


def test_pyelastica_batch_has_a_speed():
    need(pyelastica)
    case = problem("rotating_field")
    assert pyelastica.run_batch(case, pyelastica.settings(case, quick=True)[0], 3, 1) > 0.0


@pytest.mark.slow
def test_soromox_follows_the_rod():
    need(soromox)
    (setting,) = soromox.settings(problem("rotating_field"), quick=True)
    assert error(soromox, setting, "rotating_field") < 0.2
