# SPDX-License-Identifier: MIT
"""The emulated chip's table of registers against the vendor's machine-readable list (SVD), as crates.io's rp2040-pac carries it:
which registers there are, where, and which of their bits can be written. Skipped where the crate has not been fetched."""
import json
import os
import pathlib
import subprocess
import xml.etree.ElementTree as ElementTree

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
TABLE = ROOT / "tools/stagesim/board/chip/registers.mjs"
CARGO = pathlib.Path(os.environ.get("CARGO_HOME", pathlib.Path.home() / ".cargo"))
SVD = next(iter(CARGO.glob("registry/src/*/rp2040-pac-0.6.0/svd/rp2040.svd")), None)
NAMES = {"USBCTRL": "USBCTRL_REGS"}
# Where the table says something else on purpose.
DIFFERENT = {
    **{("DMA", f"CH{n}_{alias}_CTRL"): 0x9F000000 for n in range(12) for alias in ("AL1", "AL2", "AL3")},  # without fields there
    ("PPB", "SYST_CVR"): 0xFF000000,  # any write clears it (ARMv6-M B3.3.5)
    ("PPB", "VTOR"): 0,
}

pytestmark = pytest.mark.skipif(
    SVD is None, reason="no vendor list: cargo fetch --manifest-path tests/oracle/rp2040/Cargo.toml")


def vendor_registers(peripherals, name):
    """{register: (offset, mask of bits that can be written)}"""
    peripheral = peripherals[NAMES.get(name, name)]
    origin = peripherals[peripheral.get("derivedFrom", NAMES.get(name, name))]
    found = {}
    for register in origin.find("registers"):
        access = register.findtext("access") or "read-write"
        mask = 0 if access == "read-only" else 0xFFFFFFFF
        fields = register.find("fields")
        if fields is not None:
            mask = 0
            for field in fields:
                high, low = map(int, field.findtext("bitRange").strip("[]").split(":"))
                if "write" in (field.findtext("access") or access):
                    mask |= (1 << high + 1) - (1 << low)
        found[register.findtext("name")] = (int(register.findtext("addressOffset"), 0), mask)
    return int(peripheral.findtext("baseAddress"), 0), found


def blocks():
    script = f"import({json.dumps(str(TABLE))}).then(({{ BLOCKS }}) => console.log(JSON.stringify(BLOCKS)))"
    return json.loads(subprocess.run(["node", "-e", script], capture_output=True, text=True, check=True).stdout)


def test_every_register_of_the_table_is_the_vendors_with_the_same_place_and_the_same_bits():
    peripherals = {one.findtext("name"): one for one in ElementTree.parse(SVD).getroot().iter("peripheral")}
    wrong, checked = [], 0
    for block in blocks():
        name = block["name"]
        base, vendor = vendor_registers(peripherals, name)
        # The table's base of the PPB is that of its registers' page.
        shift = block["base"] - base
        for register, (offset, mask, *_) in block["registers"].items():
            checked += 1
            place, bits = vendor.get(register, (None, None))
            different = DIFFERENT.get((name, register), 0)
            if place != offset + shift or bits ^ (mask & 0xFFFFFFFF) != different:
                wrong.append(f"{name} {register}: {offset:#x} {mask & 0xFFFFFFFF:#x}, the vendor says "
                             + (f"{place - shift:#x} {bits:#x}" if place is not None else "nothing"))
    assert checked > 400 and wrong == []
