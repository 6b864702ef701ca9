"""Topics and domains by address."""

import pytest

from modt.address import parse_address
from modt.errors import MisuseError
from modt.ros2.address import domain_of, topic_of
from modt.schemes import SENSORS, open_sensor


@pytest.mark.parametrize("text", ["ros2:///Lidar/points?domain=3", "ros2://Lidar/points?domain=3"])
def test_a_topic_is_named_after_two_slashes_or_three(text):
    address = parse_address(text, SENSORS)
    assert (topic_of(address), domain_of(address)) == ("Lidar/points", 3)


def test_the_environment_states_the_domain_where_the_address_does_not(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "17")
    assert domain_of(parse_address("ros2:///points", SENSORS)) == 17
    assert domain_of(parse_address("ros2:///points?domain=0", SENSORS)) == 0
    monkeypatch.delenv("ROS_DOMAIN_ID")
    assert domain_of(parse_address("ros2:///points", SENSORS)) == 0


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        *((f"ros2:///points?domain={domain}", "from 0 to 232") for domain in ("-1", "233", "x", "²")),
        ("ros2://?domain=3", "names no topic"),
        ("ros2:///points?reliability=perfect", "reliability 'perfect' is unknown"),
    ],
)
def test_an_invalid_address_of_a_topic_is_refused(text, cause):
    pytest.importorskip("cyclonedds")
    with pytest.raises(MisuseError, match=cause):
        open_sensor(text)
