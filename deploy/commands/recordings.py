"""Commands on recordings: replay, recover, export."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from deploy.commands.terminal import (
    JsonOption,
    print_files,
    print_json,
    say,
    ticks_shown,
    writing,
)
from deploy.failure import FailedError
from protocol.process.exit_codes import ExitCode
from protocol.process.fingerprint import fingerprint

if TYPE_CHECKING:
    from deploy.recording.differences import Difference
    from plant_server.spool.spool import Spool

RecordingArgument = Annotated[
    Path, typer.Argument(metavar="RECORDING", help="A run's folder, its run.mcap, or a spool.")
]
FileArgument = Annotated[
    Path, typer.Argument(metavar="RECORDING", help="A run's folder, or its run.mcap.")
]
OutOption = Annotated[
    Path | None, typer.Option("--out", help="Folder to write to; default: beside the recording.")
]


class Format(StrEnum):
    """Files that others can read."""

    CSV = "csv"
    NPZ = "npz"
    PARQUET = "parquet"


def replay(recording: RecordingArgument, as_json: JsonOption = False) -> None:
    """Simulate a recorded run again, and compare every value.

    Commands and the deaths of processes are taken from the recording; all
    else is computed again. Exit code 1: a value differs, and it is named.

    Example: decmesh replay runs/storm-20260101-120000
    """
    # Numpy and the libraries of files are needed only now.
    from deploy.recording.differences import first_difference  # noqa: PLC0415
    from deploy.recording.files import recording_file  # noqa: PLC0415
    from deploy.recording.spools import read_spool_of  # noqa: PLC0415

    file = recording_file(recording)
    spool = read_spool_of(file)
    here, there = fingerprint(), spool.facts.get("fingerprint")
    if here != there:
        say(f"recorded where numbers are rounded otherwise: fingerprint {there}, here {here}")
    if spool.in_realtime:
        _replay_realtime(spool, file, as_json=as_json, same_arithmetic=here == there)
        return
    with ticks_shown("replay", spool.scenario) as on_tick:
        difference = first_difference(spool, on_tick)
    if difference is None:
        difference = _false_message(spool, file)
    if as_json:
        facts = {
            "identical": difference is None,
            "ticks": spool.ticks[-1].tick + 1,
            "complete": spool.complete,
            "same_arithmetic": here == there,
            "difference": difference and difference.facts,
        }
        print_json(facts)
    elif difference is None:
        print(f"identical: {_ticks(spool)}")
    else:
        print(difference)
    if difference is not None:
        raise typer.Exit(ExitCode.FAILED)


def _false_message(spool: "Spool", file: Path) -> "Difference | None":
    """What a file says that does not follow from its own records, if it is one with messages."""
    from deploy.recording.false_messages import first_false_message  # noqa: PLC0415 - as above
    from deploy.recording.files import is_mcap  # noqa: PLC0415 - as above

    if not is_mcap(file):
        return None
    with ticks_shown("messages", spool.scenario) as on_tick:
        return first_false_message(spool, file, on_tick)


def _replay_realtime(spool: "Spool", file: Path, *, as_json: bool, same_arithmetic: bool) -> None:
    """Play boards again on exactly what they used, at their own times."""
    from deploy.recording.realtime_replay import replay as play_again  # noqa: PLC0415 - as above
    from deploy.recording.replay import UnplayableError  # noqa: PLC0415 - as above

    try:
        with ticks_shown("replay", spool.scenario) as on_tick:
            found = play_again(spool, on_tick)
    except UnplayableError as error:
        raise FailedError(ExitCode.FAILED, str(error)) from error
    if not found.differences and (false := _false_message(spool, file)):
        found = found._replace(differences=(str(false),))
    if as_json:
        facts = {
            "identical": not found.differences,
            "ticks": spool.ticks[-1].tick + 1,
            "complete": spool.complete,
            "same_arithmetic": same_arithmetic,
            "turns": found.periods,
            "torque_frames": found.torques,
            "unplayed_turns": found.unplayed,
            "differences": found.differences,
        }
        print_json(facts)
    else:
        for difference in found.differences:
            print(difference)
        if not found.differences:
            turns = f"{found.periods} turns of boards, {found.torques} torque frames"
            print(f"identical: {_ticks(spool)}, {turns}")
        if found.unplayed:
            print(f"{found.unplayed} turns are not played: what was heard in them is not recorded")
    if found.differences:
        raise typer.Exit(ExitCode.FAILED)


def recover(
    recording: RecordingArgument, out_folder: OutOption = None, as_json: JsonOption = False
) -> None:
    """Make run.mcap from what there is of a run that was cut off.

    Example: decmesh recover runs/storm-20260101-120000
    """
    from deploy.recording.logical_digest import logical_sha256  # noqa: PLC0415 - as above
    from deploy.recording.recovery import places, rescue  # noqa: PLC0415 - as above
    from deploy.recording.spools import read_spool_of  # noqa: PLC0415 - as above

    source, target = places(recording, out_folder)
    spool = read_spool_of(source, whole=False)
    with ticks_shown("recover", spool.scenario) as on_tick, writing(target):
        rescue(spool, target, on_tick)
    if as_json:
        facts = {"file": target, "ticks": spool.ticks[-1].tick + 1, "complete": spool.complete}
        print_json({**facts, "logical_sha256": logical_sha256(spool)})
    else:
        print(f"{target}: {_ticks(spool)}")


def export(
    recording: FileArgument,
    to: Annotated[Format, typer.Option("--to", help="Which kind of files.")],
    out_folder: OutOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write ticks, epochs and events as tables, for an analysis of your own.

    Every column is named with its unit; the chapter on recordings explains
    them: deploy/docs/recordings.md.

    Example: decmesh export runs/storm-20260101-120000 --to csv
    """
    from deploy.recording.export import tables, write_tables  # noqa: PLC0415 - as above
    from deploy.recording.files import recording_file  # noqa: PLC0415 - as above
    from deploy.recording.reading import read_recording  # noqa: PLC0415 - as above

    found = read_recording(recording)
    folder = out_folder or recording_file(recording).parent
    with writing(folder):
        files = write_tables(tables(found), folder, to.value)
    if as_json:
        print_json({"files": files})
    else:
        print_files(files)


def _ticks(spool: "Spool") -> str:
    unfinished = "" if spool.complete else "; the recording is incomplete"
    return f"{spool.ticks[-1].tick + 1} ticks{unfinished}"


ALL = (replay, recover, export)
