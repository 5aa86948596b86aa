"""Fixtures of all tests, and the choice between the fast tier and everything."""

import gc
import os
import signal
from collections.abc import Iterator

# dm_control looks for a display as it is imported; nothing here is drawn.
os.environ["MUJOCO_GL"] = "disable"
# Of many small matrices: more threads only wait for each other, and for the other worker's.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import settings

from selfmodel.isolation import run_isolated
from selfmodel.opengl import WITHOUT_SCREEN, draws
from selfmodel.robot.mjcf import load
from selfmodel.robot.robot import Robot
from selfmodel.tasks import ROBOTS
from tests.helpers.calibration import coarse
from tests.helpers.in_process import in_this_process

settings.register_profile("full", deadline=None)  # a busy machine is no bug
settings.register_profile("fast", deadline=None, max_examples=20)

# A shell's background job ignores Ctrl-C, and hands that on to the commands that are tested.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # ignored under nohup


load.run_isolated = in_this_process

gc.set_threshold(50_000, 20, 50)  # what the tests keep is not searched for garbage every second


@pytest.fixture
def isolated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Opens models in a child process, as for users: for what may crash or fill the memory."""
    monkeypatch.setattr(load, "run_isolated", run_isolated)


@pytest.fixture(scope="module")
def coarse_calibration() -> Iterator[None]:
    """Calibrates coarsely in all tests of a file from this one on."""
    with coarse():
        yield


def pytest_configure(config: pytest.Config) -> None:
    """Selects the tests named by id whatever their markers, and the examples of the tier."""
    is_default = config.option.markexpr in config.getini("addopts")
    if is_default and any("::" in argument for argument in config.args):
        config.option.markexpr = ""
    settings.load_profile("fast" if config.option.markexpr else "full")


@pytest.fixture(scope="session")
def gl() -> str:
    """The value of ``MUJOCO_GL`` with which MuJoCo draws here."""
    for library in filter(draws, WITHOUT_SCREEN):
        return library
    pytest.skip("MuJoCo draws with neither EGL nor OSMesa here: apt-get install libosmesa6")


@pytest.fixture(scope="session", params=sorted(ROBOTS))
def robot(request: pytest.FixtureRequest) -> Robot:
    """Every registered robot in turn."""
    return ROBOTS[request.param].robot()


@pytest.fixture(scope="session")
def quadruped() -> Robot:
    return ROBOTS["quadruped"].robot()
