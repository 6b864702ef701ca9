"""Sources of the poses of frames: the recording, a file, or another process by datagrams or a topic of ROS 2."""
