"""Parquet files: damaged bytes."""

from functools import partial

from tests.fuzz.mutate import data
from tests.fuzz.table_checks import tables
from tests.fuzz.target import Target

TARGET = Target("tables-parquet", 4, partial(tables, "parquet", data.mutated))
