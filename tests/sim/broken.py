"""What the hunt is for."""


class BrokenLawError(Exception):
    """The product did what a law forbids."""

    def __init__(self, law: str, detail: str) -> None:
        super().__init__(f"{law}: {detail}")
        self.law = law
        self.detail = detail
