"""Only requests to this host, from its own pages, with the token, that read."""

import pytest

from surrogate.live.guard import policy, refusal

HOSTS, TOKEN = ("127.0.0.1:8000", "localhost:8000"), "s3cret"
OWN = [("host", HOSTS[0])]


def scope(headers: list[tuple[str, str]], path: str = f"/{TOKEN}/", kind: str = "http", method: str = "GET") -> dict:
    return {"type": kind, "path": path, "method": method, "headers": [(a.encode(), b.encode()) for a, b in headers]}


@pytest.mark.parametrize(("asked", "why"), [
    (scope(OWN), ""), (scope([("Host", HOSTS[1])]), ""), (scope([*OWN, ("origin", f"http://{HOSTS[0]}")]), ""),
    (scope([("host", "evil.example:8000")]), "another host"), (scope([("host", "127.0.0.1")]), "another host"),
    (scope([]), "another host"), (scope(OWN * 2), "another host"),
    (scope([*OWN, ("origin", "http://evil.example")]), "another origin"),
    (scope([*OWN, ("origin", "null")]), "another origin"),
    (scope([*OWN, ("origin", f"http://{HOSTS[1]}")]), "another origin"),
    (scope(OWN, "/"), "no token"), (scope(OWN, "/s3cre/"), "no token"), (scope(OWN, "/page.css"), "no token"),
    (scope(OWN, method="POST"), "read-only"),
    (scope(OWN, kind="websocket"), "no origin"),
    (scope([*OWN, ("origin", f"http://{HOSTS[0]}")], kind="websocket"), "")], ids=str)
def test_who_is_refused(asked: dict, why: str) -> None:
    assert refusal(asked, HOSTS, TOKEN) == why


def test_the_policy_allows_nothing_inline_and_nothing_elsewhere() -> None:
    rules = dict(rule.strip().split(" ", 1) for rule in policy(HOSTS).split(";"))
    assert rules["default-src"] == "'none'"
    assert rules["script-src"] == rules["style-src"] == "'self'"
    assert "unsafe" not in policy(HOSTS)
    assert "*" not in policy(HOSTS)
