"""The threads that queries run on; and processes that are forked from them."""

import multiprocessing
import os
import subprocess
import sys
import time
import types

import numpy as np
import pytest

import twincast
from twincast import _meshes

TASKS = "/proc/self/task"


def scene():
    scene = twincast.RaycastingScene()
    scene.add_triangles(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])
    return scene


def in_its_own_process(program):
    """Runs a program that knows what stands here."""
    here = "import sys; sys.path.insert(0, sys.argv[1]); from test_threads import *\n"
    subprocess.run([sys.executable, "-c", here + program, os.path.dirname(__file__)], check=True)


RAY = np.float32([[0.25, 0.25, 1, 0, 0, -1]])

#: More than one task: that is cast where it is asked for.
RAYS = np.repeat(RAY, 3000, axis=0)


@pytest.mark.skipif(not os.path.isdir(TASKS), reason="nobody says how many threads there are")
def test_few_pools_are_kept():
    one = scene()
    before = len(os.listdir(TASKS))
    for threads in range(3, 20):
        assert (one.cast_rays(RAYS, nthreads=threads)["t_hit"] == 1).all()
    # Four at most; those of the others end when they notice.
    most = before + 19 + 18 + 17 + 16
    until = time.monotonic() + 20
    while len(os.listdir(TASKS)) > most and time.monotonic() < until:
        time.sleep(0.01)
    assert len(os.listdir(TASKS)) <= most


@pytest.mark.skipif(not os.path.isdir(TASKS), reason="nobody says how many threads there are")
def test_a_ray_by_itself_starts_no_thread():
    """Each kind of query of rays."""
    program = (
        "one = scene(); one.compute_distance(RAYS[:, :3]); one.count_intersections(RAYS)\n"
        "before = len(os.listdir(TASKS))\n"
        "for ask in (one._scene.first, one._scene.occluded, one._scene.cast, one._scene.closest, one._scene.count):\n"
        "    for dtype in (np.float32, np.float64): ask(RAY[:, :3].astype(dtype), RAY[:, 3:].astype(dtype), threads=7)\n"
        "assert len(os.listdir(TASKS)) == before, (len(os.listdir(TASKS)), before)\n"
    )
    in_its_own_process(program)


@pytest.mark.parametrize("ask", ["first", "occluded", "cast", "closest", "count", "crossings", "list", "nearest", "distance", "inside"])
def test_a_query_can_be_interrupted(ask):
    """Among so many large triangles that each ray and point takes long: it ends after a small part of the time that all of them would take."""
    program = (
        "import os, signal, sys, threading, time\n"
        "import numpy as np, twincast\n"
        "rng = np.random.default_rng(1)\n"
        "scene = twincast.RaycastingScene()\n"
        "scene.add_triangles(np.float32(rng.random((30000, 3))), np.arange(30000).reshape(-1, 3))\n"
        "ask = getattr(scene._scene, sys.argv[1])\n"
        "arrays = [rng.random((2000, 3)), rng.normal(size=(2000, 3))]\n"
        "if sys.argv[1] in ('nearest', 'distance', 'inside'): del arrays[1]\n"
        "def seconds(arrays):\n"
        "    start = time.monotonic()\n"
        "    ask(*arrays, threads=1)\n"
        "    return time.monotonic() - start\n"
        # Whoever started this may have it ignored.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "seconds([array[:2] for array in arrays])\n"
        "few = seconds(arrays)\n"
        "times = min(1500, int(30 / few) + 1)\n"
        "whole, many = few * times, [np.tile(array, (times, 1)) for array in arrays]\n"
        "sent = []\n"
        "def send():\n"
        "    sent.append(time.monotonic())\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "threading.Timer(whole / 40, send).start()\n"
        "try: seconds(many)\n"
        "except KeyboardInterrupt: late = time.monotonic() - sent[0]\n"
        "assert late < whole / 4, (late, whole)\n"
    )
    subprocess.run([sys.executable, "-c", program, ask], check=True)


@pytest.mark.parametrize("ask", ["normals", "nearest"])
def test_others_go_on_while_there_is_something_to_compute(ask):
    """The interpreter's lock is not held for longer than a small part of the time."""
    program = (
        "import threading\n"
        "one = scene()\n"
        "count = 10_000_000 if sys.argv[2] == 'normals' else 1_000_000\n"
        "ids, points = np.zeros(count, np.uint32), np.random.default_rng(1).random((count, 3))\n"
        "arrays = (ids, ids) if sys.argv[2] == 'normals' else (points,)\n"
        "ask = getattr(one._scene, sys.argv[2])\n"
        "ask(*(array[:5000] for array in arrays))\n"
        "gaps, is_over = [], False\n"
        "def tick():\n"
        "    last = time.monotonic()\n"
        "    while not is_over:\n"
        "        time.sleep(0.001); now = time.monotonic(); gaps.append(now - last); last = now\n"
        "thread = threading.Thread(target=tick); thread.start()\n"
        "start = time.monotonic(); ask(*arrays, threads=1); took = time.monotonic() - start\n"
        "is_over = True; thread.join()\n"
        "assert max(gaps) < took / 2, (max(gaps), took)\n"
    )
    here = "import sys; sys.path.insert(0, sys.argv[1]); from test_threads import *\n"
    subprocess.run([sys.executable, "-c", here + program, os.path.dirname(__file__), ask], check=True)


def test_a_thread_of_little_stack_may_ask():
    program = (
        "import threading\n"
        "one = scene(); threading.stack_size(256 * 1024); answers = []\n"
        "asks = [one.cast_rays, one.test_occlusions, one.count_intersections, one.list_intersections]\n"
        "thread = threading.Thread(target=lambda: answers.extend(ask(RAYS[:n]) for ask in asks for n in (1, 3000)))\n"
        "thread.start(); thread.join()\n"
        "assert len(answers) == 8\n"
    )
    in_its_own_process(program)


@pytest.mark.skipif(not os.path.isdir(TASKS), reason="nobody says how many threads there are")
def test_too_many_threads_are_the_same_pool():
    program = (
        "one = scene()\n"
        "for threads in (1100, 1200, 1300): one.cast_rays(RAYS, nthreads=threads)\n"
        "assert len(os.listdir(TASKS)) < 1200, len(os.listdir(TASKS))\n"
    )
    in_its_own_process(program)


def test_pools_that_are_in_use_are_not_ended(rng):
    from concurrent.futures import ThreadPoolExecutor

    one = scene()
    rays = np.hstack([rng.random((20000, 3)), rng.normal(size=(20000, 3))])
    expected = one.count_intersections(rays)
    with ThreadPoolExecutor(8) as pool:
        for answer in pool.map(lambda i: one.count_intersections(rays, nthreads=i % 9 + 1), range(90)):
            assert np.array_equal(answer, expected)


def grid(side):
    """Corners and faces of so many rows of so many vertices."""
    x, y = (part.ravel() for part in np.meshgrid(np.arange(side), np.arange(side)))
    corners = np.stack([x, y, np.sin(x) + np.cos(y)], axis=1).astype(np.float32)
    first = (y * side + x)[(x < side - 1) & (y < side - 1)]
    halves = [first, first + 1, first + side + 1], [first, first + side + 1, first + side]
    return corners, np.concatenate([np.stack(half, axis=1) for half in halves])


def answer(child, queue):
    """What a child puts into the queue within a minute; it is small enough for the child to end before anyone takes it out."""
    child.join(60)
    hung = child.is_alive()
    child.kill()
    assert not hung, "the child waits for a thread that it has not"
    assert child.exitcode == 0
    return queue.get()


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no fork here")
def test_a_fork_while_another_thread_asks_for_its_first_distance():
    """Whatever that thread has begun, it does not end it in the child."""
    import threading

    corners, faces = grid(700)
    large = twincast.RaycastingScene()
    large.add_triangles(corners, faces)
    # The tree alone.
    large.cast_rays(RAY)
    context = multiprocessing.get_context("fork")
    queue = context.SimpleQueue()
    point = np.float32([[0, 0, 100]])
    asked = threading.Thread(target=large.compute_distance, args=(point,))
    asked.start()
    children = []
    for _ in range(8):
        time.sleep(0.004)
        children.append(context.Process(target=lambda: queue.put(large.compute_distance(point).tolist()), daemon=True))
        children[-1].start()
    asked.join()
    expected = large.compute_distance(point).tolist()
    for child in children:
        assert answer(child, queue) == expected


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no fork here")
@pytest.mark.parametrize("what", ["flat", "smooth", "file"])
def test_a_fork_renders_as_its_parent_did(what, tmp_path):
    """Meshes of so many vertices that threads share them; and a file without a camera, of which all is to be seen."""
    shown, normals = grid(200), what
    if what == "file":
        corners, faces = shown
        shown, normals = tmp_path / "grid.obj", None
        lines = ["v {} {} {}".format(*row) for row in corners] + ["f {} {} {}".format(*row) for row in faces + 1]
        shown.write_text("\n".join(lines))

    def render():
        return twincast.render(shown, size=(8, 8), normals=normals).tolist()

    expected = render()
    context = multiprocessing.get_context("fork")
    queue = context.SimpleQueue()
    child = context.Process(target=lambda: queue.put(render()), daemon=True)
    child.start()
    assert answer(child, queue) == expected


def test_a_mesh_that_comes_while_the_tree_is_built_counts_from_then_on(monkeypatch):
    one = scene()
    build = _meshes._native.Scene
    late = [np.float32([[0, 0, 0.5], [1, 0, 0.5], [0, 1, 0.5]])]

    def build_slowly(*arguments):
        # As another thread would.
        if late:
            assert one.add_triangles(late.pop(), [[0, 1, 2]]) == 1
        return build(*arguments)

    monkeypatch.setattr(_meshes, "_native", types.SimpleNamespace(Scene=build_slowly))
    assert one.cast_rays(RAY)["t_hit"].tolist() == [1]
    assert one.cast_rays(RAY)["t_hit"].tolist() == [0.5]
