# SPDX-License-Identifier: BSD-3-Clause
"""Topics of images to their viewers: one subscription for all, the newest image for each. No ROS.

Everything here runs in the loop, except what the graph and the pool do. An image is encoded when a viewer
has time for it, and not at all where nobody has.
"""
from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Protocol

from web_bridge.errors import BridgeError, NoSuchTopic
from web_bridge.pictures import EncodedImage

if TYPE_CHECKING:
    from web_bridge.codec import Codec
    from web_bridge.feeds import Arrival
    from web_bridge.graph import Graph, SubscribedTopic
    from web_bridge.loop_thread import LoopThread

IMAGE, COMPRESSED = "sensor_msgs/Image", "sensor_msgs/CompressedImage"
#: A subscription stays this long after its last viewer [s], for pages that ask for one image after the other.
LINGER_S = 5.0


class CameraViewer(Protocol):
    """Somebody who looks at a camera."""

    def show(self, picture: EncodedImage) -> None:
        """Show this picture next, in place of one that was not looked at."""
        ...


class _Camera:
    def __init__(self) -> None:
        self.viewers: set[CameraViewer] = set()
        self.subscription: asyncio.Future[SubscribedTopic] | None = None
        self.last: EncodedImage | None = None  # the newest
        self.is_latched = False
        self.timer: asyncio.TimerHandle | None = None


class Cameras:
    """``graph``: as in :mod:`web_bridge.session`, with ``published_topics()`` {name: type}; ``threads`` encode."""

    def __init__(self, graph: Graph, codec: Codec, loop_thread: LoopThread, threads: int = 2,
                 linger_s: float = LINGER_S) -> None:
        self._graph = graph
        self._codec = codec
        self._loop_thread = loop_thread
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="encode")
        self._linger_s = linger_s
        self._cameras: dict[str, _Camera] = {}

    async def published(self) -> dict[str, str]:
        """The topics that have a publisher, {name: type}. Raises BridgeError."""
        return await self._asked(self._graph.published_topics)

    async def find(self, name: str, kinds: tuple[str, ...] = (IMAGE, COMPRESSED)) -> str:
        """The full name of a published topic of images. Raises BridgeError, which says what is there."""
        topic = self._graph.resolve(name)
        published = await self.published()
        if topic not in published:
            images = sorted(name for name, kind in published.items() if kind in kinds)
            raise NoSuchTopic("nobody publishes %s; there %s" % (topic, ("are " + ", ".join(images)) if images else
                                                                 "is no topic of images"))
        if published[topic] not in kinds:
            raise BridgeError("%s has the type %s, not %s" % (topic, published[topic], " or ".join(kinds)))
        return topic

    async def join(self, topic: str, viewer: CameraViewer) -> None:
        """Show the images of a topic from now on. Raises BridgeError."""
        camera = self._cameras.get(topic)
        if camera is None:
            camera = self._cameras[topic] = _Camera()
            camera.subscription = asyncio.ensure_future(self._asked(
                self._graph.subscribe, topic, lambda arrival: self._loop_thread.soon(self._arrived, camera, arrival)))
        if camera.timer is not None:
            camera.timer.cancel()
            camera.timer = None
        camera.viewers.add(viewer)
        try:
            if camera.subscription is not None:
                await asyncio.shield(camera.subscription)
        except Exception:
            # The next viewer tries again.
            if self._cameras.get(topic) is camera:
                del self._cameras[topic]
            raise

    def last(self, topic: str, is_latched: bool = False) -> EncodedImage | None:
        """The newest image of a topic that is looked at, or None; ``is_latched``: only one that will stay so."""
        camera = self._cameras.get(topic)
        return camera.last if camera is not None and (camera.is_latched or not is_latched) else None

    def leave(self, topic: str, viewer: CameraViewer) -> None:
        """Show no more; also where the viewer had not joined."""
        camera = self._cameras.get(topic)
        if camera is None or viewer not in camera.viewers:
            return
        camera.viewers.discard(viewer)
        if not camera.viewers:
            camera.timer = asyncio.get_running_loop().call_later(self._linger_s, self._close, topic, camera)

    def shut_down(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)

    async def _asked(self, function: Callable[..., Any], *arguments: str | Callable[..., Any]) -> Any:
        """The result of a function that may wait for the master."""
        return await asyncio.get_running_loop().run_in_executor(None, function, *arguments)

    def _arrived(self, camera: _Camera, arrival: Arrival) -> None:
        picture = camera.last = EncodedImage(lambda: self._codec.decoded(arrival), self._pool)
        camera.is_latched = arrival.is_latched
        for viewer in camera.viewers:
            viewer.show(picture)

    def _close(self, topic: str, camera: _Camera) -> None:
        if self._cameras.get(topic) is camera:
            del self._cameras[topic]
            asyncio.ensure_future(self._unsubscribe(camera))

    async def _unsubscribe(self, camera: _Camera) -> None:
        if camera.subscription is not None:
            await self._asked((await camera.subscription).close)
