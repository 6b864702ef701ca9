"""Box features of crops, computed as those of proposals at run time."""

from __future__ import annotations

import numpy as np

from modt.classification.box_classifier import box_features
from modt.classification.crops import Crops
from modt.geometry import upright_boxes
from modt.segmentation.groups import HEADINGS, Groups, best_headings
from modt.segmentation.segmenter import SIDE_NOISE_M
from modt.types import Float64, Int
from tools.train.dataset import Dataset, Sensors

CHUNK = 2000
"""Crops processed at a time."""


def crop_features(crops: Crops, sensors: Sensors) -> Float64:
    """(R, 7) features of the boxes fitted to crops."""
    x, y, z = crops.xyz.astype(np.float32).T
    groups = Groups(np.arange(len(x)), crops.offsets)
    heading = best_headings(x, y, groups, len(x), SIDE_NOISE_M)
    box = upright_boxes(np.stack([x, y, z]), groups.offsets, HEADINGS[heading])
    return box_features(crops.count, box, sensors.ground_z_m, sensors.beam_sr)


def dataset_features(data: Dataset, rows: Int) -> Float64:
    """(R, 7) features of rows of a data set, without augmentation."""
    chunks = np.split(rows, np.arange(CHUNK, len(rows), CHUNK))
    return np.concatenate([crop_features(data.take(part), data.sensors.take(part)) for part in chunks])
