#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Copies a UF2 image to an RP2040 that shows its BOOTSEL drive (RP2040 datasheet 2.8.4.2: volume label RPI-RP2).
set -euo pipefail
image=${1:?usage: flash.sh IMAGE.uf2}
device=/dev/disk/by-label/RPI-RP2
if [ ! -e "$device" ]; then
    echo "flash: no board in BOOTSEL mode: hold BOOTSEL while plugging it in, then run this again" >&2
    exit 1
fi
mount=$(findmnt -n -o TARGET "$device" || true)
if [ -z "$mount" ]; then
    echo "flash: the board's drive RPI-RP2 is not mounted: open it in a file manager or run: udisksctl mount -b $device" >&2
    exit 1
fi
cp "$image" "$mount/"
sync
echo "flash: wrote $(basename "$image"); the board restarts by itself"
