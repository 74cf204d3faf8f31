"""replay, recover and export, as they are typed; and files that are none of theirs."""

import csv
import json
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from msgpack import Unpacker, packb
from pyarrow import parquet
from typer.testing import CliRunner, Result

from deploy.cli import app
from deploy.failure import FailedError
from deploy.outcome import results
from deploy.outcome.indices import all_indices
from deploy.outcome.results import read_run
from deploy.recording.files import UnreadableError
from deploy.recording.logical_digest import logical_sha256
from deploy.recording.mcap import file as mcap_file
from deploy.recording.mcap.file import read_mcap, write_mcap
from deploy.recording.reading import read_recording
from deploy.recording.trajectory import CUT_OFF, recorded_trajectory
from plant_server.spool import spool as spools
from plant_server.spool.chunks import ChunkWriter, read_chunks
from plant_server.spool.spool import Spool, SpoolWriter
from protocol.process.exit_codes import ExitCode
from protocol.process.fingerprint import fingerprint
from protocol.robot.events import Plug, event_of
from protocol.wire.frames import VERSION
from tests.deploy.spools import spool, timed
from tests.system.rig import decmesh

pytestmark = pytest.mark.slow

Change = Callable[[dict[str, Any]], dict[str, Any]]


def typed(*words: str | Path) -> Result:
    """Run a command in this process; errors that are told as a line are raised."""
    done = CliRunner().invoke(app, [str(word) for word in words])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done


def of_here() -> Spool:
    return timed(spool("storm"))._replace(facts={"mode": "twin", "fingerprint": fingerprint()})


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run."""
    folder = tmp_path_factory.mktemp("run")
    filed(of_here(), folder)
    return folder


def spooled(of: Spool, folder: Path) -> Path:
    """A spool as the plant would write it, in chunks of some ticks."""
    folder.mkdir(exist_ok=True)
    path = folder / "run.spool"
    with SpoolWriter(path, of.scenario, of.facts) as writer:
        for record, walls in zip(of.ticks, of.walls, strict=True):
            writer.append(record, walls)
        writer.close(of.outcome)
    return path


def filed(of: Spool, folder: Path) -> Path:
    """The file that is made of a run."""
    path = folder / "run.mcap"
    write_mcap(of, recorded_trajectory(of), path, lambda _tick: None)
    return path


def test_a_run_that_cannot_have_been_has_a_summary_and_its_spool(tmp_path: Path) -> None:
    """Such as of foreign boards. It is told in a line; what was recorded stays."""
    of = of_here()
    ticks = [*of.ticks[:50], of.ticks[50]._replace(events=(Plug(99),)), *of.ticks[51:]]
    spooled(of._replace(ticks=ticks), tmp_path)
    concluded = results.conclude(tmp_path, "twin")
    assert concluded is not None
    with pytest.raises(UnreadableError, match=r"Plug.*cannot have happened"):
        list(results.write(concluded, tmp_path, lambda _tick: None))
    assert {path.name for path in tmp_path.iterdir()} == {"run.spool", "summary.json"}


@pytest.mark.parametrize("command", ["replay", "recover", "export"])
def test_every_command_explains_itself_with_an_example(command: str) -> None:
    assert f"Example: decmesh {command} runs/" in typed(command, "--help").output


def test_a_replay_says_identical_and_how_many_ticks(whole: Path) -> None:
    assert typed("replay", whole).output == "identical: 500 ticks\n"
    assert typed("replay", whole / "run.mcap").exit_code == ExitCode.OK
    facts = json.loads(typed("replay", whole, "--json").stdout)
    assert facts == {
        "identical": True,
        "ticks": 500,
        "complete": True,
        "same_arithmetic": True,
        "difference": None,
    }


def test_a_spool_is_a_recording_too(tmp_path: Path) -> None:
    assert typed("replay", spooled(of_here(), tmp_path)).output == "identical: 500 ticks\n"


def test_a_recording_of_another_arithmetic_is_compared_and_named(tmp_path: Path) -> None:
    of = of_here()._replace(facts={"mode": "twin", "fingerprint": "0123456789abcdef"})
    done = typed("replay", spooled(of, tmp_path))
    assert "recorded where numbers are rounded otherwise" in done.stderr
    assert "0123456789abcdef" in done.stderr
    assert done.stdout == "identical: 500 ticks\n"


def tampered(source: Path, target: Path, topic: str, tick: int, change: Change) -> None:
    """Write an MCAP file again with one message changed, all checksums right."""
    with source.open("rb") as old, target.open("wb") as new:
        reader, writer = make_reader(old), Writer(new)
        writer.start()
        for metadata in reader.iter_metadata():
            writer.add_metadata(metadata.name, metadata.metadata)
        numbers: dict[int, int] = {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            assert schema is not None
            if channel.id not in numbers:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                numbers[channel.id] = writer.register_channel(channel.topic, "json", number)
            data = message.data
            if channel.topic == topic and (body := json.loads(data)).get("tick", tick) == tick:
                data = json.dumps(change(body)).encode()
            writer.add_message(
                numbers[channel.id], message.log_time, data, message.publish_time, message.sequence
            )
        writer.finish()


@pytest.mark.parametrize(
    ("topic", "tick", "change", "said"),
    [
        ("/plant/tick", 77, {"angles_rad": [0.1, 0.2, 0.3]}, "tick 77: angles_rad of ankle: "),
        ("/plant/tick", 78, {"torques_nm": ["NaN", 0, 0]}, "tick 78: torques_nm of ankle: "),
        ("/knee/torque", 79, {"torque_nm": -0.0}, "tick 79: torque_nm of the torque frame of knee"),
        ("/hip/observation", 80, {"imu_rad": 0.0}, "tick 80: imu_rad on /hip/observation: "),
        ("/knee/link/hip", 81, {"urgency": 9.0}, "tick 81: urgency on /knee/link/hip: "),
        ("/knee/link/hip", 82, {"fate": "stolen"}, "tick 82: fate on /knee/link/hip: "),
        ("/epoch", 108, {"y": [2, 0, 0]}, "tick 108: y on /epoch: "),
        ("/outcome", 500, {"ending": "fell"}, "tick 500: ending of the outcome: "),
    ],
)
def test_a_tampered_value_is_found_in_its_tick(
    tmp_path: Path, whole: Path, topic: str, tick: int, change: dict[str, Any], said: str
) -> None:
    path = tmp_path / "run.mcap"
    tampered(whole / "run.mcap", path, topic, tick, lambda body: {**body, **change})
    done = typed("replay", path)
    assert done.exit_code == ExitCode.FAILED
    assert done.stdout.startswith(said)
    assert len(done.stdout.splitlines()) == 1
    difference = json.loads(typed("replay", path, "--json").stdout)["difference"]
    assert difference["tick"] == tick


def test_what_a_file_says_of_itself_is_verified_too(tmp_path: Path, whole: Path) -> None:
    """The report shows it: a digest that is not of these records would be believed."""
    path = tmp_path / "run.mcap"
    with (whole / "run.mcap").open("rb") as old, path.open("wb") as new:
        reader, writer = make_reader(old), Writer(new)
        writer.start()
        for metadata in reader.iter_metadata():
            known = {name: "0" * 64 for name in metadata.metadata if name == "logical_sha256"}
            writer.add_metadata(metadata.name, {**metadata.metadata, **known})
        numbers: dict[str, int] = {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            assert schema is not None
            if channel.topic not in numbers:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                numbers[channel.topic] = writer.register_channel(channel.topic, "json", number)
            writer.add_message(numbers[channel.topic], message.log_time, message.data, 0)
        writer.finish()
    done = typed("replay", path)
    assert done.exit_code == ExitCode.FAILED
    assert done.stdout.startswith("tick -10: logical_sha256 in the metadata: recorded '0000")


def test_written_by_another_hand_it_is_the_same_recording(tmp_path: Path, whole: Path) -> None:
    """Other spaces, another order of names, no metadata but ours: what it says counts."""
    path = tmp_path / "run.mcap"
    tampered(whole / "run.mcap", path, "/knee/torque", 7, lambda body: dict(sorted(body.items())))
    assert typed("replay", path).output == "identical: 500 ticks\n"


def drop_chunks(path: Path, share: float) -> None:
    """Cut a spool somewhere: the last chunk is no longer whole."""
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])


@pytest.fixture
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spools, "CHUNK_BYTES", 4000)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.99])
@pytest.mark.usefixtures("small_chunks")
def test_what_is_whole_of_a_cut_recording_is_recovered(tmp_path: Path, share: float) -> None:
    of = of_here()
    path = spooled(of, tmp_path / "run")
    drop_chunks(path, share)
    kept = path.read_bytes()
    done = typed("recover", path.parent)
    back = read_mcap(path.with_suffix(".mcap"))
    ticks = len(back.ticks) - 10
    assert done.stdout.endswith(f"run.mcap: {ticks} ticks; the recording is incomplete\n")
    assert back.ticks == of.ticks[: len(back.ticks)]
    assert 0.9 * share * 500 - 50 < ticks < 500
    assert not back.complete
    assert path.read_bytes() == kept, "what it was made from stays"
    replayed = typed("replay", path.parent)
    assert replayed.stdout == f"identical: {ticks} ticks; the recording is incomplete\n"


@pytest.mark.usefixtures("small_chunks")
def test_a_recovered_run_has_indices_up_to_where_it_was_cut(tmp_path: Path) -> None:
    of = of_here()
    path = spooled(of, tmp_path / "run")
    drop_chunks(path, 0.5)
    typed("recover", path.parent)
    found = read_recording(path.parent)
    run = found.trajectory
    assert (run.ending, found.complete) == (CUT_OFF, False)
    assert read_run(path.parent) is None, "it has no end"
    assert 100 < run.ticks < 400
    first = recorded_trajectory(of)
    assert np.array_equal(run.angles_rad, first.angles_rad[: run.ticks + 1])
    assert np.array_equal(run.torques_nm, first.torques_nm[: run.ticks])
    assert run.wall_s == pytest.approx(run.ticks / 1000), "by the clock of the plant"
    assert set(all_indices(run)) == {"TS", "KNEE", "BS"}
    assert all(len(frames.fate) == run.ticks for frames in found.links.values())


def test_a_whole_spool_becomes_a_whole_file(tmp_path: Path, whole: Path) -> None:
    """As of a plant that was started by hand."""
    of = of_here()._replace(reports=[])
    path = spooled(of, tmp_path / "run")
    facts = json.loads(typed("recover", path, "--json").stdout)
    assert facts == {
        "file": str(path.with_suffix(".mcap")),
        "ticks": 500,
        "complete": True,
        "logical_sha256": logical_sha256(read_mcap(whole / "run.mcap")),
    }


def test_of_a_damaged_file_the_beginning_is_recovered(tmp_path: Path, whole: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes((whole / "run.mcap").read_bytes()[:-20_000])
    with pytest.raises(UnreadableError, match="decmesh recover reads what comes before"):
        typed("replay", path)
    damaged = path.read_bytes()
    typed("recover", path)
    assert path.read_bytes() == damaged
    assert not read_mcap(tmp_path / "run.recovered.mcap").complete


def test_of_a_file_cut_before_its_first_tick_nothing_can_be_recovered(
    tmp_path: Path, whole: Path
) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes((whole / "run.mcap").read_bytes()[:100])
    for command in ("replay", "recover"):
        with pytest.raises(UnreadableError, match="cut off; nothing of the run comes before that"):
            typed(command, path)


@pytest.mark.parametrize(
    "words", [("recover",), ("export", "--to", "csv"), ("export", "--to", "npz")]
)
def test_a_place_that_cannot_be_written_is_one_line(
    tmp_path: Path, whole: Path, words: tuple[str, ...]
) -> None:
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(FailedError, match=r"^cannot write to .*; choose another --out$") as caught:
        typed(*words, whole, "--out", tmp_path / "file")
    assert caught.value.code == ExitCode.NO_OUTPUT


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "decmesh export: Missing option '--to'. Choose from: csv, npz, parquet; see "),
        (("--to", "xlsx"), "decmesh export: Invalid value for '--to': 'xlsx' is not one of "),
    ],
)
def test_a_kind_of_file_that_there_is_none_of_is_one_line(
    whole: Path, words: tuple[str, ...], said: str
) -> None:
    done = decmesh("export", str(whole), *words)
    assert done.returncode == ExitCode.BAD_INPUT
    assert done.stderr.startswith(said)
    assert len(done.stderr.splitlines()) == 1


def read_csv(path: Path) -> dict[str, list[str]]:
    with path.open(newline="", encoding="utf-8") as file:
        names, *rows = csv.reader(file)
    return dict(zip(names, (list(column) for column in zip(*rows, strict=True)), strict=True))


def test_tables_have_a_row_for_each_tick_epoch_and_event(tmp_path: Path, whole: Path) -> None:
    done = typed("export", whole, "--to", "csv", "--out", tmp_path)
    names = ["ticks", "epochs", "events"]
    assert done.stdout.split() == [str(tmp_path / f"{name}.csv") for name in names]
    ticks, epochs, events = (read_csv(tmp_path / f"{name}.csv") for name in names)
    of = of_here()
    free = [record for record in of.ticks if record.tick >= 0]
    assert ticks["tick"] == [str(record.tick) for record in free]
    exact = [float(text) for text in ticks["knee_angle_rad"]]
    assert exact == [record.angles_rad[1] for record in free], "every bit comes back"
    assert [float(text) for text in ticks["hip_torque_nm"]] == [r.torques_nm[2] for r in free]
    away = [i for i, record in enumerate(free) if not record.answers[2]]
    assert away
    assert [i for i, state in enumerate(ticks["hip_state"]) if state == "absent"] == away
    assert set(ticks["knee_to_hip_fate"]) >= {"late", "lost", "cut", "nobody"}
    assert len(epochs["epoch"]) == 5
    assert max(float(w) for w in epochs["hip_w_rad"]) > 0.5
    told = [(r.tick, event) for r in of.ticks for event in r.events]
    assert [event_of(json.loads(text)) for text in events["event_json"]] == [one for _, one in told]
    assert [int(tick) for tick in events["tick"]] == [tick for tick, _ in told]


def test_other_formats_hold_the_same(tmp_path: Path, whole: Path) -> None:
    found = read_recording(whole)
    for ending in ("npz", "parquet"):
        typed("export", whole, "--to", ending, "--out", tmp_path)
    arrays = np.load(tmp_path / "ticks.npz")
    assert np.array_equal(arrays["knee_angle_rad"], found.trajectory.angles_rad[:-1, 1])
    assert np.array_equal(arrays["plant_opened_ns"], found.opened_ns)
    table = parquet.read_table(tmp_path / "ticks.parquet")
    assert table.column_names == list(arrays)
    assert table["knee_angle_rad"].to_pylist() == arrays["knee_angle_rad"].tolist()
    assert table["knee_state"].to_pylist() == arrays["knee_state"].tolist()


def test_without_its_library_parquet_says_what_to_install(
    tmp_path: Path, whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(FailedError, match=r"pip install 'decmesh\[parquet\]'"):
        typed("export", whole, "--to", "parquet", "--out", tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_without_elections_there_is_no_table_of_them(tmp_path: Path) -> None:
    of = spool("paper", "run.duration_s=0.05", "election.enabled=false")
    typed("export", filed(of, tmp_path), "--to", "npz")
    assert {path.name for path in tmp_path.iterdir()} == {"run.mcap", "ticks.npz", "events.npz"}


@pytest.mark.parametrize("command", [("replay",), ("recover",), ("export", "--to", "csv")])
@pytest.mark.parametrize(
    ("name", "content", "line"),
    [
        ("gone", None, "cannot read .*gone: No such file"),
        ("empty", b"", "empty is no recording that can be used: "),
        ("text", b"hello, world\n" * 50, "text is no recording that can be used: "),
        ("cut.mcap", b"\x89MCAP0\r\n", "cut.mcap is no recording that can be used: it is damaged"),
    ],
)
def test_a_file_that_is_no_recording_gets_one_line(
    tmp_path: Path, command: tuple[str, ...], name: str, content: bytes | None, line: str
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(UnreadableError, match=line) as told:
        typed(command[0], path, *command[1:])
    assert told.value.code == ExitCode.BAD_INPUT
    assert "\n" not in str(told.value)


def test_a_folder_without_a_recording_says_where_there_are_some(tmp_path: Path) -> None:
    with pytest.raises(UnreadableError, match=r"neither run\.mcap nor run\.spool$"):
        typed("replay", tmp_path)
    for name in ("original", "distributed"):
        spooled(of_here(), tmp_path / name)
    inner = f"{tmp_path / 'distributed'}, {tmp_path / 'original'}"
    with pytest.raises(UnreadableError, match=rf"; there are some in {inner}$"):
        typed("replay", tmp_path)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"scenario": {}}, "its scenario: object missing required field name"),
        ({"ticks": [], "walls": []}, "it ends before its first tick"),
        ({"ticks": [], "walls": [], "outcome": None}, "it ends before its first tick"),
    ],
)
def test_a_spool_without_a_run_is_refused(tmp_path: Path, change: dict[str, Any], why: str) -> None:
    path = spooled(of_here()._replace(**change), tmp_path)
    with pytest.raises(UnreadableError, match=why):
        typed("replay", path)


def test_a_tick_of_another_body_is_refused(tmp_path: Path) -> None:
    of = of_here()
    ticks = list(of.ticks)
    ticks[20] = ticks[20]._replace(angles_rad=(1.0, 2.0))
    path = spooled(of._replace(ticks=ticks), tmp_path)
    with pytest.raises(UnreadableError, match="tick 10 is not of 3 joints"):
        typed("replay", path)


@pytest.mark.parametrize("version", [VERSION - 1, VERSION + 1])
@pytest.mark.parametrize(
    "command", [("replay",), ("recover",), ("report",), ("export", "--to", "csv")]
)
def test_a_recording_of_another_version_of_the_wire_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...], version: int
) -> None:
    """By one line that says what to do. Its frames may be readable, and mean something else."""
    monkeypatch.setattr(spools, "VERSION", version)
    monkeypatch.setattr(mcap_file, "VERSION", version)
    spool, file = spooled(of_here(), tmp_path), filed(of_here(), tmp_path)
    line = (
        f" is no recording that can be used: it was recorded with version {version} of the wire,"
        f" and this decmesh reads version {VERSION}; read it with the decmesh that recorded it"
    )
    for path in (spool, file) if command[0] in ("replay", "recover") else (file,):
        with pytest.raises(UnreadableError) as refused:
            typed(command[0], path, *command[1:])
        assert str(refused.value) == f"{path}{line}"
        assert refused.value.code == ExitCode.BAD_INPUT


def test_a_recording_that_tells_no_version_is_of_the_first(tmp_path: Path) -> None:
    path = spooled(of_here(), tmp_path)
    content = next(read_chunks(path.read_bytes()))
    kind, scenario, _version = next(iter(Unpacker(BytesIO(content))))
    chunk = packb((kind, scenario))
    old = tmp_path / "old.spool"
    writer = ChunkWriter(old, chunk_bytes=1000)
    writer.put(chunk)
    writer.close()
    with pytest.raises(UnreadableError, match="recorded with version 1 of the wire"):
        typed("replay", old)


@pytest.mark.parametrize("command", [("report",), ("export", "--to", "csv")])
def test_of_a_spool_a_file_has_to_be_made_first(tmp_path: Path, command: tuple[str, ...]) -> None:
    """Reading computes nothing again, and a spool does not hold what a run.mcap does."""
    path = spooled(of_here(), tmp_path / "run")
    with pytest.raises(UnreadableError, match=r"is a spool; decmesh recover .*run makes run.mcap"):
        typed(command[0], path.parent, *command[1:])
    typed("recover", path.parent)
    assert typed(command[0], path.parent, *command[1:]).exit_code == ExitCode.OK


def test_the_shell_sees_one_line_and_an_exit_code(tmp_path: Path, whole: Path) -> None:
    done = decmesh("replay", str(tmp_path))
    assert (done.returncode, done.stdout) == (ExitCode.BAD_INPUT, "")
    assert len(done.stderr.splitlines()) == 1
    done = decmesh("replay", str(whole))
    assert (done.returncode, done.stdout, done.stderr) == (0, "identical: 500 ticks\n", "")
