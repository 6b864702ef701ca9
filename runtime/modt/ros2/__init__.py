"""ROS 2 messages and topics without a ROS installation."""
