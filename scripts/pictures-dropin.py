#!/usr/bin/env python3
"""Renders the pictures of embree-tools' programs on Embree and on our libembree3.so.3, and compares them.

    scripts/pictures-dropin.py [FOLDER]     where our library is (default target/dropin)

A pixel differs where a channel does by more than 8 of 255. Edges of triangles that meet, and single rays along them, fall to either
side, so a few may; more than one in 250 fails, and so does a program that does not finish.
"""

import os
import re
import subprocess
import sys
import tempfile

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


def render(program, arguments, folder, path):
    """The picture's size and its bytes; none where the program fails."""
    environment = dict(os.environ, LD_LIBRARY_PATH=folder or "")
    command = [program, *arguments, "--size", "320", "240", "-o", path]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, check=False)
    if run.returncode != 0 or not os.path.exists(path):
        print(run.stderr.strip() or run.stdout.strip(), file=sys.stderr)
        return None
    with open(path, "rb") as file:
        data = file.read()
    head = re.match(rb"P6\s+(\d+)\s+(\d+)\s+255\s", data)
    return (int(head[1]), int(head[2])), data[head.end() :]


def main():
    folder = os.path.realpath(sys.argv[1] if len(sys.argv) > 1 else "target/dropin")
    is_good = True
    for program, arguments in PROGRAMS.items():
        with tempfile.TemporaryDirectory() as scratch:
            theirs = render(program, arguments, None, f"{scratch}/embree.ppm")
            ours = render(program, arguments, folder, f"{scratch}/ours.ppm")
        if theirs is None or ours is None or theirs[0] != ours[0]:
            print(f"{program:24} no picture on {'Embree' if theirs is None else 'our library'}")
            is_good = False
            continue
        channels = list(zip(theirs[1], ours[1]))
        pixels = [channels[i : i + 3] for i in range(0, len(channels), 3)]
        differ = sum(any(abs(a - b) > 8 for a, b in pixel) for pixel in pixels)
        verdict = "" if differ <= MOST * len(pixels) else "  too many"
        print(f"{program:24} {differ:6} of {len(pixels)} pixels differ{verdict}")
        is_good &= not verdict
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
