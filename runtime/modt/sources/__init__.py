"""Sources of frames: folders of scans, captures of packets, recordings of ROS 2, and live sensors."""
