"""`studio.live.Live` within the tests' own process, which has loaded torch already."""

from contextlib import contextmanager
from pathlib import Path

import pytest

from materialist.io.package import load_scene
from materialist.studio.live import Live
from materialist.studio.live_preview import LivePreview


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


@contextmanager
def live_here():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("materialist.studio.session.Live", LiveHere)
        yield
