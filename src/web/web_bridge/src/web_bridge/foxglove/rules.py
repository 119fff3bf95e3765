# SPDX-License-Identifier: BSD-3-Clause
"""Names that a Foxglove client may use: regular expressions, as foxglove_bridge's parameters have them."""
from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from web_bridge.errors import RequestForbidden, shown

EVERYTHING = (re.compile(".*"),)
#: The kinds of files that a page needs to draw a robot. Also in capitals: vendors' meshes are called so.
ASSETS = (r"^package://(?:[-\w%]+/)*[-\w%.]+"
          r"\.(?:dae|fbx|glb|gltf|jpeg|jpg|mtl|obj|png|stl|tif|tiff|urdf|webp|xacro)$",)
#: Everything that a server can do, by the protocol's names.
CAPABILITIES = ("clientPublish", "parameters", "parametersSubscribe", "services", "connectionGraph", "assets")
_OF_ACTING = ("clientPublish", "services")


def compiled(patterns: Sequence[str], flags: re.RegexFlag | int = 0) -> tuple[re.Pattern, ...]:
    """Compiled patterns; raises re.error."""
    return tuple(re.compile(pattern, flags) for pattern in patterns)


class FoxgloveRules(NamedTuple):
    """Patterns for whole names; ``may_act`` False: the client may only watch."""

    topics: tuple = EVERYTHING
    services: tuple = EVERYTHING
    parameters: tuple = EVERYTHING
    client_topics: tuple = EVERYTHING
    assets: tuple = compiled(ASSETS, re.IGNORECASE)
    capabilities: tuple = CAPABILITIES
    may_act: bool = True

    def shows_topic(self, topic: str) -> bool:
        return _fits(self.topics, topic)

    def shows_service(self, service: str) -> bool:
        return _fits(self.services, service)

    def shows_parameter(self, name: str) -> bool:
        return _fits(self.parameters, name)

    def has(self, capability: str) -> bool:
        """May this client use a capability of the server?"""
        return capability in self.capabilities and (self.may_act or capability not in _OF_ACTING)

    def check(self, capability: str) -> None:
        """Raise RequestForbidden for a capability that this client may not use."""
        if capability not in self.capabilities:
            raise RequestForbidden("this server does not offer %s (~capabilities)" % capability)
        if not self.has(capability):
            raise RequestForbidden("the view token does not allow %s" % capability)

    def check_publish(self, topic: str) -> None:
        self.check("clientPublish")
        if not _fits(self.client_topics, topic):
            raise RequestForbidden("client_topic_whitelist of this server does not allow to publish on %s" % topic)

    def check_set_parameter(self, name: str) -> None:
        self.check("parameters")
        if not self.may_act:
            raise RequestForbidden("the view token does not allow to set parameters")
        self.check_parameter(name)

    def check_parameter(self, name: str) -> None:
        if not self.shows_parameter(name):
            raise RequestForbidden("param_whitelist of this server does not allow the parameter %s" % name)

    def check_asset(self, uri: str) -> None:
        self.check("assets")
        if ".." in uri or not _fits(self.assets, uri):
            raise RequestForbidden("asset_uri_allowlist of this server does not allow %s" % shown(uri))


def _fits(patterns: tuple[re.Pattern, ...], name: str) -> bool:
    return any(pattern.fullmatch(name) for pattern in patterns)
