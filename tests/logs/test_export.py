"""Promises of an exported table: it is the trial, and is imported as the same trial."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from selfmodel.arrays import frozen
from selfmodel.errors import InputError
from selfmodel.logs.export import export
from selfmodel.logs.recordings.importer import import_recording
from selfmodel.logs.recordings.mapping_file import parse_mapping
from selfmodel.logs.recordings.suggest import suggest
from selfmodel.logs.recordings.tables import read_table
from selfmodel.robot.robot import Robot
from selfmodel.trials.behaviour import Behaviour, columns_of
from selfmodel.trials.signals import SIGNALS

FORMS = ("csv", "npz", "parquet")


def behaviour(robot: Robot, steps: int, seed: int, share: float = 0.0) -> Behaviour:
    """Random signals, of which a share of the base, the velocities and the readings is missing."""
    rng = np.random.default_rng(seed)
    names = robot.anatomy.names
    found = {s: rng.normal(size=(steps, names.width(s))) for s in SIGNALS}
    found["base_orientation"] /= np.linalg.norm(found["base_orientation"], axis=1, keepdims=True)
    found["joint_positions"][rng.random(found["joint_positions"].shape) < 0.1] = -0.0
    for signal in ("base_position", "base_linear_velocity", "joint_velocities", "sensors"):
        # Where more than half of the rows are missing, the others are a slower sampling.
        missing = rng.permutation(steps - 2)[: int(share * steps)] + 1
        found[signal][missing] = np.nan
    found["joint_efforts"][:, 1] = np.nan
    time = np.arange(steps) * robot.control_timestep
    return Behaviour(names, frozen(time), {s: frozen(found[s]) for s in SIGNALS})


@pytest.mark.process
@settings(max_examples=12, deadline=None, suppress_health_check=[*HealthCheck])
@given(
    form=st.sampled_from(FORMS),
    steps=st.integers(5, 40),
    seed=st.integers(0, 2**32),
    share=st.sampled_from([0.0, 0.2]),
)
def test_an_export_is_imported_to_the_bit(
    form: str, steps: int, seed: int, share: float, biped: Robot
):
    original = behaviour(biped, steps, seed, share)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"t.{form}"
        export(path, original)
        mapping = parse_mapping(suggest(path, biped, "biped.xml", with_timestep=True), "MAP.toml")
        again = import_recording(path, mapping, biped).behaviour

    assert again.time.tobytes() == original.time.tobytes()
    for signal in SIGNALS:
        given_bits, found_bits = original[signal], again[signal]
        known = np.isfinite(given_bits)
        np.testing.assert_array_equal(np.isfinite(found_bits), known, err_msg=signal)
        assert given_bits[known].tobytes() == found_bits[known].tobytes(), signal


@pytest.mark.parametrize("form", FORMS)
def test_a_table_has_the_columns_of_a_trial(form: str, biped: Robot, tmp_path: Path):
    original = behaviour(biped, 7, 1)
    path = tmp_path / f"t.{form}"

    names = export(path, original)

    assert names == read_table(path, ()).names
    assert "time" in names
    assert "effort.left_hip_x" in names
    assert "effort.left_hip_y" not in names  # never observed
    found = read_table(path, names).columns
    for name, values in columns_of(original).items():
        np.testing.assert_array_equal(found[name], values)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_a_file_is_not_replaced_and_its_end_is_its_format(biped: Robot, tmp_path: Path):
    original = behaviour(biped, 5, 1)
    (tmp_path / "t.csv").write_text("mine")

    with pytest.raises(InputError, match=r"t\.csv exists, and is not overwritten"):
        export(tmp_path / "t.csv", original)
    with pytest.raises(InputError, match=r"expected a file that ends in \.csv, \.npz, \.parquet"):
        export(tmp_path / "t.xlsx", original)
    assert (tmp_path / "t.csv").read_text() == "mine"


@pytest.mark.process
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("steps", [slice(None), slice(12, None)], ids=["never", "lost midway"])
def test_a_lost_encoder_is_imported_as_it_was(
    form: str, steps: slice, biped: Robot, tmp_path: Path
):
    original = behaviour(biped, 30, 0)
    lost = {signal: original[signal].copy() for signal in ("joint_positions", "joint_velocities")}
    for values in lost.values():
        values[steps, 2] = np.nan
    original = Behaviour(original.names, original.time, {**original.signals, **lost})
    path = tmp_path / f"t.{form}"
    export(path, original)
    text = suggest(path, biped, "biped.xml", with_timestep=True)
    again = import_recording(path, parse_mapping(text, "MAP.toml"), biped).behaviour

    assert ('right_hip_x = "none"  # CHECK' in text) == (steps == slice(None))
    for signal in SIGNALS:
        np.testing.assert_array_equal(again[signal], original[signal])
