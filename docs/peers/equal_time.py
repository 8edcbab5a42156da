#!/usr/bin/env python3
"""Compares the error of Fenestra's and Mitsuba 3's pictures after the same time.

    python3 docs/peers/equal_time.py scenes/*.toml [--seconds 60] [--seeds 3] [--depth 6]
        [--size 320x240] [--fenestra target/release/fenestra] [--variant llvm_ad_rgb] [--call 16]

Exports every scene by `fenestra export --format mitsuba` and lets both programs render it in turns, with
several seeds: Fenestra with its defaults, Mitsuba by `path` with the same number of vertices, its own
roulette, and the better of its samplers `independent` and `multijitter` (a trial of a tenth of the time
decides). Fenestra's time holds training and choices, but neither loading nor compiling; Mitsuba's
neither loading nor the compilation of its kernel.

Both are unbiased for their own models, so the error is the variance between seeds: its mean over the
pixels, each relative to the squared mean of that program's pictures plus a hundredth of the mean of all
of these squares. No reference is needed, and no program is judged by the other's. `trimmed` leaves out the
worst thousandth of the pixels. The ratio of the means tells how far the models agree.

Needs `pip install mitsuba` and, for llvm_ad_rgb, LLVM (DRJIT_LIBLLVM_PATH names the library); prints
SKIPPED and exits with 77 without.
"""

import argparse
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import time

def fenestra(binary, scene, arguments, seed, folder):
    """Returns picture and samples per pixel of a render."""
    image, statistics = folder / "fenestra.exr", folder / "fenestra.json"
    subprocess.run(
        [binary, "render", scene, "--time", f"{arguments.seconds}s", "--seed", str(seed), "--size",
         arguments.size, "--depth", str(arguments.depth), "--quiet", "-o", image, "--stats",
         statistics],
        check=True, stderr=subprocess.DEVNULL)
    return image, json.loads(statistics.read_text())["samples_per_pixel"]


class Mitsuba:
    """A scene in Mitsuba, warm."""

    def __init__(self, mi, numpy, path, arguments):
        self.mi, self.numpy = mi, numpy
        width, height = arguments.size.split("x")
        text = path.read_text()
        for sampler in ["independent", "multijitter"]:
            for name, value in [("width", width), ("height", height)]:
                text = re.sub(rf'name="{name}" value="\d+"', f'name="{name}" value="{value}"', text)
            copy = path.with_name(f"{sampler}.xml")
            copy.write_text(text.replace('<sampler type="independent"', f'<sampler type="{sampler}"'))
        self.scenes = {}
        for sampler in ["independent", "multijitter"]:
            scene = mi.load_file(str(path.with_name(f"{sampler}.xml")))
            film = scene.sensors()[0].film()
            assert tuple(film.size()) == (int(width), int(height)), film.size()
            self.scenes[sampler] = scene
        self.spp = arguments.call
        self.sampler = "independent"
        self.path = mi.load_dict({"type": "path", "max_depth": arguments.depth + 1})
        for sampler in self.scenes:
            self.call(sampler, 0)
        # The better sampler, by variance between calls of the same length.
        trials = {}
        for sampler in self.scenes:
            begun, pictures = time.perf_counter(), []
            while len(pictures) < 4 or time.perf_counter() - begun < 0.05 * arguments.seconds:
                pictures.append(self.call(sampler, 1 + len(pictures)))
            seconds = (time.perf_counter() - begun) / len(pictures)
            trials[sampler] = seconds * relative_variance(numpy, pictures)[1]
        self.sampler = min(trials, key=trials.get)

    def call(self, sampler, seed):
        """Returns the picture of one call."""
        return self.numpy.array(
            self.mi.render(self.scenes[sampler], integrator=self.path, seed=seed, spp=self.spp))

    def render(self, seconds, seed):
        """Returns the mean of as many calls as fit into the time, and their samples per pixel."""
        begun, total, count = time.perf_counter(), 0.0, 0
        while True:
            total = total + self.call(self.sampler, 100_000 * seed + count).astype(float)
            count += 1
            spent = time.perf_counter() - begun
            if spent * (count + 1) / count > seconds:
                return total / count, count * self.spp


def relative_variance(numpy, pictures):
    """Returns mean and trimmed mean of the pixels' variance relative to their squared mean."""
    stack = numpy.stack([picture[..., :3] for picture in pictures]).astype(float)
    variance = stack.var(axis=0, ddof=1).mean(axis=-1)
    squares = stack.mean(axis=0).mean(axis=-1) ** 2
    relative = numpy.sort((variance / (squares + 0.01 * squares.mean())).ravel())
    return relative.mean(), relative[: int(0.999 * len(relative))].mean()


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scenes", nargs="+", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--depth", type=int, default=6)
    parser.add_argument("--size", default="320x240")
    parser.add_argument("--fenestra", default="target/release/fenestra")
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--call", type=int, default=16, help="samples per pixel of a call of Mitsuba")
    arguments = parser.parse_args()
    try:
        import mitsuba as mi
        import numpy
        mi.set_variant(arguments.variant)
    except ImportError as error:
        print(f"SKIPPED: {error}")
        sys.exit(77)

    def read(image):
        return numpy.array(mi.Bitmap(str(image)).convert(
            mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))

    print(f"Mitsuba {mi.__version__} ({arguments.variant}), {arguments.size}, depth "
          f"{arguments.depth}, {arguments.seconds:g} s, {arguments.seeds} seeds", flush=True)
    for scene in arguments.scenes:
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            exported = subprocess.run(
                [arguments.fenestra, "export", scene, folder / "scene.xml", "--format", "mitsuba",
                 "--depth", str(arguments.depth)],
                capture_output=True, text=True)
            if exported.returncode != 0:
                sys.exit(exported.stderr)
            peer = Mitsuba(mi, numpy, folder / "scene.xml", arguments)
            ours, theirs = [], []
            for seed in range(1, arguments.seeds + 1):
                image, our_samples = fenestra(arguments.fenestra, scene, arguments, seed, folder)
                ours.append(read(image))
                picture, their_samples = peer.render(arguments.seconds, seed)
                theirs.append(picture)
            a, b = relative_variance(numpy, ours), relative_variance(numpy, theirs)
            mean = numpy.mean(ours) / numpy.mean([picture[..., :3] for picture in theirs])
            print(f"{scene.stem}: fenestra over mitsuba {a[0] / b[0]:.3f}, trimmed {a[1] / b[1]:.3f}; "
                  f"relMSE {a[0]:.5f} and {b[0]:.5f}, trimmed {a[1]:.5f} and {b[1]:.5f}; samples "
                  f"{our_samples} and {their_samples} ({peer.sampler}); means {mean:.3f}", flush=True)


if __name__ == "__main__":
    main()
