"""Topics and domains by address."""

import pytest

from modt.address import parse_address
from modt.errors import MisuseError
from modt.ros2.address import domain_of, name_of, topic_of
from modt.schemes import SENSORS


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


@pytest.mark.parametrize("domain", ["-1", "233", "x", "²"])
def test_a_domain_out_of_bounds_is_refused(domain):
    with pytest.raises(MisuseError, match="from 0 to 232"):
        domain_of(parse_address(f"ros2:///points?domain={domain}", SENSORS))


def test_an_address_without_a_topic_is_refused():
    address = parse_address("ros2://", SENSORS)
    assert not name_of(address)
    with pytest.raises(MisuseError, match="names no topic"):
        topic_of(address)
