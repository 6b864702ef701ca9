"""The live page of a run in a browser, and the tables and cells that it shares with pages of recorded runs."""
