# SPDX-License-Identifier: MIT
"""Journals of archives written anew, with the chain of docs/archive.md made by zlib; and targets given another's number."""
import json
import zlib


def chained(lines):
    """The text of a journal of these lines, each an object without its chain."""
    text = b""
    for line in lines:
        body = {key: value for key, value in line.items() if key != "chain"}
        text += json.dumps(body, separators=(",", ":")).encode()[:-1]
        text += b',"chain":"%08x"}\n' % zlib.crc32(text)
    return text


def checksum(data):
    return {"bytes": len(data), "crc32": f"{zlib.crc32(data):08x}"}


def note_anew(take):
    """Makes the journal agree with targets that another program changed."""
    lines = [json.loads(line) for line in (take / "journal.jsonl").read_text().splitlines()]
    noted = [line | (checksum((take / line["file"]).read_bytes()) if line["event"] == "target" else {}) for line in lines]
    (take / "journal.jsonl").write_bytes(chained(noted))


def with_index(target, index):
    """A target's file with another number in its header: the name, type and size of the attribute, then four bytes."""
    mark = b"index\0int\0\4\0\0\0"
    at = target.index(mark) + len(mark)
    return target[:at] + index.to_bytes(4, "little") + target[at + 4:]
