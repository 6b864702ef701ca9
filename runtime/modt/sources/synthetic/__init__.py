"""A synthetic LiDAR world: the stream that is always there."""

from modt.sources.synthetic.stream import SyntheticStream

__all__ = ["SyntheticStream"]
