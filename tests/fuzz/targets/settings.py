"""Settings: of a log as JSON, of an MJCF file as TOML, and as the text of an option."""

from pathlib import Path

import numpy as np

from selfmodel.logs.records import parse_settings, settings_json
from selfmodel.robot.mjcf.settings import checked_settings, parse_setting, read_settings
from selfmodel.settings import Settings
from tests.fuzz.mutate import jsons, tomls
from tests.fuzz.mutate.numbers import number_text, text
from tests.fuzz.target import Case, Make, Target

TOML = (
    b'forward = "x"\nkeyframe = "none"\ncontrol_timestep = 0.02\n'
    b'touch = ["left_foot"]\nangle = ["left_hip_y"]\nctrlrange = [-1, 1]\n'
)
KEYS = ("forward", "keyframe", "control_timestep", "touch", "angle", "ctrlrange", "neurons", "")


def prepare(folder: Path) -> Make:  # noqa: ARG001  # its seeds are here
    """Returns the maker of settings."""
    seed = settings_json(Settings())

    def make(rng: np.random.Generator) -> Case:
        kind = int(rng.integers(3))
        if kind == 0:
            data, what = jsons.mutated(seed, rng)
            return Case(what, {"settings.json": data}, _check_json)
        if kind == 1:
            data, what = tomls.mutated(TOML, rng)
            return Case(what, {"robot.toml": data}, _check_toml)
        key = KEYS[rng.integers(len(KEYS))]
        value = number_text(rng) if rng.random() < 0.5 else text(rng)
        option = f"{key}={value}" if rng.random() < 0.8 else value
        return Case(repr(option), {}, lambda: _check_option(option))

    return make


def _check_json() -> str:
    try:
        settings = parse_settings(Path("settings.json").read_bytes())
    except (ValueError, TypeError, RecursionError):  # the errors that it declares
        return "refused"
    if parse_settings(settings_json(settings)) != settings:
        raise AssertionError("they are written and read as others")
    return "read"


def _check_toml() -> str:
    read_settings(Path("robot.xml"))
    return "read"


def _check_option(option: str) -> str:
    checked_settings(parse_setting(option))
    return "read"


TARGET = Target("settings", 2, prepare)
