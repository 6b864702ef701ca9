"""Trust: whether what is seen is possible, judged by slow invariants against their own history."""
