"""URDF files of users, with their meshes and settings: converted, simulated and logged."""

from pathlib import Path

import numpy as np

from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import read_settings
from tests.fuzz.mutate import data as raw, tomls, urdfs
from tests.fuzz.target import Case, Make, Target
from tests.fuzz.targets.mjcf_files import logged
from tests.robot.urdf.samples import BALL, CUBE, WALKER, joint, link, urdf

NAME = "walker.urdf"
MESH = "foot.obj"

TOML = b"""\
pose = {"*_hip" = 0.2, left_knee = -0.7}
kp = 40
kd = {"*" = 1.5}
effort = 20
swing = 0.5
base = "free"
"""

MESHED = WALKER.replace(
    BALL, BALL + BALL.replace('sphere radius="0.03"', f'mesh filename="{MESH}"')
)
COUPLED = WALKER.replace(
    "</robot>",
    link("tail", 0.1)
    + joint("wag", "trunk", "tail", more='<mimic joint="left_hip" multiplier="0.5" offset="0.1"/>')
    + "</robot>",
)
FIXED = urdf(
    link("world", 0),
    link("base", 1.0, BALL),
    link("cross", 0),
    link("arm", 0.5, BALL),
    joint("mount", "world", "base", kind="fixed"),
    joint("pan", "base", "cross", axis="0 0 1"),
    joint("tilt", "cross", "arm"),
)


def prepare(folder: Path) -> Make:  # noqa: ARG001  # its seeds are in the repository
    """Returns the maker of URDF files."""
    seeds = [text.encode() for text in (WALKER, MESHED, COUPLED, FIXED)]

    def make(rng: np.random.Generator) -> Case:
        text = seeds[rng.integers(len(seeds))]
        files = {NAME: text, MESH: CUBE.encode()}
        kind = rng.random()
        if kind < 0.15:
            files["walker.toml"], what = tomls.mutated(TOML, rng)
        elif kind < 0.25:
            files[MESH], what = raw.mutated(files[MESH], rng)
        else:
            files[NAME], what = urdfs.mutated(text, rng)
        return Case(what, files, _check)

    return make


def _check() -> str:
    path = Path(NAME)
    return logged(load_mjcf(path, read_settings(path)))


TARGET = Target("urdf", 10, prepare)
