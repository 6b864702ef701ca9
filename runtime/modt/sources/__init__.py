"""Sources of frames (KITTI layouts, folders of scans, the simulator) and of poses."""
