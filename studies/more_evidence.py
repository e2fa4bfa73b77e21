"""Whether more recordings ever make an answer less definite: ``python -m studies.more_evidence CASE…``.

Every case is diagnosed with the first repeat of each test, without its last test, and whole. An answer is the more
definite, the fewer things it leaves open: one name or nothing missing, a set of names, unknown.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from sloshlab.diagnosis.findings import findings_of
from sloshlab.diagnosis.verdict import Verdict, verdict_of
from sloshlab.errors import SloshlabError
from sloshlab.identification.case import Case, read_case


def main() -> int:
    """A line per case; exit code 1 where an answer became less definite, 2 where a case cannot be read."""
    parser = argparse.ArgumentParser(prog="python -m studies.more_evidence", description=__doc__)
    parser.add_argument("cases", nargs="+", type=Path)
    n_worse = 0
    try:
        for folder in parser.parse_args().cases:
            n_worse += _compared(folder)
    except SloshlabError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    sys.stdout.write(f"{n_worse} answers became less definite with more recordings\n")
    return int(n_worse > 0)


def _compared(folder: Path) -> int:
    """Say what is answered with fewer runs and with all; how many answers became less definite."""
    case = read_case(folder)
    whole, n_worse = verdict_of(findings_of(case)), 0
    said = [f"whole: {_in_words(whole)}"]
    for label, names in _subsets(case):
        fewer = _diagnosed(folder, names)
        if fewer is not None:
            is_worse = _left_open(whole) > _left_open(fewer)
            n_worse += is_worse
            said.append(f"{label}: {_in_words(fewer)}{' – more definite' if is_worse else ''}")
    sys.stdout.write(f"{folder.name}: {'; '.join(said)}\n")
    sys.stdout.flush()
    return n_worse


def _subsets(case: Case) -> Iterator[tuple[str, set[str]]]:
    """Names of fewer runs, where there are fewer."""
    tests = case.names_by_test()
    if any(len(test) > 1 for test in tests):
        yield "first repeats", {test[0] for test in tests}
    if len(tests) > 2:
        yield "without the last test", {name for test in tests[:-1] for name in test}


def _diagnosed(folder: Path, names: set[str]) -> Verdict | None:
    """A case of some of its runs; None where it is refused."""
    with tempfile.TemporaryDirectory() as home:
        part = Path(home) / folder.name
        (part / "recordings").mkdir(parents=True)
        shutil.copy(folder / "rig.toml", part)
        for file in sorted((folder / "recordings").glob("*.nc")):
            if file.stem in names:
                shutil.copy(file, part / "recordings")
        try:
            return verdict_of(findings_of(read_case(part)))
        except SloshlabError:
            return None


def _left_open(verdict: Verdict) -> int:
    if verdict.kind == "unknown":
        return 100
    return len(verdict.alternatives) if verdict.kind == "indistinguishable" else 1


def _in_words(verdict: Verdict) -> str:
    answers = [" + ".join(names) for names in verdict.alternatives]
    probability = next(iter(verdict.probabilities.values()), 1.0)
    return f"{' or '.join(answers) or verdict.kind.replace('_', ' ')} ({probability:.2f})"


if __name__ == "__main__":
    sys.exit(main())
