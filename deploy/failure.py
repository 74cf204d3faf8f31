"""What ends a command before its time: one line for the user, and an exit code."""


class FailedError(Exception):
    """Something that the user has to know; no traceback."""

    def __init__(self, code: int, line: str) -> None:
        super().__init__(line)
        self.code = code
