"""Pictures, against closed forms and against the command line's."""

import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

import twincast

SCENES = Path(__file__).parents[3] / "scenes"
TRIANGLE = (np.array([[-1.0, -1, 0], [1, -1, 0], [-1, 1, 0]]), np.array([[0, 1, 2]]))


def test_a_triangle_covers_its_pixels():
    picture = twincast.render(TRIANGLE, size=(40, 40), spp=1, eye=(0, 0, 5), look_at=(0, 0, 0), fov=2 * np.degrees(np.arctan(0.2)))
    assert picture.shape == (40, 40, 4) and picture.dtype == np.float32
    # Its side fills the picture; pixels whose middles are on the diagonal are left out.
    row, column = np.indices((40, 40))
    inside, on = row > column, row == column
    assert np.array_equal(picture[..., 3][~on] > 0, inside[~on])
    assert (picture[inside][:, :3] > 0.05).all(), "lit from the camera"


def test_far_away_is_the_same_picture():
    shift = np.array([1e7, -2e7, 3e7])
    view = dict(size=(32, 24), spp=4)
    near = twincast.render(TRIANGLE, eye=(0.5, 0, 5), look_at=(0, 0, 0), **view)
    far = twincast.render((TRIANGLE[0] + shift, TRIANGLE[1]), eye=shift + (0.5, 0, 5), look_at=shift, **view)
    assert np.abs(near - far).max() < 0.02


def test_vertices_of_no_triangle_show_nothing():
    for stray in ([1000.0, 0, 0], [np.nan] * 3):
        strewn = (np.vstack([[stray], TRIANGLE[0], [stray]]), TRIANGLE[1] + 1)
        for view in ({}, {"eye": (0.5, 0, 5)}):
            options = dict(size=(32, 24), spp=1, **view)
            assert np.array_equal(twincast.render(strewn, **options), twincast.render(TRIANGLE, **options))
    # A triangle with such a vertex cannot be seen, but the others can.
    broken = (np.vstack([TRIANGLE[0], [[np.nan] * 3]]), [[0, 1, 2], [0, 1, 3]])
    assert np.array_equal(twincast.render(broken, size=(32, 24), eye=(0, 0, 5)), twincast.render(TRIANGLE, size=(32, 24), eye=(0, 0, 5)))


def test_several_meshes_and_kinds():
    class Mesh:
        vertices, faces = TRIANGLE

    alone = twincast.render(Mesh(), size=(32, 32))
    assert (alone == twincast.render([TRIANGLE], size=(32, 32))).all()
    beside = (TRIANGLE[0] + [3, 0, 0], TRIANGLE[1])
    both = twincast.render([TRIANGLE, beside], size=(32, 32))
    assert (both == twincast.render((TRIANGLE, beside), size=(32, 32))).all(), "two meshes, not vertices and faces"
    assert (both == twincast.render((Mesh(), beside), size=(32, 32))).all()
    square = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = [[0, 1, 2], [0, 2, 3]]
    rows = twincast.render((square, tuple(map(tuple, faces))), size=(32, 32))
    assert (rows == twincast.render((square, np.array(faces)), size=(32, 32))).all(), "one mesh, of two faces"
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene([trimesh.creation.box()])
    assert (twincast.render(scene, size=(16, 16))[..., 3] > 0).any()


def test_a_background_and_threads():
    options = dict(size=(32, 32), spp=2, background=(0.25, 0.5, 0.75))
    picture = twincast.render(TRIANGLE, eye=(0, 0, 50), threads=1, **options)
    assert np.allclose(picture[0, 0], [0.25, 0.5, 0.75, 1])
    assert np.array_equal(picture, twincast.render(TRIANGLE, eye=(0, 0, 50), threads=3, **options))


def png(path):
    """The codes of an 8-bit PNG without an interlace, by its specification."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, packed = 8, b""
    while at < len(data):
        (length,), kind = struct.unpack(">I", data[at : at + 4]), data[at + 4 : at + 8]
        body = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, color = struct.unpack(">IIBB", body[:10])
            assert depth == 8 and color in (2, 6)
        packed += body if kind == b"IDAT" else b""
        at += 12 + length
    channels = 4 if color == 6 else 3
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + width * channels)
    above, pixels = np.zeros(width * channels, int), []
    for kind, *row in rows.tolist():
        line = np.zeros(width * channels, int)
        for i, x in enumerate(row):
            a, b = (line[i - channels] if i >= channels else 0), above[i]
            c = above[i - channels] if i >= channels else 0
            p = a + b - c
            best = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
            line[i] = (x + (0, a, b, (a + b) // 2, best)[kind]) % 256
        pixels.append(line)
        above = line
    return np.array(pixels).reshape(height, width, channels)


def test_a_file_as_the_command_line_renders_it(tmp_path):
    scene = SCENES / "gallery" / "gallery.glb"
    if not scene.exists():
        pytest.skip("the project's scenes are not here")
    ours = twincast.render(scene, size=(48, 27), spp=2)
    assert ours.shape == (27, 48, 4)
    out = tmp_path / "picture.png"
    line = [sys.executable, "-m", "twincast", "render", str(scene), "--size", "48x27", "--spp", "2", "-q", "-o", str(out)]
    subprocess.run(line, check=True)
    # By sRGB's curve, rounded.
    linear = np.clip(ours[..., :3], 0, 1)
    alpha = ours[..., 3:]
    straight = np.where(alpha > 0, linear / np.maximum(alpha, 1e-9), 0)
    codes = np.where(straight <= 0.0031308, 12.92 * straight, 1.055 * np.maximum(straight, 1e-9) ** (1 / 2.4) - 0.055) * 255
    assert np.abs(png(out)[..., :3] - codes)[alpha[..., 0] == 1].max() < 0.51


def test_the_command_line():
    def run(*arguments):
        return subprocess.run([sys.executable, "-m", "twincast", *arguments], capture_output=True, text=True, check=False)

    version = run("--version")
    assert version.returncode == 0 and twincast.__version__ in version.stdout and "native" in version.stdout
    assert run("render").returncode == 2
    assert run("render", "no-such.glb", "-o", "x.png").returncode == 3


def test_the_console_script():
    script = Path(sys.executable).parent / "twincast"
    if not script.exists():
        pytest.skip("the package is not installed, only on the path")
    done = subprocess.run([str(script), "--version"], capture_output=True, text=True, check=True)
    assert twincast.__version__ in done.stdout


def test_warnings_of_a_file_are_pythons(tmp_path):
    scene = tmp_path / "broken.obj"
    scene.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nf 1 2 3\nf 1 2 4\n")
    with pytest.warns(UserWarning, match="broken.obj"):
        twincast.render(scene, size=(8, 8))
    scene.write_text("v 0 0 zero\n")
    with pytest.raises(ValueError, match="broken.obj"):
        twincast.render(scene, size=(8, 8))
