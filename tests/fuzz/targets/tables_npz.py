"""NPZ files as recordings: other arrays, headers and packing."""

from functools import partial

from tests.fuzz.mutate import npzs
from tests.fuzz.table_checks import tables
from tests.fuzz.target import Target

TARGET = Target("tables-npz", 4, partial(tables, "npz", npzs.mutated))
