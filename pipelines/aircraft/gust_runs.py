"""Models of an aircraft in a gust: frozen and sideways liquids, with trained models in the tanks or without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import Final

from pipelines.aircraft.flying_wing_gusts import GustCase
from pipelines.aircraft.response_file import RecordedCase, RecordedResponse
from pipelines.aircraft.tank_models import TankModels
from pipelines.flutter.problem import FlownAircraft
from sloshlab.aeroelastic.gust import one_minus_cosine
from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aircraft.linear_flight import LIQUID_MODELS, LinearFlight, LiquidModel, linear_flight
from sloshlab.aircraft.tank_simulation import simulate_flight

LONGEST_OUTPUT_STEP_S: Final = 2e-3


@dataclass(frozen=True, eq=False)
class GustedAircraft:
    """An aircraft, its air, and what is in its tanks.

    Attributes
    ----------
    flown : FlownAircraft
    air : RationalForces
    tanks : TankModels or None
        Trained models; none leaves the models ``vertical`` and ``full`` out.
    """

    flown: FlownAircraft
    air: RationalForces
    tanks: TankModels | None

    @property
    def models(self) -> tuple[LiquidModel, ...]:
        """That can be simulated."""
        if not self.flown.model.tanks:
            return ("frozen",)
        return tuple(name for name, (_, sloshes) in LIQUID_MODELS.items() if self.tanks is not None or not sloshes)

    @property
    def output_step_s(self) -> float:
        """2 ms, or a little less so that tanks of one rate step at outputs: steps of one length cost far less."""
        rates = {force.sampling_rate_hz for force in self.tanks.forces().values()} if self.tanks else set()
        if len(rates) != 1:
            return LONGEST_OUTPUT_STEP_S
        period_s = 1 / rates.pop()
        return period_s / ceil(period_s / LONGEST_OUTPUT_STEP_S)

    def flight(self, model: LiquidModel, speed_m_per_s: float) -> LinearFlight:
        """The linear part of a model at a speed."""
        liquids, _ = LIQUID_MODELS[model]
        return linear_flight(
            self.flown.model,
            liquids,
            speed_m_per_s=speed_m_per_s,
            air=self.air,
            gust=self.flown.gust,
            density_kg_per_m3=self.flown.model.density_kg_per_m3,
        )

    def through(
        self, gust: GustCase, model: LiquidModel, duration_s: float, member: int | None = None
    ) -> RecordedResponse:
        """Fly one model through a gust, from rest.

        Parameters
        ----------
        gust : GustCase
        model : str
            One of `models`.
        duration_s : float
        member : int, optional
            Of the ensemble of trained models, in place of the model itself.
        """
        flight = self.flight(model, gust.speed_m_per_s)
        shape = one_minus_cosine(
            gust.amplitude_m_per_s, gust_length_m=gust.length_m, speed_m_per_s=gust.speed_m_per_s
        )
        step_s = self.output_step_s
        if LIQUID_MODELS[model][1] and self.tanks is not None:
            return self.tanks.flown(
                model, flight, shape, duration_s=duration_s, output_step_s=step_s, member=member
            )
        response = simulate_flight(flight, duration_s=duration_s, output_step_s=step_s, gust=shape)
        return RecordedResponse(model, response)


def recorded_case(gust: GustCase, runs: Sequence[RecordedResponse]) -> RecordedCase:
    """A gust with the models that flew through it, as `response.nc` takes it."""
    return RecordedCase(gust.name, gust.speed_m_per_s, gust.amplitude_m_per_s, gust.length_m, tuple(runs))
