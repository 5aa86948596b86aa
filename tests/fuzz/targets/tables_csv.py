"""CSV files: other fields, separators and characters."""

from functools import partial

from tests.fuzz.mutate import csvs
from tests.fuzz.table_checks import tables
from tests.fuzz.target import Target

TARGET = Target("tables-csv", 4, partial(tables, "csv", csvs.mutated))
