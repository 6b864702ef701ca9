"""Energy accounting: ledger, meters, windows, attribution to the stages."""
