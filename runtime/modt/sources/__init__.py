"""Streams of frames: KITTI layouts, bare scans, the synthetic world."""
