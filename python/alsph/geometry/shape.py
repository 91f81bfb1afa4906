"""What the shapes of bodies that are read from files share."""

from pydantic import Field

from alsph.parameters import Parameters


class Shape(Parameters):
    """The shape of a body as text. A run folder holds it, and so needs no file beside it."""

    file: str = Field(description="name of the file that it was read from")
    sha256: str = Field(description="SHA-256 of the text that it is written as here")

    def __repr__(self) -> str:
        """Tell what it is, without the text."""
        return f"<{self}>"
