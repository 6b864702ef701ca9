"""Names of labels by data set, and the class and role of each; other names are an error, not an empty evaluation."""

from __future__ import annotations

from modt.classes import ObjectClass
from modt_evaluation.truth import KITTI_TYPES, PANDASET_TYPES, Role, Types

BACKGROUND = (ObjectClass.BACKGROUND, Role.COUNTED)
"""Judged for segmentation alone."""
CAR = (ObjectClass.CAR, Role.COUNTED)
LARGE_VEHICLE = (ObjectClass.CAR, Role.NEUTRAL)
PEDESTRIAN = (ObjectClass.PEDESTRIAN, Role.COUNTED)
CARRIED = (ObjectClass.PEDESTRIAN, Role.NEUTRAL)
CYCLIST = (ObjectClass.CYCLIST, Role.COUNTED)
WITHOUT_RIDER = ".without_rider"
"""Suffix of the types of nuScenes' bicycles and motorcycles that nobody rides."""


def _types(**names_of: str) -> dict[str, tuple[ObjectClass, Role]]:
    """Types by the name of a role here; each value lists names, separated by `, `."""
    return {name: globals()[role] for role, names in names_of.items() for name in names.split(", ")}


KITTI_NAMES: Types = {**_types(BACKGROUND="Truck, Tram, Misc, DontCare"), **KITTI_TYPES}
NUSCENES_TYPES: Types = _types(
    CAR="vehicle.car",
    LARGE_VEHICLE="vehicle.truck, vehicle.trailer, vehicle.construction, vehicle.bus.bendy, vehicle.bus.rigid, "
    "vehicle.emergency.ambulance, vehicle.emergency.police",
    PEDESTRIAN="human.pedestrian.adult, human.pedestrian.child, human.pedestrian.construction_worker, "
    "human.pedestrian.police_officer",
    CARRIED="human.pedestrian.personal_mobility, human.pedestrian.stroller, human.pedestrian.wheelchair",
    CYCLIST="vehicle.bicycle, vehicle.motorcycle",
    BACKGROUND="vehicle.bicycle.without_rider, vehicle.motorcycle.without_rider, vehicle.ego, animal, "
    "movable_object.barrier, movable_object.debris, movable_object.pushable_pullable, movable_object.trafficcone, "
    "static_object.bicycle_rack, static.manmade, static.other, static.vegetation, noise, flat.driveable_surface, "
    "flat.other, flat.sidewalk, flat.terrain",
)
ARGOVERSE_TYPES: Types = _types(
    CAR="REGULAR_VEHICLE",
    LARGE_VEHICLE="LARGE_VEHICLE, BUS, BOX_TRUCK, TRUCK, TRUCK_CAB, SCHOOL_BUS, ARTICULATED_BUS, VEHICULAR_TRAILER, "
    "MESSAGE_BOARD_TRAILER, RAILED_VEHICLE, TRAFFIC_LIGHT_TRAILER",
    PEDESTRIAN="PEDESTRIAN, OFFICIAL_SIGNALER",
    CARRIED="STROLLER, WHEELCHAIR",
    CYCLIST="BICYCLIST, MOTORCYCLIST, WHEELED_RIDER",
    BACKGROUND="BICYCLE, MOTORCYCLE, WHEELED_DEVICE, DOG, ANIMAL, BOLLARD, CONSTRUCTION_BARREL, CONSTRUCTION_CONE, "
    "SIGN, STOP_SIGN, MOBILE_PEDESTRIAN_CROSSING_SIGN, MOBILE_PEDESTRIAN_SIGN",
)
OTHER_TYPES: Types = _types(
    CAR="car",
    LARGE_VEHICLE="truck, bus, trailer, construction_vehicle, Bus",
    PEDESTRIAN="pedestrian",
    CYCLIST="cyclist, Rider",
    BACKGROUND="background, bicycle, motorcycle, barrier, traffic_cone, Static, Motor, ParkedBicycle, "
    "ParkedMotorcycle, TYPE_SIGN, TYPE_UNKNOWN, Unknown, Other",
)
"""Names of benchmarks, of Waymo and of our own tables."""
PANDASET_BACKGROUND = _types(
    BACKGROUND="Bicycle, Motorized Scooter, Personal Mobility Device, Animals - Bird, Animals - Other, "
    "Construction Signs, Cones, Emergency Vehicle, Other Vehicle - Pedicab, Other Vehicle - Uncommon, Pylons, "
    "Road Barriers, Rolling Containers, Signs, Temporary Construction Barriers, Train, Tram / Subway, Trolley"
)
CUBOID_TYPES: dict[str, tuple[ObjectClass, Role]] = {
    **KITTI_NAMES,
    **OTHER_TYPES,
    **NUSCENES_TYPES,
    **ARGOVERSE_TYPES,
    **PANDASET_BACKGROUND,
    **PANDASET_TYPES,
}
CUBOID_TYPES |= {name.replace(" ", "_"): role for name, role in CUBOID_TYPES.items()}
"""Names in tables of cuboids, which may come from any data set."""
