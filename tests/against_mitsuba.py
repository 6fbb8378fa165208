#!/usr/bin/env python3
"""Compares path-traced pictures with Mitsuba 3's, on scenes that both can say.

Usage: tests/against_mitsuba.py TWINCAST [--spp N] [--keep FOLDER]

Skips, with exit code 0, where Mitsuba (pip install mitsuba) is not installed. Exit code 1 where the relative mean square
error, the mean over pixels of (a - b)^2 / (b^2 + 0.01), is 0.5 % or more for a scene. Mitsuba renders with twice
the samples.
"""

import argparse
import pathlib
import subprocess
import sys
import tempfile
import time

try:
    import mitsuba
    import numpy
except ImportError:
    print("skipped: Mitsuba is not installed (pip install mitsuba)")
    sys.exit(0)

mitsuba.set_variant("scalar_rgb")
from mitsuba import ScalarTransform4f as T  # noqa: E402 (the variant comes first)

SIZE = 96
LIMIT = 0.005
EYE, TARGET, FOV = [0, 2.2, 6.5], [0, 0.9, 0], 38

HEAD = f"""[render]
size = [{SIZE}, {SIZE}]
integrator = "path"
headlight = false
{{render}}

[[camera]]
eye = {EYE}
look_at = {TARGET}
fov = {FOV}

[material.floor]
diffuse = [0.6, 0.5, 0.4]

[[triangle]]
corners = [[-6, 0, 6], [6, 0, 6], [6, 0, -6]]
material = "floor"

[[triangle]]
corners = [[-6, 0, 6], [6, 0, -6], [-6, 0, -6]]
material = "floor"
"""

PANEL = """
[material.lamp]
diffuse = 0
emission = [12, 11, 10]

[[triangle]]
corners = [[-1, 4, -1], [1, 4, -1], [1, 4, 1]]
material = "lamp"

[[triangle]]
corners = [[-1, 4, -1], [1, 4, 1], [-1, 4, 1]]
material = "lamp"
"""

BALL = """
[material.ball]
{material}

[[sphere]]
centre = [0, 1, 0]
radius = 1
material = "ball"
"""

# Material here, BSDF there.
MATERIALS = {
    "diffuse": ("diffuse = [0.2, 0.4, 0.7]", {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.2, 0.4, 0.7]}}),
    "mirror": (
        "diffuse = 0\nreflection = [0.9, 0.8, 0.7]",
        {"type": "conductor", "material": "none", "specular_reflectance": {"type": "rgb", "value": [0.9, 0.8, 0.7]}},
    ),
    "glass": ('type = "glass"\nior = 1.5', {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0}),
    "pane": ('type = "glass"\nthin = true\nior = 1.5', {"type": "thindielectric", "int_ior": 1.5, "ext_ior": 1.0}),
}


def panel():
    """The lamp: two-sided, as every surface that glows is here."""
    light = {"type": "area", "radiance": {"type": "rgb", "value": [12, 11, 10]}}
    black = {"type": "diffuse", "reflectance": 0.0}
    down = T().translate([0, 4, 0]).rotate([1, 0, 0], 90)
    up = T().translate([0, 4.0001, 0]).rotate([1, 0, 0], -90)
    return {
        "down": {"type": "rectangle", "to_world": down, "emitter": light, "bsdf": black},
        "up": {"type": "rectangle", "to_world": up, "emitter": dict(light), "bsdf": dict(black)},
    }


def theirs(bsdf, light, spp):
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 65},
        "sensor": {
            "type": "perspective",
            "fov": FOV,
            "fov_axis": "y",
            "to_world": T().look_at(origin=EYE, target=TARGET, up=[0, 1, 0]),
            "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": spp},
        },
        "floor": {
            "type": "rectangle",
            "to_world": T().rotate([1, 0, 0], -90).scale(6),
            "bsdf": {
                "type": "twosided",
                "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.6, 0.5, 0.4]}},
            },
        },
        "ball": {"type": "sphere", "center": [0, 1, 0], "radius": 1, "bsdf": bsdf},
        **light,
    }
    start = time.time()
    image = numpy.array(mitsuba.render(mitsuba.load_dict(scene)))[:, :, :3]
    return image, time.time() - start


def ours(program, text, spp, folder, name):
    path = folder / f"{name}.toml"
    path.write_text(text)
    picture = folder / f"{name}.exr"
    start = time.time()
    flags = ["--spp", str(spp), "--filter", "box", "-q"]
    subprocess.run([program, "render", str(path), "-o", str(picture), *flags], check=True)
    seconds = time.time() - start
    return numpy.array(mitsuba.Bitmap(str(picture)).convert(mitsuba.Bitmap.PixelFormat.RGB, mitsuba.Struct.Type.Float32)), seconds


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("twincast")
    parser.add_argument("--spp", type=int, default=1024)
    parser.add_argument("--keep", type=pathlib.Path)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        # Large, for the two place pixels differently by up to half of one.
        sky = numpy.zeros((512, 1024, 3), dtype=numpy.float32)
        sky[:256] = [0.3, 0.5, 0.9]
        sky[256:] = [0.2, 0.15, 0.1]
        sky[96:144, 320:384] = 40
        mitsuba.Bitmap(sky).write(str(folder / "sky.exr"))
        # The middle of its picture is +z.
        turned = T().rotate([0, 1, 0], 180)
        environment = {"around": {"type": "envmap", "filename": str(folder / "sky.exr"), "to_world": turned}}
        failed = False
        for name, (material, bsdf) in MATERIALS.items():
            for light, text, there in [("panel", PANEL, panel()), ("sky", '\n[environment]\nimage = "sky.exr"\n', environment)]:
                if arguments.only not in f"{name}-{light}":
                    continue
                text = HEAD.format(render="") + text + BALL.format(material=material)
                mine, my_seconds = ours(arguments.twincast, text, arguments.spp, folder, f"{name}-{light}")
                other, seconds = theirs(bsdf, there, 2 * arguments.spp)
                if arguments.keep:
                    mitsuba.Bitmap(other).write(str(folder / f"{name}-{light}-mitsuba.exr"))
                error = float(numpy.mean((mine - other) ** 2 / (other**2 + 0.01)))
                bias = float(mine.mean() / other.mean() - 1)
                verdict = "ok" if error < LIMIT else "DIFFERS"
                failed |= error >= LIMIT
                print(
                    f"{name:8} {light:6} relMSE {100 * error:.4f} %, mean {100 * bias:+.3f} %,"
                    f" {my_seconds:.1f} s here, {seconds:.1f} s there: {verdict}",
                    flush=True,
                )
        sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
