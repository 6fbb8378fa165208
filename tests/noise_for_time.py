#!/usr/bin/env python3
"""Noise for time beside Mitsuba 3's: mean square error times seconds of a path-traced mesh on a floor under an area light.

Usage: tests/noise_for_time.py TWINCAST MESH.obj [--spp N] [--rounds N] [--threads N] [--keep FOLDER]

The mesh stands along z. Each round renders the scene with both, in turn, each time with another seed; with Mitsuba by its default sampler,
random numbers, and by multijitter, which spreads samples as ours are spread. The error is the variance of a pixel's mean over the rounds, which
needs no reference; that all tend to the same picture is checked beside it. The time of Twincast is that of its whole process, loading,
building and writing included; that of Mitsuba its rendering alone. Skips, with exit code 0, where Mitsuba (pip install mitsuba) is not
installed; exit code 1 where the product is above half of Mitsuba's by default, or the pictures differ.
"""

import argparse
import collections
import pathlib
import subprocess
import sys
import tempfile
import time

try:
    import drjit
    import mitsuba
    import numpy
except ImportError:
    print("skipped: Mitsuba is not installed (pip install mitsuba)")
    sys.exit(0)

mitsuba.set_variant("scalar_rgb")
from mitsuba import ScalarTransform4f as T  # noqa: E402 (the variant comes first)

SIZE = 256
DIFFUSE, FLOOR, EMISSION = [0.6, 0.55, 0.5], [0.5, 0.5, 0.5], [20, 19, 18]
DEPTH = 65
# Mitsuba's, its default first.
SAMPLERS = ["independent", "multijitter"]
# What means may differ by, relative to the brighter: many times what noise leaves of a mean over all pixels.
MEANS = 0.01


class Stage:
    """Where floor, lamp and camera stand for a mesh of these bounds, z up."""

    def __init__(self, low: numpy.ndarray, high: numpy.ndarray) -> None:
        self.middle, size = (low + high) / 2, numpy.linalg.norm(high - low)
        self.ground = float(low[2] - 1e-3 * size)
        self.floor, self.lamp, self.height = float(2 * size), float(size / 4), float(low[2] + 1.5 * size)
        self.eye = self.middle + size * numpy.array([0.9, -1.2, 0.5])

    def corners(self, half: float, z: float) -> list[list[float]]:
        x, y = map(float, self.middle[:2])
        return [[x - half, y - half, z], [x + half, y - half, z], [x + half, y + half, z], [x - half, y + half, z]]


def read_bounds(path: pathlib.Path) -> tuple[numpy.ndarray, numpy.ndarray]:
    rows = [line.split()[1:4] for line in path.read_text().splitlines() if line.startswith("v ")]
    positions = numpy.array(rows, dtype=float)
    return positions.min(axis=0), positions.max(axis=0)


def to_toml(mesh: pathlib.Path, stage: Stage) -> str:
    def quad(half: float, z: float, material: str) -> str:
        a, b, c, d = stage.corners(half, z)
        return "".join(f'[[triangle]]\ncorners = {[p, q, r]}\nmaterial = "{material}"\n' for p, q, r in [(a, b, c), (a, c, d)])

    return f"""[render]
size = [{SIZE}, {SIZE}]
integrator = "path"
headlight = false
max_depth = {DEPTH}

[[camera]]
eye = {stage.eye.tolist()}
look_at = {stage.middle.tolist()}
up = [0, 0, 1]
fov = 38

[material.clay]
diffuse = {DIFFUSE}

[material.floor]
diffuse = {FLOOR}

[material.lamp]
diffuse = 0
emission = {EMISSION}

[[file]]
path = "{mesh.resolve()}"
material = "clay"
normals = "flat"

{quad(stage.floor, stage.ground, "floor")}
{quad(stage.lamp, stage.height, "lamp")}
"""


def to_mitsuba(mesh: pathlib.Path, stage: Stage, sampler: str):
    def two_sided(color) -> dict:
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": color}}}

    def square(half: float, z: float, downwards: bool):
        placed = T().translate([*stage.middle[:2], z]).scale([half, half, 1])
        return {"type": "rectangle", "to_world": placed.rotate([1, 0, 0], 180) if downwards else placed}

    # The lamp glows downwards alone: its upper side lights nothing that is seen.
    lamp = {"emitter": {"type": "area", "radiance": {"type": "rgb", "value": EMISSION}}, "bsdf": {"type": "diffuse", "reflectance": 0.0}}
    return mitsuba.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": DEPTH},
            "sensor": {
                "type": "perspective",
                "fov": 38,
                "fov_axis": "y",
                "to_world": T().look_at(origin=stage.eye.tolist(), target=stage.middle.tolist(), up=[0, 0, 1]),
                "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}},
                "sampler": {"type": sampler},
            },
            "mesh": {"type": "obj", "filename": str(mesh), "face_normals": True, "bsdf": two_sided(DIFFUSE)},
            "floor": square(stage.floor, stage.ground, False) | {"bsdf": two_sided(FLOOR)},
            "lamp": square(stage.lamp, stage.height, True) | lamp,
        }
    )


def ours(program: str, scene: pathlib.Path, picture: pathlib.Path, spp: int, seed: int, threads: int):
    flags = ["--spp", str(spp), "--seed", str(seed), "--filter", "box", "--threads", str(threads), "-q"]
    start = time.perf_counter()
    subprocess.run([program, "render", str(scene), "-o", str(picture), *flags], check=True)
    seconds = time.perf_counter() - start
    rgb = mitsuba.Bitmap(str(picture)).convert(mitsuba.Bitmap.PixelFormat.RGB, mitsuba.Struct.Type.Float32)
    return numpy.array(rgb, dtype=float), seconds


def theirs(scene, spp: int, seed: int):
    start = time.perf_counter()
    image = numpy.array(mitsuba.render(scene, spp=spp, seed=seed), dtype=float)[:, :, :3]
    return image, time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("twincast")
    parser.add_argument("mesh", type=pathlib.Path)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--keep", type=pathlib.Path)
    arguments = parser.parse_args()
    drjit.set_thread_count(arguments.threads)
    stage = Stage(*read_bounds(arguments.mesh))
    pictures, times = collections.defaultdict(list), collections.defaultdict(list)
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        scene = folder / "scene.toml"
        scene.write_text(to_toml(arguments.mesh, stage))
        others = {sampler: to_mitsuba(arguments.mesh, stage, sampler) for sampler in SAMPLERS}
        for seed in range(arguments.rounds):
            picture = folder / f"{seed}.exr"
            rendered = {"Twincast": ours(arguments.twincast, scene, picture, arguments.spp, seed, arguments.threads)}
            rendered |= {f"Mitsuba, {sampler}": theirs(other, arguments.spp, seed) for sampler, other in others.items()}
            for name, (picture, seconds) in rendered.items():
                pictures[name].append(picture)
                times[name].append(seconds)
        if arguments.keep:
            last = pictures[f"Mitsuba, {SAMPLERS[0]}"][-1]
            mitsuba.Bitmap(last.astype(numpy.float32)).write(str(folder / "mitsuba.exr"))
    products, means = {}, {}
    for name, each in pictures.items():
        stack = numpy.array(each)
        error, seconds = float(stack.var(axis=0, ddof=1).mean()), float(numpy.median(times[name]))
        products[name], means[name] = error * seconds, float(stack.mean())
        print(f"{name:22} mean {means[name]:.5f}  error {error:.3e}  {seconds:5.2f} s  product {products[name]:.3e}")
    our_product, our_mean = products.pop("Twincast"), means.pop("Twincast")
    ratios = {name: our_product / product for name, product in products.items()}
    for name, ratio in ratios.items():
        print(f"over {name}: {ratio:.3f}, means apart by {100 * abs(our_mean / means[name] - 1):.3f} %")
    is_same = all(abs(our_mean / mean - 1) < MEANS for mean in means.values())
    sys.exit(0 if ratios[f"Mitsuba, {SAMPLERS[0]}"] <= 0.5 and is_same else 1)


if __name__ == "__main__":
    main()
