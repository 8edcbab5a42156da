#!/usr/bin/env python3
"""Compares Fenestra's pictures with Mitsuba 3's renderings of `fenestra export`.

    python3 docs/peers/agreement.py [--fenestra target/release/fenestra] [--table]
    python3 docs/peers/agreement.py --file scene.xml [--depth 12] [--width 96] [--keep FOLDER]

The second form lets both programs render one Mitsuba file, and compares means and blocks of pixels.

Needs a built `fenestra` and `pip install mitsuba`; prints SKIPPED and exits with 77 where Mitsuba is
missing. Exits with 1 if means differ by more than 0.5% and four standard errors in a scene where the
models agree, and with `--file` if means differ by more than `--tolerance` and four standard errors or
if more than one block in fifty does. `--variant llvm_ad_rgb` is several times faster than the default and needs LLVM
(DRJIT_LIBLLVM_PATH names the library).
"""

import argparse
import datetime
import os
import pathlib
import re
import subprocess
import sys
import tempfile

SEEDS = 4
TOLERANCE = 0.005
SIZE = (64, 48)
BLOCK = 8

SKY = "sky = { width = 256, sun_radius_deg = 4.0, sun_radiance = [400, 370, 310] }\nrotation_deg = 25.0"
# Broad sun, so that highlights do not drown differences in noise.
SOFT = SKY.replace("4.0", "15.0").replace("[400, 370, 310]", "[30, 27, 23]")
WALLS = """
[[material]]
name = "walls"
type = "diffuse"
reflectance = [0.7, 0.5, 0.3]

[[object]]
shape = "box"
size = [6.0, 0.2, 6.0]
material = "walls"
translate = [0.0, -0.1, 0.0]

[[object]]
shape = "box"
size = [6.0, 2.0, 0.2]
material = "walls"
translate = [0.0, 1.0, -1.5]
"""
BALL = """
[[object]]
shape = "sphere"
radius = 0.7
segments = 256
material = "ball"
translate = [0.0, 0.7, 0.0]
"""


def scene(environment, ball, camera=""):
    """Scene text: floor, wall and a ball of a material with the keys `ball`."""
    width, height = SIZE
    camera = camera or "position = [1.5, 1.6, 4.0]\nlook_at = [0.0, 0.6, 0.0]\nvertical_fov_deg = 40.0"
    return f"""[camera]
{camera}

[film]
width = {width}
height = {height}
filter = "box"

[environment]
{environment}

[[material]]
name = "ball"
{ball}
{WALLS}{BALL}"""


def conductor(alpha):
    return f'type = "conductor"\nalpha = {alpha}\neta = [0.2, 0.92, 1.1]\nk = [3.9, 2.45, 2.14]'


def schlick(alpha):
    return f'type = "conductor"\nalpha = {alpha}\nreflectance = [0.95, 0.64, 0.54]'


def plastic(alpha):
    return f'type = "plastic"\nalpha = {alpha}\ndiffuse = [0.6, 0.3, 0.1]\nior = 1.5'


DIFFUSE = 'type = "diffuse"\nreflectance = [0.5, 0.5, 0.8]'
TEXEL = 'map = "texel.pfm"\nrotation_deg = 50.0'
LENS = ("position = [1.5, 1.6, 4.0]\nlook_at = [0.0, 0.6, 0.0]\nvertical_fov_deg = 40.0\n"
        "aperture_radius = 0.1\nfocus_distance = 3.0")
SIDEWAYS = "position = [1.5, 1.6, 4.0]\nlook_at = [2.0, 2.2, 1.0]\nup = [0.2, 1, 0]\nvertical_fov_deg = 75.0"

# Name, text, depth, true where the models are the same.
SCENES = [
    ("diffuse, direct", scene(SKY, DIFFUSE), 1, True),
    ("diffuse, depth 4", scene(SKY, DIFFUSE), 4, True),
    ("diffuse, thin lens", scene(SKY, DIFFUSE, LENS), 2, True),
    ("one bright texel, shadows", scene(TEXEL, DIFFUSE), 1, True),
    ("one bright texel, seen", scene(TEXEL, DIFFUSE, SIDEWAYS), 1, True),
    ("conductor, α 0.05", scene(SOFT, conductor(0.05)), 1, True),
    ("conductor, α 0.3", scene(SOFT, conductor(0.3)), 1, False),
    ("Schlick conductor, α 0.05", scene(SOFT, schlick(0.05)), 1, True),
    ("Schlick conductor, α 0.3", scene(SOFT, schlick(0.3)), 1, False),
    ("plastic, α 0.05", scene(SOFT, plastic(0.05)), 1, False),
    ("plastic, α 0.3", scene(SOFT, plastic(0.3)), 1, False),
]


def write_texel_map(path):
    """A dark map of 16×8 texels with one bright one, above the horizon and off the middle."""
    import numpy as np

    texels = np.full((8, 16, 3), 0.2, np.float32)
    texels[2, 10] = (40.0, 30.0, 20.0)
    with open(path, "wb") as file:
        file.write(b"PF\n16 8\n-1.0\n")
        file.write(texels[::-1].astype("<f4").tobytes())


def render_ours(mi, np, fenestra, path, output, options):
    """Renders with Fenestra and returns the pixels."""
    subprocess.run([fenestra, "render", path, "-o", output, "--quiet", *map(str, options)], check=True)
    channels = mi.Bitmap(str(output)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32,
                                              False)
    return np.array(channels, np.float64)


def compare(mi, np, fenestra, folder, case, samples):
    """Renders a scene with both and returns name, ratio of means, its error and two extremes."""
    name, text, depth, _ = case
    path = folder / "scene.toml"
    path.write_text(text)
    subprocess.run([fenestra, "export", path, folder / "mitsuba.xml", "--format", "mitsuba",
                    "--depth", str(depth)], check=True, stdout=subprocess.DEVNULL,
                   env={**os.environ, "RUST_LOG": "error"})
    ours, theirs = [], []
    peer = mi.load_file(str(folder / "mitsuba.xml"))
    for seed in range(SEEDS):
        options = ["--depth", depth, "--seed", seed, "--spp", samples]
        ours.append(render_ours(mi, np, fenestra, path, folder / f"{seed}.exr", options))
        image = mi.render(peer, seed=seed, spp=4 * samples)
        theirs.append(np.array(image, np.float64)[..., :3])
    ours, theirs = np.array(ours), np.array(theirs)
    mean = lambda images: images.mean(axis=(1, 2, 3))
    error = lambda images: mean(images).std(ddof=1) / mean(images).mean() / SEEDS**0.5
    ratio = mean(ours).mean() / mean(theirs).mean()
    width, height = SIZE
    blocks = lambda images: images.mean(axis=(0, 3)).reshape(
        height // BLOCK, BLOCK, width // BLOCK, BLOCK).mean(axis=(1, 3))
    ratios = blocks(ours) / blocks(theirs)
    return ratio, float(np.hypot(error(ours), error(theirs))), ratios.min(), ratios.max()


def block_means(pictures):
    """Means of blocks of pixels; what is left over at the right and lower edges is left out."""
    seeds, height, width, _ = pictures.shape
    rows, columns = height // BLOCK, width // BLOCK
    cut = pictures[:, :rows * BLOCK, :columns * BLOCK].mean(axis=3)
    return cut.reshape(seeds, rows, BLOCK, columns, BLOCK).mean(axis=(2, 4))


def compare_file(mi, np, arguments, folder):
    """Renders one Mitsuba file with both, prints the comparison, and returns 1 if they differ."""
    path = arguments.file.resolve()
    try:
        peer = mi.load_file(str(path))
    except RuntimeError as error:
        print(f"SKIPPED: Mitsuba refuses {path}: {error}", file=sys.stderr)
        return 77
    parameters = mi.traverse(peer.sensors()[0])
    width, height = parameters["film.size"]
    size = (arguments.width, max(1, round(arguments.width * height / width)))
    parameters["film.size"] = size
    parameters.update()
    # Mitsuba counts the edges of a path, the one to the light included.
    integrator = mi.load_dict({"type": "path", "max_depth": arguments.depth + 1})
    seeds = max(arguments.seeds, 2)
    ours, theirs = [], []
    for seed in range(seeds):
        options = ["--depth", arguments.depth, "--seed", seed, "--spp", arguments.samples, "--size",
                   f"{size[0]}x{size[1]}"]
        ours.append(render_ours(mi, np, arguments.fenestra, path, folder / f"{seed}.exr", options))
        image = mi.render(peer, integrator=integrator, seed=seed, spp=4 * arguments.samples)
        theirs.append(np.array(image, np.float64)[..., :3])
    ours, theirs = np.array(ours), np.array(theirs)
    if arguments.keep:
        arguments.keep.mkdir(parents=True, exist_ok=True)
        for name, pictures in [("fenestra", ours), ("mitsuba", theirs)]:
            mean = pictures.mean(axis=0).astype(np.float32)
            mi.Bitmap(mean).write(str(arguments.keep / f"{path.stem}_{name}.exr"))
    mean = lambda pictures: pictures.mean(axis=(1, 2, 3))
    error = lambda pictures: mean(pictures).std(ddof=1) / mean(pictures).mean() / seeds**0.5
    ratio = mean(ours).mean() / mean(theirs).mean()
    ratio_error = float(np.hypot(error(ours), error(theirs)))
    blocks = [block_means(pictures) for pictures in (ours, theirs)]
    difference = blocks[0].mean(axis=0) - blocks[1].mean(axis=0)
    # Pool the relative variance of all blocks: few seeds say little about one block.
    level = 0.5 * (blocks[0].mean(axis=0) + blocks[1].mean(axis=0))
    floor = 0.01 * level.mean()
    relative = [block.var(axis=0, ddof=1) / (level + floor) ** 2 for block in blocks]
    deviation = np.sqrt(sum(np.maximum(one, np.median(one)) for one in relative) / seeds)
    score = difference / (deviation * (level + floor) + 1e-12)
    far = (np.abs(score) > 4) & (np.abs(difference) > arguments.tolerance * (level + floor))
    share = far.mean()
    failed = abs(ratio - 1) > max(arguments.tolerance, 4 * ratio_error) or share > 0.02
    print(f"{path}: {size[0]}×{size[1]} pixels, depth {arguments.depth}, {seeds} seeds of "
          f"{arguments.samples} and {4 * arguments.samples} samples\n"
          f"ratio of means {ratio:.4f} ± {ratio_error:.4f}\n"
          f"blocks of {BLOCK}×{BLOCK} pixels: {far.sum()} of {far.size} differ by more than four "
          f"standard errors and {arguments.tolerance:.0%}; largest z {np.abs(score).max():.1f}"
          + ("\nFAILED" if failed else ""))
    return 1 if failed else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    root = pathlib.Path(__file__).resolve().parents[2]
    parser.add_argument("--fenestra", default=root / "target/release/fenestra", type=pathlib.Path)
    parser.add_argument("--variant", default="scalar_rgb")
    parser.add_argument("--samples", default=128, type=int, help="Fenestra's; Mitsuba takes 4 times as many")
    parser.add_argument("--table", action="store_true", help="write the table into docs/peers.md")
    parser.add_argument("--file", type=pathlib.Path, help="Mitsuba file to render with both")
    parser.add_argument("--depth", default=12, type=int, help="path vertices, with --file")
    parser.add_argument("--width", default=96, type=int, help="width of the film, with --file")
    parser.add_argument("--seeds", default=SEEDS, type=int, help="renders of each, with --file")
    parser.add_argument("--tolerance", default=0.02, type=float, help="of means and blocks, with --file")
    parser.add_argument("--keep", type=pathlib.Path, help="folder for both pictures, with --file")
    arguments = parser.parse_args()
    try:
        import mitsuba as mi
        import numpy as np
    except ImportError as error:
        print(f"SKIPPED: {error}; nothing was compared. Install it with `pip install mitsuba`.",
              file=sys.stderr)
        return 77
    if not arguments.fenestra.is_file():
        sys.exit(f"{arguments.fenestra}: not found; build it with `cargo build --release`")
    mi.set_variant(arguments.variant)
    if arguments.file:
        with tempfile.TemporaryDirectory() as name:
            return compare_file(mi, np, arguments, pathlib.Path(name))
    version = subprocess.run([arguments.fenestra, "--version"], capture_output=True, text=True).stdout
    lines = [
        f"{datetime.date.today()}, {version.strip()}, Mitsuba {mi.__version__} ({arguments.variant}), "
        f"{SIZE[0]}×{SIZE[1]} pixels, {SEEDS} seeds of {arguments.samples} and "
        f"{4 * arguments.samples} samples per pixel.",
        "",
        f"| scene | same model | ratio of means | standard error | blocks of {BLOCK}×{BLOCK} |",
        "|---|---|---|---|---|",
    ]
    failures = 0
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        write_texel_map(folder / "texel.pfm")
        print("\n".join(lines))
        for case in SCENES:
            ratio, error, low, high = compare(mi, np, arguments.fenestra, folder, case,
                                              arguments.samples)
            same = case[3]
            failed = same and abs(ratio - 1) > max(TOLERANCE, 4 * error)
            failures += failed
            lines.append(f"| {case[0]} | {'yes' if same else 'no'} | {ratio:.4f} | {error:.4f} | "
                         f"{low:.3f} to {high:.3f} |")
            print(lines[-1] + (" FAILED" if failed else ""), flush=True)
    if arguments.table:
        page = root / "docs/peers.md"
        block = "<!-- agreement -->\n" + "\n".join(lines) + "\n<!-- end of agreement -->"
        text = page.read_text()
        page.write_text(re.sub(r"<!-- agreement -->.*?<!-- end of agreement -->", lambda _: block,
                               text, flags=re.S))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
