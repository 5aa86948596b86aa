"""Draws three trials of a recovery in lanes side by side: before, after the failure, recovered.

Usage: python examples/plot_lanes.py RUN_FOLDER FIGURE.png

Each lane shows the robot at several moments of one trial, and a line each 5 m. A detached limb is
not drawn. The file has the displacements as text, too, with which a test compares the README. The
picture needs EGL or OSMesa, as ``selfmodel render`` does.
"""

import json
import os
import sys
from pathlib import Path

from selfmodel.opengl import GL, choose_gl

# Before MuJoCo is imported, which reads it.
os.environ[GL] = choose_gl("install EGL or OSMesa")

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from PIL.PngImagePlugin import PngInfo

from selfmodel.arrays import FloatArray
from selfmodel.cli.film import evenly, film_of
from selfmodel.faults.notation import parse
from selfmodel.logs import TrialLog, read_log
from selfmodel.logs.robots import common_robot

WIDTH, HEIGHT = 1280, 400
LANE = 1.6
"""Distance between two lanes, m."""

MOMENTS = 11
RULE = 5.0
"""Distance between two lines across the lanes, m."""

MARGIN = 2.0
"""Ground that is seen beyond both ends of the longest lane, m."""

FIELD_OF_VIEW = 14.0
"""Vertical angle of the camera, degrees."""

COLOURS = {
    "before": (0.13, 0.30, 0.47),
    "after": (0.77, 0.25, 0.18),
    "recovery": (0.16, 0.48, 0.28),
}
TITLES = {
    "before": "before the failure",
    "after": "after: a lower leg is lost",
    "recovery": "recovered",
}


def main(folder: Path, figure: Path) -> None:
    """Draws the first two trials of a run, and the best of the others."""
    logs = [read_log(path) for path in sorted((folder / "trials").glob("*.mcap"))]
    best = max(logs[2:], key=lambda log: log.trial.displacement)
    truth = json.loads((folder / "result.json").read_text(encoding="utf-8"))["truth"]
    shown = {"before": (logs[0], "intact"), "after": (logs[1], truth), "recovery": (best, truth)}
    image = Image.fromarray(_rendered(list(shown.values()), list(COLOURS.values())))
    draw, numbers = ImageDraw.Draw(image), PngInfo()
    font = ImageFont.load_default(20)
    for row, (stage, (log, _)) in enumerate(shown.items()):
        text = f"{TITLES[stage]}: {log.trial.displacement:.2f} m"
        colour = tuple(round(255 * part) for part in COLOURS[stage])
        draw.text((24, HEIGHT - 92 + 28 * row), text, fill=colour, font=font)
        numbers.add_text(stage, f"{log.trial.displacement:.1f}")
    image.save(figure, pnginfo=numbers)


def _rendered(
    lanes: list[tuple[TrialLog, str]], colours: list[tuple[float, float, float]]
) -> np.ndarray:
    """The picture of all lanes in one scene, ``(height, width, 3)``."""
    robot = common_robot([log for log, _ in lanes])
    longest = max(log.trial.displacement for log, _ in lanes)
    rules = "".join(
        f'<geom type="box" size=".02 {1.6 * LANE} .002" pos="{x} 0 0" rgba=".8 .8 .78 1"/>'
        for x in np.arange(0, longest + MARGIN, RULE)
    )
    floor = mujoco.MjModel.from_xml_string(
        f"""<mujoco><visual><global offwidth="{WIDTH}" offheight="{HEIGHT}"
        fovy="{FIELD_OF_VIEW}"/>
        <headlight ambient=".45 .45 .45" diffuse=".35 .35 .35" specular="0 0 0"/></visual>
        <worldbody><light directional="true" pos="0 0 6" dir=".15 .35 -1" diffuse=".45 .45 .45"/>
        <geom type="plane" size="90 90 .1" rgba=".97 .97 .95 1"/>{rules}</worldbody></mujoco>"""
    )
    data = mujoco.MjData(floor)
    mujoco.mj_forward(floor, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = (longest / 2, 0.0, 0.1)
    camera.azimuth, camera.elevation = 90, -30
    seen = 2 * np.tan(np.radians(FIELD_OF_VIEW / 2)) * WIDTH / HEIGHT
    camera.distance = (longest + 2 * MARGIN) / seen
    with mujoco.Renderer(floor, HEIGHT, WIDTH) as renderer:
        renderer.update_scene(data, camera)
        for row, ((log, notation), colour) in enumerate(zip(lanes, colours, strict=True)):
            moments = evenly(log.trial.trajectory.time, MOMENTS)
            film = film_of(
                robot,
                parse(notation, robot.anatomy),
                [("logged", log.trial.trajectory)],
                moments,
            )
            model = film.model
            model.geom_rgba[:] = (*colour, 1.0)
            model.geom_rgba[model.geom_bodyid == 0, 3] = 0.0
            model.geom_rgba[np.isin(model.geom_bodyid, list(film.detached)), 3] = 0.0
            model.site_rgba[:, 3] = 0.0
            for qpos in film.shots[0].qpos:
                _add(renderer.scene, model, qpos + _offset(model.nq, (1 - row) * LANE))
        return np.asarray(renderer.render())


def _offset(size: int, y: float) -> FloatArray:
    offset = np.zeros(size)
    offset[1] = y
    return offset


def _add(scene: mujoco.MjvScene, model: mujoco.MjModel, qpos: FloatArray) -> None:
    """Adds a robot in one pose to a scene."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    mujoco.mjv_addGeoms(
        model,
        data,
        mujoco.MjvOption(),
        mujoco.MjvPerturb(),
        int(mujoco.mjtCatBit.mjCAT_DYNAMIC),
        scene,
    )


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
