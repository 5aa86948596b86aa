"""Counts the pixels of a robot in each picture of a film, in a process that may use OpenGL.

``python -m tests.robot.robot_pixels NAME...`` prints a JSON object: per robot, the smallest
number of pixels of the robot in any picture of each motion.
"""

import json
import re
import sys
import tempfile
from pathlib import Path

import numpy as np

from selfmodel.arguments import robot_entry
from selfmodel.cli import film as films
from selfmodel.cli.film import Film, film_of
from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.motion import POSE
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from tests.helpers.drivers import random_controllers
from tests.helpers.robots.menagerie import menagerie

FRAMES = 2
STEPS = 31
LARGE_RINGS = 170
"""Detail of meshes that are too large for a log: 2.9 MB each."""


def main(names: list[str]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        packages = Path(folder)
        layouts = {name: packages / name for name in ("small", "large", "colliding", "bare")}
        menagerie(layouts["small"])
        menagerie(layouts["large"], LARGE_RINGS)
        menagerie(layouts["colliding"], LARGE_RINGS, meshes_collide=True)
        _remove_visual_geoms(menagerie(layouts["bare"]) / "xml" / "go.xml")
        found = {name: robot_pixels(_robot(name, layouts)) for name in names}
    sys.stdout.write(json.dumps(found))


def _remove_visual_geoms(file: Path) -> None:
    """Removes the visual geoms of a Menagerie-like MJCF: those for contacts are in group 3."""
    text = file.read_text(encoding="utf-8")
    file.write_text(re.sub(r'<geom class="visual" [^>]*/>', "", text), encoding="utf-8")


def _robot(name: str, layouts: dict[str, Path]) -> Robot:
    """Returns a robot by its name, its file, or ``LAYOUT:FILE`` of Menagerie-like packages."""
    layout, colon, file = name.partition(":")
    path = str(layouts[layout] / "go" / "xml" / file) if colon else name
    return robot_entry(path).robot()


def robot_pixels(robot: Robot) -> list[int]:
    """Returns the smallest number of pixels of a robot in any picture of each motion.

    They are the pixels that differ from those of a film in which the robot is hidden.
    """
    film = _film(robot)
    shown = np.stack(list(films.filmed(film)))
    own = film.model.body_rootid[film.model.geom_bodyid] == film.model.body_rootid[film.root]
    chosen = films.visible_geoms
    films.visible_geoms = lambda model: chosen(model) & ~own
    try:
        empty = np.stack(list(films.filmed(film)))
    finally:
        films.visible_geoms = chosen
    different = np.any(shown != empty, axis=3).reshape(FRAMES, films.HEIGHT, 2, films.WIDTH)
    return [int(count) for count in different.sum(axis=(1, 3)).min(axis=0)]


def _film(robot: Robot) -> Film:
    (controller,) = random_controllers(robot, 1)
    batch = Simulator(robot, 1).run([(INTACT, controller)], STEPS, POSE).behaviour
    seen = Behaviour(batch.names, batch.time, {signal: batch[signal][0] for signal in POSE})
    moments = np.linspace(0, batch.time[-1], FRAMES)
    return film_of(robot, INTACT, [("logged", seen), ("model", seen)], moments)


if __name__ == "__main__":
    main(sys.argv[1:])
