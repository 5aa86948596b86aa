"""Tables of the usual dialects and types are read, exported and imported; damage has its place."""

import datetime as dt
import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from selfmodel.arrays import frozen
from selfmodel.errors import InputError
from selfmodel.logs.recordings import tables
from selfmodel.logs.recordings.recording import TABLE, Series
from selfmodel.logs.recordings.suggest import suggest
from selfmodel.logs.recordings.tables import export, read_table
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory
from tests.logs.recordings.conftest import imported
from tests.logs.recordings.table_files import MAPPING, WRITERS, columns, write_csv, write_npz

START = 1_700_000_000_123_456_789


def table(path: Path, *wanted: str, time: str = "") -> Series:
    return read_table(path, wanted, time=time).series[TABLE]


def column(path: Path, name: str) -> np.ndarray:
    return table(path, name).columns[name].values[:, 0]


@pytest.mark.process
def test_a_table_is_read_in_a_child_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delattr(tables, "read_in_child")  # of this process

    assert column(written(tmp_path, "time,q\n0,1.5"), "q").tolist() == [1.5]


def written(folder: Path, text: str | bytes) -> Path:
    path = folder / "t.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


@pytest.mark.parametrize(
    "text",
    [
        "time,q\n0,1.5\n1,-2e3\n2,NaN\n3,True",
        "time;q\n0;1,5\n1;-2e3\n2;\n3;1",
        "time\tq\r\n0\t1.5\r\n1\t-2e3\r\n2\tnull\r\n3\ttrue\r\n",
        '\ufeff"time","q"\n"0","1.5"\n"1","-2e3"\n"2","n/a"\n"3","1"\n',
        "# time, q\n0, 1.5\n\n1, -2e3\n2, -\n3, 1",
        "time q\n0 1.5\n1 -2e3\n2 nan\n3 1\n",
        "note,time,q\nwalk,0,1.5\nstand,1,-2e3\n,2,none\n,3,1",
    ],
)
def test_the_usual_dialects_of_csv_are_the_same_table(text: str, tmp_path: Path):
    series = table(written(tmp_path, text), "q")

    assert [name for name in series.names if name != "note"] == ["time", "q"]
    np.testing.assert_array_equal(series.columns["q"].values[:, 0], [1.5, -2000.0, np.nan, 1.0])


@pytest.mark.parametrize(
    ("texts", "expected"),
    [
        (["1700000000123456789", "1700000000123456790"], [0, 1]),
        (["2023-11-14 22:13:20.123456789", "", "2023-11-14T22:13:21+00:00"], [0, 876543211]),
    ],
)
def test_times_in_a_csv_file_are_whole_nanoseconds(texts: list, expected: list, tmp_path: Path):
    path = written(tmp_path, "t,q\n" + "".join(f"{text},1\n" for text in texts))

    assert table(path, time="t").logged.tolist() == [START + k for k in expected]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("# of a robot\ntime,q\n0,1\n", "line 2: "),
        ("1,2\n3,4\n", "line 1: "),
        ("time,q\n0,1\n1\n", "line 3: expected 2 fields, .*got 1"),
        ("time,q\n0,1\n\n1,x\n", r"line 4, column 2 \(q\): .*'x'"),
        ("time;q\n0;1.000,5\n", r"line 2, column 2 \(q\): .*'1.000,5'"),
        ("time,q\n2026-13-01 00:00:00,1", r"line 2, column 1 \(time\): .*'2026"),
        ("time,q,q\n0,1,2\n", "2 columns are called 'q'"),
        ('time,q\n0,"1\n', "line 2: .*unexpected end of data"),
        (b"time,q\n0,\xff\n", "UTF-8"),
    ],
)
def test_an_error_in_a_csv_file_has_its_line_and_column(
    text: str | bytes, message: str, tmp_path: Path
):
    with pytest.raises(InputError, match=message):
        table(written(tmp_path, text), "q", time="time")


def test_matrices_of_npz_are_columns_with_labels_and_nothing_is_unpickled(tmp_path: Path):
    path = tmp_path / "t.npz"
    dates = np.array(["2026-01-01T00:00:00.5", "NaT", "NaT"], dtype="datetime64[ms]")
    q, objects = np.arange(6.0).reshape(3, 2), np.array([{"a": 1}, print], dtype=object)
    np.savez(path, t=dates, joint_names=["a", "b"], q=q, w=np.zeros((3, 3)), by=objects)

    assert table(path).names == ("t", "q.a", "q.b", "w.0", "w.1", "w.2")
    assert column(path, "q.b").tolist() == [1, 3, 5]
    assert table(path, time="t").logged.tolist() == [1767225600_500_000_000]


def test_numbers_of_every_type_of_parquet_are_columns_and_missing_ones_are_nan(tmp_path: Path):
    path = tmp_path / "t.parquet"
    when = dt.datetime(2026, 1, 1, tzinfo=dt.UTC)
    content = {
        "t": pa.array([when, None], pa.timestamp("us", "UTC")),
        "f": pa.array([1.5, None], pa.float32()),
        "i": pa.array([1, None], pa.int8()),
        "b": pa.array([True, None]),
        "text": ["a", "b"],
    }
    pq.write_table(pa.table(content), path)

    assert table(path).names == ("t", "f", "i", "b")
    assert table(path, time="t").logged.tolist() == [round(when.timestamp()) * 10**9]
    for name, first in (("f", 1.5), ("i", 1.0), ("b", 1.0)):
        np.testing.assert_array_equal(column(path, name), [first, np.nan])


# ---------------------------------------------------------------- import


@pytest.mark.parametrize("form", WRITERS)
def test_columns_become_signals_in_the_models_units_and_signs(
    form: str, biped: Robot, tmp_path: Path
):
    found = columns()
    recording = imported(WRITERS[form](tmp_path / f"t.{form}", found), biped, MAPPING)
    signals = recording.trajectory

    assert (signals.steps, recording.clock) == (20, "column")
    np.testing.assert_array_equal(signals["joint_positions"][:, 1], 0.1 - found["q_1"][::2])
    np.testing.assert_array_equal(signals["joint_velocities"][:, 1], -found["qd_1"][::2])
    assert np.isnan(signals["joint_velocities"][:, 0]).all()
    np.testing.assert_array_equal(signals["commands"][:, 2], found["cmd_2"][::2])
    assert np.allclose(signals["base_position"][-1], [0.19, 0.19, 2.19])
    assert signals["sensors"][:, 0].tolist() == ([0.0] * 5 + [1.0] * 5) * 2
    assert recording.qualities["table"].rate == pytest.approx(200)


@pytest.mark.parametrize(
    ("unit", "times"),
    [
        ("s", columns()["time"] + 1.7e9),
        ("ms", np.arange(40) * 5),
        ("ns", np.arange(40) * 5_000_000 + START),
    ],
)
def test_times_may_be_absolute_or_relative_in_any_unit(
    unit: str, times: np.ndarray, biped: Robot, tmp_path: Path
):
    path = write_csv(tmp_path / "t.csv", {**columns(), "time": times})
    recording = imported(path, biped, MAPPING.replace('unit = "s"', f'unit = "{unit}"'))

    assert recording.trajectory.steps == 20
    assert unit != "ns" or recording.origin == START


def test_degrees_and_velocities_in_the_world_are_converted(biped: Robot, tmp_path: Path):
    found = columns()
    half = math.sqrt(0.5)
    base = {"w": half, "x": 0.0, "y": 0.0, "z": half}
    found |= {f"quat_{axis}": np.full(40, value) for axis, value in base.items()}
    found |= {f"vel_{axis}": np.full(40, float(k)) for k, axis in enumerate("xyz")}
    text = MAPPING.replace('[joints]\nunit = "rad"', '[joints]\nunit = "deg"').replace(
        'unit = "mm"',
        'unit = "m"\norientation = ["quat_w", "quat_x", "quat_y", "quat_z"]\n'
        'linear_velocity = ["vel_x", "vel_y", "vel_z"]\nvelocity_frame = "world"',
    )
    text = text.replace("[commands]\n", '[joints.efforts]\nleft_hip_y = "cmd_1"\n\n[commands]\n')
    path = write_npz(tmp_path / "t.npz", found)
    signals = imported(path, biped, text).trajectory
    of_base = imported(path, biped, text.replace('velocity_frame = "world"', "")).trajectory

    assert np.allclose(signals["joint_positions"][:, 0], np.deg2rad(found["q_0"][::2]))
    # The heading at the start, +y, is turned to +x: so is the velocity.
    assert np.allclose(signals["base_linear_velocity"][0], [1.0, 0.0, 2.0])
    # There, the axes of the base are those of the world.
    assert np.allclose(of_base["base_linear_velocity"][0], [0.0, 1.0, 2.0])
    # A torque has the sign of its angle.
    np.testing.assert_array_equal(signals["joint_efforts"][:, 1], -found["cmd_1"][::2])


def test_rows_are_sorted_and_those_without_a_time_or_number_are_left_out(
    biped: Robot, tmp_path: Path
):
    found = columns()
    order = np.r_[20:40, 0:20, 5]
    twice = {name: values[order].copy() for name, values in found.items()}
    twice["q_0"][-1] = 9.0  # the first of equal times is kept
    twice["time"][27] = np.nan
    twice["q_2"][:4] = np.nan, np.inf, 1e300, np.nan
    recording = imported(write_csv(tmp_path / "t.csv", twice), biped, MAPPING)
    positions = recording.trajectory["joint_positions"]

    np.testing.assert_array_equal(positions[:, 0], found["q_0"][::2])
    assert np.flatnonzero(np.isnan(positions[:, 2])).tolist() == [10, 11]
    assert recording.qualities["table"].refused == {"without a time": 1}
    sentences = " ".join(recording.notes)
    infinite = "table: numbers left out, as they are infinite or above 1e+12: 2 of q_2"
    for part in ("1 without a time", "out of order", "1 with a stamp that another has", infinite):
        assert part in sentences


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("q_3", "q_9"), "MAP.toml:14: unknown column of the table 'q_9': did you mean q_"),
        (('left_hip_y = "qd_1"', 'knee = "qd_1"'), "unknown hinge of the robot 'knee'"),
        (('"base_pos_x", ', ""), "position must be a list of length 3"),
        (('[time]\ncolumn = "time"\nunit = "s"', ""), r"a table needs \[time\]"),
        (('unit = "s"', 'unit = "min"'), "unknown unit 'min'"),
        (
            ("[commands]\n", '[commands]\ntopic = "/x"\n'),
            "MAP.toml:19: topic is a key of the mapping of a bag",
        ),
        (("[time]\n", 'clock = "log"\n\n[time]\n'), "clock is a key of the mapping of a bag"),
        (('column = "left_force"\n', ""), r"\[touch.left_touch\] needs column"),
        (('column = "left_force"', 'column = "short"'), "expected 40 rows in short, as in time"),
        (('column = "time"', 'column = "late"'), "in row 1: check the unit in"),
    ],
)
def test_an_error_of_the_mapping_is_named(
    change: tuple[str, str], message: str, biped: Robot, tmp_path: Path
):
    more = {"short": np.zeros(39), "late": columns()["time"] + 5e9}
    path = write_npz(tmp_path / "t.npz", {**columns(), **more})
    assert change[0] in MAPPING

    with pytest.raises(InputError, match=message):
        imported(path, biped, MAPPING.replace(*change))


# ---------------------------------------------------------------- export


def trajectory(robot: Robot, steps: int, share: float) -> Trajectory:
    """Random signals, of which a share of the base, the velocities and the readings is missing."""
    rng = np.random.default_rng(steps)
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
    return Trajectory(names, frozen(time), {s: frozen(found[s]) for s in SIGNALS})


@pytest.mark.parametrize("lost", ["no encoder", "never", "midway"])
@pytest.mark.parametrize("form", WRITERS)
def test_an_export_is_imported_to_the_bit(form: str, lost: str, biped: Robot, tmp_path: Path):
    original = trajectory(biped, {"never": 30, "midway": 40, "no encoder": 5}[lost], 0.2)
    if lost != "no encoder":
        for signal in ("joint_positions", "joint_velocities"):
            values = original[signal].copy()
            values[{"never": 0, "midway": 12}[lost] :, 2] = np.nan
            original = Trajectory(
                original.names, original.time, {**original.signals, signal: values}
            )
    path = tmp_path / f"t.{form}"
    names = export(path, original)
    text = suggest(path, biped, "biped.xml", with_timestep=True)
    again = imported(path, biped, text).trajectory

    assert names == table(path).names
    assert "effort.left_hip_y" not in names  # never observed
    assert ('right_hip_x = "none"  # CHECK' in text) == (lost == "never")
    assert again.time.tobytes() == original.time.tobytes()
    for signal in SIGNALS:
        known = np.isfinite(original[signal])
        np.testing.assert_array_equal(np.isfinite(again[signal]), known, err_msg=signal)
        assert original[signal][known].tobytes() == again[signal][known].tobytes(), signal
    with pytest.raises(InputError, match=r"exists, and is not overwritten"):
        export(path, original)
    with pytest.raises(InputError, match=r"expected a file that ends in \.csv, \.npz, \.parquet"):
        export(tmp_path / "t.xlsx", original)
