"""MJCF files of others that packages carry."""

from importlib.util import find_spec
from pathlib import Path


def assets(package: str, *folders: str) -> Path:
    """Returns a folder of an installed package, which is not imported."""
    found = find_spec(package)
    assert found is not None, f"{package} is not installed: pip install --group dev"
    assert found.origin is not None
    return Path(found.origin).parent.joinpath(*folders)


GYMNASIUM = ("ant", "half_cheetah", "hopper", "humanoid", "swimmer", "walker2d")
DM_CONTROL = ("cheetah", "fish", "hopper", "humanoid", "humanoid_CMU", "walker")
SAMPLES: dict[str, Path] = {
    f"gymnasium {name}": assets("gymnasium", "envs", "mujoco", "assets", f"{name}.xml")
    for name in GYMNASIUM
} | {f"dm_control {name}": assets("dm_control", "suite", f"{name}.xml") for name in DM_CONTROL}
"""By package and name."""
