"""The Python package, as it is installed."""

import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import unittest

import numpy as np

import fenestra

SCENES = pathlib.Path(__file__).resolve().parents[3] / "scenes"
ROOM = SCENES / "meeting_room.toml"
#: Few and cheap.
QUICK = {"size": (16, 12), "depth": 1, "sampler": "mis"}


def floor(triangles=((0, 1, 2), (0, 2, 3)), reflectance=(0.5, 0.5, np.float32(0.25)), uvs=None, **light):
    """A floor of reflectance one half, seen from above."""
    mesh = {"positions": [[-9, 0, -9], [-9, 0, 9], [9, 0, 9], [9, 0, -9]], "triangles": triangles}
    return fenestra.Scene.build({
        "camera": {
            "position": np.array([0, 2, 0]),
            "look_at": [0, 0, 0],
            "up": [0, 0, 1],
            "vertical_fov_deg": 40,
        },
        "film": {"width": 8, "height": 6},
        "environment": light,
        "material": [{"name": "grey", "type": "diffuse", "reflectance": reflectance}],
        "object": [{"mesh": mesh if uvs is None else {**mesh, "uvs": uvs}, "material": "grey"}],
    })


class Package(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def test_a_picture_is_that_of_the_program(self):
        heard = []
        options = {"spp": 3, "seed": 7, "aov": ["Albedo", "N", "P"]}
        picture = fenestra.load(ROOM).render(**QUICK, **options, progress=heard.append)
        self.assertEqual((picture.rgb.shape, picture.rgb.dtype), ((12, 16, 3), np.float32))
        self.assertEqual((picture.reason, picture.spp, heard[-1].samples), ("spp", 3, 3))
        self.assertEqual(set(picture.layers), {"Albedo", "N", "P", "depth"})
        self.assertTrue((picture.layers["depth"] > 0).all())
        ours, theirs = self.folder / "ours.exr", self.folder / "theirs.exr"
        picture.write_exr(ours)
        program = [sys.executable, "-m", "fenestra"]
        render = [*program, "render", ROOM, "--quiet", "-o", theirs]
        same = "--size 16x12 --depth 1 --sampler mis --spp 3 --seed 7".split()
        subprocess.run([*render, *same], check=True)
        compare = [*program, "compare", ours, theirs, "--fail-above", "mse=0"]
        compared = subprocess.run(compare, stdout=subprocess.PIPE)
        self.assertEqual(compared.returncode, 0, compared.stdout)

    def test_arrays_make_a_scene(self):
        # Light of one from everywhere: half of it comes back, and of blue a quarter.
        maps = {"constant": [1, 1, 1]}, {"map": np.ones((16, 32, 3))}
        for environment in maps:
            mean = floor(**environment).render(depth=1, sampler="mis", spp=64).rgb.mean(axis=(0, 1))
            np.testing.assert_allclose(mean, [0.5, 0.5, 0.25], rtol=0.02)
        # An image of four columns, of which all corners lie between the first two.
        columns = np.repeat([[[0.8], [0.8], [0.2], [0.2]]], 3, axis=2)
        scene = floor(reflectance={"texture": columns}, uvs=[[0.25, 0.5]] * 4, constant=[1, 1, 1])
        small = scene.render(depth=1, sampler="mis", spp=64, size=(4, 3), aov=["P"])
        np.testing.assert_allclose(small.rgb.mean(), 0.8, rtol=0.02)
        # The floor lies across the view, two metres away, at the edges too.
        np.testing.assert_allclose(small.layers["depth"], 2, rtol=1e-4)
        half = floor(((0, 1, 2),), constant=[1, 1, 1]).render(depth=1, sampler="mis", spp=1, aov=["P"])
        self.assertEqual(set(half.layers["depth"].round(4).flat), {2, np.inf})
        # A size is that of one render.
        self.assertEqual(scene.size, (8, 6))

    def test_an_interrupt_keeps_the_picture(self):
        # Shells start what runs in the background deaf to interrupts.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        scene = floor(constant=[1, 1, 1])
        picture = scene.render(spp=10**6, progress=lambda _: os.kill(os.getpid(), signal.SIGINT))
        self.assertEqual(picture.reason, "interrupt")
        self.assertGreater(picture.rgb.mean(), 0)

        def fail(_):
            raise ZeroDivisionError

        self.assertRaises(ZeroDivisionError, scene.render, spp=10**6, progress=fail)

    def test_errors_are_the_programs(self):
        for message, work in [
            ("cannot read", lambda: fenestra.load(self.folder / "none.toml")),
            ("expected corners below 4, found 4", lambda: floor([[0, 1, 4]], constant=[1, 1, 1])),
            ("whole numbers", lambda: floor([[0.0, 1, 2]], constant=[1, 1, 1])),
            ("shape", lambda: floor(map=np.ones((4, 8)))),
            ("unknown field `colour`", lambda: floor(constant=[1, 1, 1], colour=1)),
            ("--depth 0: expected 1 to 64", lambda: floor(constant=[1, 1, 1]).render(depth=0, spp=1)),
            ("invalid value 'best'", lambda: floor(constant=[1, 1, 1]).render(sampler="best")),
        ]:
            with self.subTest(message), self.assertRaisesRegex(fenestra.Error, message):
                work()
        with self.assertLogs("fenestra", "WARNING") as log:
            floor(constant=[0, 0, 0])
        self.assertIn("no light", log.output[0])

    def test_pictures_are_converted(self):
        path = self.folder / "floor.png"
        picture = floor(constant=[1, 1, 1]).render(spp=1, depth=1)
        fenestra.convert(picture, path, exposure=-1, curve="filmic")
        self.assertEqual(path.read_bytes()[1:4], b"PNG")

    def test_the_notebook_runs(self):
        here = pathlib.Path.cwd()
        self.addCleanup(os.chdir, here)
        os.chdir(SCENES.parent / "crates/python")
        names = {}
        for cell in json.loads(pathlib.Path("example.ipynb").read_text(encoding="utf-8"))["cells"]:
            if cell["cell_type"] == "code":
                code = "".join(cell["source"]).replace("SECONDS = 5", "SECONDS = 0.2")
                exec(code.replace("320, 240", "32, 24"), names)
        self.assertTrue(names["picture"]._repr_png_().startswith(b"\x89PNG"))
        self.assertGreater(names["share"], 0)

    def test_studies_return_their_results(self):
        quick = {"size": (8, 6), "spp": [1], "seeds": 1, "reference_spp": 4, "reference_check": "off"}
        samplers = ["mis", "ris:candidates=2"]
        results = fenestra.study(ROOM, self.folder / "report", samplers=samplers, **quick)
        self.assertEqual(len(results["runs"]), 2)


if __name__ == "__main__":
    unittest.main()
