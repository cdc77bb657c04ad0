# SPDX-License-Identifier: MIT
"""A GPIO chip of the guest's kernel (gpio-sim), with the stage's lines and one beside them."""
import sys

NAMES = ["ARM", "ESTOP", "GENLOCK", "TALLY", "WITNESS"]
PLATFORM = "/sys/bus/platform/drivers/gpio-sim"

MAKE = """set -e
mountpoint -q /sys/kernel/config || mount -t configfs none /sys/kernel/config
mkdir -p /sys/kernel/config/gpio-sim/stage/bank
cd /sys/kernel/config/gpio-sim/stage
echo 8 > bank/num_lines; echo stage-lines > bank/label
{names}
echo 1 > live
cat dev_name bank/chip_name
"""
REMOVE = """cd /sys/kernel/config/gpio-sim/stage || exit 0
echo 0 > live; rmdir bank/line* ; rmdir bank; cd ..; rmdir stage
"""
TRAIN = """import sys, time
for n in range(int(sys.argv[1])):
    for path in sys.argv[3:]:
        with open(path, "w") as pull:
            pull.write("pull-down" if n % 2 else "pull-up")
    time.sleep(float(sys.argv[2]))
"""


class Chip:
    """The simulated chip: a line's pull is its level from outside, an output's value is what stagectl drives."""

    def __init__(self, guest):
        self.guest = guest
        guest.load("gpio-sim")
        names = "\n".join(f"mkdir -p bank/line{n}; echo {name} > bank/line{n}/name" for n, name in enumerate(NAMES))
        self.device, self.name = self.shell(MAKE.format(names=names)).split()
        self.lines = f"/sys/devices/platform/{self.device}/{self.name}/sim_gpio"

    def shell(self, script):
        done = self.guest.run(["sh", "-c", script])
        assert done.returncode == 0, f"{script}: {done.stderr}"
        return done.stdout

    def path(self, name, what):
        return f"{self.lines}{NAMES.index(name)}/{what}"

    def pull(self, name, high):
        self.shell(f"echo pull-{'up' if high else 'down'} > {self.path(name, 'pull')}")

    def train(self, names, edges, pause_s):
        """So many edges on each of the lines, one after the other, beginning with a rise."""
        done = self.guest.run([sys.executable, "-S", "-c", TRAIN, str(edges), str(pause_s), *(self.path(name, "pull") for name in names)])
        assert done.returncode == 0, done.stderr

    def value(self, name):
        return self.shell(f"cat {self.path(name, 'value')}").strip() == "1"

    def unbind(self):
        self.shell(f"echo {self.device} > {PLATFORM}/unbind")

    def remove(self):
        self.guest.run(["sh", "-c", REMOVE])
