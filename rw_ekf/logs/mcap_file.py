"""MCAP files (https://mcap.dev/spec): one that grows message by message, and what it becomes when it grows no more.

While it grows it has no chunks: every message is in the system's hands as it comes, and a reader of streams reads the
file whatever ended it. Afterwards `chunk` gives it compressed chunks, and for readers that seek an index and a summary.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

from rw_ekf.logs.atomic import atomic_path, begun_file
from rw_ekf.plain_file import write_whole
from rw_ekf.version import __version__

_LIBRARY = f"rw_ekf {__version__}"
_LARGEST = 2**31  # bytes of one record


class GrowingMcap:
    """Appends messages of JSON. Never overwrites: a file that exists is someone's data."""

    def __init__(self, path: Path, schemas: Mapping[str, tuple[str, dict[str, Any]]], about: Mapping[str, str]) -> None:
        """Make the file, with all its channels.

        schemas: by topic, a name and a JSON schema; about: metadata of the name `rw_ekf`. Raises BadInputError if it
        exists, or cannot be made.
        """
        from mcap.writer import CompressionType, IndexType, Writer

        self.path = path
        self.length = 0  # of the whole records so far [bytes]
        self._buffer = BytesIO()
        self._writer = Writer(
            self._buffer, compression=CompressionType.NONE, index_types=IndexType.NONE, use_chunking=False
        )
        self._writer.start(library=_LIBRARY)
        self._channels: dict[str, int] = {}
        self._count = 0
        for topic, (name, schema) in schemas.items():
            number = self._writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
            self._channels[topic] = self._writer.register_channel(topic, "json", number)
        self._writer.add_metadata("rw_ekf", dict(about))
        self._descriptor: int | None = None
        with begun_file(path) as self._descriptor:
            self._put()

    @property
    def removed(self) -> bool:
        """Whether the file has no name any more: nobody would ever read what is added."""
        return self._descriptor is not None and os.fstat(self._descriptor).st_nlink == 0

    def add(self, messages: list[tuple[str, dict[str, Any]]], stamp_ns: int) -> None:
        """Append messages of one time, a topic and an object each. Raises OSError; none is then in the file."""
        for topic, message in messages:
            data = json.dumps(message, allow_nan=False, separators=(",", ":")).encode()
            self._writer.add_message(self._channels[topic], stamp_ns, data, stamp_ns, self._count)
            self._count += 1
        self._put()

    def attach(self, file: Path, stamp_ns: int) -> None:
        """Append a copy of a text file. Raises OSError."""
        self._writer.add_attachment(stamp_ns, stamp_ns, file.name, "text/yaml", file.read_bytes())
        self._put()

    def close(self) -> None:
        """Onto the disk, and closed. Safe to call twice. Raises OSError."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            try:
                os.fsync(descriptor)
            finally:
                os.close(descriptor)

    def _put(self) -> None:
        """Hand over what is in the buffer."""
        data = self._buffer.getvalue()
        self._buffer.seek(0)
        self._buffer.truncate()
        if self._descriptor is None:
            raise OSError(errno.EBADF, "it is closed", str(self.path))
        write_whole(self._descriptor, data, self.length)
        self.length += len(data)


def chunk(path: Path) -> None:
    """Give a file that grows no more its chunks (zstd), index and summary; what was torn off at its end is left out.

    The old one is replaced once the new one is on the disk. Raises BadInputError where that cannot be written.
    """
    from mcap.exceptions import EndOfFile
    from mcap.records import Attachment, Channel, Message, Metadata, Schema
    from mcap.stream_reader import StreamReader
    from mcap.writer import Writer

    with atomic_path(path, follow=False) as temporary, path.open("rb") as old, temporary.open("wb") as new:
        writer = Writer(new)
        writer.start(library=_LIBRARY)
        try:
            for record in StreamReader(old, record_size_limit=_LARGEST).records:
                if isinstance(record, Schema):
                    writer.register_schema(record.name, record.encoding, record.data)
                elif isinstance(record, Channel):
                    writer.register_channel(record.topic, record.message_encoding, record.schema_id, record.metadata)
                elif isinstance(record, Message):
                    writer.add_message(
                        record.channel_id, record.log_time, record.data, record.publish_time, record.sequence
                    )
                elif isinstance(record, Metadata):
                    writer.add_metadata(record.name, record.metadata)
                elif isinstance(record, Attachment):
                    writer.add_attachment(
                        record.create_time, record.log_time, record.name, record.media_type, record.data
                    )
        except EndOfFile:
            pass  # it was not ended: it is now
        writer.finish()
