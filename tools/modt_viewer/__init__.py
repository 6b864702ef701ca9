"""Pictures of recorded runs, seen from above."""
