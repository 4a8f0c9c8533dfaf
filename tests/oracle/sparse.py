"""Numbers for the tests of `src/sparse`: orthogonal matching pursuit by scikit-learn.

Needs numpy and scikit-learn; writes sparse.json beside itself.
"""

import json
from pathlib import Path

import numpy as np
from sklearn.linear_model import orthogonal_mp

rng = np.random.default_rng(7)
atoms = rng.normal(size=(24, 10)).astype(np.float32)
atoms /= np.linalg.norm(atoms, axis=1, keepdims=True)
signals = rng.normal(size=(30, 10)).astype(np.float32)
out = {"atoms": atoms.tolist(), "signals": signals.tolist()}
for sparsity in (1, 2, 4):
    weights = orthogonal_mp(atoms.T.astype(float), signals.T.astype(float), n_nonzero_coefs=sparsity)
    out[f"weights {sparsity}"] = weights.T.tolist()
Path(__file__).with_suffix(".json").write_text(json.dumps(out) + "\n")
