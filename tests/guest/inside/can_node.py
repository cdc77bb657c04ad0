# SPDX-License-Identifier: MIT
"""Joins a CAN interface of the guest to the tests: every frame of others goes there, and what comes from there onto the bus.
Records of 16 bytes, struct can_frame (Linux, include/uapi/linux/can.h); error frames go both ways, too.

usage: can_node.py INTERFACE CHANNEL
"""
import select
import socket
import sys

from host import channel

FRAME_BYTES = 16
SO_RCVBUFFORCE = 33
CAN_RAW_ERR_FILTER = 2


def main():
    far = channel(sys.argv[2])
    bus = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    bus.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, 16 << 20)
    bus.bind((sys.argv[1],))
    bus.setblocking(False)
    print("joined", flush=True)
    waiting = b""
    while True:
        ready, _, _ = select.select([far, bus], [], [])
        if bus in ready:
            frames = []
            try:
                while len(frames) < 64:
                    frames.append(bus.recv(FRAME_BYTES))
            except OSError:  # no more for now, or the interface has gone down
                pass
            far.sendall(b"".join(frames))
        if far in ready:
            part = far.recv(65536)
            if not part:
                return
            waiting += part
            while len(waiting) >= FRAME_BYTES:
                try:
                    bus.send(waiting[:FRAME_BYTES])
                except OSError:  # the interface is down: nobody hears it
                    pass
                waiting = waiting[FRAME_BYTES:]


if __name__ == "__main__":
    main()
