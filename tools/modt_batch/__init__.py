"""Many recordings: one task a recording and mode, one Parquet dataset, one report."""
