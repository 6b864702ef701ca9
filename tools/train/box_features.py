"""Box features of crops, computed as those of proposals at run time."""

from __future__ import annotations

import numpy as np

from modt.classification.box_classifier import beam_solid_angle_sr, box_features
from modt.classification.crops import Crops
from modt.config import SensorConfig
from modt.config.segmentation import BoxConfig
from modt.geometry import upright_boxes
from modt.segmentation.box_fitting import fit_headings
from modt.segmentation.groups import Groups
from modt.types import Float64, Int
from tools.train.augment import Beams
from tools.train.dataset import SENSOR_HEIGHT_M, Dataset

CHUNK = 2000
"""Crops processed at a time."""


def crop_features(crops: Crops) -> Float64:
    """(R, 7) features of the boxes fitted to crops."""
    x, y, z = crops.xyz.astype(np.float32).T
    groups = Groups(np.arange(len(x)), crops.offsets)
    box = upright_boxes(np.stack([x, y, z]), groups.offsets, fit_headings(x, y, groups, BoxConfig().noise_m))
    beams = Beams()
    sensor = SensorConfig(azimuth_step_deg=beams.azimuth_deg, elevation_step_deg=beams.elevation_deg)
    return box_features(crops.count, box, SENSOR_HEIGHT_M, beam_solid_angle_sr(sensor, box))


def dataset_features(data: Dataset, rows: Int) -> Float64:
    """(R, 7) features of rows of a data set, without augmentation."""
    return np.concatenate([crop_features(data.take(rows[i : i + CHUNK])) for i in range(0, len(rows), CHUNK)])
