"""Who may see the page: requests to this very host, from its own pages, that know the token."""

import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

_HEADERS = {"cache-control": "no-store", "x-content-type-options": "nosniff", "referrer-policy": "no-referrer",
            "cross-origin-resource-policy": "same-origin", "cross-origin-opener-policy": "same-origin"}


def policy(hosts: tuple[str, ...]) -> str:
    """The content security policy: scripts, styles and connections of these hosts alone, nothing inline."""
    sockets = " ".join(f"ws://{host}" for host in hosts)
    return (f"default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self' {sockets}; img-src data:; "
            "base-uri 'none'; form-action 'none'; frame-ancestors 'none'")


def refusal(scope: Scope, hosts: tuple[str, ...], token: str) -> str:
    """Why a request is refused; empty where it is not."""
    headers = [(name.decode("latin-1").lower(), value.decode("latin-1")) for name, value in scope["headers"]]
    named, origins = ([value for name, value in headers if name == key] for key in ("host", "origin"))
    if len(named) != 1 or named[0] not in hosts:
        return "another host"
    if len(origins) > 1 or (origins and origins[0] != f"http://{named[0]}"):
        return "another origin"
    if scope["type"] == "websocket" and not origins:
        return "no origin"
    first = str(scope["path"]).lstrip("/").split("/")[0]
    if not hmac.compare_digest(first.encode(), token.encode()):
        return "no token"
    return "" if scope["type"] == "websocket" or scope["method"] in ("GET", "HEAD") else "read-only"


def guarded(app: App, hosts: tuple[str, ...], token: str) -> App:
    """An app whose requests are refused with status 403 where `refusal` says so, and whose answers carry the policy."""
    headers = [(name.encode(), value.encode()) for name, value in {
        **_HEADERS, "content-security-policy": policy(hosts)}.items()]

    async def answer(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await app(scope, receive, send)
            return

        async def sent(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", ()), *headers]}
            await send(message)

        if why := refusal(scope, hosts, token):
            await _refuse(scope, sent, why)
        else:
            await app(scope, receive, sent)

    return answer


async def _refuse(scope: Scope, send: Send, why: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": why})
        return
    await send({"type": "http.response.start", "status": 403, "headers": [(b"content-type", b"text/plain")]})
    await send({"type": "http.response.body", "body": f"refused: {why}\n".encode()})
