"""Fenestra: a physically based renderer for scenes lit by an environment map.

Keywords are the options of the program ``fenestra`` with underscores, and have its defaults: ``fenestra
render --help`` explains them. Warnings go to the logger ``fenestra``; errors are :class:`Error`, with the
message of the program.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from typing import Any, Callable, Mapping, Optional, Sequence, Union

import numpy as np

from . import _fenestra
from ._fenestra import Error, Standing

__all__ = ["Error", "Picture", "Scene", "Standing", "convert", "load", "main", "study"]

Path = Union[str, "os.PathLike[str]"]
Progress = Callable[[Standing], object]

# The self-test of a device, which its driver may crash, runs in a process of its own.
_fenestra.set_program([sys.executable, "-m", "fenestra"] if sys.executable else [])

#: Kind and number of the components of each array of a mesh.
_KINDS = {
    "positions": ("f4", 3),
    "normals": ("f4", 3),
    "uvs": ("f4", 2),
    "colors": ("f4", 4),
    "triangles": ("u4", 3),
}


def load(
    path: Path,
    *,
    environment: Optional[Path] = None,
    rotate_environment: Optional[float] = None,
    camera: Union[str, int, None] = None,
    look_from: Optional[Sequence[float]] = None,
    look_at: Optional[Sequence[float]] = None,
    fov: Optional[float] = None,
    allow_root: Optional[Path] = None,
    strict: bool = False,
) -> Scene:
    """Opens a scene in any format that the program opens."""
    options = dict(locals())
    return Scene(_fenestra.Scene.load(_arguments("render", [options.pop("path")], options)))


class Scene:
    """A scene in memory: of :func:`load`, or of :meth:`build`."""

    def __init__(self, native: _fenestra.Scene) -> None:
        self._native = native

    @classmethod
    def build(cls, description: Mapping[str, Any], *, name: str = "built", folder: Path = ".") -> Scene:
        """Builds a scene of tables with the keys of a scene file: ``camera``, ``film``, ``environment``, and
        lists of ``material``, ``object``, ``lamp``, ``portal``, ``include``.

        In place of a mesh file may stand a dict of arrays: ``positions`` (n, 3), ``triangles`` (m, 3) of
        indices, and of each vertex ``normals`` (n, 3), ``uvs`` (n, 2), ``colors`` (n, 4). In place of an
        image file, as ``environment.map`` or ``texture``, may stand an array (height, width, 3) of linear
        Rec.709. Files are relative to ``folder``.
        """
        meshes: dict[str, dict[str, bytes]] = {}
        images: dict[str, tuple[int, int, bytes]] = {}

        def replaced(key: str, value: Any) -> Any:
            if key == "mesh" and isinstance(value, Mapping):
                meshes[f"array {len(meshes)}"] = _mesh(value)
                return f"array {len(meshes) - 1}"
            if key in ("map", "texture") and isinstance(value, np.ndarray):
                height, width = _shape(key, value, (None, None, 3))[:2]
                images[f"image {len(images)}"] = (width, height, _bytes(value, "f4"))
                return f"image {len(images) - 1}"
            if isinstance(value, Mapping):
                return {name: replaced(name, inner) for name, inner in value.items()}
            if isinstance(value, (list, tuple)):
                return [replaced(key, inner) for inner in value]
            return value

        text = "".join(_section(key, replaced(key, value)) for key, value in description.items())
        return cls(_fenestra.Scene.build(os.path.join(folder, name), text, meshes, images))

    @property
    def name(self) -> str:
        """Name of the scene."""
        return self._native.name

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the film, pixels."""
        return self._native.size

    @property
    def warnings(self) -> list[str]:
        """Lines on what was left out or repaired."""
        return self._native.warnings

    def render(
        self,
        *,
        size: Optional[Sequence[int]] = None,
        crop: Optional[Sequence[int]] = None,
        sampler: Optional[str] = None,
        depth: Optional[int] = None,
        shadow_rays: Optional[int] = None,
        roulette_depth: Optional[int] = None,
        roulette_throughput: Optional[float] = None,
        seed: Optional[int] = None,
        sample_offset: Optional[int] = None,
        set: Optional[Mapping[str, object]] = None,
        quality: Optional[str] = None,
        spp: Optional[int] = None,
        time: Union[float, str, None] = None,
        error: Optional[float] = None,
        aov: Sequence[str] = (),
        load_guide: Optional[Path] = None,
        device: Union[str, int, None] = None,
        tracer: Optional[str] = None,
        validate: bool = False,
        progress: Optional[Progress] = None,
    ) -> Picture:
        """Renders until ``spp``, ``time`` (seconds or as "1m") or ``error`` is met, else by ``quality``.

        ``aov`` names layers as the image file does: "Albedo", "N", "P", "Variance", "SampleCount",
        "Visible". ``progress`` is called after every pass. A KeyboardInterrupt, also of ``progress``, ends
        the render and keeps the picture: its ``reason`` is "interrupt".
        """
        options = dict(locals())
        del options["self"], options["progress"]
        # It would announce the device on standard error.
        options["quiet"] = True
        native = self._native.render(_arguments("render", ["scene"], options), progress)
        return Picture(native, self._native.view)


class Picture:
    """A rendered picture with its layers."""

    #: Linear Rec.709, (height, width, 3), 32-bit floats.
    rgb: np.ndarray
    #: Further layers by name, (height, width) or (height, width, components); "depth" beside "P", metres,
    #: infinite where no sample met a surface.
    layers: dict[str, np.ndarray]
    #: Rule that ended the render: "spp", "time", "error", "last-sample" or "interrupt".
    reason: str
    #: Settings, samples, times and device, as in the image file.
    metadata: dict[str, Any]

    def __init__(self, native: _fenestra.Picture, view: tuple[Sequence[float], Sequence[float]]) -> None:
        self._native = native
        self.reason, self.metadata = native.reason, native.metadata
        width, height = native.size
        groups: dict[str, dict[str, np.ndarray]] = {}
        for name, values in native.channels().items():
            layer, _, component = name.rpartition(".")
            groups.setdefault(layer, {})[component] = np.frombuffer(values, "f4").reshape(height, width)
        self.layers = {}
        for layer, parts in groups.items():
            components = [parts[component] for component in sorted(parts, key="RGBAXYZ".index)]
            self.layers[layer] = components[0] if len(components) == 1 else np.stack(components, axis=-1)
        self.rgb = self.layers.pop("")
        if "P" in self.layers:
            position, direction = (np.asarray(vector, "f4") for vector in view)
            depth = (self.layers["P"] - position) @ direction
            depth[~self.layers["P"].any(-1)] = np.inf
            self.layers["depth"] = depth

    @property
    def spp(self) -> int:
        """Samples per pixel."""
        return self.metadata["samplesPerPixel"]

    def write_exr(self, path: Path) -> None:
        """Writes the image with all layers and metadata, for every command of the program."""
        self._native.write_exr(path)

    def _repr_png_(self) -> bytes:
        """The picture as notebooks show it."""
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "picture.png")
            convert(self, path, curve="filmic")
            with open(path, "rb") as file:
                return file.read()


def convert(
    image: Union[Picture, Path],
    output: Path,
    *,
    exposure: Optional[float] = None,
    auto_exposure: bool = False,
    curve: Optional[str] = None,
    crop: Optional[Sequence[int]] = None,
    layer: Optional[str] = None,
    denoise: bool = False,
) -> None:
    """Makes a PNG, JPEG, HDR or EXR file of a picture or an EXR file."""
    options = dict(locals())
    del options["image"], options["output"]
    with tempfile.TemporaryDirectory() as folder:
        if isinstance(image, Picture):
            path = os.path.join(folder, "picture.exr")
            image.write_exr(path)
            image = path
        _fenestra.run(_arguments("convert", [image, output], options))


def study(
    inputs: Union[Path, Sequence[Path]],
    output: Path,
    *,
    samplers: Optional[Sequence[str]] = None,
    spp: Optional[Sequence[int]] = None,
    time: Union[float, str, None] = None,
    seeds: Optional[int] = None,
    strict: bool = False,
    size: Optional[Sequence[int]] = None,
    shadow_rays: Optional[int] = None,
    depth: Optional[int] = None,
    reference_sampler: Optional[str] = None,
    reference_spp: Optional[int] = None,
    reference: Sequence[Path] = (),
    reference_check: Optional[str] = None,
    overhead: bool = False,
    baseline: Optional[str] = None,
    repetitions: Optional[int] = None,
    set: Optional[Mapping[str, object]] = None,
    quick: bool = False,
    redo: bool = False,
    device: Union[str, int, None] = None,
    tracer: Optional[str] = None,
    progress: Optional[Progress] = None,
) -> dict[str, Any]:
    """Compares samplers on scene files, or by a study file, in a report in the folder ``output``; returns its
    ``results.json``. An interrupted study continues there."""
    options = dict(locals())
    del options["inputs"], options["progress"]
    # Each half of a reference is an option of its own.
    halves = [f"--reference={os.fspath(half)}" for half in options.pop("reference")]
    files = [inputs] if isinstance(inputs, (str, os.PathLike)) else list(inputs)
    options["quiet"] = True
    arguments = _arguments("study", files, options)
    _fenestra.run(arguments[:2] + halves + arguments[2:], progress)
    with open(os.path.join(output, "results.json"), encoding="utf-8") as file:
        return json.load(file)


def main() -> int:
    """Runs the program ``fenestra``."""
    return _fenestra.main(["fenestra", *sys.argv[1:]])


def _arguments(command: str, files: Sequence[Path], options: Mapping[str, Any]) -> list[str]:
    """Writes keywords as options of the command line."""
    arguments = ["fenestra", command]
    for key, value in options.items():
        if value is None or value is False:
            continue
        name = "--" + key.replace("_", "-")
        if value is True:
            arguments.append(name)
        elif key == "set":
            arguments += [f"--set={knob}={_word(setting)}" for knob, setting in value.items()]
        elif isinstance(value, (str, os.PathLike)):
            arguments.append(f"{name}={os.fspath(value)}")
        elif key == "time":
            arguments.append(f"{name}={value:f}")
        elif not hasattr(value, "__len__"):
            arguments.append(f"{name}={value}")
        elif len(value):
            arguments.append(f"{name}=" + ("x" if key == "size" else ",").join(map(str, value)))
    return [*arguments, "--", *(os.fspath(file) for file in files)]


def _word(setting: object) -> str:
    return ("off", "on")[setting] if isinstance(setting, bool) else str(setting)


def _shape(name: str, array: Any, expected: Sequence[Optional[int]]) -> tuple[int, ...]:
    shape = np.shape(array)
    if len(shape) != len(expected) or any(e not in (None, n) for e, n in zip(expected, shape)):
        wanted = ", ".join("n" if side is None else str(side) for side in expected)
        raise Error(f"{name}: expected an array of shape ({wanted}), found {shape}")
    return shape


def _bytes(array: Any, kind: str) -> bytes:
    return np.ascontiguousarray(array, dtype=kind).tobytes()


def _mesh(arrays: Mapping[str, Any]) -> dict[str, bytes]:
    found = {}
    for name, array in arrays.items():
        if name not in _KINDS:
            raise Error(f"mesh: expected arrays {', '.join(_KINDS)}, found {name}")
        kind, width = _KINDS[name]
        _shape(f"mesh: {name}", array, (None, width))
        if kind == "u4":
            numbers = np.asarray(array)
            if numbers.dtype.kind not in "iu" or ((numbers < 0) | (numbers >= 2**32)).any():
                raise Error(f"mesh: {name}: expected whole numbers from 0 on, found {numbers.dtype}")
        found[name] = _bytes(array, kind)
    return found


def _section(name: str, value: Any) -> str:
    """Writes a table, or tables of one name, of a scene file."""
    is_list = isinstance(value, list)
    head = f"[[{name}]]" if is_list else f"[{name}]"
    lines = []
    for table in value if is_list else [value]:
        if not isinstance(table, Mapping):
            raise Error(f"{name}: expected a table or a list of tables, found {table!r}")
        lines += [head, *(f"{json.dumps(key)} = {_value(inner)}" for key, inner in table.items())]
    return "\n".join([*lines, ""])


def _value(value: Any) -> str:
    """Writes a value of a scene file."""
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, Mapping):
        pairs = (f"{json.dumps(key)} = {_value(inner)}" for key, inner in value.items())
        return "{ " + ", ".join(pairs) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, (bool, str)):
        return json.dumps(value)
    if isinstance(value, os.PathLike):
        return json.dumps(os.fspath(value))
    if isinstance(value, (int, float)):
        return repr(value)
    raise Error(f"expected a number, a text, a list or a table, found {value!r}")
