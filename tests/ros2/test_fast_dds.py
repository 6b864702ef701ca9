"""Topics that are taken by Fast DDS, the default middleware of ROS 2."""

import shutil
import subprocess
import time
from pathlib import Path

import pytest

from modt.sinks.topics import OBJECTS, TopicOptions, topics
from tests.results import CAR, PEDESTRIAN, result
from tests.ros2.network import DEADLINE_S, NEAR, WIRE

pytest.importorskip("cyclonedds")
from modt.ros2 import dds

pytestmark = pytest.mark.usefixtures("loopback")
SOURCE = Path(__file__).with_name("fast_dds_subscriber.cpp")
FRAME = result(3, [5, 4], {0: 1, 1: 12}, {1: CAR, 12: PEDESTRIAN})


@pytest.fixture(scope="module")
def subscriber(tmp_path_factory):
    """The program that prints a message."""
    if not Path("/usr/include/fastdds").is_dir() or shutil.which("g++") is None:
        pytest.skip("needs Debian's libfastrtps-dev and g++")
    program = tmp_path_factory.mktemp("fast_dds") / "subscriber"
    command = ["g++", "-std=c++14", SOURCE, "-o", program, "-lfastrtps", "-lfastcdr"]
    subprocess.run(command, check=True, capture_output=True, timeout=600)
    return program


@pytest.mark.parametrize("form", OBJECTS)
def test_fast_dds_takes_the_objects(subscriber, form):
    topic = topics(TopicOptions(messages=form))[0]
    sent = topic.encode(FRAME)
    package, _, short = topic.type.partition("/")
    publication = dds.Publication(dds.participant(NEAR), topic.name, topic.type)
    arguments = [str(WIRE), f"rt{topic.name}", f"{package}::msg::dds_::{short}_", str(int(DEADLINE_S))]
    with subprocess.Popen([subscriber, *arguments], stdout=subprocess.PIPE, text=True) as process:
        while process.poll() is None:  # a volatile message is sent again until the subscriber has joined
            assert publication.write(sent)
            time.sleep(0.05)
        received = bytes.fromhex(process.stdout.read())
    assert process.returncode == 0, "nothing has arrived"
    assert received == sent
