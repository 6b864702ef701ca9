"""Names of labels by data set, and the class and role of each; other names are an error, not an empty evaluation."""

from __future__ import annotations

from modt.classes import ObjectClass
from modt_evaluation.truth import KITTI_TYPES, LABELLED_TYPES, PANDASET_TYPES, Role, Types

BACKGROUND = (ObjectClass.BACKGROUND, Role.COUNTED)
"""Judged for segmentation alone."""
LARGE_VEHICLE = (ObjectClass.CAR, Role.NEUTRAL)
CARRIED = (ObjectClass.PEDESTRIAN, Role.NEUTRAL)
WITHOUT_RIDER = ".without_rider"
"""Suffix of the types of nuScenes' bicycles and motorcycles that nobody rides."""


def _types(large_vehicle: str = "", carried: str = "", *, background: str) -> dict[str, tuple[int, Role]]:
    """Types of three roles, each a list of names separated by `, `, and the names of the classes."""
    roles = {LARGE_VEHICLE: large_vehicle, CARRIED: carried, BACKGROUND: background}
    types = {name: role for role, names in roles.items() for name in names.split(", ") if name}
    return types | dict(LABELLED_TYPES)


KITTI_NAMES: Types = {**dict.fromkeys(("Truck", "Tram", "Misc", "DontCare", "Forklift"), BACKGROUND), **KITTI_TYPES}
NUSCENES_TYPES = _types(
    large_vehicle="vehicle.truck, vehicle.trailer, vehicle.construction, vehicle.bus.bendy, vehicle.bus.rigid, "
    "vehicle.emergency.ambulance, vehicle.emergency.police",
    carried="human.pedestrian.personal_mobility, human.pedestrian.stroller, human.pedestrian.wheelchair",
    background="vehicle.bicycle.without_rider, vehicle.motorcycle.without_rider, vehicle.ego, animal, "
    "movable_object.barrier, movable_object.debris, movable_object.pushable_pullable, movable_object.trafficcone, "
    "static_object.bicycle_rack, static.manmade, static.other, static.vegetation, noise, flat.driveable_surface, "
    "flat.other, flat.sidewalk, flat.terrain",
)
ARGOVERSE_TYPES = _types(
    large_vehicle="LARGE_VEHICLE, BUS, BOX_TRUCK, TRUCK, TRUCK_CAB, SCHOOL_BUS, ARTICULATED_BUS, VEHICULAR_TRAILER, "
    "MESSAGE_BOARD_TRAILER, RAILED_VEHICLE, TRAFFIC_LIGHT_TRAILER",
    carried="STROLLER, WHEELCHAIR",
    background="BICYCLE, MOTORCYCLE, WHEELED_DEVICE, DOG, ANIMAL, BOLLARD, CONSTRUCTION_BARREL, CONSTRUCTION_CONE, "
    "SIGN, STOP_SIGN, MOBILE_PEDESTRIAN_CROSSING_SIGN, MOBILE_PEDESTRIAN_SIGN",
)
OTHER_TYPES = _types(
    large_vehicle="truck, bus, trailer, construction_vehicle, Bus",
    background="background, bicycle, motorcycle, barrier, traffic_cone, Static, Motor, ParkedBicycle, "
    "ParkedMotorcycle, TYPE_SIGN, TYPE_UNKNOWN, Unknown, Other",
)
"""Names of benchmarks, of Waymo and of our own tables."""
PANDASET_BACKGROUND = _types(
    background="Bicycle, Motorized Scooter, Personal Mobility Device, Animals - Bird, Animals - Other, "
    "Construction Signs, Cones, Emergency Vehicle, Other Vehicle - Pedicab, Other Vehicle - Uncommon, Pylons, "
    "Road Barriers, Rolling Containers, Signs, Temporary Construction Barriers, Train, Tram / Subway, Trolley"
)
CUBOID_TYPES: dict[str, tuple[int, Role]] = {
    **KITTI_NAMES,
    **OTHER_TYPES,
    **NUSCENES_TYPES,
    **ARGOVERSE_TYPES,
    **PANDASET_BACKGROUND,
    **PANDASET_TYPES,
}
CUBOID_TYPES |= {name.replace(" ", "_"): role for name, role in CUBOID_TYPES.items()}
"""Names in tables of cuboids, which may come from any data set."""
