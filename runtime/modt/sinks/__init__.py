"""Sinks: the formats of the results, and the files, sockets and topics that they go to."""
