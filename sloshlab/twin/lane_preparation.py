"""Many simulations at once: lanes that agree in their shape are packed by eight, and run in one compiled loop."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from sloshlab.errors import InputError
from sloshlab.twin import lanes as engine
from sloshlab.twin.blocks import Blocks
from sloshlab.twin.excitation import Excitation
from sloshlab.twin.lane_vector import N_LANES
from sloshlab.twin.law import N_MOTION
from sloshlab.twin.model import INPUTS, N_OF_BASE_MOTION, Outputs, Stretch, scratch
from sloshlab.twin.motion import Motion
from sloshlab.twin.preparation import (
    Prepared,
    bounds_of_states,
    half_steps_of,
    most_event_functions,
    place_of,
    prepared,
    start_state,
    stretches,
)
from sloshlab.twin.status import Ending, Status

FloatArray = npt.NDArray[np.float64]
_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
_FEWEST_TOGETHER: Final = 2
"""Lanes in use from which eight side by side are faster than each in turn: measured, on registers of 512 bits."""


class Executor(Protocol):
    """Whoever does independent work, one piece after the other or several at once."""

    def map(self, function: Callable[[_Item], _Result], items: Iterable[_Item], /) -> Iterable[_Result]:
        """Results in the order of the items."""

    def map_apart(self, function: Callable[[_Item], _Result], items: Iterable[_Item], /) -> Iterable[_Result]:
        """The same of pieces that take long, perhaps in processes of their own.

        What comes back are numbers, strings, arrays and what is made of them; what else a piece changes is lost.
        """


class InTurn:
    """One piece after the other."""

    def map(self, function: Callable[[_Item], _Result], items: Iterable[_Item], /) -> list[_Result]:
        """Results in the order of the items."""
        return [function(item) for item in items]

    def map_apart(self, function: Callable[[_Item], _Result], items: Iterable[_Item], /) -> list[_Result]:
        """The same."""
        return self.map(function, items)


IN_TURN: Final = InTurn()


@dataclass(frozen=True, eq=False)
class Lane:
    """One simulation of many; as the arguments of `Twin.simulate`.

    Attributes
    ----------
    twin : Blocks
    excitation : Excitation
    start : tuple of float
        Displacement [m] and velocity [m/s] of the tank at t = 0.
    n_substeps : int
    """

    twin: Blocks
    excitation: Excitation
    start: tuple[float, float] = (0.0, 0.0)
    n_substeps: int = 1


def motions(lanes: Sequence[Lane], executor: Executor = IN_TURN) -> list[Motion | InputError]:
    """Free runs of many twins, each up to where it ended; what one lane does disturbs no other.

    Parameters
    ----------
    lanes : sequence of Lane
        Those alike in modes, kinds of terms, steps and length run together.
    executor : Executor, optional
        Shares eight lanes at a time among its workers; results do not depend on it.

    Returns
    -------
    list of Motion or InputError
        In place of a motion why the blocks of a twin contradict each other.
    """
    found: dict[int, Motion | InputError] = {}
    ready: dict[int, _Ready] = {}
    groups: defaultdict[tuple[Any, ...], list[int]] = defaultdict(list)
    for i, lane in enumerate(lanes):
        try:
            ready[i] = _Ready.of(lane)
        except InputError as error:
            found[i] = error
        else:
            groups[_shape_of(lane, ready[i].prepared)].append(i)
    packs = [pack for members in groups.values() for pack in _packs(members, lanes)]

    def of_pack(pack: list[int]) -> list[Motion]:
        return _Pack([lanes[i] for i in pack], [ready[i] for i in pack]).motions()

    for pack, results in zip(packs, executor.map(of_pack, packs), strict=True):
        found |= zip(pack, results, strict=True)
    return [found[i] for i in range(len(lanes))]


def done(motion: Motion | InputError) -> Motion:
    """A motion that reached its end.

    Raises
    ------
    InputError
        If there is none.
    AnalysisError
        If it did not reach its end.
    """
    if isinstance(motion, InputError):
        raise motion
    return motion.require_done()


@dataclass(frozen=True, eq=False)
class _Ready:
    """A lane as arrays."""

    prepared: Prepared
    start: FloatArray

    @classmethod
    def of(cls, lane: Lane) -> _Ready:
        ready = prepared(lane.twin.terms, lane.twin.structure, lane.excitation)
        return cls(ready, start_state(lane.twin, ready, lane.excitation.at_start(), *lane.start))


def _shape_of(lane: Lane, ready: Prepared) -> tuple[Any, ...]:
    """What lanes of one pack have in common."""
    model, excitation = ready.model, lane.excitation
    return (
        excitation.n_samples,
        excitation.sampling_rate_hz,
        excitation.inputs is None,
        lane.n_substeps,
        model.stiffness.size,
        model.friction_frame,
        *((term.kind.name, term.kind.law.address, term.place) for term in lane.twin.terms),
        model.parameters_at.tobytes(),
        model.parameters.size,
        model.memory_at.tobytes(),
    )


def _packs(members: Sequence[int], lanes: Sequence[Lane]) -> list[list[int]]:
    """Eight lanes each, of one excitation as far as that goes: its rows are then read once for all of them."""
    by_excitation: defaultdict[int, list[int]] = defaultdict(list)
    for i in members:
        by_excitation[id(lanes[i].excitation.inputs)].append(i)
    whole, rest = [], []
    for own in by_excitation.values():
        n_packed = len(own) // N_LANES * N_LANES
        whole += [own[k : k + N_LANES] for k in range(0, n_packed, N_LANES)]
        rest += own[n_packed:]
    return whole + [rest[k : k + N_LANES] for k in range(0, len(rest), N_LANES)]


class _Pack:
    """Up to eight lanes; places of missing ones hold zeros, and nothing of them is read."""

    def __init__(self, lanes: Sequence[Lane], ready: Sequence[_Ready]) -> None:
        self.lanes, self.ready = lanes, ready
        self.excitation, self.n_substeps = lanes[0].excitation, lanes[0].n_substeps
        first = ready[0].prepared.model
        self.n_modes, self.n_terms, self.n_memory = (
            first.stiffness.size,
            first.law.size,
            ready[0].prepared.memory.size,
        )
        self.steps_together = len(lanes) >= _FEWEST_TOGETHER and not first.updates
        kinds = [term.kind for term in lanes[0].twin.terms]
        # the acceleration is solved for in each lane by itself
        laws = np.array([0 if kind.uses_acceleration else kind.law.address_of_lanes for kind in kinds], np.int64)
        self.twins = engine.Lanes(
            len(lanes),
            int(first.frame.min(initial=1)),
            int(first.frame.max(initial=0)),
            self.n_modes,
            **{name: self._rows(name) for name in _OF_LANES},
            of_first=first,
            laws=laws,
            has_lone_laws=not laws.all(),
        )
        self.factors = np.zeros(N_LANES)
        self.factors[: len(lanes)] = [lane.excitation.factor for lane in lanes]

    def _rows(self, name: str) -> FloatArray:
        values = [np.asarray(getattr(ready.prepared.model, name)) for ready in self.ready]
        rows = np.zeros((N_LANES, *values[0].shape))
        rows[: len(values)] = values
        return rows

    def motions(self) -> list[Motion]:
        """Simulate all of them."""
        n_rows = self.excitation.n_samples
        own = [np.empty((3 * self.n_modes + 1, n_rows)) for _ in self.lanes]
        series = engine.Series(_addresses(own), n_rows)
        side_by_side, scratches = self._side_by_side(), self._scratch()
        status, filled, where = (np.full(N_LANES, value) for value in (int(Status.DONE), n_rows, -1))
        out = Outputs(np.empty((0, 0)), np.empty((0, 4)), np.zeros(1, np.int64), 0, 0)
        stepped_alone, unsolved = np.zeros(N_LANES, np.int64), np.zeros(N_LANES, np.int64)
        ends = engine.LaneEnds(status, filled, where, stepped_alone, unsolved, out)
        largest = bounds_of_states(self.n_modes, self.n_memory)
        step = 1.0 / (self.excitation.sampling_rate_hz * self.n_substeps)
        inputs = _Inputs(self.lanes)
        for first_row, last_row in stretches(n_rows, self.n_substeps):
            tables, drives = inputs.of(first_row, last_row, self.factors)
            stretch = Stretch(first_row, last_row, self.n_substeps, step, largest)
            alone = engine.addresses_for(self.twins, drives, scratches, stretch, ends)
            if first_row == 1:
                engine.begin_lanes(self.twins, drives, side_by_side, scratches, ends, series, alone.begin)
            if self.steps_together:
                engine.integrate_together(
                    self.twins, drives, side_by_side, scratches, stretch, ends, series, alone.integrate
                )
            else:
                engine.integrate_in_turn(self.twins, drives, scratches, stretch, ends, series, alone.integrate)
            del tables  # kept up to here, as the loop has only their addresses
        return [self._motion(i, own[i], ends, inputs) for i in range(len(self.lanes))]

    def _side_by_side(self) -> engine.SideBySide:
        n, twins = self.n_modes, self.twins
        rows = (
            twins.shape, twins.shape * twins.inverse_mass, twins.inverse_mass, -twins.stiffness, twins.damping,
            twins.base_participation, twins.parameters, twins.mass,
        )  # fmt: skip
        sizes = (2 * n, 2 * n, 5 * 2 * n, n, len(INPUTS), 2 * N_MOTION, 1, self.n_terms, 2)
        return engine.SideBySide(*(_aligned(of) for of in (*(row.T for row in rows), *map(_empty_rows, sizes))))

    def _scratch(self) -> engine.LaneScratch:
        n_values = most_event_functions(self.lanes[0].twin.terms)
        own = [scratch(ready.prepared.model, ready.start, n_values) for ready in self.ready]
        rows = {}
        for name in engine.LaneScratch._fields[:-3]:
            values = [getattr(s, name) for s in own]
            rows[name] = np.zeros((N_LANES, *values[0].shape))
            rows[name][: len(values)] = values
        return engine.LaneScratch(
            **rows, nothing=np.zeros(0), no_powers=np.zeros((5, 0)), slope_before=np.zeros(N_LANES)
        )

    def _motion(self, i: int, series: FloatArray, ends: engine.LaneEnds, inputs: _Inputs) -> Motion:
        lane, filled, status = self.lanes[i], int(ends.filled[i]), Status(int(ends.status[i]))
        rate, n = self.excitation.sampling_rate_hz, self.n_modes
        place = place_of(lane.twin, self.ready[i].prepared.model, int(status), int(ends.where[i]))
        base_motion, external_force_n = inputs.kept(i)
        return Motion(
            lane.twin,
            rate,
            Ending(status, filled / rate, place),
            series[: 3 * n, :filled].reshape(3, n, filled).transpose(2, 0, 1),
            base_motion[:filled] if self.factors[i] == 1.0 else self.factors[i] * base_motion[:filled],
            external_force_n[:filled],
            series[3 * n, :filled],
        )


_OF_LANES: Final = engine.Lanes._fields[4:-3]


class _Inputs:
    """Tables of what drives some lanes, and what of them is kept at the samples."""

    def __init__(self, lanes: Sequence[Lane]) -> None:
        self._lanes = lanes
        n = lanes[0].excitation.n_samples
        self._distinct: dict[int, Excitation] = {id(lane.excitation.inputs): lane.excitation for lane in lanes}
        self._kept = {key: (np.zeros((N_OF_BASE_MOTION, n)).T, np.zeros(n)) for key in self._distinct}

    def of(self, first_row: int, last_row: int, factors: FloatArray) -> tuple[list[FloatArray], engine.Drives]:
        """Tables of a stretch, and where the compiled loop finds them."""
        n_substeps = self._lanes[0].n_substeps
        tables = {}
        for key, excitation in self._distinct.items():
            tables[key], first = half_steps_of(excitation, n_substeps, first_row - 1, last_row - 1)
            self._keep(key, tables[key], 2 * n_substeps * (first_row - 1) - first, (first_row - 1, last_row))
        n_rows = next(iter(tables.values())).shape[0]
        addresses = _addresses([tables[id(lane.excitation.inputs)] for lane in self._lanes])
        drives = engine.Drives(addresses, n_rows, first, factors, len(tables) == 1)
        return list(tables.values()), drives

    def _keep(self, key: int, table: FloatArray, begin: int, rows: tuple[int, int]) -> None:
        if not table.size:
            return
        per_row = 2 * self._lanes[0].n_substeps
        of_rows = table[begin : begin + per_row * (rows[1] - rows[0]) : per_row]
        base_motion, external_force_n = self._kept[key]
        base_motion[rows[0] : rows[1]] = of_rows[:, :N_OF_BASE_MOTION]
        external_force_n[rows[0] : rows[1]] = of_rows[:, INPUTS.index("force")]

    def kept(self, i: int) -> tuple[FloatArray, FloatArray]:
        """Motion of the base at the samples, before the factor of the lane, and force on the tank."""
        return self._kept[id(self._lanes[i].excitation.inputs)]


def _addresses(tables: Sequence[FloatArray]) -> npt.NDArray[np.int64]:
    addresses = np.zeros(N_LANES, np.int64)
    addresses[: len(tables)] = [table.ctypes.data for table in tables]
    return addresses


def _empty_rows(n: int) -> FloatArray:
    return np.zeros((n, N_LANES))


def _aligned(rows: FloatArray) -> FloatArray:
    """A flat copy whose first number begins a line of the cache: eight numbers are then read from one line."""
    room = np.empty(rows.size + N_LANES)
    skipped = (-room.ctypes.data % 64) // 8
    flat = room[skipped : skipped + rows.size]
    flat[:] = rows.ravel()
    return flat
