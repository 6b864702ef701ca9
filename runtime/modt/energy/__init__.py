"""Energy accounting: ledger, meters, attribution, reconciliation."""
