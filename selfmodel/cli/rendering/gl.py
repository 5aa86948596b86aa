"""Choice of the OpenGL library with which MuJoCo renders off screen."""

import os
import subprocess
import sys

from selfmodel.errors import WorkError

VARIABLE = "MUJOCO_GL"
"""Environment variable that MuJoCo reads as it is imported."""

NOTHING = "disable"
"""Value of the variable without rendering: MuJoCo then loads no library."""

WITHOUT_SCREEN = ("egl", "osmesa") if sys.platform == "linux" else ("",)
"""Values that are tried, in this order; other systems than Linux use MuJoCo's default."""

TIMEOUT = 60
"""Time limit for one picture, s."""

TRIAL = (
    "import mujoco\n"
    "model = mujoco.MjModel.from_xml_string('<mujoco><worldbody><light/></worldbody></mujoco>')\n"
    "with mujoco.Renderer(model, 8, 8) as renderer:\n"
    "    renderer.update_scene(mujoco.MjData(model))\n"
    "    renderer.render()\n"
)


def choose_gl() -> str:
    """Sets ``MUJOCO_GL`` to a library that works; call it before MuJoCo is imported.

    If ``MUJOCO_GL`` is set, only that library is tried. Each is tried in a process of its own,
    because a failed initialisation cannot always be undone.

    Returns:
        The value of ``MUJOCO_GL``.

    Raises:
        WorkError: No library works.
    """
    wanted = os.environ.get(VARIABLE, "")
    tried = (wanted,) if wanted else WITHOUT_SCREEN
    for name in tried:
        if works(name):
            os.environ[VARIABLE] = name
            return name
    if wanted:
        raise WorkError(
            f"MuJoCo cannot draw with {VARIABLE}={wanted}: unset it, so that EGL and OSMesa are "
            f"tried, or draw stick figures, with --stick or -o NAME.png"
        )
    raise WorkError(
        "MuJoCo found no library to draw with, neither EGL nor OSMesa: install one (on Debian and "
        "Ubuntu: apt-get install libegl1 libgl1-mesa-dri, or libosmesa6), or draw stick figures, "
        "with --stick or -o NAME.png"
    )


def choose_nothing() -> None:
    """Disables rendering by MuJoCo; call it before MuJoCo is imported."""
    os.environ[VARIABLE] = NOTHING


def works(name: str) -> bool:
    """Returns whether MuJoCo renders a picture with that value of ``MUJOCO_GL``."""
    try:
        done = subprocess.run(  # noqa: S603  # this Python, and a text from above
            [sys.executable, "-c", TRIAL],
            env={**os.environ, VARIABLE: name},
            capture_output=True,
            check=False,
            timeout=TIMEOUT,
        )
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0
