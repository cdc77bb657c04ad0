# SPDX-License-Identifier: MIT
"""Runs in the guest as its first process: does what the host asks for over a connection that it opens (tests/guest/guest.py).

usage: agent.py MODULES_FOLDER HOST_PORT TOKEN
"""
import ctypes
import json
import os
import pathlib
import socket
import subprocess
import sys
import threading

HOST = "10.0.2.2"  # QEMU's user network: the machine it runs on


def connect(port, token, purpose):
    connection = socket.create_connection((HOST, port))
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.sendall(f"{token} {purpose}\n".encode())
    return connection


def load(modules, name, parameters=""):
    """Loads a module and what it needs, as modprobe does."""
    index = json.loads((modules / "index.json").read_text())
    name = name.replace("-", "_")
    if name not in index:
        raise ValueError(f"no module {name}: name it in tests/guest/kernel.py")
    if pathlib.Path("/sys/module", name).exists():
        return
    for needed in index[name]["depends"]:
        load(modules, needed)
    libc = ctypes.CDLL(None, use_errno=True)
    with open(modules / index[name]["file"], "rb") as file:
        if libc.syscall(313, file.fileno(), parameters.encode(), 0) != 0:  # finit_module(2)
            raise OSError(ctypes.get_errno(), f"module {name}: {os.strerror(ctypes.get_errno())}")
    if name == "configfs":
        subprocess.run(["mount", "-t", "configfs", "configfs", "/sys/kernel/config"], check=True)


def unload(name):
    if not pathlib.Path("/sys/module", name.replace("-", "_")).exists():
        return
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.syscall(176, name.replace("-", "_").encode(), os.O_NONBLOCK) != 0:  # delete_module(2)
        raise OSError(ctypes.get_errno(), f"module {name}: {os.strerror(ctypes.get_errno())}")


class Agent:
    def __init__(self, modules, port, token):
        self.modules, self.port, self.token = modules, port, token
        self.control = connect(port, token, "control")
        self.lock = threading.Lock()
        self.running = {}
        os.environ.update(OLS_GUEST_PORT=str(port), OLS_GUEST_TOKEN=token)

    def tell(self, **answer):
        with self.lock:
            self.control.sendall(json.dumps(answer).encode() + b"\n")

    def run(self, number, argv, cwd, environment, user, groups):
        """A program whose standard input and output are one connection, its standard error another."""
        out, err = (connect(self.port, self.token, f"{kind} {number}") for kind in ("output", "errors"))
        try:
            options = {"user": user, "group": user, "extra_groups": groups} if user else {}
            process = subprocess.Popen(argv, stdin=out, stdout=out, stderr=err, cwd=cwd, start_new_session=True,
                                       env=os.environ | environment, **options)
        except (OSError, subprocess.SubprocessError) as error:
            err.sendall(f"guest: {error}\n".encode())
            self.tell(id=number, rc=127)
            return
        finally:
            out.close()
            err.close()
        self.running[number] = process
        self.tell(id=number, rc=process.wait())

    def serve(self):
        for line in self.control.makefile("rb"):
            asked = json.loads(line)
            do = asked.pop("do")
            try:
                if do == "run":
                    asked["number"] = asked.pop("id")
                    threading.Thread(target=self.run, kwargs=asked, daemon=True).start()
                elif do == "signal":
                    os.killpg(self.running[asked["process"]].pid, asked["signal"])
                    self.tell(id=asked["id"])
                elif do == "load":
                    load(self.modules, asked["module"], asked["parameters"])
                    self.tell(id=asked["id"])
                elif do == "unload":
                    unload(asked["module"])
                    self.tell(id=asked["id"])
            except KeyError as error:
                self.tell(id=asked["id"], error=f"the agent has no program {error} that has started")
            except (OSError, ValueError) as error:
                self.tell(id=asked["id"], error=str(error))


def main():
    modules, port, token = pathlib.Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    for command in ("ip link set lo up", "ip link set eth0 up", "ip address add 10.0.2.15/24 dev eth0"):
        subprocess.run(command.split(), check=True)
    Agent(modules, port, token).serve()
    os.sync()
    ctypes.CDLL(None).reboot(0x4321FEDC)  # RB_POWER_OFF: the host has gone


if __name__ == "__main__":
    main()
