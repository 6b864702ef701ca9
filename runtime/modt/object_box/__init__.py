"""Boxes of whole objects, whatever part of them a frame shows (docs/object-boxes.md)."""
