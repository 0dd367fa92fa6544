"""Types of options and arguments: each reads one kind of text and says how to write it."""

from pathlib import Path
from typing import Any

import click

from femupdate.study import Study

Place = tuple[float, float, float]


class Input(click.ParamType):
    """A type whose value names something that must exist before a command starts."""

    def require(self, value: Any) -> None:
        """Raise the library's error where it is missing, without heavy imports."""
        raise NotImplementedError


class InputFile(Input):
    """A measured file."""

    name = "file"

    def convert(self, value: Any, param: Any, ctx: Any) -> Path:
        """Its path."""
        return Path(value)

    def require(self, value: Path) -> None:
        """Refuse a file that is missing or empty."""
        from femupdate.measurement.text import read_head

        read_head(value)


class BuildingName(Input):
    """A building file, or the name of a shipped building."""

    name = "building"

    def convert(self, value: Any, param: Any, ctx: Any) -> str:
        """As it is written."""
        return str(value)

    def require(self, value: str) -> None:
        """Refuse a name that is neither a file nor a shipped building."""
        from femupdate.building.shipped import building_text

        building_text(value)


class StudyFolder(Input):
    """A study, whose folder may be missing."""

    name = "directory"

    def convert(self, value: Any, param: Any, ctx: Any) -> Study:
        """The study in that folder."""
        return Study(Path(value))

    def require(self, value: Study) -> None:
        """Refuse a path that is a file."""
        value.check_folder()


class Names(click.ParamType):
    """Names with commas between them."""

    name = "names"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[str, ...]:
        """Return the names without empty ones."""
        if isinstance(value, tuple):
            return value
        return tuple(part.strip() for part in value.split(",") if part.strip())


class Numbers(click.ParamType):
    """Numbers with commas between them."""

    name = "numbers"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[float, ...]:
        """The numbers."""
        try:
            return tuple(float(part) for part in value.split(","))
        except ValueError:
            return self.fail("write numbers with commas, such as 0.8,1.1,1.0", param, ctx)


class Band(Numbers):
    """Two frequencies, Hz, the lower first."""

    name = "low,high"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[float, float]:
        """Lowest and highest frequency."""
        if isinstance(value, tuple):
            return value
        numbers = super().convert(value, param, ctx)
        if len(numbers) != 2 or not 0.0 <= numbers[0] < numbers[1]:
            self.fail("write the lowest and the highest frequency, such as 0.5,18", param, ctx)
        return numbers[0], numbers[1]


class Columns(click.ParamType):
    """Our column names, each with the name in the file."""

    name = "ours=theirs,..."

    def convert(self, value: Any, param: Any, ctx: Any) -> dict[str, str]:
        """Return our names mapped to those in the file."""
        pairs = [part.split("=", 1) for part in value.split(",") if part.strip()]
        if not pairs or any(len(pair) != 2 or not all(p.strip() for p in pair) for pair in pairs):
            self.fail(
                "write ours=theirs pairs with commas, such as base=a0,2F=a1,RF=a2", param, ctx
            )
        from femupdate.measurement.names import is_ours

        stripped = [(ours.strip(), theirs.strip()) for ours, theirs in pairs]
        named = dict(  # written the other way round, they say the same
            pair[::-1] if is_ours(pair[1]) and not is_ours(pair[0]) else pair for pair in stripped
        )
        if len(named) < len(pairs):
            self.fail("one of our names is given twice; give each once", param, ctx)
        return named


def channel(value: str) -> int | str:
    """A channel of a record: a number where digits are written, else a name."""
    return int(value) if value.isdigit() else value


class Member(click.ParamType):
    """A point in the building, or a wall."""

    name = "place|wall"

    def convert(self, value: Any, param: Any, ctx: Any) -> Place | str:
        """Return the point x, y, z in m, or the name of a wall, such as X2:S1."""
        if value.count(":") in (1, 2):
            return str(value)
        try:
            x, y, z = (float(part) for part in value.split(","))
        except ValueError:
            return self.fail(
                f"{value!r} is neither a place nor a wall; write x,y,z in m, such as 3.6,0,1.5, or "
                "the wall's line and story, such as X2:S1",
                param,
                ctx,
            )
        return x, y, z


class SizedEffect(click.ParamType):
    """An effect at its place and its parameters."""

    name = "name@place=size"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[str, tuple[float, ...]]:
        """Its label, such as added_mass@3F, and its first parameters."""
        label, _, numbers = value.partition("=")
        try:
            values = tuple(float(part) for part in numbers.split(",")) if numbers else ()
        except ValueError:
            values, label = (), ""
        if "@" not in label:
            self.fail("write name@place=size, such as added_mass@3F=0.1", param, ctx)
        return label.strip(), values


INPUT_FILE, BUILDING_NAME, STUDY_FOLDER = InputFile(), BuildingName(), StudyFolder()
NAMES, NUMBERS, BAND, COLUMNS = Names(), Numbers(), Band(), Columns()
CHANNEL, MEMBER, SIZED_EFFECT = click.types.FuncParamType(channel), Member(), SizedEffect()
