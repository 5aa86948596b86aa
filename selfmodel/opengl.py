"""The OpenGL library with which MuJoCo draws: with a screen or without."""

import importlib
import os
import subprocess
import sys
from contextlib import suppress
from functools import cache

from selfmodel.errors import WorkError

GL = "MUJOCO_GL"
"""Environment variable with the OpenGL library, which MuJoCo reads as it is imported."""

WITHOUT_SCREEN = ("egl", "osmesa") if sys.platform == "linux" else ("",)
"""Values that are tried, in this order; other systems than Linux use MuJoCo's default."""

PICTURE = (
    "import mujoco\n"
    "model = mujoco.MjModel.from_xml_string('<mujoco><worldbody><light/></worldbody></mujoco>')\n"
    "with mujoco.Renderer(model, 8, 8) as renderer:\n"
    "    renderer.update_scene(mujoco.MjData(model))\n"
    "    renderer.render()\n"
)
"""Program that draws one picture."""

PICTURE_SECONDS = 60
"""Time limit of that program."""

DISABLED = "disable"
"""Value of that variable for work without pictures, which loads no library."""


@cache
def prepare_dm_control() -> None:
    """Makes dm_control draw where there is no screen and no library without one was chosen, once.

    It chooses a library as it is imported, one that needs a screen or, if a robot was loaded
    before, none.

    Raises:
        WorkError: No library works, or not the chosen one.
    """
    has_screen = any(os.environ.get(screen) for screen in ("DISPLAY", "WAYLAND_DISPLAY"))
    wanted = os.environ.get(GL, "")
    if wanted != DISABLED if has_screen else wanted in WITHOUT_SCREEN:
        return
    os.environ[GL] = "" if wanted == DISABLED else wanted
    os.environ[GL] = "glfw" if has_screen else choose_gl("leave render_mode out")
    importlib.reload(importlib.import_module("dm_control._render"))


def choose_gl(instead: str) -> str:
    """Returns a value of ``MUJOCO_GL`` that works: of the environment, or else EGL or OSMesa.

    Each is tried in a process of its own, because a failed initialisation cannot always be undone.

    Raises:
        WorkError: No library works; the message has what can be done ``instead``.
    """
    wanted = os.environ.get(GL, "")
    for library in (wanted,) if wanted else WITHOUT_SCREEN:
        if draws(library):
            return library
    if wanted:
        raise WorkError(
            f"MuJoCo cannot draw with {GL}={wanted}: unset it, so that EGL and OSMesa are tried, "
            f"or {instead}"
        )
    raise WorkError(
        f"MuJoCo found no library to draw with, neither EGL nor OSMesa: install one (on Debian and "
        f"Ubuntu: apt-get install libegl1 libgl1-mesa-dri, or libosmesa6), or {instead}"
    )


def draws(library: str) -> bool:
    """Returns whether MuJoCo renders a picture with that value of ``MUJOCO_GL``."""
    command, environment = [sys.executable, "-P", "-c", PICTURE], {**os.environ, GL: library}
    with suppress(subprocess.SubprocessError):
        subprocess.run(  # noqa: S603  # this Python, and a text from above
            command, env=environment, capture_output=True, check=True, timeout=PICTURE_SECONDS
        )
        return True
    return False
