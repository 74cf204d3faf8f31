"""The command `decmesh report`: what came of one run, or of several side by side, as a page."""

from pathlib import Path
from typing import Annotated

import typer

from deploy.commands.terminal import JsonOption, err, print_dim, print_files, print_json, writing
from deploy.launch.folders import new_folder


def report(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="DIR", help="Folders of runs, or their run.mcap."),
    ],
    epoch: Annotated[
        int | None,
        typer.Option(help="Draw this epoch frame by frame; default: the first that lost one."),
    ] = None,
    out_folder: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Where to write; default: beside the run; of several: a new folder."
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Write a page about a run, or about several side by side.

    Writes report.html, which needs nothing else, and its figures beside it.

    Example: decmesh report runs/storm-20260101-120000 --epoch 12
    """
    # Numpy and matplotlib are needed only now.
    from deploy.report.compose import compose, write  # noqa: PLC0415
    from deploy.report.runs import read_runs  # noqa: PLC0415

    with err.status("reading ..."):
        page, pictures = compose(read_runs(runs), epoch)
    pictures.draw()  # By forks, so without a status meanwhile: that has a thread.
    folder = _folder(runs, out_folder)
    with writing(folder):
        written, *drawn = write(page, pictures, folder)
    if as_json:
        print_json({"report": written, "figures": drawn})
        return
    print_files([written])
    print_dim(f"{len(drawn)} picture files in {drawn[0].parent}")


def _folder(runs: list[Path], out_folder: Path | None) -> Path:
    """Where a report goes: to its run, or to a folder of its own."""
    if out_folder is not None:
        return out_folder
    if len(runs) > 1:
        return new_folder(None, "report")
    return runs[0] if runs[0].is_dir() else runs[0].parent
