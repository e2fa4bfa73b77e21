"""What a challenger says is true of a case, checked but not yet compared with any vocabulary."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from sloshlab.errors import InputError

Hidden = Literal["nothing", "wrong_baseline", "effects", "masked", "look_alikes", "outside"]
Block = Literal["excitation", "structure", "tank", "aerodynamics", "control", "sensor"]
UNNAMED: Final = "unknown"
"""Name of physics that has none in any vocabulary."""

_MOST_EFFECTS: Final = 2
_MEMBERS: Final = ("float", "str", "constrained-float", "constrained-str")
_Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,63}$")]
_Number = Annotated[float, Field(allow_inf_nan=False)]
_Text = Annotated[str, Field(min_length=1, max_length=60)]
_N_EFFECTS: Final[dict[str, tuple[int, int]]] = {
    "nothing": (0, 0),
    "wrong_baseline": (0, 0),
    "effects": (1, _MOST_EFFECTS),
    "masked": (1, 1),
    "look_alikes": (1, _MOST_EFFECTS),
    "outside": (1, _MOST_EFFECTS),
}


class StatedEffect(BaseModel):
    """One hidden effect.

    Attributes
    ----------
    name : str
        As the vocabulary or its author calls it.
    block : str
    parameters : dict
        A number in the unit that the name of the parameter ends with, or a text with a unit of its own.
    strength : float or None
        What it changes beyond retuning over the noise floor, where that is known.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    name: _Name = UNNAMED
    block: Block
    parameters: dict[_Name, _Number | _Text] = {}
    strength: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None


class StatedTruth(BaseModel):
    """What is true of a case.

    Attributes
    ----------
    hidden : str
        The class of the case.
    effects : list of StatedEffect
        What is hidden; nothing for `nothing` and `wrong_baseline`.
    equals : list of list of str
        Names that explain the recordings as well, for `look_alikes`.
    note : str
        For people.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    hidden: Hidden
    effects: list[StatedEffect] = []
    equals: list[list[_Name]] = []
    note: Annotated[str, Field(max_length=500)] = ""

    @model_validator(mode="before")
    @classmethod
    def _block_alone(cls, given: Any) -> Any:
        """Of physics outside every vocabulary the block is enough."""
        if isinstance(given, dict) and given.get("hidden") == "outside" and "block" in given:
            rest = {key: value for key, value in given.items() if key != "block"}
            if "effects" not in rest:
                return {**rest, "effects": [{"block": given["block"]}]}
        return given

    @model_validator(mode="after")
    def _complete(self) -> StatedTruth:
        least, most = _N_EFFECTS[self.hidden]
        if not least <= len(self.effects) <= most:
            allowed = f"{least}" if least == most else f"{least} or {most}"
            raise ValueError(f"{allowed} effects where hidden is {self.hidden}")
        if bool(self.equals) != (self.hidden == "look_alikes") or not all(self.equals):
            raise ValueError("lists of names in equals where hidden is look_alikes, and only there")
        if len({(effect.name, effect.block) for effect in self.effects}) < len(self.effects):
            raise ValueError("different effects")
        return self

    def document(self, case: str) -> dict[str, Any]:
        """What is committed to: every field, numbers as floats, whatever form it was written in."""
        return {"case": case, **self.model_dump(mode="json")}


def stated_truth(given: Any, what: str) -> StatedTruth:
    """A truth from the tables of a file.

    Parameters
    ----------
    given : object
    what : str
        What messages call it: the file and the case.

    Raises
    ------
    InputError
        Naming the first field that is wrong.
    """
    try:
        return StatedTruth.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        # of a union pydantic names the member it tried, which is no field
        place = ".".join(str(part) for part in first["loc"] if part not in _MEMBERS)
        got = repr(first["input"])[:80] if first["loc"] else "what does not go together"
        allowed = first["msg"].removeprefix("Value error, ")
        raise InputError(f"{what}: {place}" if place else what, got=got, allowed=allowed) from error
