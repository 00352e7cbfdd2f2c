"""Training from arrays: stopped and resumed, step by step, the same bits."""

import itertools

import deepmill
import numpy as np
import pytest

SETTINGS = {"n_epochs": 3, "batch_size": 2, "seed": 7, "evaluate_every": 3}


@pytest.fixture(scope="module")
def samples(mesh):
    return list(itertools.islice(deepmill.online([mesh], seed=2, sites=300), 5))


def weights(trainer, path):
    return trainer.network.save(path).read_bytes()


def test_whole_stopped_and_stepped_runs_end_with_the_same_bits(samples, tmp_path):
    def start():
        return deepmill.Trainer(samples[:4], samples[4:], preset="tiny", settings=SETTINGS, definition="published")

    whole = start()
    steps = []
    assert whole.train(steps.append) and whole.is_finished
    assert [(step["epoch"], step["step"]) for step in steps] == [(e, s) for e in (1, 2, 3) for s in (1, 2)]
    assert all(np.isfinite(step["loss"]) and step["n_steps"] == 2 for step in steps)

    stopped = start()
    assert not stopped.train(lambda step: step["epoch"] < 2)
    resumed = deepmill.Trainer.resume(stopped.save(tmp_path / "state"), samples[:4], samples[4:])
    assert resumed.settings == stopped.settings and not resumed.is_finished
    assert resumed.train()

    stepped = start()
    losses = [step["loss"] for step in iter(stepped.step, None)]
    assert losses == [step["loss"] for step in steps] and stepped.step() is None

    expected = weights(whole, tmp_path / "whole")
    assert expected == weights(resumed, tmp_path / "resumed") == weights(stepped, tmp_path / "stepped")
    for other in (resumed, stepped):
        without_time = [[{**row, "seconds": 0} for row in run.history] for run in (whole, other)]
        assert without_time[0] == without_time[1]
    assert whole.history[-1]["validation"].keys() == {"inaccessible", "occlusion"}


def test_a_trained_network_predicts_and_its_file_gives_the_same(samples, tmp_path):
    trainer = deepmill.Trainer(samples, preset="tiny", settings={"n_epochs": 1, "batch_size": 5})
    assert trainer.train() and len(trainer.history) == 1
    sample = samples[0]
    ours = trainer.network.predict(sample.points, sample.normals, sample.cutter_mm, out_of_domain=True)
    read = deepmill.Network.read(trainer.network.save(tmp_path / "weights.safetensors"))
    again = read.predict(sample.points, sample.normals, deepmill.Tool(sample.cutter_mm), out_of_domain=True)
    assert np.array_equal(ours.logits_inaccessible, again.logits_inaccessible)


def test_samples_may_be_given_or_drawn_anew(samples):
    first = samples[0]
    given = deepmill.Sample(first.points, first.normals, first.cutter_mm, first.inaccessible, first.occlusion)
    assert np.array_equal(given.points, first.points) and given.name == "part"
    settings = {**SETTINGS, "n_epochs": 1, "online": {"mirror": False}}
    trainer = deepmill.Trainer([given, first], preset="tiny", settings=settings)
    assert trainer.settings["online"]["mirror"] is False and trainer.train()


def test_exceptions_stop_training_which_can_go_on(samples):
    trainer = deepmill.Trainer(samples[:2], preset="tiny", settings=SETTINGS)

    def fails(step):
        with pytest.raises(RuntimeError, match="at work"):
            trainer.history
        raise LookupError(step["step"])

    with pytest.raises(LookupError):
        trainer.train(fails)
    with pytest.raises(KeyboardInterrupt):
        trainer.train(interrupts)
    assert trainer.train() and len(trainer.history) == 3


def interrupts(step):
    raise KeyboardInterrupt
