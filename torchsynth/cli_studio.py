"""The command for the page in the browser: ``torchsynth studio``."""

from __future__ import annotations

from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command to an application."""
    app.command()(studio)


def studio(
    host: Annotated[
        str, typer.Option(help="The address to listen at; 0.0.0.0 lets anyone in the network use it.")
    ] = "127.0.0.1",
    port: Annotated[
        int | None,
        typer.Option(help="The port. Default: 7860, or the next one that is free.", show_default=False),
    ] = None,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = False,
    max_upload: Annotated[int, typer.Option(metavar="MB", help="The largest file to accept.")] = 20,
) -> None:
    """Work in the browser: choose, paint, watch, compare, download. It works offline; Ctrl-C ends it."""
    from torchsynth.studio.server import launch  # here, as no other command needs it

    launch(host, port, browser=browser, max_upload=max_upload, say=typer.echo)
