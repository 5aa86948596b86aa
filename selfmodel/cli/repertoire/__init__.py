"""``selfmodel repertoire``: files with many diverse gaits of one robot."""

from selfmodel.cli.lazy import group

app = group(
    "repertoire",
    "Make a repertoire of diverse gaits of a robot, once, before it fails.",
    {
        "make": ("selfmodel.cli.repertoire.make:make", "Search for diverse gaits, and keep them."),
        "info": ("selfmodel.cli.repertoire.info:info", "Show what a repertoire contains."),
    },
)
