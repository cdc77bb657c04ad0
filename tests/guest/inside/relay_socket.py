# SPDX-License-Identifier: MIT
"""A socket in the guest whose connections go to the tests (Guest.channel), as an emulated board's does on the host.

usage: relay_socket.py PATH CHANNEL
"""
import socket
import sys
import threading

from host import channel


def pump(source, to):
    try:
        while part := source.recv(65536):
            to.sendall(part)
    except OSError:
        pass
    for end in (source, to):
        try:
            end.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass


def main():
    path, name = sys.argv[1:]
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(path)
    listener.listen()
    print("listens", flush=True)
    while True:
        near, far = listener.accept()[0], channel(name)
        for source, to in ((near, far), (far, near)):
            threading.Thread(target=pump, args=(source, to), daemon=True).start()


main()
