"""The vector fit against that of scikit-rf on one noisy response (skips without it)."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.modal.vector_fitting import vector_fit

skrf = pytest.importorskip("skrf", reason="scikit-rf is not installed: no independent vector fit to compare with")


def test_poles_are_those_of_scikit_rf() -> None:
    lines = np.linspace(5, 100, 600)
    s = 2j * np.pi * lines
    poles = np.array([-2.0 + 68.3j, -9.0 + 497.0j])
    residues = np.array([3.0 + 1.0j, -4.0 + 20.0j])
    clean = 0.01 + sum(
        r / (s - p) + r.conjugate() / (s - p.conjugate()) for p, r in zip(poles, residues, strict=True)
    )
    noise = np.random.default_rng(1).normal(0, 1e-3, (2, lines.size))
    response = clean + noise[0] + 1j * noise[1]
    network = skrf.Network(f=lines, s=response[:, None, None], z0=50.0, f_unit="Hz")
    reference = skrf.vectorFitting.VectorFitting(network)
    reference.vector_fit(n_poles_real=0, n_poles_cmplx=2, fit_constant=True, fit_proportional=False)
    expected = reference.poles[np.argsort(np.abs(reference.poles))]
    found = vector_fit(lines, response, n_pole_pairs=2).poles
    # the noise moves the poles by some 1e-3; the two fits weigh it alike
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    assert np.abs(found - poles).max() > 1e-4
