"""Reader of recordings as tables: columns of numbers by name, of CSV, NPZ and Parquet files."""
