"""Commands that measure one thing on purpose: `decmesh measure consensus`, `measure te`."""

from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer
from rich.table import Table

from deploy.commands.terminal import JsonOption, OutOption, SetOption, err, progress, tell
from deploy.failure import FailedError
from deploy.launch import machine
from deploy.launch.folders import new_folder
from deploy.launch.workers import work_off
from protocol.process.exit_codes import ExitCode
from protocol.process.stopping import StoppedError

if TYPE_CHECKING:
    from deploy.experiments.consensus.network import BatchResult, ConsensusCase

app = typer.Typer(
    no_args_is_help=True,
    help="One thing on purpose: the consensus, or what T_e decides.",
)
Value = TypeVar("Value")


@app.command()
def consensus(
    boards: Annotated[str, typer.Option(metavar="N,N,…", help="How many boards.")] = "3,5,10,20,50",
    graph: Annotated[
        str, typer.Option(metavar="NAME,…", help="Who hears whom: line, ring, tree, random.")
    ] = "line,ring,tree,random",
    loss: Annotated[
        str, typer.Option(metavar="P,P,…", help="Share of all frames that is lost, 0 to 0.9.")
    ] = "0,0.1,0.3",
    epochs: Annotated[int, typer.Option(min=1, help="Elections of each case.")] = 1000,
    rounds: Annotated[
        int | None,
        typer.Option(min=1, max=100_000, help="R: rounds until they latch; default: the diameter."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of urgencies, losses and random graphs.")] = 1,
    processes: Annotated[
        bool, typer.Option("--processes", help="A process per board over Zenoh: wall time too.")
    ] = False,
    out_folder: OutOption = None,
    as_json: JsonOption = False,
) -> None:
    """Measure the consensus by itself: rounds, agreement, latency.

    Boards without a body elect; their urgencies are drawn from the seed. In
    the twin there can be thousands; as processes, as many as there is room for.

    Example: decmesh measure consensus --boards 3,10,100 --loss 0,0.2
    """
    from deploy.experiments.consensus import run as measuring  # noqa: PLC0415 - numpy, needed only now

    try:
        cases = measuring.grid(
            boards=_numbers(boards, int, "--boards", "3,5,10"),
            graphs=graph.replace(" ", "").split(","),
            losses=_numbers(loss, float, "--loss", "0,0.1"),
            rounds=rounds,
            epochs=epochs,
            seed=seed,
        )
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    if processes:
        cases = _that_fit(cases)
    folder = new_folder(out_folder, "measure-consensus")
    played, complete = (_in_processes if processes else _in_twin)(cases)
    if any(epochs for _, epochs in played):
        _tell_consensus(cases, played, folder, complete=complete, as_json=as_json)
    if not complete:
        done = sum(len(epochs) for _, epochs in played)
        err.print(f"{done} of {sum(case.epochs for case in cases)} epochs were played")
        raise StoppedError


@app.command()
def te(
    values: Annotated[
        str, typer.Option(metavar="S:S or S,S,…", help="T_e in seconds: a range, or one by one.")
    ] = "0.02:1",
    settings: SetOption = None,
    out_folder: OutOption = None,
    as_json: JsonOption = False,
) -> None:
    """Measure what the election period T_e does to the paper's Table II.

    The paper does not print its T_e. Here each value is a run of its
    experiment in the twin; one run without elections is put beside them.

    Example: decmesh measure te --values 0.05,0.1,0.2
    """
    from deploy.experiments.election_period import run as measuring  # noqa: PLC0415 - as above
    from deploy.experiments.election_period.figure import te_figure  # noqa: PLC0415 - as above
    from deploy.experiments.election_period.table import te_table  # noqa: PLC0415 - as above
    from deploy.scenario_file.load import load  # noqa: PLC0415 - pydantic, needed only now

    usual = load(measuring.SCENARIO, settings or [])
    tick_s: float = usual.run.tick_s
    try:
        periods_s = measuring.periods_s(values, tick_s=tick_s)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--values") from error
    cases = measuring.grid(periods_s, settings or [])
    folder = new_folder(out_folder, "measure-te")
    with progress("measure te", len(cases)) as advance:
        results, complete = work_off(measuring.measure, cases, lambda _result: advance(1))
    results = measuring.in_order(results)
    if results:
        usual_s: float = usual.election.period_ticks * tick_s

        def write() -> list[Path]:
            measuring.write_csv(results, folder / measuring.CSV)
            return [folder / measuring.CSV, *te_figure(results, usual_s, folder / "te")]

        found = [{"period_s": period_s, **summary} for period_s, summary in results]
        facts = {"complete": complete, "runs": found}
        tell(facts, [te_table(results)], write, as_json=as_json)
    if not complete:
        err.print(f"{len(results)} of {len(cases)} runs were done")
        raise StoppedError


def _numbers(text: str, read: Callable[[str], Value], option: str, example: str) -> list[Value]:
    try:
        return list(dict.fromkeys(map(read, text.split(","))))
    except ValueError as error:
        line = f"{text!r}: write numbers with commas between them, like {example}"
        raise typer.BadParameter(line, param_hint=option) from error


def _that_fit(cases: "Sequence[ConsensusCase]") -> "list[ConsensusCase]":
    """Leave out, and say so, what this machine cannot run as processes."""
    from deploy.experiments.consensus import processes as measure_processes  # noqa: PLC0415 - as above

    most = measure_processes.boards_max()
    large = dict.fromkeys(str(case.boards) for case in cases if case.boards > most)
    if large:
        line = (
            f"{', '.join(large)} boards are too many processes for this machine, which takes {most}"
            f" ({machine.cores()} cores, {machine.free_memory_mb()} MB free)"
        )
        if len(large) == len({case.boards for case in cases}):
            raise FailedError(ExitCode.BAD_INPUT, f"{line}; leave --processes away")
        err.print(f"{line}; left out", highlight=False, soft_wrap=True)
    return [case for case in cases if case.boards <= most]


def _in_twin(cases: "Sequence[ConsensusCase]") -> "tuple[list[BatchResult], bool]":
    from deploy.experiments.consensus import network  # noqa: PLC0415 - as above

    pieces = network.pieces(cases)
    with progress("consensus", sum(case.epochs * case.boards for case in cases)) as advance:
        return work_off(
            network.play,
            pieces,
            lambda played: advance(len(played.epochs) * played.case.boards),
        )


def _in_processes(cases: "Sequence[ConsensusCase]") -> "tuple[list[BatchResult], bool]":
    from deploy.experiments.consensus import processes as measure_processes  # noqa: PLC0415 - as above
    from deploy.experiments.consensus.network import BatchResult  # noqa: PLC0415 - as above

    played = [BatchResult(case, []) for case in cases]
    costs = {case: case.boards * case.period_ticks for case in cases}
    with progress("consensus", sum(costs[case] * case.epochs for case in cases)) as advance:
        try:
            for case, epochs in played:
                with closing(measure_processes.play(case)) as playing:
                    for epoch in playing:
                        epochs.append(epoch)
                        advance(costs[case])
        except StoppedError:
            return played, False
    return played, True


def _tell_consensus(
    cases: "Sequence[ConsensusCase]",
    played: "Sequence[BatchResult]",
    folder: Path,
    *,
    complete: bool,
    as_json: bool,
) -> None:
    from deploy.experiments.consensus import run as measure_consensus  # noqa: PLC0415 - as above
    from deploy.experiments.consensus import table as measure_table  # noqa: PLC0415 - as above
    from deploy.experiments.consensus import theory as measure_theory  # noqa: PLC0415 - as above
    from deploy.experiments.consensus.figure import consensus_figure  # noqa: PLC0415 - as above

    rows = list(measure_consensus.rows(cases, played))
    by_case = measure_consensus.by_case(cases, played)
    beside = [
        line
        for case, epochs in by_case.items()
        if measure_theory.applies(case)
        for line in measure_theory.beside(case, epochs)
    ]

    def write() -> list[Path]:
        measure_consensus.write_csv(rows, folder / measure_consensus.CSV)
        figures = consensus_figure(rows, folder / "consensus")
        return [folder / measure_consensus.CSV, *figures]

    shown: list[Table | str] = [measure_table.rounds_table(rows), measure_table.LEGEND]
    if any(row.wall_ms.p50 is not None for row in rows):
        shown += [measure_table.wall_table(rows), ""]
    if beside:
        shown += [measure_table.theory_table(beside), ""]
    facts = {"complete": complete, "cases": rows, "line_of_three": beside}
    tell(facts, shown, write, as_json=as_json)
