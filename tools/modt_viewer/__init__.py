"""Pictures of recorded runs, seen from above."""

import logging

# Matplotlib's notes on fonts and their cache are no warnings of a run, and an error of ffmpeg is reported once.
logging.getLogger("matplotlib").setLevel(logging.ERROR)
