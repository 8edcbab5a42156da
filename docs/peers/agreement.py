#!/usr/bin/env python3
"""Compares Fenestra's pictures with Mitsuba 3's renderings of `fenestra export`.

    python3 docs/peers/agreement.py [--fenestra target/release/fenestra]
    python3 docs/peers/agreement.py --file scene.xml [--ours FILE] [--depth 12] [--width 96]
                                    [--keep FOLDER]

The second form lets both programs render one Mitsuba file, and compares means and blocks of pixels;
Fenestra may render another form of the scene, such as the one that the Mitsuba file was exported from.

Needs a built `fenestra` and `pip install mitsuba`; prints SKIPPED and exits with 77 where Mitsuba is
missing. Exits with 1 if in a scene where the models agree means differ by more than 0.5% and four
standard errors, or more than one block in fifty does by 2%; with `--file`, if either differs by more
than `--tolerance`. `--variant llvm_ad_rgb` is several times faster than the default and needs LLVM
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

PRINCIPLED = 'type = "principled"\nbase_color = [0.8, 0.5, 0.2]\nmetallic = {}\nroughness = {}'
GREY = "constant = [0.5, 0.6, 0.8]"
DARK = "constant = [0, 0, 0]"
# A square on the floor that shows the whole image, leaning back; its mesh is written by `write_inputs`.
SQUARE = """
[[object]]
mesh = "square.obj"
material = "ball"
translate = [0.0, 0.75, 0.3]
rotate_deg = [-30.0, 20.0, 0.0]
"""
# A small square that hangs above and faces down.
LAMP = """
[[material]]
name = "lamp"
type = "diffuse"
reflectance = [0.2, 0.2, 0.2]
{}

[[object]]
mesh = "square.obj"
material = "lamp"
scale = 0.5
rotate_deg = [{}, 0.0, 0.0]
translate = [-0.6, 2.2, 0.8]
"""
# Window between the camera and the room, and one between the room and the sky.
PANE = """
[[material]]
name = "pane"
type = "thin_dielectric"
transmittance = [0.9, 1.0, 0.95]

[[object]]
mesh = "square.obj"
material = "pane"
scale = 1.5
"""


def principled(metallic, roughness):
    return PRINCIPLED.format(metallic, roughness)


def dielectric(alpha):
    return f'type = "dielectric"\nalpha = {alpha}\nior = 1.5\ntransmittance = [0.9, 0.95, 1.0]'


def textured(keys, image="colours.png"):
    return 'type = "diffuse"\nreflectance = { texture = "' + image + '"' + keys + ' }'


def shows(material, environment=SOFT):
    """Scene whose ball is replaced by a textured square."""
    return scene(environment, material).replace(BALL, SQUARE)


def lit(keys, turn, environment=DARK):
    """Scene under a square lamp with more keys; 90 degrees turn its front down."""
    return scene(environment, DIFFUSE) + LAMP.format(keys, turn)


def with_lamp(keys):
    return scene(DARK, DIFFUSE) + "\n[[lamp]]\n" + keys


POSITION = "position = [-1.0, 2.5, 1.5]"
SPOT = (f'type = "spot"\n{POSITION}\ndirection = [1.0, -2.0, -1.5]\nintensity = [20, 18, 15]\n'
        "inner_angle_deg = 10.0\nouter_angle_deg = 30.0\n")
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
    ("principled dielectric, roughness 0.2", scene(SOFT, principled(0.0, 0.2)), 1, False),
    ("principled dielectric, roughness 0.6", scene(SOFT, principled(0.0, 0.6)), 1, False),
    ("principled metal, roughness 0.2", scene(SOFT, principled(1.0, 0.2)), 1, True),
    ("principled metal, roughness 0.6", scene(SOFT, principled(1.0, 0.6)), 1, False),
    ("principled, half metal", scene(SOFT, principled(0.5, 0.3)), 1, False),
    ("mirror", scene(GREY, 'type = "mirror"\nreflectance = [0.9, 0.7, 0.5]'), 4, True),
    ("smooth glass", scene(GREY, dielectric(0.0)), 12, True),
    ("rough glass, α 0.05", scene(GREY, dielectric(0.05)), 12, True),
    ("rough glass, α 0.3", scene(GREY, dielectric(0.3)), 12, False),
    ("pane before the room", scene(GREY, DIFFUSE) + PANE + "translate = [0.9, 1.2, 2.5]\n", 12, True),
    ("pane as a window", scene(DARK, DIFFUSE) + LAMP.format("emission = [9, 8, 7]", 90.0) + PANE
     + "rotate_deg = [90.0, 0.0, 0.0]\ntranslate = [0.0, 1.6, 0.5]\n", 12, True),
    ("texture, sRGB", shows(textured("")), 1, True),
    ("texture, linear", shows(textured(", linear = true")), 1, True),
    ("texture, factor", shows(textured(", factor = [0.5, 0.75, 1.0]")), 1, True),
    ("texture, repeat", shows(textured(", scale = [3.0, 2.0], offset = [0.1, 0.2]")), 1, True),
    ("texture, turned", shows(textured(", scale = 2.0, rotate_deg = 30.0, wrap = \"repeat\"")), 1, True),
    ("texture, mirror", shows(textured(", scale = 3.0, wrap = \"mirror\"")), 1, True),
    ("texture, clamp", shows(textured(", scale = 2.0, offset = [0.3, 0.2], wrap = \"clamp\"")), 1, True),
    ("texture, nearest", shows(textured(", interpolation = \"nearest\"")), 1, True),
    ("texture, red channel", shows(textured(", channel = \"r\"")), 1, True),
    ("metal, roughness texture", shows(PRINCIPLED.format(
        1.0, '{ texture = "colours.png", channel = "g", factor = 0.3 }')), 1, True),
    ("normal map", shows(DIFFUSE + '\nnormal = { texture = "bumps.png" }'), 1, True),
    ("normal map, strength 2", shows(
        DIFFUSE + '\nnormal = { texture = "bumps.png", strength = 2.0 }'), 1, True),
    ("opacity, blend", shows(DIFFUSE + '\nopacity = { texture = "colours.png", channel = "g" }'), 12,
     True),
    ("opacity, factor", shows(DIFFUSE + "\nopacity = 0.4"), 12, True),
    ("opacity, cutoff", shows(DIFFUSE + '\nopacity = { texture = "colours.png", channel = "g" }\n'
                              "opacity_cutoff = 0.5"), 12, True),
    ("one-sided", shows(DIFFUSE + "\ntwo_sided = false").replace("20.0, 0.0]\n", "200.0, 0.0]\n"), 1,
     True),
    ("emission texture, seen", shows(DIFFUSE + '\nemission = { texture = "colours.png", '
                                     "factor = [3.0, 2.0, 1.0] }", GREY), 2, True),
    ("area lamp, one-sided", lit("emission = [20, 18, 15]", 90.0), 2, True),
    ("area lamp, upright", lit("emission = [20, 18, 15]", 0.0), 2, True),
    ("area lamp, two-sided", lit("emission = [20, 18, 15]\nemission_two_sided = true", -60.0), 2, True),
    ("area lamp, textured", lit('emission = { texture = "colours.png", factor = [40, 40, 40] }', 90.0),
     2, True),
    ("point lamp", with_lamp(f'type = "point"\n{POSITION}\nintensity = [8, 7, 6]\n'), 2, True),
    ("spot lamp, linear", with_lamp(SPOT + 'falloff = "linear_angle"\n'), 2, True),
    ("spot lamp, squared cosine", with_lamp(SPOT + 'falloff = "squared_cosine"\n'), 2, False),
    ("directional lamp", with_lamp('type = "directional"\ndirection = [0.5, -1.0, -0.4]\n'
                                   "irradiance = [3, 2.5, 2]\n"), 2, True),
]


def write_inputs(folder):
    """Writes the images and the mesh that scenes name."""
    import mitsuba as mi
    import numpy as np

    write_texel_map(folder / "texel.pfm")
    random = np.random.default_rng(7)
    texels = random.integers(0, 256, (6, 8, 3), np.uint8)
    mi.Bitmap(texels).write(str(folder / "colours.png"))
    # Slopes of waves, three along one side and two along the other, in a frame whose y points up.
    y, x = (np.mgrid[:32, :32] + 0.5) / 32 * 2 * np.pi
    slopes = np.stack([-0.5 * np.cos(3 * x), 0.3 * np.cos(2 * y), np.ones_like(x)], axis=-1)
    normals = slopes / np.linalg.norm(slopes, axis=-1, keepdims=True)
    mi.Bitmap(np.round(127.5 + 127.5 * normals).astype(np.uint8)).write(str(folder / "bumps.png"))
    (folder / "square.obj").write_text(
        "v -0.8 -0.8 0\nv 0.8 -0.8 0\nv 0.8 0.8 0\nv -0.8 0.8 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        "vn 0 0 1\nf 1/1/1 2/2/1 3/3/1 4/4/1\n")


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
    """Renders a scene with both and returns the ratio of means, its error, two extremes of
    blocks, and true if more than one block in fifty differs by 2% and four standard errors."""
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
    pairs = [block_means(pictures).mean(axis=0) for pictures in (ours, theirs)]
    # Leave out dark blocks.
    lit = pairs[1] > 0.01 * pairs[1].mean()
    ratios = pairs[0][lit] / pairs[1][lit]
    far, _ = far_blocks(np, ours, theirs, 0.02)
    return (ratio, float(np.hypot(error(ours), error(theirs))), ratios.min(), ratios.max(),
            far.mean() > 0.02)


def block_means(pictures):
    """Means of blocks of pixels; what is left over at the right and lower edges is left out."""
    seeds, height, width, _ = pictures.shape
    rows, columns = height // BLOCK, width // BLOCK
    cut = pictures[:, :rows * BLOCK, :columns * BLOCK].mean(axis=3)
    return cut.reshape(seeds, rows, BLOCK, columns, BLOCK).mean(axis=(2, 4))


def far_blocks(np, ours, theirs, tolerance):
    """Tells the blocks that differ by more than `tolerance` and four standard errors, and z."""
    blocks = [block_means(pictures) for pictures in (ours, theirs)]
    difference = blocks[0].mean(axis=0) - blocks[1].mean(axis=0)
    # Pool the relative variance of all blocks: few seeds say little about one block.
    level = 0.5 * (blocks[0].mean(axis=0) + blocks[1].mean(axis=0))
    floor = 0.01 * level.mean()
    relative = [block.var(axis=0, ddof=1) / (level + floor) ** 2 for block in blocks]
    deviation = np.sqrt(sum(np.maximum(one, np.median(one)) for one in relative) / len(ours))
    score = difference / (deviation * (level + floor) + 1e-12)
    far = (np.abs(score) > 4) & (np.abs(difference) > tolerance * (level + floor))
    return far, score


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
        own = (arguments.ours or path).resolve()
        ours.append(render_ours(mi, np, arguments.fenestra, own, folder / f"{seed}.exr", options))
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
    far, score = far_blocks(np, ours, theirs, arguments.tolerance)
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
    parser.add_argument("--only", default="", help="regular expression for the names of scenes")
    parser.add_argument("--file", type=pathlib.Path, help="Mitsuba file to render with both")
    parser.add_argument("--ours", type=pathlib.Path, help="file for Fenestra, with --file")
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
    head = [
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
        write_inputs(folder)
        print("\n".join(head))
        for case in SCENES:
            if not re.search(arguments.only, case[0]):
                continue
            ratio, error, low, high, is_far = compare(mi, np, arguments.fenestra, folder, case,
                                              arguments.samples)
            same = case[3]
            failed = same and (abs(ratio - 1) > max(TOLERANCE, 4 * error) or is_far)
            failures += failed
            print(f"| {case[0]} | {'yes' if same else 'no'} | {ratio:.4f} | {error:.4f} | "
                  f"{low:.3f} to {high:.3f} |" + (" FAILED" if failed else ""), flush=True)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
