"""What it costs: ledger, meters, attribution, prediction."""
