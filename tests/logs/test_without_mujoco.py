import subprocess
import sys
from pathlib import Path

SCRIPT = """
import sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("mujoco", "dm_control", "rosbags"):
            raise ImportError(f"{name} is blocked")

sys.meta_path.insert(0, Blocker())
import selfmodel.logs
log = selfmodel.logs.read_log(sys.argv[1])
print(log.trial.trajectory.steps, selfmodel.logs.read_truth(sys.argv[1]))
"""


def test_a_log_is_read_where_there_is_no_mujoco(log: Path):
    result = subprocess.run(
        [sys.executable, "-c", SCRIPT, log], check=True, capture_output=True, text=True
    )
    assert result.stdout == "120 intact\n"
