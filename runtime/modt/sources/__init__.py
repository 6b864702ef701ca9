"""Sources of frames: KITTI's layouts, folders of scans, captures of packets, recordings of ROS 2, and live sensors."""
