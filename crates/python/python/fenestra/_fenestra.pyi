from typing import Any, Callable, Optional, Union
import os

class Error(Exception): ...

class Standing:
    """State of a render."""

    #: Fraction done, 0 to 1, by the stop rule that will be met first.
    fraction: float
    #: Camera paths per pixel so far.
    samples: int
    #: Wall time until the end, seconds; None if unknown.
    seconds_left: Optional[float]
    #: Rays per second so far; 0 if unknown.
    rays_per_second: float
    #: Mean relative standard error, if known.
    error: Optional[float]

class Scene:
    name: str
    warnings: list[str]
    size: tuple[int, int]
    view: tuple[list[float], list[float]]
    @staticmethod
    def load(arguments: list[str]) -> Scene: ...
    @staticmethod
    def build(
        path: str,
        text: str,
        meshes: dict[str, dict[str, bytes]],
        images: dict[str, tuple[int, int, bytes]],
    ) -> Scene: ...
    def render(self, arguments: list[str], progress: Optional[Callable[[Standing], object]]) -> Picture: ...

class Picture:
    size: tuple[int, int]
    reason: str
    metadata: dict[str, Any]
    def channels(self) -> dict[str, bytearray]: ...
    def write_exr(self, path: Union[str, os.PathLike[str]]) -> None: ...

def run(arguments: list[str], progress: Optional[Callable[[Standing], object]] = None) -> None: ...
def main(arguments: list[str]) -> int: ...
def set_program(program: list[str]) -> None: ...
