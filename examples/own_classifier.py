"""A classifier of your own in place of the network: docs/own-classifier.md explains it.

    python examples/own_classifier.py

The cells (`# %%`) open as a notebook in Jupyter (by Jupytext), VS Code and PyCharm.
"""

# %% A stream. For yours: modt.open("DRIVE")
import numpy as np

import modt
from modt_simulation.synthetic_stream import SyntheticStream

frames = list(SyntheticStream("street", "vlp-16", 2.0, seed=3))


# %% The classifier: likelihoods of background, car, pedestrian and cyclist, by the size of what the points show
def by_size(clouds):
    """(R, 4) likelihoods of R proposals, each with (n, 4) points."""
    length_m = np.array([2 * np.linalg.norm(xy - xy.mean(axis=0), axis=1).max() for xy in (c[:, :2] for c in clouds)])
    height_m = np.array([np.ptp(cloud[:, 2]) for cloud in clouds])
    background = np.ones(len(clouds))
    car = np.where((length_m > 2.5) & (length_m < 6.0) & (height_m < 2.0), 20.0, 0.05)
    pedestrian = np.where((length_m < 1.0) & (height_m > 1.2) & (height_m < 2.1), 20.0, 0.05)
    cyclist = np.where((length_m > 1.2) & (length_m < 2.2) & (height_m > 1.2), 5.0, 0.05)
    return np.column_stack([background, car, pedestrian, cyclist])


# %% The pipeline: segmentation, tracking, schedule and fusion are those of modt
pipeline = modt.Pipeline.from_profile("vlp-16", classifier=by_size)
for frame in frames:
    found = pipeline.step(frame).objects()
for row in found.as_dicts():
    print(row["id"], row["object_class"], f"{row['speed_mps']:.1f} m/s", f"{max(row['posterior']):.2f}")
