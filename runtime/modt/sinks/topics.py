"""Topics of the results, which the sinks ros2://, mcap:// and foxglove:// publish."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from modt.address import Address
from modt.ros2 import odometry, point_cloud2
from modt.sinks import clouds, diagnostics, markers, object_messages, poses
from modt.types import FrameResult, Self

# Names used if neither the address nor the input gives one
PREFIX = "modt"
FRAME_ID = "lidar"
WORLD_FRAME_ID = "world"

OBJECTS = {
    "vision": ("detections", object_messages.DETECTIONS, object_messages.detections),
    "autoware": ("tracked_objects", object_messages.TRACKED_OBJECTS, object_messages.tracked_objects),
    "nav2": ("dynamic_obstacles", object_messages.OBSTACLES, object_messages.obstacles),
}
"""Name, type and encoder of the objects for each value of the option `messages`."""


@dataclass(frozen=True)
class Topic:
    """A topic, the type of its messages, and the function that encodes a frame."""

    name: str
    type: str
    encode: Callable[[FrameResult], bytes]


@dataclass(frozen=True, kw_only=True)
class TopicOptions:
    """Choice of the topics that are published.

    Attributes:
        prefix: begins the names.
        frame_id: frame of the sensor; "" takes the frame of the input, or FRAME_ID if the input names none.
        world_frame_id: frame of the poses; "" takes WORLD_FRAME_ID, without the topic /tf.
        messages: form of the objects, a key of OBJECTS.
        background: whether they hold the background too.
        points: whether the sweep is published.
        obstacles: whether the points of obstacles and those of the ground are published.
    """

    prefix: str = PREFIX
    frame_id: str = ""
    world_frame_id: str = ""
    messages: str = "vision"
    background: bool = False
    points: bool = False
    obstacles: bool = False

    @classmethod
    def of(
        cls,
        address: Address,
        *,
        prefix: str = PREFIX,
        world_frame_id: str = "",
        points: tuple[str, str] = ("none", "all"),
    ) -> Self:
        """The options of an address. The arguments are the defaults of the kind of sink.

        Args:
            address: address of a sink.
            prefix: begins the names.
            world_frame_id: frame of the poses if the address names none; "" as in the attribute.
            points: values of the option `points`, the default first.

        Raises:
            MisuseError: an option is invalid.
        """
        return cls(
            prefix=prefix,
            frame_id=address.option("frame_id") or "",
            world_frame_id=address.option("world_frame_id") or world_frame_id,
            messages=address.choice("messages", *OBJECTS),
            background=address.choice("tracks", "objects", "all") == "all",
            points=address.choice("points", *points) == "all",
            obstacles=address.choice("obstacles", "none", "all") == "all",
        )


def topics(options: TopicOptions = TopicOptions()) -> list[Topic]:
    """The topics that are asked for."""

    def topic(name: str, kind: str, encode: Callable[..., bytes], *more: object) -> Topic:
        return Topic(name, kind, lambda r: encode(r, options.frame_id or r.frame.frame_id or FRAME_ID, *more))

    prefix = options.prefix
    name, kind, encode = OBJECTS[options.messages]
    made = [
        topic(f"/{prefix}/{name}", kind, encode, options.background),
        topic(f"/{prefix}/markers", markers.TYPE, markers.markers),
        topic(f"/{prefix}/odometry", odometry.TYPE, poses.pose, options.world_frame_id or WORLD_FRAME_ID),
        topic(f"/{prefix}/diagnostics", diagnostics.TYPE, diagnostics.diagnostics),
    ]
    if options.world_frame_id:
        made.append(topic("/tf", odometry.TF, poses.transform, options.world_frame_id))
    if options.points:
        made.append(topic(f"/{prefix}/points", point_cloud2.TYPE, clouds.cloud))
    if options.obstacles:
        made.append(topic(f"/{prefix}/obstacles", point_cloud2.TYPE, clouds.obstacle_cloud))
        made.append(topic(f"/{prefix}/ground", point_cloud2.TYPE, clouds.ground_cloud))
    return made
