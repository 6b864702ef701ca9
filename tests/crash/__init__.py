"""Loss of power, disk or process: the records that remain."""
