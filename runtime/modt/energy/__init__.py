"""Energy accounting: ledger, meters, attribution, prediction."""
