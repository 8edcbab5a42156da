#!/usr/bin/env python3
"""Maps where the visibility cache pays: error and time of `visibility` against `product`.

    python3 docs/peers/cache_regimes.py FOLDER [--fenestra target/release/fenestra] [--seeds 4]

Makes five scenes from open to closed out of those in scenes/studies, under a sky with and without a sun,
and compares the samplers in each with `fenestra study` at 512 shadow rays a pixel, 5 to 256 of them at
a hit. An interrupted run continues. Prints a table and writes FOLDER/cache_regimes.json and .svg.

Three samplers tell the cache's effect from that of its random numbers, which cannot be stratified over the
rays of one hit: `product`, `visibility:k=0`, which draws as `visibility` does but learns nothing, and
`visibility`. Errors are those of lit surfaces, ratios geometric means over pairs of the same seed with 95%
bounds.
"""

import argparse
import json
import math
import pathlib
import re
import statistics
import subprocess

RAYS_OF_PIXEL = 512
ENVIRONMENTS = {
    "smooth": "sky = { width = 256, sun_radiance = [0, 0, 0] }",
    "sun": "sky = { width = 1024, sun_elevation_deg = 25, sun_azimuth_deg = 285 }",
}
# Student's t at 97.5%, by pairs less one.
STUDENT = [0, 12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26]


def scenes(folder, repository):
    """Writes the scenes, from open to closed; returns their names."""
    read = lambda name: (repository / f"scenes/studies/{name}.toml").read_text()
    parts = re.split(r"(?m)^(?=\[\[object\]\])", read("window_band"))
    is_outside = lambda part: re.search(r'name = ".*(wall|roof)', part)
    open_air = parts[0] + "".join(part for part in parts[1:] if not is_outside(part))
    band = read("window_band")
    slit = band.replace("size = [0.1, 0.6, 6.4]", "size = [0.1, 1.6, 6.4]").replace(
        "translate = [-2.25, 2.4, 0.0]", "translate = [-2.25, 1.9, 0.0]")
    texts = {"open": open_air, "roofless": read("roofless"), "loggia": read("loggia"),
             "band": band, "slit": slit}
    for environment, sky in ENVIRONMENTS.items():
        for name, text in texts.items():
            text = re.sub(r"(?ms)^\[environment\].*?(?=^\[\[)", f"[environment]\n{sky}\n\n", text)
            (folder / f"{name}_{environment}.toml").write_text(text)
    return list(texts)


def studies():
    """Yields name, environment, rays of a hit and samplers of every study."""
    def three(parameters):
        # A preset replaces all parameters, so it stands first.
        return ["product" + parameters.replace(":cache-capacity=64", ""),
                "visibility" + re.sub("^(:preset=[a-z]+)?", r"\1:k=0", parameters, count=1),
                "visibility" + parameters]
    basic = three(":cache-capacity=64")
    pixel = ["visibility:cache=pixel:cache-capacity=64"]
    yield "smooth_5", "smooth", 5, basic + pixel
    yield "smooth_64", "smooth", 64, basic + pixel
    yield "smooth_16", "smooth", 16, basic + pixel
    yield "smooth_256", "smooth", 256, basic + pixel
    yield "sun_5", "sun", 5, basic
    yield "sun_64", "sun", 64, basic + pixel
    yield "sun_256", "sun", 256, basic
    yield "strict_64", "smooth", 64, three(":preset=strict:cache-capacity=64")
    yield "strict_sun_64", "sun", 64, three(":preset=strict:cache-capacity=64")
    yield "strict_sun_5", "sun", 5, three(":preset=strict:cache-capacity=64")
    yield "lobes_256", "smooth", 64, three(":lobes=256:cache-capacity=64")
    yield "lobes_8", "smooth", 64, three(":lobes=8:cache-capacity=64")


def run(arguments, folder, name, environment, rays, samplers, names):
    """Runs a study or takes it from its folder; returns its results."""
    reference = folder / ("smooth_5" if environment == "smooth" else "sun_5")
    command = [arguments.fenestra, "study", *(folder / f"{scene}_{environment}.toml" for scene in names),
               "--samplers", ",".join(samplers), "--spp", str(RAYS_OF_PIXEL // rays),
               "--seeds", str(arguments.seeds), "--size", arguments.size, "--shadow-rays", str(rays),
               "--reference-check", "off", "-q", "-o", folder / name]
    if reference.name == name:
        command += ["--reference-sampler", "guided", "--reference-spp", str(10240 // rays)]
    else:
        command += ["--reference", reference]
    subprocess.run([str(part) for part in command], check=True, stderr=subprocess.DEVNULL)
    return json.loads((folder / name / "results.json").read_text())


def ratio(numerators, denominators):
    """Returns the geometric mean of the ratios with its 95% bounds."""
    logarithms = [math.log(a / b) for a, b in zip(numerators, denominators)]
    middle = statistics.mean(logarithms)
    wide = STUDENT[len(logarithms) - 1] * statistics.stdev(logarithms) / math.sqrt(len(logarithms))
    return [math.exp(middle), math.exp(middle - wide), math.exp(middle + wide)]


def figures(results, samplers, names, environment):
    """Yields a row for every scene and every sampler with a cache."""
    for scene in names:
        runs = {}
        for each in results["runs"]:
            if each["scene"] == f"{scene}_{environment}":
                runs.setdefault(each["sampler"], []).append(each)
        last = {name: [each["measurements"][-1] for each in sorted(of, key=lambda each: each["seed"])]
                for name, of in runs.items()}
        error = {name: [max(each["parts"]["surfaces"]["mse"], 1e-30) ** 0.5 for each in of]
                 for name, of in last.items()}
        seconds = {name: [each["gpu_seconds"] for each in of] for name, of in last.items()}
        base, unlearned = samplers[:2]
        for guided in samplers[2:]:
            yield {
                "scene": scene, "sampler": guided,
                "visible": statistics.mean(each["visible_share"] for each in runs[base]),
                "to_unlearned": ratio(error[guided], error[unlearned]),
                "to_product": ratio(error[guided], error[base]),
                "numbers": ratio(error[unlearned], error[base]),
                "time": statistics.median(a / b for a, b in zip(seconds[guided], seconds[base])),
            }


def plot(rows, names, path):
    """Draws error against rays of a hit, one line a scene."""
    counts = [5, 16, 64, 256]
    colours = ["#1b6ca8", "#2a9d5c", "#c98a00", "#c0392b", "#7d3c98"]
    shapes = [("hit", "visibility:cache-capacity=64"),
              ("pixel", "visibility:cache=pixel:cache-capacity=64")]
    out = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 640 250" '
           'font-family="sans-serif" font-size="11">',
           '<rect width="640" height="250" fill="white"/>']
    for panel, (cache, sampler) in enumerate(shapes):
        left = 45 + 290 * panel
        x = lambda count: left + 230 * math.log(count / 5) / math.log(256 / 5)
        y = lambda value: 30 + 180 * (1.3 - min(max(value, 0.5), 1.3)) / 0.8
        out.append(f'<text x="{left}" y="18">cache of a {cache}: RMSE over that without learning</text>')
        for tick in [0.6, 0.8, 1.0, 1.2]:
            out.append(f'<path d="M{left} {y(tick):.0f}h230" stroke="#{"888" if tick == 1 else "ddd"}"/>')
            out.append(f'<text x="{left - 24}" y="{y(tick) + 4:.0f}">{tick}</text>')
        for count in counts:
            out.append(f'<text x="{x(count) - 8:.0f}" y="226">{count}</text>')
        out.append(f'<text x="{left + 60}" y="243">shadow rays of a hit</text>')
        for scene, colour in zip(names, colours):
            found = {row["rays"]: row["to_unlearned"] for row in rows if row["scene"] == scene
                     and row["sampler"] == sampler and row["study"].startswith("smooth")}
            line = " ".join(f"{x(c):.0f},{y(found[c][0]):.1f}" for c in counts if c in found)
            out.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="2"/>')
            for count, (_, low, high) in found.items():
                out.append(f'<path d="M{x(count):.0f} {y(low):.1f}V{y(high):.1f}" stroke="{colour}"/>')
    for index, (scene, colour) in enumerate(zip(names, colours)):
        out.append(f'<text x="{585}" y="{60 + 16 * index}" fill="{colour}">{scene}</text>')
    path.write_text("\n".join(out + ["</svg>"]) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--fenestra", default="target/release/fenestra")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--size", default="32x24")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    names = scenes(arguments.folder, pathlib.Path(__file__).resolve().parents[2])
    rows = []
    for name, environment, rays, samplers in studies():
        results = run(arguments, arguments.folder, name, environment, rays, samplers, names)
        for row in figures(results, samplers, names, environment):
            rows.append({"study": name, "rays": rays, **row})
            text = {key: "{:.2f} ({:.2f}–{:.2f})".format(*row[key])
                    for key in ["to_unlearned", "to_product", "numbers"]}
            print(f"| {name} | {row['scene']} | {row['sampler']} | {row['visible']:.3f} "
                  f"| {text['to_unlearned']} | {text['numbers']} | {text['to_product']} "
                  f"| {row['time']:.2f} |", flush=True)
        (arguments.folder / "cache_regimes.json").write_text(json.dumps(rows, indent=1))
        plot(rows, names, arguments.folder / "cache_regimes.svg")


if __name__ == "__main__":
    main()
