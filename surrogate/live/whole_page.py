"""The page as one file: its text, style and scripts with what they show."""

import re
from pathlib import Path

PAGE = Path(__file__).parent / "page"
_POLICY = ("default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
           "form-action 'none'")
_SCRIPTS = ("skin.js", "drawing.js", "press.js", "learned_map.js", "browser_skin.js", "page.js")


def page_with(data: str) -> str:
    """The page with style, scripts and the data of `export_page` in it, and a policy that forbids every request."""
    text = (PAGE / "index.html").read_text(encoding="utf-8")
    text = text.replace('<meta charset="utf-8">', f'<meta charset="utf-8">\n<meta http-equiv="Content-Security-Policy" '
                                                  f'content="{_POLICY}">')
    style = (PAGE / "page.css").read_text(encoding="utf-8")
    text = text.replace('<link rel="stylesheet" href="page.css">', f"<style>\n{style}</style>")
    scripts = "\n".join(f"<script>\n{(PAGE / name).read_text(encoding='utf-8')}</script>" for name in _SCRIPTS)
    within = f'<script type="application/json" id="learned">{data}</script>\n{scripts}'
    return re.sub(r'<script src="skin.js">.*<script src="page.js"></script>', lambda _: within, text,
                  flags=re.DOTALL)
