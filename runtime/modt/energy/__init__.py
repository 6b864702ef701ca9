"""What it costs: ledger, meters, prediction."""
