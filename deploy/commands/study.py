"""Commands that run many twins over a grid of cases: `decmesh study loss`."""

from pathlib import Path
from typing import Annotated

import typer

from deploy.commands import live as live_cli
from deploy.commands.terminal import JsonOption, OutOption, err, progress, tell
from deploy.launch.folders import new_folder
from deploy.launch.workers import work_off
from protocol.process.stopping import StoppedError

app = typer.Typer(
    no_args_is_help=True, help="Many runs of the twin, summed up: what lost frames do."
)


@app.command()
def loss(
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each loss and R.")] = 5,
    duration: Annotated[str, typer.Option(help="Of each run, such as 10s.")] = "10s",
    out_folder: OutOption = None,
    as_json: JsonOption = False,
) -> None:
    """Run the twin with 0 to 50 % of all frames lost: agreement, balance.

    Each loss is run with 2 to 8 consensus rounds, and with several seeds.

    Example: decmesh study loss --seeds 2
    """
    from deploy.experiments import loss as studies  # noqa: PLC0415 - numpy and matplotlib, needed only now
    from deploy.experiments import loss_figure as study_figure  # noqa: PLC0415 - as above
    from deploy.experiments.loss_table import loss_table  # noqa: PLC0415 - as above

    cases = studies.grid(seeds=seeds, duration_s=live_cli.quantity(duration, "time"))
    folder = new_folder(out_folder, "study-loss")
    with progress("study loss", len(cases)) as advance:
        results, complete = work_off(studies.measure, cases, lambda _result: advance(1))
    rows = list(studies.means(results))
    if rows:

        def write() -> list[Path]:
            studies.write_csv(results, folder / studies.CSV)
            return [folder / studies.CSV, *study_figure.loss_figure(rows, folder / "loss")]

        facts = {"complete": complete, "means": rows}
        tell(facts, [loss_table(rows)], write, as_json=as_json)
    if not complete:
        err.print(f"{len(results)} of {len(cases)} runs were done")
        raise StoppedError
