"""``selfmodel suite``: studies of the bodies of dm_control's suite and of MJCF and URDF files."""

from selfmodel.cli.lazy import group

app = group(
    "suite",
    "Fail and recover the bodies of dm_control's suite, selfmodel's robots and your own.",
    {
        "list": ("selfmodel.cli.studies:list_bodies", "List the domains and their cases."),
        "run": ("selfmodel.cli.studies:run_suite", "Run a study: bodies x cases x seeds."),
    },
)
