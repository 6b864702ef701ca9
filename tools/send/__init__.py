"""Tools that send recordings as a live sensor does."""
