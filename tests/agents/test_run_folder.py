"""The folder of a run: what a failed write leaves, which checkpoint is taken, whose folder it is."""

import os
import stat

import pytest

from agents.run_folder import (
    checkpoint_path,
    checkpoints,
    load_newest,
    read_arguments,
    remove_partial,
    require_free,
    write_arguments,
    write_whole,
)


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "file"
    write_whole(path, b"old")

    def full(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_whole(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(os.name == "nt", reason="modes of Unix")
def test_files_have_the_mode_that_the_user_asks_for(tmp_path):
    before = os.umask(0o027)
    try:
        write_whole(tmp_path / "file", b"")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "file").stat().st_mode) == 0o640


def test_checkpoints_are_ordered_by_steps_and_other_files_are_none(tmp_path):
    for name in ("checkpoint_512_steps.zip", "checkpoint_10240_steps.zip", "checkpoint_9_steps.zip"):
        (tmp_path / name).touch()
    for name in ("checkpoint_x_steps.zip", "checkpoint_99999_steps.zip.12.partial", "policy.zip"):
        (tmp_path / name).touch()
    assert checkpoints(tmp_path) == [checkpoint_path(tmp_path, steps) for steps in (10240, 512, 9)]


def load_text(path):
    if not path.read_text():
        raise EOFError
    return path.read_text()


def test_the_newest_whole_checkpoint_is_taken_with_a_word_about_others(tmp_path, capsys):
    assert load_newest(tmp_path, load_text) is None
    for steps, content in ((1, "first"), (2, "second"), (3, "")):
        checkpoint_path(tmp_path, steps).write_text(content)
    assert load_newest(tmp_path, load_text) == "second"
    assert capsys.readouterr().err == "skipped checkpoint_3_steps.zip, which cannot be loaded: EOFError\n"
    for path in checkpoints(tmp_path):
        path.write_text("")
    with pytest.raises(ValueError, match="none of the 3"):
        load_newest(tmp_path, load_text)


def test_a_folder_that_is_not_empty_is_not_free(tmp_path):
    require_free(tmp_path / "new" / "run")
    (tmp_path / "args.json.12.partial").touch()
    require_free(tmp_path / "new" / "run")
    (tmp_path / "anything").touch()
    with pytest.raises(ValueError, match=r"must be empty, but .* holds anything"):
        require_free(tmp_path)


def test_halves_are_removed_and_files_are_not(tmp_path):
    for name in ("args.json", "args.json.12.partial"):
        (tmp_path / name).touch()
    remove_partial(tmp_path)
    assert list(tmp_path.iterdir()) == [tmp_path / "args.json"]


def test_arguments_come_back(tmp_path):
    write_arguments(tmp_path, {"seed": 1, "folder": tmp_path})
    assert read_arguments(tmp_path) == {"seed": 1, "folder": str(tmp_path)}


@pytest.mark.parametrize("content", [b"", b"{", b"[1]", b"null", b"\xff\xfe", b'{"seed": 1} 2', b"\x00"], ids=repr)
def test_damaged_arguments_are_refused(tmp_path, content):
    (tmp_path / "args.json").write_bytes(content)
    with pytest.raises(ValueError, match="must hold the arguments of a run as a JSON object") as refused:
        read_arguments(tmp_path)
    assert "\n" not in str(refused.value)
