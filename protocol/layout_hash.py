#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Hashes the layout of wire.h (structs with field types, names and offsets; enum values; constants), so that host and
board notice when they were built from different ones. Comments, white space and the order of definitions do not count.

usage: layout_hash.py wire.h > layout_hash.h        layout_hash.py --list wire.h
"""
import hashlib
import re
import sys

SIZES = {'char': 1, 'uint8_t': 1, 'int8_t': 1, 'uint16_t': 2, 'int16_t': 2, 'uint32_t': 4, 'int32_t': 4, 'uint64_t': 8,
         'int64_t': 8}


def fields(name, structs):
    """(type, field, count, bytes of all) of a packed struct, whose members may be structs of the same header."""
    for declaration in filter(None, (part.strip() for part in structs[name].split(';'))):
        match = re.fullmatch(r'(?:struct\s+)?(\w+)\s+(\w+)(?:\s*\[\s*(\d+)\s*\])?', declaration)
        if not match or match[1] not in SIZES and match[1] not in structs:
            raise SystemExit(f'struct {name}: cannot read the field "{declaration}": use a fixed-size integer or char')
        count = int(match[3] or 1)
        one = SIZES.get(match[1]) or sum(size for *_, size in fields(match[1], structs))
        yield match[1], match[2], count, one * count


def struct_lines(name, structs):
    """The fields of a packed struct, one line each, with their byte offsets; then its size."""
    offset = 0
    lines = []
    for kind, field, count, size in fields(name, structs):
        lines.append(f'struct {name} {offset:4d} {kind} {field}[{count}]')
        offset += size
    return lines + [f'struct {name} {offset:4d} end']


def enum_lines(name, body):
    lines = []
    for enumerator in filter(None, (part.strip() for part in body.split(','))):
        match = re.fullmatch(r'(\w+)\s*=\s*(\w+)', enumerator)
        if not match:
            raise SystemExit(f'enum {name}: give "{enumerator}" an explicit number: it is part of the wire format')
        lines.append(f'enum {name} {match[1]} = {int(match[2], 0)}')
    return lines


def layout(source):
    """The layout as sorted lines of text, from the text of the header."""
    source = re.sub(r'//[^\n]*|/\*.*?\*/', ' ', source, flags=re.S)
    lines = [f'constant {name} = {int(value, 0)}'
             for name, value in re.findall(r'^#define\s+(\w+)\s+(0[xX][0-9a-fA-F]+|\d+)\s*$', source, re.M)]
    structs = dict(re.findall(r'\bstruct\s+(\w+)\s*\{(.*?)\}', source, re.S))
    for name in structs:
        lines += struct_lines(name, structs)
    for name, body in re.findall(r'\benum\s+(\w+)\s*\{(.*?)\}', source, re.S):
        lines += enum_lines(name, body)
    return sorted(lines)


def layout_hash(source):
    """64 bits of SHA-256 over the layout."""
    return int.from_bytes(hashlib.sha256('\n'.join(layout(source)).encode()).digest()[:8], 'little')


def main(arguments):
    listing = arguments[:1] == ['--list']
    paths = arguments[1:] if listing else arguments
    if len(paths) != 1:
        raise SystemExit(__doc__)
    with open(paths[0], encoding='utf-8') as file:
        source = file.read()
    if listing:
        print('\n'.join(layout(source)))
    else:
        print('// SPDX-License-Identifier: MIT\n// Made by layout_hash.py from wire.h.\n#ifndef OLS_LAYOUT_HASH_H\n'
              f'#define OLS_LAYOUT_HASH_H\n\n#define OLS_LAYOUT_HASH 0x{layout_hash(source):016x}ull\n\n#endif')


if __name__ == '__main__':
    main(sys.argv[1:])
