# SPDX-License-Identifier: MIT
"""read_camera in the guest (read_camera.cpp): a camera through its driver, and what it says of it."""
import base64
import json
import pathlib

READ_CAMERA = pathlib.Path(__file__).resolve().parents[2] / "build/host/bin/read_camera"


class CameraProgram:
    """`camera` has the keys of the stage's [[camera]]."""

    def __init__(self, guest, source, frames, saved="/dev/null", pause="", user=None, groups=(), **camera):
        self.guest, self.saved = guest, saved
        text = "[[camera]]\n" + "".join(f"{key} = {value}\n" for key, value in camera.items())
        guest.run(["sh", "-c", f"cat > /tmp/stage.toml <<'END'\n{text}END"])
        self.process = guest.start([READ_CAMERA, "/tmp/stage.toml", source, frames, saved, pause], user=user, groups=groups)

    def lines(self):
        return [json.loads(line) for line in self.process.output.splitlines() if line.endswith("}")]

    def wait_until(self, is_so):
        """Until what has come is so, or it has ended."""
        with self.process.changed:
            came = self.process.changed.wait_for(lambda: is_so() or self.process.returncode is not None, 600)
        assert came, self.process.output
        return self

    def wait(self, count):
        """Until so many frames have come."""
        return self.wait_until(lambda: len(self.frames()) >= count)

    def end(self):
        self.process.wait(600)
        lines = self.lines()
        assert lines, self.process.errors
        return lines[-1]

    def frames(self):
        return [line for line in self.lines() if "id" in line]

    def samples(self, frame, pixels):
        data = base64.b64decode(self.guest.run(["base64", "-w0", self.saved]).stdout)
        return data[frame * pixels * 2 : (frame + 1) * pixels * 2]
