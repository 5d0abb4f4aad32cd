# SPDX-License-Identifier: Apache-2.0
"""A connection to the gRPC port of a server, and its errors in words."""

import importlib
import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import grpc
from google.protobuf import descriptor_pb2
from google.protobuf.message import Message

from rigcal.errors import RigcalError
from rigcal.identity import UserIdentity, is_on_this_machine
from rigcal.version import VERSION

CALL_TIMEOUT_S = 10.0
_PROBE_TIMEOUT_S = 3.0
# How a server answers that waits for its turn.
_NOT_ACTIVE = "this server is not the active one"

# The files of proto/rigcal/v1 with services.
SERVICE_FILES = (
    "agent",
    "calibration",
    "camera",
    "identity",
    "ingest",
    "lens",
    "live",
    "maintenance",
    "rig",
    "session",
    "status",
    "triangulation",
)

_OPTIONS = (
    # A calibration of a large rig, or a session with thousands of refusals.
    ("grpc.max_receive_message_length", 64 << 20),
    # A rig's server is on its own network.
    ("grpc.enable_http_proxy", 0),
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.min_reconnect_backoff_ms", 10_000),  # in spite of its name: the least time of an attempt
    ("grpc.max_reconnect_backoff_ms", 1000),
    ("grpc.dns_min_time_between_resolutions_ms", 1000),
)
_ADDRESS = re.compile(r"unix:/.+|(\[[^\]]+\]|[^:\[\]/ ]+):\d{1,5}")


def message_class(descriptor: Any) -> type[Message]:
    """The generated class of a message of the API."""
    file = descriptor.file.name.removesuffix(".proto").replace("/", ".")
    return getattr(importlib.import_module(f"{file}_pb2"), descriptor.name)


def _release_of(version: str) -> tuple[int, ...]:
    """The numbers that a version begins with: "1.2.3~git5" is (1, 2, 3)."""
    found = re.match(r"\d+(\.\d+)*", version)
    return tuple(int(number) for number in found[0].split(".")) if found else ()


class ServerConnection:
    """The services of one server. Connects with the first call. May be used by several threads."""

    def __init__(self, address: str, identity: UserIdentity):
        """RigcalError: `address` is none, or this PC has no certificate for it."""
        if not _ADDRESS.fullmatch(address):
            raise RigcalError(
                f"'{address}' is no server address; give HOST:PORT, such as 127.0.0.1:7420 or "
                "[::1]:7420, and the gRPC port (7420), not that of the dashboard",
                "INVALID_ARGUMENT",
            )
        self.address = address
        self._services: dict[str, Service] = {}
        target = address if address.startswith("unix:") else f"dns:///{address}"
        if is_on_this_machine(address) and address not in identity.servers():
            self._channel = grpc.insecure_channel(target, _OPTIONS)
            return
        if not identity.exists:
            raise RigcalError(
                f"the server at {address} is on another machine and wants a certificate, and this "
                "PC has none; make a join string on the server's PC (rigcal token create --role "
                "operator), and here call rigcal.Client.join(STRING), or run rigcal login STRING",
                "FAILED_PRECONDITION",
            )
        identity.renew_if_due(address)
        ca, certificate, key = identity.certificates()
        credentials = grpc.ssl_channel_credentials(ca, key, certificate)
        self._channel = grpc.secure_channel(target, credentials, _OPTIONS)

    def close(self) -> None:
        self._channel.close()

    def service(self, file: str) -> "Service":
        """The service of proto/rigcal/v1/FILE_service.proto."""
        if file not in self._services:
            self._services[file] = Service(self, file)
        return self._services[file]

    def explain(self, error: grpc.RpcError, method: str, timeout_s: float | None) -> RigcalError:
        """The server's message as it is, or what keeps it from giving one."""
        code, details = error.code(), error.details() or ""
        name = code.name
        if code == grpc.StatusCode.UNAVAILABLE and details.startswith(_NOT_ACTIVE):
            return RigcalError(details, name)
        if code == grpc.StatusCode.UNAVAILABLE:
            cause = details.rpartition(": ")[2]
            return RigcalError(
                f"cannot reach the server at {self.address} ({cause}). Is rigcal-server running "
                "there? Another address is given as Client(HOST:PORT) or in the environment "
                "variable RIGCAL_SERVER; rigcal doctor says more",
                name,
            )
        if code == grpc.StatusCode.DEADLINE_EXCEEDED and timeout_s is not None:
            return RigcalError(
                f"the server at {self.address} did not answer {method} within {timeout_s:g} s", name
            )
        if code == grpc.StatusCode.UNIMPLEMENTED:
            return RigcalError(self._missing(method), name)
        return RigcalError(details or f"the server at {self.address} refused: {name}", name)

    def _missing(self, method: str) -> str:
        try:
            version = self.service("status").GetStatus().software_version
        except RigcalError:
            version = ""
        if not version:
            return (
                f"the server at {self.address} does not know {method}: it is another program; "
                f"a rigcal-server of version {VERSION} or newer is needed"
            )
        says = f"the server at {self.address} is rigcal-server {version} and does not know {method}"
        if _release_of(version) > _release_of(VERSION):
            return (
                f"{says} of this package's version {VERSION}: install the Python package of "
                f"version {version}"
            )
        return f"{says}: a server of version {VERSION} or newer is needed"

    def multi_callable(self, kind: str, path: str, response: type[Message]) -> Callable[..., Any]:
        """One RPC of the channel: unary_unary, unary_stream or stream_stream."""
        return getattr(self._channel, kind)(
            path,
            request_serializer=lambda message: message.SerializeToString(),
            response_deserializer=response.FromString,
        )


def connect(addresses: str, identity: UserIdentity) -> ServerConnection:
    """To the server, or of several with commas between to the first that answers.

    RigcalError: as ServerConnection. Where none answers, the last one is returned, and calls say why.
    """
    connections = [ServerConnection(text.strip(), identity) for text in addresses.split(",")]
    while len(connections) > 1:
        try:
            connections[0].service("status").GetStatus(timeout_s=_PROBE_TIMEOUT_S)
            break
        except RigcalError as error:
            if error.code not in ("UNAVAILABLE", "DEADLINE_EXCEEDED"):
                break
            connections.pop(0).close()
    for other in connections[1:]:
        other.close()
    return connections[0]


class Service:
    """The RPCs of one service as methods, by their names in the proto file.

    A request is the generated message, or its fields by name: `GetSession(id="wave")`. What comes
    is the generated message, or an iterator of them. Errors are RigcalError.
    """

    def __init__(self, connection: ServerConnection, file: str):
        if file not in SERVICE_FILES:
            raise RigcalError(f"there is no service {file}; there are {', '.join(SERVICE_FILES)}")
        module = importlib.import_module(f"rigcal.v1.{file}_service_pb2")
        for name, service in module.DESCRIPTOR.services_by_name.items():
            described = descriptor_pb2.ServiceDescriptorProto()
            service.CopyToProto(described)
            for method, proto in zip(service.methods, described.method):
                call = self._call_of(connection, service, method, proto)
                call.__name__ = method.name
                call.__qualname__ = f"{name}.{method.name}"
                setattr(self, method.name, call)

    @staticmethod
    def _call_of(connection: ServerConnection, service: Any, method: Any, proto: Any) -> Callable:
        request_class = message_class(method.input_type)
        kind = "_".join(
            "stream" if streams else "unary"
            for streams in (proto.client_streaming, proto.server_streaming)
        )
        path = f"/{service.full_name}/{method.name}"
        call = connection.multi_callable(kind, path, message_class(method.output_type))
        name = f"{service.name}.{method.name}"

        def request_of(request: Message | None, fields: dict[str, Any]) -> Message:
            return request if request is not None else request_class(**fields)

        def unary(
            request: Message | None = None,
            *,
            timeout_s: float = CALL_TIMEOUT_S,
            **fields: Any,
        ) -> Message:
            try:
                return call(request_of(request, fields), timeout=timeout_s)
            except grpc.RpcError as error:
                raise connection.explain(error, name, timeout_s) from None

        def from_server(request: Message | None = None, **fields: Any) -> Iterator[Message]:
            return _messages(connection, name, call(request_of(request, fields)))

        def both_ways(requests: Iterable[Message]) -> Iterator[Message]:
            return _messages(connection, name, call(iter(requests)))

        made = {"unary_unary": unary, "unary_stream": from_server, "stream_stream": both_ways}[kind]
        fields_of = ", ".join(field.name for field in method.input_type.fields)
        made.__doc__ = (
            f"{method.input_type.full_name}({fields_of}) to {method.output_type.full_name}."
        )
        return made


def _messages(connection: ServerConnection, name: str, call: Any) -> Iterator[Message]:
    """What comes over a stream; whoever stops reading ends it."""
    try:
        yield from call
    except grpc.RpcError as error:
        raise connection.explain(error, name, None) from None
    finally:
        call.cancel()
