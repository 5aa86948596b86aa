"""The commands of the groups ``suite``, ``repertoire`` and ``logs``."""

from selfmodel.cli.lazy import group

suite = group(
    "suite",
    "Fail and recover the bodies of dm_control's suite, selfmodel's robots and your own.",
    {
        "list": (
            "selfmodel.cli.study_commands:ListSuite",
            "selfmodel.cli.studies:list_bodies",
            "List the domains and their cases.",
        ),
        "run": (
            "selfmodel.cli.study_commands:RunSuite",
            "selfmodel.cli.studies:run_suite",
            "Run a study: bodies x cases x seeds.",
        ),
    },
)

repertoire = group(
    "repertoire",
    "Make a repertoire of diverse gaits of a robot, once, before it fails.",
    {
        "make": (
            "selfmodel.cli.commands:MakeRepertoire",
            "selfmodel.cli.repertoire:make",
            "Search for diverse gaits, and keep them.",
        ),
        "info": (
            "selfmodel.cli.commands:RepertoireInfo",
            "selfmodel.cli.repertoire:info",
            "Show what a repertoire contains.",
        ),
    },
)

logs = group(
    "logs",
    "Inspect and verify trial logs, salvage damaged ones, import recordings, export tables.",
    {
        "info": (
            "selfmodel.cli.commands:LogInfo",
            "selfmodel.cli.logs:info",
            "Show what logs contain.",
        ),
        "verify": (
            "selfmodel.cli.commands:Verify",
            "selfmodel.cli.logs:verify",
            "Check every checksum, count and digest.",
        ),
        "salvage": (
            "selfmodel.cli.commands:SalvageLog",
            "selfmodel.cli.logs:salvage",
            "Save the good steps of a bad log.",
        ),
        "import": (
            "selfmodel.cli.commands:ImportRecording",
            "selfmodel.cli.recordings:import_",
            "Import a recording as a log.",
        ),
        "export": (
            "selfmodel.cli.commands:ExportTable",
            "selfmodel.cli.recordings:export",
            "Write a log's signals as a table.",
        ),
    },
)
