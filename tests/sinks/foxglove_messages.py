"""Foxglove's messages, decoded by their own schemas."""

from __future__ import annotations

import json
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, json_format, message_factory


def decoded(encoding: str, schema_name: str, schema: bytes, data: bytes) -> dict[str, Any]:
    """A message as plain data, fields by their names in the schema; bytes in base 64."""
    if encoding == "json":
        return json.loads(data)
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema).file:
        pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema_name))
    return json_format.MessageToDict(kind.FromString(data), preserving_proto_field_name=True)
