#!/usr/bin/env python3
"""Renders the pictures of embree-tools' programs on Embree and on our libembree3.so.3, and compares them. Where Blender is installed
(Debian 12's is linked to that library), its Cycles renders a scene as well, without and with motion blur.

    scripts/pictures-dropin.py [FOLDER]     where our library is (default target/dropin)

A pixel differs where a channel does by more than 8 of 255. Edges of triangles that meet, and single rays along them, fall to either
side, so a few may; more than one in 250 fails, and so does a program that does not finish.
"""

import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile
from functools import partial

MODEL = ["-c", "/usr/share/doc/embree3/models/cornell_box.ecs"]
PROGRAMS = {
    "triangle_geometry": [],
    "user_geometry": [],
    "intersection_filter": [],
    "instanced_geometry": [],
    "dynamic_scene": [],
    "multiscene_geometry": [],
    "quaternion_motion_blur": [],
    "point_geometry": [],
    "next_hit": [],
    "lazy_geometry": [],
    "viewer": MODEL,
    "pathtracer": MODEL + ["--spp", "4"],
}
MOST = 1 / 250


def run(command, folder, path):
    """The file that a command writes; none where it fails."""
    environment = dict(os.environ, LD_LIBRARY_PATH=folder or "")
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, check=False)
    if run.returncode != 0 or not os.path.exists(path):
        print(run.stderr.strip() or run.stdout.strip(), file=sys.stderr)
        return None
    with open(path, "rb") as file:
        return file.read()


def example(program, arguments, folder, scratch):
    """The picture of one of embree-tools' programs: its size and its bytes."""
    path = f"{scratch}/picture.ppm"
    data = run([program, *arguments, "--size", "320", "240", "-o", path], folder, path)
    head = re.match(rb"P6\s+(\d+)\s+(\d+)\s+255\s", data or b"")
    return head and ((int(head[1]), int(head[2])), data[head.end() :])


def cycles(way, folder, scratch):
    """The picture of Blender: its size and its bytes, from a TGA file without compression."""
    path = f"{scratch}/picture.tga"
    scene = os.path.join(os.path.dirname(__file__), "blender-scene.py")
    data = run(["blender", "-b", "--factory-startup", "--python", scene, "--", path, way], folder, path)
    return data and (struct.unpack("<2H", data[12:16]), data[18 + data[0] :])


def main():
    folder = os.path.realpath(sys.argv[1] if len(sys.argv) > 1 else "target/dropin")
    ways = {program: partial(example, program, arguments) for program, arguments in PROGRAMS.items()}
    if shutil.which("blender"):
        ways |= {f"blender, {way}": partial(cycles, way) for way in ("still", "blurred")}
    else:
        print("blender is not installed, and left out")
    is_good = True
    for name, picture in ways.items():
        with tempfile.TemporaryDirectory() as scratch:
            theirs = picture(None, scratch)
        with tempfile.TemporaryDirectory() as scratch:
            ours = picture(folder, scratch)
        if not theirs or not ours or theirs[0] != ours[0]:
            print(f"{name:24} no picture on {'our library' if theirs else 'Embree'}")
            is_good = False
            continue
        channels = list(zip(theirs[1], ours[1]))
        pixels = [channels[i : i + 3] for i in range(0, len(channels), 3)]
        differ = sum(any(abs(a - b) > 8 for a, b in pixel) for pixel in pixels)
        verdict = "" if differ <= MOST * len(pixels) else "  too many"
        print(f"{name:24} {differ:6} of {len(pixels)} pixels differ{verdict}")
        is_good &= not verdict
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
