"""The targets of the campaign, one file each."""

from tests.fuzz.target import Target
from tests.fuzz.targets import (
    bags_mcap,
    bags_ros1,
    bags_sqlite,
    command_line,
    controllers,
    damaged_logs,
    journals,
    mappings,
    mjcf_files,
    reports,
    sealed_logs,
    settings,
    study_folders,
    tables_csv,
    tables_npz,
    tables_parquet,
    urdf_files,
)

TARGETS: dict[str, Target] = {
    module.TARGET.name: module.TARGET
    for module in (
        damaged_logs,
        sealed_logs,
        bags_mcap,
        bags_sqlite,
        bags_ros1,
        tables_csv,
        tables_npz,
        tables_parquet,
        mappings,
        mjcf_files,
        urdf_files,
        controllers,
        journals,
        reports,
        study_folders,
        settings,
        command_line,
    )
}
"""Targets by name."""
