"""A pyramid of arrays under a sky of an array, by two samplers: python crates/python/example.py"""

import numpy as np

import fenestra

positions = [[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1], [0, 1.5, 0]]
triangles = [[0, 4, 1], [1, 4, 2], [2, 4, 3], [3, 4, 0]]
floor = [[-9, 0, -9], [-9, 0, 9], [9, 0, 9], [9, 0, -9]]
sky = np.full((64, 128, 3), 0.3)
sky[:32] = [0.4, 0.6, 1.0]
sky[14:17, 90:93] = 200.0

scene = fenestra.Scene.build({
    "camera": {"position": [3, 2, 5], "look_at": [0, 0.5, 0], "vertical_fov_deg": 35},
    "film": {"width": 160, "height": 120},
    "environment": {"map": sky},
    "material": [
        {"name": "red", "type": "plastic", "diffuse": [0.6, 0.1, 0.1], "alpha": 0.1},
        {"name": "grey", "type": "diffuse", "reflectance": [0.5, 0.5, 0.5]},
    ],
    "object": [
        {"mesh": {"positions": positions, "triangles": triangles}, "material": "red"},
        {"mesh": {"positions": floor, "triangles": [[0, 1, 2], [0, 2, 3]]}, "material": "grey"},
    ],
})
for sampler in ["mis", "guided"]:
    picture = scene.render(sampler=sampler, depth=4, spp=32, aov=["Albedo", "P", "Variance"],
                           progress=lambda standing: print(f"{sampler} {standing.fraction:.0%}", end="\r"))
    print(f"{sampler}: mean {picture.rgb.mean():.4f}, variance {picture.layers['Variance'].mean():.2e}, "
          f"nearest {picture.layers['depth'][picture.layers['Albedo'][..., 0] > 0].min():.2f} m")
    fenestra.convert(picture, f"pyramid_{sampler}.png", curve="filmic")
