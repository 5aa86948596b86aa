"""Checks of a bag: topics, an import with the mapping of the biped, and a suggested mapping."""

import json
from pathlib import Path

from selfmodel.errors import InputError, WorkError
from selfmodel.logs import read_log
from selfmodel.logs.recordings.importer import import_recording, write_recording
from selfmodel.logs.recordings.mapping.mapping import RecordingMapping
from selfmodel.logs.recordings.mapping.mapping_file import parse_mapping
from selfmodel.logs.recordings.mapping.suggest import suggest
from selfmodel.robot.robot import Robot


def check_bag(bag: str, mapping: RecordingMapping, robot: Robot) -> str:
    """Reads a bag in every way.

    Args:
        bag: The file or folder.
        mapping: Mapping of the bag.
        robot: Robot of the mapping.
    """
    proposal = suggest(Path(bag), robot, "biped.xml", with_timestep=True)
    try:
        parse_mapping(proposal, "MAP.toml")
    except (InputError, WorkError) as error:
        if "?" not in proposal:
            raise AssertionError(f"its own suggestion is refused: {error}") from error
    recording = import_recording(Path(bag), mapping, robot)
    json.dumps(recording.facts(), allow_nan=False)
    out = Path("imported.mcap")
    write_recording(out, robot, recording, mapping, None)
    steps = read_log(out).trial.behaviour.steps
    out.unlink()
    if steps != recording.behaviour.steps:
        raise AssertionError(f"{steps} of {recording.behaviour.steps} steps were logged")
    return "imported"
