"""What the tests of tables share: a table of the biped in every format, and its mapping."""

import csv
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

HINGES = ("left_hip_x", "left_hip_y", "right_hip_x", "right_hip_y")

MAPPING = """\
robot = "biped.xml"
control_timestep = 0.01

[time]
column = "time"
unit = "s"

[joints]
unit = "rad"
[joints.names]
left_hip_x = "q_0"
left_hip_y = { name = "q_1", sign = -1, offset = 0.1 }
right_hip_x = "q_2"
right_hip_y = "q_3"
[joints.velocities]
left_hip_y = "qd_1"

[commands]
unit = "rad"
[commands.names]
left_hip_x = "cmd_0"
left_hip_y = "cmd_1"
right_hip_x = "cmd_2"
right_hip_y = "cmd_3"

[base]
position = ["base_pos_x", "base_pos_y", "base_pos_z"]
unit = "mm"

[touch.left_touch]
column = "left_force"
threshold = 5.0
"""


def columns(rows: int = 40) -> dict[str, np.ndarray]:
    """Columns of a recording of the biped at 200 Hz."""
    time = np.arange(rows) * 0.005
    found = {"time": time}
    for k in range(4):
        found[f"q_{k}"] = 0.3 * np.sin(3 * time + k)
        found[f"qd_{k}"] = 0.9 * np.cos(3 * time + k)
        found[f"cmd_{k}"] = 0.2 * np.sin(4 * time + k)
    for k, axis in enumerate("xyz"):
        found[f"base_pos_{axis}"] = 1000.0 * (k + time)
    found["left_force"] = np.where(np.arange(rows) % 20 < 10, 3.0, 9.0)
    return found


def write_csv(path: Path, found: Mapping[str, np.ndarray]) -> Path:
    """Writes a CSV file."""
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(found)
        rows.writerows(zip(*[values.tolist() for values in found.values()], strict=True))
    return path


def write_npz(path: Path, found: Mapping[str, np.ndarray]) -> Path:
    """Writes an NPZ file."""
    np.savez_compressed(path, **found)
    return path


def write_parquet(path: Path, found: Mapping[str, np.ndarray]) -> Path:
    """Writes a Parquet file."""
    pq.write_table(pa.table(dict(found)), path, write_page_checksum=True)
    return path


WRITERS = {"csv": write_csv, "npz": write_npz, "parquet": write_parquet}
