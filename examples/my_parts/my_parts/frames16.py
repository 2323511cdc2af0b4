import numpy as np

from eitsim.sensors.formats.layout import Layout, frames


def read_frames16(path, kind):
    return frames(path, np.frombuffer(path.read_bytes()[8:], "<f8").reshape(-1, 208), kind)


FRAMES16 = Layout("our board", lambda path: path.suffix == ".f16", read_frames16)
