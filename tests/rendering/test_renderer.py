"""Facts about frames: what they are, where things land on them, and that bad input does not stop them."""

import ast
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("PIL")

from bent_rod import FIELD, LENGTH, PICTURE, arc

from magrod_env.rendering import Picture, Renderer, palette
from magrod_env.rendering.camera import make_camera


def scene(**changes):
    nodes, rotations = arc(12.0)
    marks = nodes[-1] + 5e-3 * np.random.default_rng(0).normal(size=(50, 3))
    return {
        "nodes": nodes,
        "rotations": rotations,
        "field": FIELD,
        "target": nodes[-1],
        "path": marks,
        "trace": marks,
        "time": 1.25,
        "tip_error": 4e-4,
        "text": "words",
        **changes,
    }


def centroid(frame, other, columns):
    """Mean pixel (x, y) of what differs between two frames, between two columns of the panes."""
    weight = np.abs(frame[41:445, columns].astype(int) - other[41:445, columns]).sum(axis=2)
    y, x = np.indices(weight.shape) + 0.5
    return np.array([np.average(x, weights=weight) + columns.start, np.average(y, weights=weight) + 41])


@pytest.mark.parametrize("size", [(960, 480), (640, 480), (161, 121)])
def test_frame_has_the_asked_size_and_type(size):
    frame = Renderer(PICTURE, size=size).draw(**scene())
    assert frame.shape == (size[1], size[0], 3)
    assert frame.dtype == np.uint8


def test_each_call_returns_a_fresh_equal_array():
    renderer = Renderer(PICTURE)
    first, second = renderer.draw(**scene()), renderer.draw(**scene())
    np.testing.assert_array_equal(first, second)
    first[:] = 0
    np.testing.assert_array_equal(renderer.draw(**scene()), second)
    assert second.flags.writeable and not np.shares_memory(first, second)


def test_two_renderers_draw_the_same_frame():
    np.testing.assert_array_equal(Renderer(PICTURE).draw(**scene()), Renderer(PICTURE).draw(**scene()))


def test_inputs_are_left_alone():
    inputs = scene()
    copies = {name: np.copy(value) for name, value in inputs.items()}
    Renderer(PICTURE).draw(**inputs)
    for name, value in inputs.items():
        np.testing.assert_array_equal(value, copies[name])


@pytest.mark.parametrize(("views", "pane"), [(("side", "front"), 0), (("side", "front"), 1), (("side", "top"), 1)])
def test_target_lands_where_the_projection_says(views, pane):
    target = np.array([0.6 * LENGTH, 0.15 * LENGTH, -0.2 * LENGTH])
    renderer = Renderer(PICTURE, views=views)
    frame, without = (renderer.draw(**scene(target=x)) for x in (target, None))
    box = ((10, 40, 475, 446), (485, 40, 950, 446))[pane]
    expected = make_camera(views[pane], box, PICTURE).project(target)
    # The ring is symmetric, but its edges fall on thirds of a pixel.
    np.testing.assert_allclose(centroid(frame, without, slice(box[0], box[2])), expected, atol=0.34)


def test_tip_magnet_lands_on_the_tip_and_points_north_outwards():
    nodes, rotations = arc(1e-3)
    frame = Renderer(PICTURE, views=("tip",)).draw(nodes=nodes, rotations=rotations, field=FIELD)
    red, _, blue = np.moveaxis(frame[60:400].astype(int), 2, 0)
    north, south = np.argwhere(red > blue + 100).mean(axis=0), np.argwhere(blue > red + 120).mean(axis=0)
    np.testing.assert_allclose((north + south) / 2 + (60.5, 0.5), (243.0, 480.0), atol=2.0)
    assert north[1] > south[1]


def test_end_on_view_hides_the_clamp_behind_a_straight_rod():
    nodes, rotations = arc(1e-3)
    picture = Picture(length=LENGTH, radius=2e-3)
    frame = Renderer(picture, views=("front",)).draw(nodes=nodes, rotations=rotations, field=FIELD)
    assert frame[243, 480, 2] > frame[243 + 14, 480, 2] + 40


def test_drawn_rod_is_as_thick_as_the_rod():
    nodes, rotations = arc(1e-3)
    picture = Picture(length=LENGTH, radius=2e-3)
    renderer = Renderer(picture, views=("side",))
    with_rod = renderer.draw(nodes=nodes, rotations=rotations, field=FIELD)
    without = renderer.draw(nodes=np.full_like(nodes, np.nan), rotations=rotations, field=FIELD)
    thickness = np.any(with_rod != without, axis=2)[60:400, 480].sum()
    scale = make_camera("side", (10, 40, 950, 446), picture).scale
    np.testing.assert_allclose(thickness, 2 * picture.radius * scale, atol=2.0)


def test_field_arrow_has_the_colour_and_direction_of_the_field():
    renderer = Renderer(PICTURE)
    up = renderer.draw(**scene(field=[0.0, 0.0, 45e-3]))
    down = renderer.draw(**scene(field=[0.0, 0.0, -45e-3]))
    dial = slice(378, 462)

    def arrow_row(frame):
        return np.nonzero(np.all(frame[54:139, dial] == palette.FIELD, axis=2))[0].mean()

    assert arrow_row(up) < 42 < arrow_row(down)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e300])
@pytest.mark.parametrize("name", ["nodes", "rotations", "field", "target", "path", "trace"])
@pytest.mark.filterwarnings("error")
def test_bad_numbers_are_survived(name, bad):
    inputs = scene()
    inputs[name] = np.copy(inputs[name])
    inputs[name][-1:] = bad
    Renderer(PICTURE).draw(**inputs)
    inputs[name][:] = bad
    Renderer(PICTURE).draw(**inputs)


@pytest.mark.parametrize("place", ["nodes", "rotations"])
def test_status_line_says_diverged(place):
    inputs = scene()
    sound = Renderer(PICTURE).draw(**inputs)
    inputs[place] = np.copy(inputs[place])
    inputs[place][7:] = np.nan
    for frame, said in ((sound, False), (Renderer(PICTURE).draw(**inputs), True)):
        assert np.any(np.all(frame[446:] == palette.ALARM, axis=2)) == said


@pytest.mark.filterwarnings("error")
def test_what_is_out_of_view_is_cut():
    renderer = Renderer(PICTURE)
    away = np.array([[0.0, 0.0, 50.0], [0.0, 50.0, 0.0]])
    frame = renderer.draw(**scene(target=away, path=away, trace=away))
    empty = renderer.draw(**scene(target=None, path=None, trace=None))
    np.testing.assert_array_equal(frame[:40], empty[:40])
    np.testing.assert_array_equal(frame[446:], empty[446:])


@pytest.mark.parametrize("views", [("side",), ("top", "oblique"), ("side", "front", "tip")])
@pytest.mark.parametrize("plane", ["spatial", "xz", "xy"])
def test_every_view_draws_every_plane(views, plane):
    picture = Picture(length=LENGTH, radius=2e-3, section="square", plane=plane)
    assert Renderer(picture, views=views).draw(**scene()).std() > 0


def test_two_targets_draw_more_than_one():
    nodes, _ = arc(12.0)
    renderer = Renderer(PICTURE)
    counts = [
        np.sum(np.all(renderer.draw(**scene(target=target))[50:440] == palette.TARGET, axis=2))
        for target in (nodes[-1], nodes[[5, 10]])
    ]
    assert counts[1] > 1.5 * counts[0]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"nodes": np.zeros((11, 2))}, "nodes must have shape"),
        ({"nodes": np.zeros((10, 3))}, "same number"),
        ({"field": np.zeros(2)}, "field must have shape"),
        ({"target": np.zeros(2)}, "target must have shape"),
        ({"path": np.zeros((4, 2))}, "path must have shape"),
    ],
)
def test_wrong_shapes_are_named(changes, words):
    with pytest.raises(ValueError, match=words):
        Renderer(PICTURE).draw(**scene(**changes))


def test_wrong_views_and_sizes_are_named():
    with pytest.raises(ValueError, match="views must be"):
        Renderer(PICTURE, views=("behind",))
    with pytest.raises(ValueError, match="size must be"):
        Renderer(PICTURE, size=(20, 20))


@pytest.mark.parametrize(
    "value",
    [float("nan"), 1e300, -1, True, "x", set(), [], [1], {}, object(), (960, 480.5)],
    ids=lambda value: "object" if type(value) is object else str(value),
)
def test_views_and_sizes_of_a_wrong_kind_are_named(value):
    with pytest.raises(ValueError, match="views must be"):
        Renderer(PICTURE, views=value)
    with pytest.raises(ValueError, match="size must be"):
        Renderer(PICTURE, size=value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"length": 0.0}, "length must be positive"),
        ({"radius": float("nan")}, "radius must be positive"),
        ({"magnet_nodes": (1,)}, "one entry per magnet"),
        ({"gravity": (0.0, 0.0, 0.0)}, "gravity must be"),
        ({"plane": "yz"}, "plane must be one of"),
        ({"section": "star"}, "section must be one of"),
        ({"length": "long"}, "length must be positive"),
        ({"radius": None}, "radius must be positive"),
        ({"field_limit": True}, "field_limit must be positive"),
        ({"gravity": 9.81}, "gravity must be"),
        ({"gravity": (0.0, None, 1.0)}, "gravity must be"),
    ],
)
def test_wrong_pictures_are_named(changes, words):
    with pytest.raises(ValueError, match=words):
        Picture(**{"length": LENGTH, "radius": 1e-3, **changes})


def test_rendering_imports_neither_physics_nor_windows():
    allowed = {*sys.stdlib_module_names, "numpy", "PIL", "imageio"} - {"tkinter"}
    for file in Path(palette.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) else []
            for name in names:
                assert name.split(".")[0] in allowed or name.startswith("magrod_env.rendering"), (file, name)


def test_frames_need_no_display(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert Renderer(PICTURE).draw(**scene()).std() > 0
