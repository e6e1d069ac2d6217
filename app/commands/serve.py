"""`salab serve`: the lab, put together from its configuration and run until it is stopped."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args
from urllib.parse import urlsplit

import typer

from app.commands import options
from app.commands.console import announce, shown
from app.commands.groups import RUN_A_STUDY
from app.commands.options import choice, file, flow_of, port_number, registered, whole_number
from app.config import LOOPBACK, LabConfig, Pace, StartMethod, public_url
from app.errors import LabError
from app.limits import with_limits
from app.monitoring.log_lines import LogFormat
from app.trial.robots import ROBOTS, chosen_robot
from study.store import DataPlace

if TYPE_CHECKING:
    from app.lab.lab import Lab

DEFAULTS = LabConfig()
READY_LINE = "SALAB_READY_LINE"
"""Whoever starts the lab from a program sets this variable and waits for the line that begins with READY."""
STARTED_EVERY_S = 0.02
BACKLOG = 128
"""So many connections wait to be taken."""
FORWARDED = "FORWARDED_ALLOW_IPS"
LOOPBACK_ADDRESSES = ("127.0.0.0/8", "::1")

commands = typer.Typer()


@commands.command(
    rich_help_panel=RUN_A_STUDY, epilog="Example: salab serve --study my-study.toml --data data --port 8000"
)
def serve(
    context: typer.Context,
    host: Annotated[str, typer.Option(metavar="HOST", help="address to listen on")] = DEFAULTS.host,
    port: Annotated[
        int, typer.Option(metavar="PORT", parser=port_number, help="port to listen on; 0 = any free one")
    ] = DEFAULTS.port,
    data: Annotated[DataPlace, options.data("folder of the database, or address of one on a server")] = DEFAULTS.data,
    own_folder: Annotated[Path | None, options.own_folder()] = None,
    url: Annotated[
        str | None, typer.Option("--public-url", metavar="URL", help="what links begin with, behind a proxy")
    ] = None,
    study: Annotated[Path | None, file("study file; the paper's study if not given")] = None,
    trust: Annotated[bool, options.trust()] = False,
    robot: Annotated[
        str | None, registered(ROBOTS, "which robot moves; bullet if not given, or mujoco without pybullet")
    ] = DEFAULTS.robot,
    pace: Annotated[Pace, choice(get_args(Pace), "how new participants are paced")] = DEFAULTS.pace,
    no_scene: Annotated[bool, typer.Option("--no-scene", help="no 3-D scene (for scripted clients)")] = False,
    log_format: Annotated[
        LogFormat, choice(get_args(LogFormat), "how the log on standard error is written, one line an event")
    ] = DEFAULTS.log_format,
    start_method: Annotated[
        StartMethod, choice(get_args(StartMethod), "how the processes of sessions begin; spawn works on every system")
    ] = DEFAULTS.start_method,
    trusted_proxy: Annotated[
        list[str] | None,
        typer.Option(metavar="ADDRESS", help="a proxy on another machine, whose word on who asks is believed"),
    ] = None,
    capacity: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            parser=whole_number,
            help="how many people at once; 0 = no bound; what `salab bench sessions` found if not given",
        ),
    ] = DEFAULTS.capacity,
    limit: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="what a client may cost at most, instead of the default"),
    ] = None,
) -> None:
    """Run the lab.

    Prints the link of the experimenter's page, from which participants are invited. Stop it with Ctrl+C.
    """
    import asyncio

    from app.monitoring.log_setup import end_with_whole_log, set_up_logging
    from app.processes import without_collections
    from app.worker.process_source import process_source

    data = options.beside(data, own_folder)
    config = LabConfig(
        data_dir=data.folder,
        database_url=data.url,
        host=host,
        port=port,
        public_url=public_url(url, host),
        study_file=study,
        trust=trust,
        robot=robot,
        pace=pace,
        scene=not no_scene,
        log_format=log_format,
        start_method=start_method,
        trusted_proxies=proxies(trusted_proxy or (), behind_one=bool(url)),
        limits=with_limits(limit or ()),
        capacity=checked_capacity(capacity),
    )
    with listen(config.host, config.port) as listener, closing(set_up_logging(log_format)) as lines:
        end_with_whole_log(lines)
        with without_collections():
            # The process that sessions' processes come from makes its imports while this one makes its own.
            process_source(chosen_robot(robot).name, start_method, scene=config.scene).tend()
            from app.lab.lab import Lab
            from app.web.server import create_app

            lab = Lab(
                config,
                os.environ.get("SALAB_EXPERIMENTER_TOKEN"),
                flow=flow_of(context),
                metrics_token=os.environ.get("SALAB_METRICS_TOKEN") or None,
            )
            lab.prepare()
            if not lab.base_url:
                address = f"[{config.host}]" if ":" in config.host else config.host
                lab.base_url = f"http://{address}:{listener.getsockname()[1]}"
            site = create_app(lab)
        asyncio.run(_run_server(lab, site, listener))


async def _run_server(lab: Lab, app: Any, listener: socket.socket) -> None:
    import asyncio

    import uvicorn

    from app.monitoring.log_setup import log_errors_of
    from app.web.connections import Door, Proxies, allowed_connections, bounded

    log_errors_of(asyncio.get_running_loop())
    limits, trusted = lab.config.limits, lab.config.trusted_proxies
    http, websocket = bounded(Door(limits, lab.refusals, Proxies(trusted), allowed_connections(limits)))
    config = uvicorn.Config(
        app,
        log_config=None,  # ours, which fold
        access_log=False,  # links carry tokens
        backlog=BACKLOG,  # at the limit of open files asyncio complains once for each that it could have taken
        http=http,
        ws=websocket,
        ws_max_size=limits.frame_bytes,  # larger than we take, so that too large is answered and not cut off
        ws_per_message_deflate=False,
        forwarded_allow_ips=list(trusted),
        timeout_keep_alive=limits.idle_s,
        timeout_graceful_shutdown=3,
        server_header=False,
    )
    server = uvicorn.Server(config)
    serving = asyncio.create_task(server.serve(sockets=[listener]))
    while not server.started and not serving.done():  # noqa: ASYNC110
        await asyncio.sleep(STARTED_EVERY_S)  # uvicorn has no event for this
    if server.started:
        _announce(lab)
    await serving


def checked_capacity(given: int | None) -> int | None:
    """A number of people. Raises `LabError` for one that no lab takes."""
    from app.sizing.capacity import MOST

    if given is not None and not 0 <= given <= MOST:
        raise LabError(f"--capacity {given}: must be from 0 (no bound) to {MOST}")
    return given


def proxies(given: Sequence[str], behind_one: bool) -> tuple[str, ...]:
    """Whose word on who asks is believed: those named, those of `FORWARDED_ALLOW_IPS`, and, behind a proxy, this
    machine's own."""
    from app.web.connections import Proxies

    named = [*given, *filter(None, (part.strip() for part in os.environ.get(FORWARDED, "").split(",")))]
    Proxies(named)  # says so when one is no address
    return (*named, *(LOOPBACK_ADDRESSES if behind_one else ()))


def _announce(lab: Lab) -> None:
    from study.flow.open_link import open_link

    links = {
        "base_url": lab.base_url,
        "experimenter_link": lab.experimenter_link(),
        "demo_link": lab.link(lab.demo_token),
    }
    rules = lab.setup.study.recruitment
    announce(
        f"Shared Autonomy Lab: {shown(lab.setup.study.title)}\n"
        f"  front page         {links['base_url']}/\n"
        f"  experimenter       {links['experimenter_link']}\n"
        f"  demo participant   {links['demo_link']}\n"
        + (f"  open link          {open_link(lab.base_url, rules)}\n" if rules.open else "")
        + f"  data               {shown(str(lab.config.data))}\n"
        + (f"  people at once     {lab.door.most}\n" if lab.door.most else "")
        + "Stop with Ctrl+C."
    )
    if lab.config.host not in LOOPBACK:
        announce(f"Listening on {lab.config.host}: others can reach this lab.")
    is_local = urlsplit(lab.base_url).hostname in LOOPBACK
    if not is_local and not lab.base_url.startswith("https:"):
        announce("Without HTTPS the links travel in the clear, and browsers give pages no gamepad.")
    if os.environ.get(READY_LINE):
        announce("READY " + json.dumps(links))


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens there. `LabError` says why it cannot."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # The protocol is named because asyncio turns Nagle's delay off only on sockets that say they are TCP: without it
    # a world and its tick reach the page 40 ms apart.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    # On Windows the option of that name would let another program take the port away; this one keeps it.
    option = getattr(socket, "SO_EXCLUSIVEADDRUSE", socket.SO_REUSEADDR)
    listener.setsockopt(socket.SOL_SOCKET, option, 1)
    try:
        listener.bind((host, port))
        listener.listen(BACKLOG)
    except OSError as error:
        listener.close()
        reason = error.strerror or str(error)
        raise LabError(f"cannot listen on {host}:{port}: {reason}; choose another with --port") from None
    return listener
