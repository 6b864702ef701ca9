"""Installation of the service, and proofs of it."""
