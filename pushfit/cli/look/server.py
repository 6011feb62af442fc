"""The address of the page: on this machine only, and only for who knows its token.

Excluded: the page itself (`pushfit.cli.look.page`).
"""

import secrets

from bokeh.application import Application
from bokeh.application.handlers import FunctionHandler
from bokeh.document import Document
from bokeh.server.server import Server
from bokeh.settings import settings

from pushfit.cli.look.page import Page, Save, page_template, page_title
from pushfit.cli.look.state import Look
from pushfit.errors import ConfigError

HOST = "127.0.0.1"


def start_server(
    look: Look, *, title: str, save: Save, port: int
) -> tuple[Server, str]:
    """Have the page at an address; it answers while the loop of the server runs.

    Args:
        look: What is shown; the same in every window, so that nothing is lost when a
            page is loaded again.

    Raises:
        ConfigError: The port cannot be had (`port`).
    """

    def open_page(document: Document) -> None:
        document.add_root(Page(look, title=title, save=save).root)
        document.title = page_title(title)
        document.template = page_template()

    path = f"/{secrets.token_urlsafe(32)}"
    try:
        server = Server(
            {path: Application(FunctionHandler(open_page))},
            address=HOST,
            port=port,
            # At /, a list of pages, or the way to the only one, would tell the token.
            use_index=False,
        )
    except OSError as error:
        raise ConfigError(
            f"port {port}: {error.strerror}; name another, or 0 for a free one",
            code="port",
        ) from error
    # Set here, these have the last word over the environment of the user.
    settings.allowed_ws_origin = [f"{HOST}:{server.port}"]
    settings.resources = "inline"
    server.start()
    return server, f"http://{HOST}:{server.port}{path}"
