"""`studio.live.process.Live` without a process of its own, which takes seconds to start.

`live_here`: within the tests' process, which has loaded torch already. `live_nowhere`: the photo alone, without edits.
"""

from contextlib import contextmanager
from pathlib import Path

import pytest

from materialist.io.package import load_scene
from materialist.studio.live.preview import LivePreview
from materialist.studio.live.process import Live


class LiveHere(Live):
    def _start(self, worker):
        file = Path(self._file)
        self.here = LivePreview(load_scene(self._package), file, Path(self._package))

    @property
    def ready(self):
        return self.here.ready

    @property
    def fine(self):
        return self.here.fine

    def wait(self):
        self.here.wait()

    def call(self, function, **arguments):
        return function(self.here, **arguments)


class LiveNowhere(Live):
    def _start(self, worker):
        self._built.set_result(None)

    def call(self, function, **arguments):
        raise AssertionError(f"{function.__name__} needs a preview")


@contextmanager
def _in_place(double):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("materialist.studio.session.Live", double)
        # Nor does one get ready for the next photo, or for glass, at whatever is selected.
        patch.setattr("materialist.studio.studio.warmed", lambda device: None)
        patch.setattr("materialist.studio.live.glass.GlassClient.get_ready", lambda self: None)
        yield


def live_here():
    return _in_place(LiveHere)


def live_nowhere():
    return _in_place(LiveNowhere)
