"""Progress, stopping, threads."""

import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import deepmill
import numpy as np
import pytest

TOOLS = [f"{radius},{height},20,20" for radius in (1, 1.5, 2, 3) for height in (5, 10, 20)]


def test_progress_has_stages_with_their_parts(mesh):
    seen = []
    deepmill.analyze(mesh, TOOLS[:3], sites=300, progress=lambda *at: seen.append(at))
    assert [at for at in seen if at[0] == "labels"] == [("labels", k, 3) for k in range(4)]
    assert seen[0] == ("sites", 0, 1) and seen[-1] == ("findings", 1, 1)


def test_false_stops_and_exceptions_pass(mesh, tmp_path):
    with pytest.raises(deepmill.Interrupted, match="interrupted"):
        deepmill.analyze(mesh, TOOLS, sites=300, progress=lambda stage, done, of: done < 2)

    def fails(stage, done, of):
        raise LookupError(stage)

    with pytest.raises(LookupError, match="sites"):
        deepmill.analyze(mesh, TOOLS, sites=300, progress=fails)
    outcome = deepmill.analyze(mesh, TOOLS[0], sites=300)
    with pytest.raises(deepmill.Interrupted):
        outcome.save(tmp_path, progress=lambda *at: False)
    assert not list(tmp_path.iterdir())


LONG = """
import deepmill, sys
mesh = deepmill.Mesh.read(sys.argv[1])
def progress(stage, done, of):
    if stage == "labels" and done == 0:
        print("ready", flush=True)
try:
    deepmill.analyze(mesh, "1,4,60,20", sites=100_000, prove=True, progress=progress)
except KeyboardInterrupt:
    print("stopped", flush=True)
"""

CHILD = """
import deepmill, sys
mesh = deepmill.Mesh.read(sys.argv[1])
tools = [f"{1 + 0.01 * k},{5 + k},60,20" for k in range(2000)]
def progress(stage, done, of):
    if stage == "labels" and done == 1:
        print("ready", flush=True)
try:
    deepmill.analyze(mesh, tools, progress=progress)
except KeyboardInterrupt:
    print("stopped", flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("text", [CHILD, LONG], ids=["between tools", "within a tool"])
def test_ctrl_c_stops_long_work(stl, text):
    # A shell without job control starts background jobs with SIGINT ignored, and children inherit that.
    reset = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
    command = [sys.executable, "-c", text, str(stl)]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, preexec_fn=reset)
    try:
        assert child.stdout.readline() == "ready\n"
        time.sleep(0.2)
        start = time.monotonic()
        child.send_signal(signal.SIGINT)
        assert child.communicate(timeout=60)[0] == "stopped\n"
        assert child.returncode == 0 and time.monotonic() - start < 10
    finally:
        child.kill()


def test_other_threads_run_meanwhile_and_answers_do_not_depend_on_them(mesh):
    expected = deepmill.analyze(mesh, "2,5,20,20", sites=3000)[0]
    counts, stop = [0], threading.Event()

    def count():
        while not stop.is_set():
            counts[0] += 1
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    before = counts[0]
    with ThreadPoolExecutor(4) as pool:
        work = [pool.submit(deepmill.analyze, mesh, "2,5,20,20", sites=3000) for _ in range(4)]
        answers = [outcome.result()[0] for outcome in work]
    after = counts[0]
    stop.set()
    counter.join()
    assert after > before
    for other in answers:
        assert np.array_equal(other.inaccessible, expected.inaccessible)
        assert np.array_equal(other.witness, expected.witness, equal_nan=True)


def test_a_callable_may_label_itself(mesh):
    inner = []

    def progress(stage, done, of):
        if stage == "labels" and not inner:
            inner.append(deepmill.analyze(mesh, "2,5,20,20", sites=300)[0])

    outer = deepmill.analyze(mesh, "2,5,20,20", sites=300, progress=progress)[0]
    assert np.array_equal(outer.inaccessible, inner[0].inaccessible)


def test_samples_are_drawn_once_by_several_threads(mesh):
    draw = lambda: deepmill.online([mesh, mesh], seed=3, epochs=4, sites=200)
    expected = {(sample.epoch, sample.index): sample.inaccessible.tobytes() for sample in draw()}
    samples = draw()
    with ThreadPoolExecutor(3) as pool:
        several = list(pool.map(lambda _: list(samples), range(3)))
    found = [((sample.epoch, sample.index), sample.inaccessible.tobytes()) for part in several for sample in part]
    assert len(found) == len(expected) == 8 and dict(found) == expected
