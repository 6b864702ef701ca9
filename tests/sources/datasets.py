"""Small scenes of nuScenes and logs of Argoverse 2, written as their documentation lays them out."""

import json
from dataclasses import dataclass

import numpy as np

MOUNT_M = (0.94, 0.0, 1.84)
"""Place of nuScenes' sensor on the vehicle."""
SENSOR_TURN = (0.70710678118, 0.0, 0.0, -0.70710678118)
"""nuScenes' sensor looks along the vehicle's x with its y axis: turned by -90 degrees, as quaternion w, x, y, z."""
BEGAN_US = 1_532_402_927_647_951


def turned(yaw):
    """Quaternion w, x, y, z of a turn about z."""
    return [float(np.cos(yaw / 2)), 0.0, 0.0, float(np.sin(yaw / 2))]


@dataclass(frozen=True)
class Box:
    """An object in the frame of the poses: instance, category, attributes, centre, l, w, h [m], yaw [rad]."""

    instance: str
    category: str
    centre: tuple
    size: tuple = (4.0, 2.0, 1.5)
    yaw: float = 0.0
    attributes: tuple = ()
    points: int = 30


@dataclass(frozen=True)
class Sweep:
    """A sweep: time since the first [us], points (x forward, y left, z up, intensity to 255), vehicle, boxes.

    `vehicle` is x, y and yaw in the frame of the poses; `boxes` are None but for key frames.
    """

    time_us: int
    points: np.ndarray
    vehicle: tuple = (0.0, 0.0, 0.0)
    boxes: tuple | None = ()


def write_nuscenes(root, scenes, version="v1.0-mini"):
    """Write scenes, lists of sweeps by name; returns the root."""
    tables = {name: [] for name in (
        *("scene", "sample", "sample_data", "ego_pose", "calibrated_sensor", "sensor", "sample_annotation"),
        *("instance", "category", "attribute", "visibility", "log", "map"),
    )}  # fmt: skip
    tables["sensor"] = [
        {"token": "top", "channel": "LIDAR_TOP", "modality": "lidar"},
        {"token": "front", "channel": "CAM_FRONT", "modality": "camera"},
    ]
    tables["visibility"] = [{"token": "4", "level": "v80-100", "description": ""}]
    tables["log"] = [{"token": "log", "logfile": "", "vehicle": "n015", "date_captured": "", "location": "x"}]
    tables["map"] = [{"token": "map", "log_tokens": ["log"], "category": "semantic_prior", "filename": "maps/a.png"}]
    for name, sweeps in scenes.items():
        _write_scene(root, tables, name, sweeps)
    folder = root / version
    folder.mkdir(parents=True)
    (root / "maps").mkdir(exist_ok=True)
    (root / "maps" / "a.png").touch()
    for name, rows in tables.items():
        (folder / f"{name}.json").write_text(json.dumps(rows))
    return root


def _write_scene(root, tables, name, sweeps):
    place = {"translation": list(MOUNT_M), "rotation": list(SENSOR_TURN), "camera_intrinsic": []}
    tables["calibrated_sensor"].append({"token": f"{name}-mount", "sensor_token": "top", **place})
    tables["calibrated_sensor"].append({"token": f"{name}-camera", "sensor_token": "front", **place})
    samples = [f"{name}-{k}" for k, sweep in enumerate(sweeps) if sweep.boxes is not None]
    of_instance = {}
    sample = samples[0]
    for k, sweep in enumerate(sweeps):
        x, y, yaw = sweep.vehicle
        key = sweep.boxes is not None
        sample = f"{name}-{k}" if key else sample
        time_us = BEGAN_US + sweep.time_us
        kind = "samples" if key else "sweeps"
        file = f"{kind}/LIDAR_TOP/n015-2018-07-24-11-22-45+0800__LIDAR_TOP__{time_us}.pcd.bin"
        (root / kind / "LIDAR_TOP").mkdir(parents=True, exist_ok=True)
        table = np.zeros((len(sweep.points), 5), np.float32)
        table[:, 0] = -sweep.points[:, 1]
        table[:, 1] = sweep.points[:, 0]
        table[:, 2:4] = sweep.points[:, 2:4]
        table.tofile(root / file)
        token = f"{name}-data-{k}"
        tables["ego_pose"].append(
            {"token": token, "timestamp": time_us, "translation": [x, y, 0.0], "rotation": turned(yaw)}
        )
        row = {"sample_token": sample, "ego_pose_token": token, "timestamp": time_us, "is_key_frame": key}
        row |= {"fileformat": "pcd", "height": 0, "width": 0, "prev": "", "next": ""}
        tables["sample_data"].append(
            {"token": token, "calibrated_sensor_token": f"{name}-mount", "filename": file, **row}
        )
        camera = {"token": f"{token}-camera", "calibrated_sensor_token": f"{name}-camera", "filename": "a.jpg"}
        tables["sample_data"].append({**row, **camera})
        if not key:
            continue
        at = samples.index(sample)
        around = {"prev": samples[at - 1] if at else "", "next": samples[at + 1] if at + 1 < len(samples) else ""}
        tables["sample"].append({"token": sample, "timestamp": time_us, "scene_token": name, **around})
        for n, box in enumerate(sweep.boxes):
            _write_box(tables, f"{sample}-{n}", sample, f"{name}-{box.instance}", box, of_instance)
    scene = {"token": name, "name": name, "log_token": "log", "nbr_samples": len(samples), "description": ""}
    tables["scene"].append({**scene, "first_sample_token": samples[0], "last_sample_token": samples[-1]})


def _write_box(tables, token, sample, instance, box, of_instance):
    for names, table in (((box.category,), "category"), (box.attributes, "attribute")):
        known = [row["name"] for row in tables[table]]
        tables[table] += [{"token": n, "name": n, "description": ""} for n in names if n not in known]
    before = of_instance.get(instance)
    if before is None:
        row = {"token": instance, "category_token": box.category, "nbr_annotations": 1}
        tables["instance"].append({**row, "first_annotation_token": token, "last_annotation_token": token})
    else:
        before["next"] = token
        row = next(row for row in tables["instance"] if row["token"] == instance)
        row["last_annotation_token"] = token
    length, width, height = box.size
    row = {
        "token": token,
        "sample_token": sample,
        "instance_token": instance,
        "visibility_token": "4",
        "attribute_tokens": list(box.attributes),
        "translation": list(box.centre),
        "size": [width, length, height],
        "rotation": turned(box.yaw),
        "prev": before["token"] if before else "",
        "next": "",
        "num_lidar_pts": box.points,
        "num_radar_pts": 0,
    }
    tables["sample_annotation"].append(row)
    of_instance[instance] = row


def write_argoverse(log, sweeps):
    """Write a log; boxes of a sweep have the vehicle's frame."""
    import pyarrow as pa
    from pyarrow import feather

    folder = log / "sensors" / "lidar"
    folder.mkdir(parents=True)
    (log / "calibration").mkdir()
    names = ("qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m")

    def placed(rows):
        return {name: [row[k] for row in rows] for k, name in enumerate(names)}

    times_ns = [315_966_265_259_836_000 + 1000 * sweep.time_us for sweep in sweeps]
    for time_ns, sweep in zip(times_ns, sweeps, strict=True):
        points = sweep.points[:, :3] + [1.35, 0.0, 1.64]
        columns = {name: points[:, k].astype(np.float16) for k, name in enumerate("xyz")}
        columns["intensity"] = sweep.points[:, 3].astype(np.uint8)
        columns["laser_number"] = np.zeros(len(points), np.uint8)
        columns["offset_ns"] = np.zeros(len(points), np.int32)
        feather.write_feather(pa.table(columns), folder / f"{time_ns}.feather")
    poses = [(*turned(yaw), x, y, 0.0) for x, y, yaw in (sweep.vehicle for sweep in sweeps)]
    feather.write_feather(pa.table({"timestamp_ns": times_ns, **placed(poses)}), log / "city_SE3_egovehicle.feather")
    mounts = {"sensor_name": ["ring_front_center", "up_lidar", "down_lidar"]}
    mounts |= placed([(1.0, 0, 0, 0, 9, 9, 9), (1.0, 0, 0, 0, 1.35, 0, 1.64), (0, 1.0, 0, 0, 1.35, 0, 1.5)])
    feather.write_feather(pa.table(mounts), log / "calibration" / "egovehicle_SE3_sensor.feather")
    rows = [(time_ns, box) for time_ns, sweep in zip(times_ns, sweeps, strict=True) for box in sweep.boxes or ()]
    table = {
        "timestamp_ns": [time_ns for time_ns, _ in rows],
        "track_uuid": [box.instance for _, box in rows],
        "category": [box.category for _, box in rows],
        **{f"{name}_m": [box.size[k] for _, box in rows] for k, name in enumerate(("length", "width", "height"))},
        **placed([(*turned(box.yaw), *box.centre) for _, box in rows]),
        "num_interior_pts": [box.points for _, box in rows],
    }
    feather.write_feather(pa.table(table), log / "annotations.feather")
    return log
