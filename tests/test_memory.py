"""What a run takes at its peak, against what is said before it starts."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

# One process imports the library, and a copy of it makes each run: peaks cannot be reset.
MEASURE = """
import json, os, resource, sys
import torch
torch.set_num_threads(1)
import torchsynth as ts
from torchsynth import memory
from torchsynth.search import base

def peak():
    scale = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * scale

def measure(recipe, channels, side, out, budget):
    base.TABLE_BUDGET = budget
    image = torch.rand(channels, side, side, generator=torch.Generator().manual_seed(0))
    hole = torch.zeros(side, side, dtype=torch.bool)
    hole[:out, :out] = True
    recipe = getattr(ts.recipes, recipe)()
    filling = recipe.name.endswith("fill") or recipe.name == "efros_leung"
    size = (side, side) if filling else (out, out)
    needed = memory.memory_needed(recipe, ts.Exemplar(image), size, 1)
    before = peak()
    ts.fill(image, hole, recipe=recipe) if filling else ts.synthesize(image, size, recipe)
    return needed, peak() - before

for case in json.loads(sys.argv[1]):
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.write(writing, json.dumps(measure(*case)).encode())
        os._exit(0)
    os.close(writing)
    print(os.read(reading, 1000).decode(), flush=True)
    os.close(reading)
    assert os.waitpid(child, 0)[1] == 0
"""
KEPT, READ = 2**30, 0
CASES = [
    ("wei_levoy", 3, 320, 8, KEPT),
    ("wei_levoy", 3, 320, 4, READ),
    ("wei_levoy_tsvq", 1, 128, 16, KEPT),
    ("ashikhmin", 1, 128, 400, KEPT),
    ("coherent_fill", 3, 500, 4, KEPT),
    ("coherent_fill", 3, 500, 4, READ),
    ("wei_levoy_fill", 1, 400, 4, KEPT),
    ("efros_leung", 3, 300, 2, READ),
    ("quilting", 3, 400, 600, KEPT),
    ("graphcut", 3, 200, 300, KEPT),
    ("graphcut", 1, 64, 128, KEPT),
    ("improved_wl", 3, 320, 8, KEPT),
]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="measuring needs copies of a process")
def test_runs_take_no_more_memory_than_was_said():
    options = {"capture_output": True, "text": True, "env": os.environ | {"OMP_NUM_THREADS": "1"}}
    ended = subprocess.run([sys.executable, "-c", MEASURE, json.dumps(CASES)], **options)
    assert ended.returncode == 0, ended.stderr
    for case, line in zip(CASES, ended.stdout.splitlines(), strict=True):
        needed, taken = json.loads(line)
        assert taken <= needed, case
        assert needed <= 2 * taken + 300 * 2**20, case
