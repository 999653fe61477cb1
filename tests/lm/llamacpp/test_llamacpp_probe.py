"""The trial of a model in a child process: what kills the child is survived, cured where possible, remembered."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from erag.core.errors import ModelError
from erag.lm.ledger import Ledger
from erag.lm.llamacpp import probe as probes
from erag.lm.llamacpp.library import library_version
from erag.lm.llamacpp.probe import Candidate, Probe, explain, remembered
from erag.lm.llamacpp.process import ask
from erag.lm.probe import Cpu

AMX = Cpu("Some CPU with AMX", "x86_64", frozenset({"avx2", "amx_tile", "amx_int8"}))
CANDIDATE = Candidate("toy", Path("models/toy.gguf"), "ab" * 32)

SAY_YES = "print(json.dumps({'ok': True, 'description': 'toy 1M', 'file_type': 3}))"
NEVER = "raise SystemExit(9)"


def child(code: str, log: Path | None = None) -> tuple[str, ...]:
    """A child that runs `code` with the request as `r`, and notes in `log` which kernels it was asked for."""
    note = f"open({str(log)!r}, 'a').write(r.get('kernels', '') + ' ')" if log else "0"
    head = "import json, os, signal, sys, time\nr = json.load(sys.stdin)\n"
    return (sys.executable, "-c", f"{head}{note}\n{code}")


def crashing(log: Path | None = None) -> tuple[str, ...]:
    """A child that dies of a segmentation fault with fast kernels, as on AMX in a virtual machine."""
    return child(f"if r['kernels'] == 'fast': os.kill(os.getpid(), signal.SIGSEGV)\n{SAY_YES}", log)


def test_a_model_that_lives_keeps_its_fast_kernels(tmp_path: Path) -> None:
    choice = Probe(tmp_path, command=child(SAY_YES, tmp_path / "log"), cpu=AMX).survive(CANDIDATE, "auto")
    assert (choice.kernels, choice.reason, choice.file_type) == ("fast", "", 3)
    assert (tmp_path / "log").read_text() == "fast "


@pytest.mark.skipif(library_version() is None, reason="no llama.cpp: pip install 'erag[llamacpp]'")
def test_a_crash_is_cured_remembered_and_explained(tmp_path: Path) -> None:
    log = tmp_path / "log"
    choice = Probe(tmp_path, command=crashing(log), cpu=AMX).survive(CANDIDATE, "auto")
    assert choice.kernels == "plain"
    assert "SIGSEGV" in choice.reason
    again = Probe(tmp_path, command=child(NEVER), cpu=AMX).survive(CANDIDATE, "auto")
    assert again == choice
    assert log.read_text() == "fast plain "
    lines = explain(tmp_path, AMX)
    assert "AMX" in lines[0]
    assert lines[1] == "toy (toy 1M): plain kernels because the child process with fast kernels was killed by SIGSEGV"


def test_a_hang_is_cured_as_well(tmp_path: Path) -> None:
    command = child(f"if r['kernels'] == 'fast': time.sleep(60)\n{SAY_YES}")
    choice = Probe(tmp_path, seconds=2, command=command, cpu=AMX).survive(CANDIDATE, "auto")
    assert (choice.kernels, choice.reason) == ("plain", "fast kernels did not end within 2 s")


@pytest.mark.parametrize("changed", ["cpu name", "cpu flags", "library", "weights", "wish"])
def test_what_was_tried_is_tried_again_when_anything_changes(
    tmp_path: Path, changed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, chip, candidate = tmp_path / "log", AMX, CANDIDATE
    Probe(tmp_path, command=crashing(log), cpu=chip).survive(candidate, "auto")
    if changed == "cpu name":
        chip = replace(AMX, name="another")
    elif changed == "cpu flags":
        chip = replace(AMX, flags=AMX.flags | {"amx_bf16"})
    elif changed == "library":
        monkeypatch.setattr(probes, "library_stamp", lambda: "another build")
    elif changed == "weights":
        candidate = replace(CANDIDATE, sha256="cd" * 32)
    Probe(tmp_path, command=crashing(log), cpu=chip).survive(candidate, "plain" if changed == "wish" else "auto")
    assert log.read_text() == ("fast plain plain " if changed == "wish" else "fast plain fast plain ")
    assert len(remembered(tmp_path / "probes.json")) == 2


@pytest.mark.parametrize("damage", ["", "{", '{"choices": [{"key": 1}]}', '{"choices": [], "more": 1}', "\0" * 100])
def test_a_damaged_memory_of_trials_only_costs_trying_again(tmp_path: Path, damage: str) -> None:
    file = tmp_path / "probes.json"
    file.write_text(damage)
    assert Probe(tmp_path, command=crashing(), cpu=AMX).survive(CANDIDATE, "auto").kernels == "plain"
    assert len(remembered(file)) == 1


def test_a_memory_of_trials_that_cannot_be_written_is_counted(tmp_path: Path) -> None:
    folder, ledger = tmp_path / "file", Ledger()
    folder.write_text("no folder")
    choice = Probe(folder, command=child(SAY_YES), cpu=AMX, ledger=ledger).survive(CANDIDATE, "auto")
    assert choice.kernels == "fast"
    assert [n for name, n in ledger.events.items() if "cannot be remembered" in name] == [1]


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", "killed by SIGSEGV"),
        ("os.abort()", "killed by SIGABRT"),
        ("sys.exit(3)", "exit code 3"),
        ("print('all is well')", "no answer"),
        ("print('[1]')", "wrong answer"),
        (f"{SAY_YES}; sys.stdout.flush(); os.abort()", "killed by SIGABRT"),
        ("print(json.dumps({'ok': False, 'error': 'tensors are\\nmissing \\x1b[2J'}))", "tensors are"),
        ("time.sleep(60)", "did not end within 2 s"),
    ],
)
def test_a_model_that_no_child_survives_is_one_line(tmp_path: Path, code: str, said: str) -> None:
    probe = Probe(tmp_path, seconds=2, command=child(code), cpu=AMX)
    with pytest.raises(ModelError) as caught:
        probe.survive(CANDIDATE, "auto")
    line = caught.value.line()
    assert said in line
    assert "models/toy.gguf" in line
    assert "erag models verify toy" in line
    assert line.isprintable()
    assert remembered(probe.file) == ()


def test_only_the_kernels_asked_for_are_tried(tmp_path: Path) -> None:
    log = tmp_path / "log"
    with pytest.raises(ModelError, match="SIGSEGV"):
        Probe(tmp_path, command=crashing(log), cpu=AMX).survive(CANDIDATE, "fast")
    assert Probe(tmp_path, command=crashing(log), cpu=AMX).survive(CANDIDATE, "plain").kernels == "plain"
    assert log.read_text() == "fast plain "


def test_files_of_the_working_folder_are_not_imported_by_the_child(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "json.py").write_text("raise SystemExit(77)")
    monkeypatch.chdir(tmp_path)
    request = {"do": "render", "template": "{{ messages[0].content }}", "bos": "", "eos": "", "roles": ["user"]}
    from erag.lm.llamacpp.process import child_command

    assert json.loads(json.dumps(dict(ask(child_command(), request, 60).answer)))["pieces"] == [["0", False]]
