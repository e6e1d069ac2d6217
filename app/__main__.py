"""The command line `salab`, and the composition root: what is put together stands here and in `app.trial.robots`."""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import socket
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import urlsplit

from app.config import LOOPBACK, LabConfig, public_url
from app.errors import LabError
from app.study_commands import add_study_commands
from study.records import StudyError, utc_text


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; an error the user can mend is one line on stderr and exit status 1."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.run(options) or 0)
    except (LabError, StudyError) as error:
        print(f"salab: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


def _parser() -> argparse.ArgumentParser:
    defaults = LabConfig()
    parser = argparse.ArgumentParser(prog="salab", description="Shared Autonomy Lab")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    serve = commands.add_parser("serve", help="run the lab", formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    serve.add_argument("--host", default=defaults.host, help="address to listen on")
    serve.add_argument("--port", type=_port, default=defaults.port, help="port to listen on; 0 = any free one")
    serve.add_argument("--data", type=Path, default=defaults.data_dir, help="folder of the database")
    serve.add_argument("--public-url", default=None, help="what links begin with, behind a proxy")
    serve.add_argument("--study", type=Path, default=None, help="study file; the paper's study if not given")
    serve.add_argument("--robot", choices=("bullet", "kinematic"), default=defaults.robot, help="which robot moves")
    serve.add_argument(
        "--pace", choices=("real_time", "lockstep"), default=defaults.pace, help="how new participants are paced"
    )
    serve.add_argument("--no-scene", action="store_true", help="no 3-D scene (for scripted clients)")
    serve.set_defaults(run=_serve)

    add_study_commands(commands)

    export = commands.add_parser("export", help="write the data as a data package (CSV, Parquet, descriptions)")
    export.add_argument("--data", type=Path, default=defaults.data_dir, help="folder of the database")
    export.add_argument("--out", type=Path, required=True, help="folder to write into, or the archive with --zip")
    export.add_argument("--zip", action="store_true", help="write one archive instead: OUT, with .zip at its end")
    export.add_argument("--pilot", action="store_true", help="pilot participants too")
    export.set_defaults(run=_export)

    erase = commands.add_parser("erase", help="delete everything about one participant, for good")
    erase.add_argument("--data", type=Path, default=defaults.data_dir, help="folder of the database; no lab runs on it")
    erase.add_argument("--participant", required=True, metavar="ID", help="such as P001")
    erase.add_argument("--yes", action="store_true", help="do it; without this nothing is deleted")
    erase.set_defaults(run=_erase)

    _add_simulate(commands)
    _add_fit(commands)
    _add_replicate(commands)
    _add_power(commands)

    analyze = commands.add_parser("analyze", help="analyse an export: report, figures, tables, measures.json")
    analyze.add_argument("dir", type=Path, metavar="DIR", help="folder that `salab export` or `salab simulate` wrote")
    analyze.add_argument("--out", type=Path, required=True, metavar="REPORT", help="folder to write the report into")
    analyze.set_defaults(run=_analyze)

    bot = commands.add_parser("bot", help="complete a whole study over a participant's link")
    bot.add_argument("--url", required=True, help="a participant's link")
    bot.add_argument("--panel-url", default=None, help="the second device's link, if the study uses one")
    bot.add_argument("--quiet", action="store_true", help="no progress")
    bot.set_defaults(run=_bot)
    return parser


def _add_simulate(commands) -> None:  # type: ignore[no-untyped-def]
    simulate = commands.add_parser(
        "simulate",
        help="run a study with simulated participants",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    simulate.add_argument("--participants", type=int, default=12, help="how many")
    simulate.add_argument("--seed", type=int, default=7, help="of everything random")
    simulate.add_argument("--robot", choices=("kinematic", "bullet"), default="kinematic", help="which robot moves")
    simulate.add_argument(
        "--preset",
        choices=("paper", "lab", "fitted"),
        default=argparse.SUPPRESS,
        help="put other coefficients into the study file: 1 per metre, the lab's, or as fitted to the paper's "
        "teleoperation (default: the study file as it stands)",
    )
    simulate.add_argument("--study", type=Path, default=None, help="study file; the paper's study if not given")
    simulate.add_argument("--workers", type=int, default=1, help="processes; the data are the same for any number")
    simulate.add_argument("--out", type=Path, required=True, help="folder to write into, laid out as by `salab export`")
    simulate.set_defaults(run=_simulate)


def _add_fit(commands) -> None:  # type: ignore[no-untyped-def]
    fit = commands.add_parser(
        "fit",
        help="calibrate simulated participants on the paper's pure teleoperation",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    fit.add_argument("--transition", choices=("both", "replan", "mix"), default="both", help="how the robot moves")
    fit.add_argument("--participants", type=int, default=24, help="simulated people an evaluation rests on")
    fit.add_argument("--seed", type=int, default=1, help="of everything random")
    fit.add_argument("--workers", type=int, default=1, help="processes")
    fit.add_argument("--out", type=Path, default=None, help="file for the values found; none = only print them")
    fit.set_defaults(run=_fit)


def _add_replicate(commands) -> None:  # type: ignore[no-untyped-def]
    replicate = commands.add_parser(
        "replicate",
        help="the paper's comparisons in many simulated studies",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    replicate.add_argument("--studies", type=int, default=200, help="how many studies")
    replicate.add_argument("--participants", type=int, default=12, help="people in each")
    replicate.add_argument("--seed", type=int, default=2020, help="of everything random")
    replicate.add_argument("--workers", type=int, default=1, help="processes; the results are the same for any number")
    replicate.add_argument("--robot", choices=("kinematic", "bullet"), default="kinematic", help="which robot moves")
    replicate.add_argument("--preset", choices=("fitted", "paper", "lab"), default="fitted", help="open coefficients")
    replicate.add_argument("--vary", type=int, default=5, help="studies run again for each thing varied; 0 = none")
    replicate.add_argument("--out", type=Path, default=None, help="folder for the report and for going on later")
    replicate.set_defaults(run=_replicate)


def _add_power(commands) -> None:  # type: ignore[no-untyped-def]
    power = commands.add_parser(
        "power",
        help="chance of the paper's differences by number of participants",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    power.add_argument("--sizes", type=int, nargs="+", default=[6, 12, 18, 24, 36, 48], help="numbers of participants")
    power.add_argument("--draws", type=int, default=200, help="studies drawn of every size")
    power.add_argument("--studies", type=int, default=40, help="studies of 12 to draw people from")
    power.add_argument("--seed", type=int, default=2020, help="of everything random")
    power.add_argument("--workers", type=int, default=1, help="processes")
    power.add_argument("--preset", choices=("fitted", "paper", "lab"), default="fitted", help="open coefficients")
    power.add_argument("--out", type=Path, required=True, help="folder; studies of `salab replicate` in it are used")
    power.set_defaults(run=_power)


def _port(text: str) -> int:
    port = int(text) if text.isdigit() else -1
    if not 0 <= port <= 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is not a port; ports are 0 to 65535")
    return port


def _serve(options: argparse.Namespace) -> None:
    from app.lab.lab import Lab

    config = LabConfig(
        data_dir=options.data,
        host=options.host,
        port=options.port,
        public_url=public_url(options.public_url, options.host),
        study_file=options.study,
        robot=options.robot,
        pace=options.pace,
        scene=not options.no_scene,
    )
    with _listen(config.host, config.port) as listener:
        lab = Lab(config, os.environ.get("SALAB_EXPERIMENTER_TOKEN"))
        lab.prepare()
        if not lab.base_url:
            host = f"[{config.host}]" if ":" in config.host else config.host
            lab.base_url = f"http://{host}:{listener.getsockname()[1]}"
        asyncio.run(_run_server(lab, listener))


async def _run_server(lab, listener: socket.socket) -> None:  # type: ignore[no-untyped-def]
    import uvicorn

    from app.web.server import create_app
    from app.wire import MAX_MESSAGE_BYTES

    config = uvicorn.Config(
        create_app(lab),
        log_level="warning",
        access_log=False,  # links carry tokens
        ws="websockets-sansio",
        ws_max_size=16 * MAX_MESSAGE_BYTES,  # larger than we take, so that too large is answered and not cut off
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=3,
        server_header=False,
    )
    server = uvicorn.Server(config)
    serving = asyncio.create_task(server.serve(sockets=[listener]))
    while not server.started and not serving.done():  # noqa: ASYNC110
        await asyncio.sleep(0.02)  # uvicorn has no event for this
    if server.started:
        _announce(lab)
    await serving


def _announce(lab) -> None:  # type: ignore[no-untyped-def]
    from study.flow.open_link import open_link

    links = {
        "base_url": lab.base_url,
        "experimenter_link": lab.experimenter_link(),
        "demo_link": lab.link(lab.demo_token),
    }
    rules = lab.setup.study.recruitment
    print(
        f"Shared Autonomy Lab: {lab.setup.study.title}\n"
        f"  front page         {links['base_url']}/\n"
        f"  experimenter       {links['experimenter_link']}\n"
        f"  demo participant   {links['demo_link']}\n"
        + (f"  open link          {open_link(lab.base_url, rules)}\n" if rules.open else "")
        + f"  data               {lab.config.data_dir}\n"
        "Stop with Ctrl+C.",
        flush=True,
    )
    if lab.config.host not in LOOPBACK:
        print(f"Listening on {lab.config.host}: others can reach this lab.", flush=True)
    is_local = urlsplit(lab.base_url).hostname in LOOPBACK
    if not is_local and not lab.base_url.startswith("https:"):
        print("Without HTTPS the links travel in the clear, and browsers give pages no gamepad.", flush=True)
    if os.environ.get("SALAB_READY_LINE"):
        print("READY " + json.dumps(links), flush=True)


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # The protocol is named because asyncio turns Nagle's delay off only on sockets that say they are TCP: without it
    # a world and its tick reach the page 40 ms apart.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(128)
    except OSError as error:
        listener.close()
        reason = error.strerror or str(error)
        raise LabError(f"cannot listen on {host}:{port}: {reason}; choose another with --port") from None
    return listener


def _export(options: argparse.Namespace) -> None:
    from study.export.export import export, export_zip
    from study.store import open_store

    out = options.out
    if options.zip and out.suffix != ".zip":
        out = out.with_name(out.name + ".zip")
    with open_store(options.data, must_exist=True) as store:
        (export_zip if options.zip else export)(store, out, include_pilot=options.pilot)
    print(f"exported to {out}")


def _erase(options: argparse.Namespace) -> None:
    from app.report import process as reporter
    from study.store import open_store

    with open_store(options.data, exclusive=True, must_exist=True) as store:
        store.session(options.participant)  # says so when there is none
        if not options.yes:
            raise LabError(f"{options.participant} would be erased for good; say --yes to do it")
        store.erase(options.participant, utc_text(time.time()))
    reporter.remove(options.data)  # of a lab that was killed
    print(f"erased {options.participant}: only the mark that there was one is left")


def _simulate(options: argparse.Namespace) -> None:
    from app.simulated.study import make_plan, simulate

    preset = getattr(options, "preset", None)
    plan = make_plan(options.seed, options.robot, preset, options.study)
    rows = simulate(plan, options.participants, options.workers, options.out, preset)
    print(f"{options.participants} simulated participants, {rows['ticks']} ticks: {options.out}")


def _fit(options: argparse.Namespace) -> None:
    from app.replication.fit import run

    variants = ("replan", "mix") if options.transition == "both" else (options.transition,)
    print(run(variants, options.participants, options.seed, options.workers, options.out))


def _analyze(options: argparse.Namespace) -> None:
    from app.report.figure2 import heatmap_of
    from study.analysis.analysis import analyse
    from study.analysis.dataset import load
    from study.analysis.report import claim, write_report

    data = load(options.dir)
    claim(options.out)  # before the work, not after it
    print(f"report: {write_report(analyse(data), options.out, heatmap_of(data))}")


def _replicate(options: argparse.Namespace) -> None:
    from app.replication.replicate import replicate
    from app.replication.text import LEGEND, table, write
    from app.simulated.study import make_plan

    plan = make_plan(options.seed, options.robot, options.preset)
    result = replicate(
        plan, options.preset, options.studies, options.participants, options.workers, options.vary, options.out
    )
    print(f"{table(result)}\n\n{LEGEND}")
    if options.out is not None:
        write(result, options.out)
        print(f"report: {options.out / 'replication.md'}")


def _power(options: argparse.Namespace) -> None:
    from app.replication.power import power, table, write
    from app.replication.replicate import check_place
    from app.replication.studies import run_studies
    from app.simulated.study import make_plan

    check_place(options.out)
    plan = make_plan(options.seed, "kinematic", options.preset)
    studies = run_studies(plan, options.studies, 12, options.workers, options.out / "studies")
    result = power(studies, options.sizes, options.draws, options.seed, options.workers)
    write(result, options.out)
    print(f"{table(result)}\nfrom {result.people} simulated people; curves: {options.out / 'power.svg'}")


def _bot(options: argparse.Namespace) -> None:
    from app.simulated.bot import run_bot

    report = asyncio.run(run_bot(options.url, panel_url=options.panel_url, say=None if options.quiet else print))
    print(f"done: {report.ticks} ticks, {report.alerts} alerts answered, {report.surveys} surveys")


if __name__ == "__main__":
    sys.exit(main())
