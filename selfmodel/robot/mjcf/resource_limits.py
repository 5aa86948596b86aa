"""Limits of the memory and time that a model in a log may require."""

from collections.abc import Mapping
from types import MappingProxyType

MAX_MODEL_SIZE = 2 * 2**20
"""Largest MJCF text, in characters, or in bytes before it is decoded; the package's own have under
10,000. A mesh point in the text takes six characters, and MuJoCo some ten seconds for the convex
hull of a million points."""

MAX_ASSET_BYTES = 4 * 2**20
"""Largest sum of all files that a model names, counted once per mention, in bytes; the reason is
that of ``MAX_MODEL_SIZE``."""

MAX_ELEMENTS = 20_000
"""Largest number of XML elements of a model."""

MAX_DEPTH = 200
"""Largest number of XML elements within each other."""

MAX_ARRAY_ENTRIES = 2**23
"""Largest sum of pixels, heights and numbers whose counts a model contains."""

MAX_USER_NUMBERS = 100
"""Largest number of values of a ``user`` attribute; MuJoCo gives every element as many values as
the longest attribute has."""

REFUSED_ELEMENTS: Mapping[str, str] = MappingProxyType(
    {
        "include": "reads another file",
        "attach": "reads another model",
        "model": "reads another model",
        "plugin": "runs other code",
        "extension": "runs other code",
        "replicate": "makes any number of bodies",
        "composite": "makes any number of bodies",
        "flexcomp": "makes any number of bodies",
        "muscle": "is simulated, for any time, while the model is loaded",
        "lengthrange": "has actuators simulated, for any time, while the model is loaded",
    }
)
"""Elements that a model in a log may not have, and their effects."""

MAX_COUNTS: Mapping[str, int] = MappingProxyType(
    {"joint": 1000, "freejoint": 1000, "actuator": 1000, "key": 100}
)
"""Largest number of elements whose memory or time grows with the square of their number, by tag."""

MAX_VALUES: Mapping[str, float] = MappingProxyType(
    {
        **dict.fromkeys(("width", "height", "nrow", "ncol"), 8192),
        **dict.fromkeys(("dim", "num", "nsample", "maxhullvert", "njmax", "nconmax"), 10_000),
        **dict.fromkeys(("nuserdata", "nstack"), 10**6),
        **dict.fromkeys(("nkey", "actdim", "cellcount"), 100),
        **dict.fromkeys(("offwidth", "offheight", "shadowsize"), 16_384),
        **dict.fromkeys(("numslices", "numstacks", "numquads", "offsamples"), 1000),
        **dict.fromkeys(
            (
                *("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations"),
                *("sdf_iterations", "sdf_initpoints"),
            ),
            10_000,
        ),
    }
)
"""Largest values of the attributes that set memory or time, by attribute."""

ENTRIES_PER_UNIT: Mapping[str, int] = MappingProxyType(
    {
        **dict.fromkeys(("width", "height", "nrow", "ncol", "dim", "actdim", "nuserdata"), 1),
        "num": 32,  # numbers per contact of a contact sensor
        "nsample": 64,  # numbers per sample of a sensor history
    }
)
"""Factors of the attributes that count towards ``MAX_ARRAY_ENTRIES``: the array entries of an
element are the product of its scaled attributes."""
