"""Run llama.cpp in a process of its own, which a crash of native code may end: prompts in, logits and texts out.

    python llama_child.py MODEL.gguf PROMPTS.json OUT.npz

PROMPTS.json holds {"prompts": [[token, …], …], "ends": [token, …], "most": n}.
"""

import json
import sys
from pathlib import Path

import numpy as np
from llama_cpp import Llama


def main(model: str, prompts: str, out: str) -> None:
    asked = json.loads(Path(prompts).read_text())
    exact = {"type_k": 0, "type_v": 0, "flash_attn": False}  # keys and values in float32
    llama = Llama(model, n_ctx=512, logits_all=True, verbose=False, n_threads=1, n_threads_batch=1, **exact)
    found = {}
    for i, prompt in enumerate(asked["prompts"]):
        llama.reset()
        llama.eval(prompt)
        found[f"logits{i}"] = np.array(llama.scores[: len(prompt)])
        llama.reset()
        text: list[int] = []
        for token in llama.generate(prompt, temp=0.0, top_k=1, repeat_penalty=1.0):
            if token in asked["ends"] or len(text) == asked["most"]:
                break
            text.append(token)
        found[f"text{i}"] = np.array(text)
    np.savez(out, **found)


main(*sys.argv[1:])
