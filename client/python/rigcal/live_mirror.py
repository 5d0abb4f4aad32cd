# SPDX-License-Identifier: Apache-2.0
"""The live state of a rig, kept from answers that hold only what has changed."""

from rigcal.v1.live_pb2 import LiveState

# Parts that are sent as a whole.
_PARTS = ("session", "overlap", "estimate", "alerts", "agents", "goal", "monitor")


class LiveMirror:
    """The last full state, with what has changed since."""

    def __init__(self) -> None:
        self.state = LiveState()

    def merge(self, answer: LiveState) -> bool:
        """Takes an answer of GetLive. True: something has changed."""
        if answer.full:
            self.state.CopyFrom(answer)
            return True
        if not answer.HasField("time"):
            return False  # nothing but the revision
        state = self.state
        state.revision, state.age_s = answer.revision, answer.age_s
        state.time.CopyFrom(answer.time)
        cameras = {camera.camera: camera for camera in state.cameras}
        for removed in answer.removed_cameras:
            cameras.pop(removed, None)
        cameras.update({camera.camera: camera for camera in answer.cameras})
        in_order = LiveState(cameras=[cameras[name] for name in sorted(cameras)])
        del state.cameras[:]
        state.cameras.extend(in_order.cameras)
        for part in _PARTS:
            if answer.HasField(part):
                getattr(state, part).CopyFrom(getattr(answer, part))
        return True
